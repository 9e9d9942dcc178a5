"""More input than any robot takes: the declared rate goes out, and the last value arrives."""

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

from bench.rig.deaths import robot_profile
from bench.rig.operator_process import Page, Plan
from bench.rig.programs import Heard, Robots, Server
from tests.e2e.verdict import judged

PERIOD_NS = 1_000_000
FLOOD_NS = 2_000_000_000
RATE = 20
"""A second, as the robot's document has it."""
LEAST_SENT = 10 * RATE * FLOOD_NS // 1_000_000_000
"""Ticks that are a flood: ten times the declared rate."""
SECOND_NS = 1_000_000_000
WAIT_S = 15.0
STILL_NS = 400_000_000
"""Longer than the lease."""

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
    """The page of the robot."""
    file = tmp_path / "robot-0.yaml"
    file.write_text(robot_profile(0, "127.0.0.1", robots.ports[0]), "utf-8")
    with Server([file], tmp_path / "data") as server:
        made = Page(Plan(1, "127.0.0.1", server.port, "robot-0", "", 0, key=server.key))
        try:
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


class Flood(NamedTuple):
    """Result of one flood."""

    sent: int
    last: str
    """The value that was sent last."""
    heard: list[str]
    most: float
    """Limit of the lines that the robot may get in this time."""
    refusal: str

    @property
    def is_good(self) -> bool:
        """Whether the rate was kept, and the last value arrived."""
        return len(self.heard) <= self.most and self.heard[-1:] == [self.last]

    @property
    def is_excused(self) -> bool:
        """Whether the machine paused for longer than a lease, or sent no flood."""
        is_invalid = bool(self.refusal) or self.sent < LEAST_SENT
        return is_invalid and len(self.heard) <= self.most


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
    floods: list[Flood] = []
    while not judged(floods, 1):
        floods.append(flooded(robots, page))


def flooded(robots: Robots, page: Page) -> Flood:
    """Take the controls, flood the robot, hold still until the lease ends, and leave."""
    page.take_controls()
    page.refusal, began_ns = "", time.monotonic_ns()
    count, last = flood(page)

    def has_stopped() -> bool:
        return [one.text for one in robots.since(0, began_ns)][-1:] == ["M 0"]

    page.wait(time.monotonic_ns() + STILL_NS)
    robots.wait_until(has_stopped, WAIT_S, "the stop")
    motion = [one for one in robots.since(0, began_ns) if one.text != "M 0"]
    most = most_by(motion, began_ns) + 1 if motion else 0
    found = Flood(count, last, [one.text for one in motion], most, page.refusal)
    page.let_go()
    page.has_let_go = False
    page.say({"t": "drive", "verb": "leave"})
    page.wait(time.monotonic_ns() + STILL_NS)
    return found
