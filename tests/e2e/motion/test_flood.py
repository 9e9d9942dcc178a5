"""More input than any robot takes: the declared rate goes out, and the last value arrives."""

import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from bench.rig.deaths import lane_profile
from bench.rig.operator_process import Page, Plan
from bench.rig.programs import Heard, Robots, Server

PERIOD_NS = 1_000_000
FLOOD_NS = 2_000_000_000
RATE = 20
"""A second, as the robot's document has it."""
SECOND_NS = 1_000_000_000
WAIT_S = 15.0
MOST_TRIALS = 10

pytestmark = [
    pytest.mark.alone,
    pytest.mark.skipif("sys.platform != 'linux'", reason="the rig is for Linux"),
]


@pytest.fixture
def robots() -> Iterator[Robots]:
    """One robot."""
    with Robots(["tcp:127.0.0.1:0"]) as made:
        yield made


@pytest.fixture
def page(robots: Robots, tmp_path: Path) -> Iterator[Page]:
    """A page that has its controls."""
    file = tmp_path / "lane-0.yaml"
    file.write_text(lane_profile(0, "127.0.0.1", robots.ports[0]), "utf-8")
    with Server([file], tmp_path / "data") as server:
        made = Page(Plan(1, "127.0.0.1", server.port, "lane-0", "", 0, key=server.key))
        try:
            made.take_controls()
            yield made
        finally:
            made.close()


def flood(page: Page) -> tuple[int, str]:
    """Tick a thousand times a second; return how often, and the last value."""
    next_ns = time.monotonic_ns()
    until_ns, before, last = next_ns + FLOOD_NS, page.sent, 0
    while next_ns < until_ns:
        page.wait(next_ns)
        last = page.tick()
        next_ns += PERIOD_NS
    return page.sent - before, f"M {last}"


def most_by(heard: Sequence[Heard], began_ns: int) -> float:
    """Return how many lines may have been written by the time the last one was heard.

    Counted from when the flood began: of lines that a busy machine holds up on their way several
    come at once, and however late they are, that leaves time for no more of them.
    """
    return (heard[-1].time_ns - began_ns) / SECOND_NS * RATE + 1


def test_flood_of_input_leaves_at_the_declared_rate_and_its_last_value_arrives(
    robots: Robots, page: Page
) -> None:
    """Twenty a second, and one; what comes in between is replaced, never queued."""
    for _ in range(MOST_TRIALS):
        began_ns = time.monotonic_ns()
        count, last = flood(page)

        def has_stopped(began_ns: int = began_ns) -> bool:
            return [one.text for one in robots.since(0, began_ns)][-1:] == ["M 0"]

        page.wait(time.monotonic_ns() + 400_000_000)  # it holds still; then the lease runs out
        robots.wait_until(has_stopped, WAIT_S, "the stop")
        motion = [one for one in robots.since(0, began_ns) if one.text != "M 0"]
        assert not motion or len(motion) <= most_by(motion, began_ns) + 1
        if page.refusal or count < FLOOD_NS / PERIOD_NS / 2:
            page.refusal = ""  # the machine paused for longer than a lease: this says nothing
            page.let_go()
            page.has_let_go = False
            page.say({"t": "drive", "verb": "leave"})
            page.wait(time.monotonic_ns() + 400_000_000)
            page.take_controls()
            continue
        assert motion[-1].text == last
        return
    pytest.fail("the machine is too busy to flood anything")
