"""A server that hangs, dies, or has no room on its disk: the robots are stopped all the same."""

import json
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

from bench.rig.deaths import Rig, Trial, robot_profile
from bench.rig.engine import ENGINE_DEATHS, EngineRig
from bench.rig.operator_process import Page, Plan
from bench.rig.programs import Operators, Robots, Server
from tests.e2e.verdict import judged
from tests.effort import IS_THOROUGH

ROBOTS = 8
EACH = 16
IDLE_S = 20.0
"""Ten minutes, on every kind of line, are listened to by ``./dev bench --full motion_idle``."""
RESTARTS = 5
BATCHES = 10 if IS_THOROUGH else 1
WAIT_S = 20.0
ROOM_BYTES = 2_000_000
MOST_BOUTS = 4

pytestmark = [
    pytest.mark.alone,
    pytest.mark.skipif("sys.platform != 'linux'", reason="the rig is for Linux"),
]


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EngineRig]:
    """Robots that are driven by way of a server that can be held up."""
    with EngineRig(tmp_path_factory.mktemp("engine"), robot_count=ROBOTS) as made:
        made.bout("close")
        yield made


def repeated(bout: Callable[[], list[Trial]], wanted: int) -> list[Trial]:
    """Let it happen until so many times say something."""
    trials: list[Trial] = []
    while not judged(trials, wanted):
        trials += bout()
    return trials


class Idle(NamedTuple):
    """A robot that was driven once, and stopped."""

    robots: Robots
    operators: Operators
    stopped_ns: int


@pytest.fixture(scope="module")
def idle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Idle]:
    """One whose page has the controls, holds nothing, and goes on being told beats."""
    with (
        Robots(["tcp:127.0.0.1:0"]) as robots,
        served(tmp_path_factory.mktemp("idle"), robots) as server,
        Operators() as operators,
    ):
        life_s = 2 * IDLE_S + 60
        place = ("127.0.0.1", server.port, "robot-0")
        plan = Plan(1, *place, "outside", 0.3, life_s=life_s, key=server.key)
        operators.start(plan._asdict())
        robots.wait_until(lambda: len(robots.heard[0]) > 3, WAIT_S, "motion")
        operators.order(json.dumps({"let_go": 1}))
        robots.wait_until(lambda: is_still(robots), WAIT_S, "the stop")
        yield Idle(robots, operators, time.monotonic_ns())
        assert ("ended", 1) not in operators.news


def is_still(robots: Robots) -> bool:
    """Return whether the newest word is the stop."""
    return [one.text for one in robots.heard[0][-1:]] == ["M 0"]


def served(folder: Path, robots: Robots, *, inside: tuple[str, ...] = ()) -> Server:
    """Start a server for the first robot."""
    file = folder / "robot-0.yaml"
    file.write_text(robot_profile(0, "127.0.0.1", robots.ports[0]), "utf-8")
    return Server([file], folder / "data", inside=inside)


@contextmanager
def opened(server: Server) -> Iterator[Page]:
    """Open the page of the first robot."""
    page = Page(Plan(1, "127.0.0.1", server.port, "robot-0", "", 0, key=server.key))
    try:
        yield page
    finally:
        page.close()


def until(page: Page, is_so: Callable[[], bool], what: str) -> None:
    """Let the page live until something is so."""
    end_ns = time.monotonic_ns() + int(WAIT_S * 1e9)
    while not is_so():
        assert time.monotonic_ns() < end_ns, what
        page.wait(time.monotonic_ns() + 10_000_000)


@pytest.mark.parametrize("death", ENGINE_DEATHS)
def test_robots_of_a_server_that_hangs_or_dies_are_stopped_in_time(
    rig: EngineRig, idle: Idle, death: str
) -> None:
    """Stopped by a signal, killed, or held up by a pattern: lease + 50 ms, as ever."""
    repeated(lambda: rig.engine_bout(death), EACH)


def test_killed_guards_of_a_real_server_are_replaced_and_stop_first(rig: EngineRig) -> None:
    """Each robot hears the stop before anything else; nobody else's robot is disturbed."""
    trials: list[Trial] = []
    for _ in range(MOST_BOUTS):
        trials += rig.guard_bout()
        if len(trials) >= ROBOTS / 2:
            break
    assert [one.fault for one in trials if one.fault] == []
    assert len(trials) >= ROBOTS / 2, "hardly any of them moved"


@pytest.mark.needs("tun")  # root: it mounts a small disk for the server alone
def test_full_disk_delays_no_stop_and_loses_no_latch(tmp_path: Path) -> None:
    """Driving, dying operators and STOP go on; the latch is kept as soon as there is room."""
    data = tmp_path / "data"
    data.mkdir()
    script = 'mount -t tmpfs -o size=1m tmpfs "$0" && exec "$@"'
    inside = ("unshare", "--mount", "sh", "-c", script, str(data))
    with Rig(tmp_path, robot_count=4, inside=inside) as rig:
        rig.bout("close")
        there = Path(f"/proc/{rig.server.pid}/root") / data.relative_to("/")
        fill(there / "filler")
        repeated(lambda: rig.bout("freeze"), 4)
        repeated(lambda: rig.bout("close"), 4)
        latch, before_ns = there / "latches" / "robot-0.latch.json", time.monotonic_ns()
        with opened(rig.server) as page:
            page.say({"t": "stop"})
            until(page, lambda: page.is_latched, "a latched stop")
            rig.robots.wait_until(lambda: bool(rig.robots.since(0, before_ns)), WAIT_S, "the stop")
            assert not is_latched(latch), "the disk is not full: nothing is shown"
            (there / "filler").unlink()
            until(page, lambda: is_latched(latch), "the latch on the disk")


def fill(file: Path) -> None:
    """Write until there is no room."""
    with file.open("wb", buffering=0) as filler:
        try:
            for _ in range(ROOM_BYTES // 512):
                filler.write(bytes(512))
        except OSError:
            return
    raise AssertionError("the disk took it all")


def is_latched(file: Path) -> bool:
    """Return whether a latched stop is kept."""
    return file.exists() and b'"latched_by":""' not in file.read_bytes().replace(b" ", b"")


@pytest.fixture(scope="module")
def latched(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Robots]]:
    """A robot that somebody has stopped, and the folder that knows it."""
    folder = tmp_path_factory.mktemp("latched")
    with Robots(["tcp:127.0.0.1:0"]) as robots:
        with served(folder, robots) as server, opened(server) as page:
            page.say({"t": "stop"})
            until(page, lambda: page.is_latched, "a latched stop")
            until(page, lambda: is_latched(folder / "data/latches/robot-0.latch.json"), "a file")
        yield folder, robots


@pytest.mark.parametrize("batch", range(BATCHES))
def test_latched_stop_holds_over_restarts(latched: tuple[Path, Robots], batch: int) -> None:
    """Ended or killed, again and again: it stays stopped, and whoever tries moves nothing."""
    folder, robots = latched
    for number in range(RESTARTS):
        with served(folder, robots) as server, opened(server) as page:
            until(page, lambda: page.epoch >= 0 and page.is_live, "a page")
            assert page.is_latched, f"restart {number} of batch {batch}"
            page.say({"t": "drive", "verb": "take"})
            page.tick()
            until(page, lambda: page.refusal != "", "a refusal")
            assert not page.is_mine
            if number % 2:
                os.kill(server.pid, 9)
    assert {one.text for one in robots.heard[0]} <= {"M 0"}


def test_robot_that_was_stopped_hears_nothing_more(idle: Idle) -> None:
    """Not one word, for as long as nobody begins a new gesture: zeros would fight autonomy."""
    left_s = IDLE_S - (time.monotonic_ns() - idle.stopped_ns) / 1e9
    time.sleep(max(0.0, left_s))
    # Nor from a server that was held up by a busy machine: it stops only what moves.
    assert idle.robots.since(0, idle.stopped_ns) == []
