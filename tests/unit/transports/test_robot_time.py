"""The robot's clock: `/clock` in each encoding, and bytes with the time."""

import json
import struct

import pytest

from urc.model.payload import RESTARTED, Envelope
from urc.transports.ros.robot_time import RIVAL_S, RobotTime

HERE_NS = 1_700_000_000 * 10**9


@pytest.mark.parametrize(
    ("encoding", "body", "names"),
    [
        ("cdr", b"\0\1\0\0" + struct.pack("<iI", 7, 8), ("sec", "nanosec")),
        ("cdr", b"\0\0\0\0" + struct.pack(">iI", 7, 8), ("sec", "nanosec")),
        ("ros1", struct.pack("<II", 7, 8), ("secs", "nsecs")),
        ("json", json.dumps({"clock": {"sec": 7, "nanosec": 8}}).encode(), ("sec", "nanosec")),
        (None, {"clock": {"secs": 7, "nsecs": 8}}, ("secs", "nsecs")),
    ],
)
def test_the_simulated_time_is_the_newest_clock(
    encoding: str | None, body: object, names: tuple[str, str]
) -> None:
    clock = RobotTime(clock_only=True)
    assert clock.now(HERE_NS) == (0, 0)
    assert clock.clock(encoding, body) is None
    clock.told(HERE_NS + 10**12, HERE_NS)  # other messages of the robot do not count
    assert clock.now(HERE_NS + 10**10) == (7, 8)
    stamped = clock.timed({"header": {"stamp": "now"}, "text": "later"}, HERE_NS)
    parts = dict(zip(names, (7, 8), strict=True))
    assert stamped == {"header": {"stamp": parts}, "text": "later"}


@pytest.mark.parametrize(
    ("encoding", "body"),
    [
        ("cdr", b"\0\1\0\0\1\2"),
        ("ros1", b""),
        ("json", b"{"),
        ("json", b"[" * 5000),
        (None, {"clock": {"sec": -1, "nanosec": 0}}),
        (None, {"clock": {"sec": "1", "nanosec": 0}}),
        (None, "now"),
        (None, None),
    ],
)
def test_invalid_messages_change_nothing(encoding: str | None, body: object) -> None:
    clock = RobotTime(clock_only=True)
    clock.clock(None, {"clock": {"sec": 5, "nanosec": 6}})
    assert clock.clock(encoding, body) is None
    assert clock.now(HERE_NS) == (5, 6)


def test_a_clock_that_goes_back_is_reported() -> None:
    clock = RobotTime(clock_only=True)
    clock.clock(None, {"clock": {"sec": 5, "nanosec": 0}})
    told = clock.clock(None, {"clock": {"sec": 2, "nanosec": 500_000_000}})
    assert told is not None
    assert (told.verb, told.body) == (RESTARTED, "the simulated clock went back by 2.500 s")


def set_to(clock: RobotTime, sec: int) -> tuple[object, object] | None:
    """Publish a time; return the level and the text for the log."""
    told = clock.clock(None, {"clock": {"sec": sec, "nanosec": 0}})
    return None if told is None else (told.attributes["level"], told.body)


def test_two_programs_that_publish_the_clock_are_reported_once() -> None:
    """The time goes back with every second message, which must not fill the log."""
    now_s = 100.0
    clock = RobotTime(True, lambda: now_s)
    found = []
    for _ in range(200):
        now_s += 0.01
        assert set_to(clock, 9) is None
        found.append(set_to(clock, 2))
    first = ("info", "the simulated clock went back by 7.000 s")
    why = " again: two programs publish /clock; stop one of them"
    assert found[:3] == [first, first, ("warning", first[1] + why)]
    assert set(found[3:]) == {("warning", "")}, "the engine still learns of each step"
    now_s += RIVAL_S
    set_to(clock, 9)
    assert set_to(clock, 2) == first, "a restart much later"


def test_now_in_lists_is_replaced_at_every_depth() -> None:
    clock = RobotTime(clock_only=True)
    set_to(clock, 7)
    path = {"poses": [{"header": {"stamp": "now"}}, {"x": [1, 2]}], "times": ("now", "later")}
    seven = {"sec": 7, "nanosec": 0}
    assert clock.timed(path, HERE_NS) == {
        "poses": [{"header": {"stamp": seven}}, {"x": [1, 2]}],
        "times": [seven, "later"],
    }


SECOND_NS = 10**9


class Machine:
    """This machine's clocks, and the robot's time as estimated by its messages."""

    def __init__(self) -> None:
        self.now_ns = HERE_NS
        self.step_ns = 0
        self.clock = RobotTime(None, lambda: (self.now_ns - HERE_NS) / 1e9)

    def hear(self, robot_s: float) -> Envelope | None:
        """Take a message with the robot's time, in seconds after this machine's start."""
        robot_ns = HERE_NS + round(robot_s * SECOND_NS)
        return self.clock.told(robot_ns, self.now_ns + self.step_ns)

    def wait(self, seconds: float) -> None:
        self.now_ns += round(seconds * SECOND_NS)

    @property
    def now_s(self) -> float:
        """Time since this machine's start, in seconds."""
        return (self.now_ns - HERE_NS) / 1e9

    @property
    def robot_s(self) -> float:
        """Estimated time of the robot, in seconds after this machine's start."""
        seconds, nanoseconds = self.clock.now(self.now_ns + self.step_ns)
        return (seconds * SECOND_NS + nanoseconds - HERE_NS) / 1e9


def test_a_robots_clock_that_is_set_back_is_followed_within_a_third_of_a_second() -> None:
    """Stamps in the future could make a controller ignore the next commands."""
    here = Machine()
    for _ in range(50):
        assert here.hear(here.now_s + 20) is None
        here.wait(0.02)
    found = []
    for _ in range(17):
        found.append(here.hear(here.now_s + 15))
        here.wait(0.02)
    assert here.robot_s == pytest.approx(here.now_s + 15)
    (told,) = [one for one in found if one is not None]
    assert (told.verb, told.attributes["level"]) == (RESTARTED, "info")
    assert str(told.body).startswith("the robot's clock went back by 4.")


def test_late_messages_do_not_set_the_clock_back() -> None:
    """After a stalled link, old messages arrive in a burst; some topics are always slow."""
    here = Machine()
    here.hear(0)
    here.wait(1)
    for place in range(50):  # a second of messages, within 50 ms
        assert here.hear(place / 50) is None
        here.wait(0.001)
    for _ in range(200):
        here.wait(0.02)
        assert here.hear(here.now_s - 1) is None
        assert here.hear(here.now_s - 0.1) is None
    assert here.robot_s == pytest.approx(here.now_s, abs=0.11)


def test_a_robot_that_was_silent_for_long_is_believed_again() -> None:
    here = Machine()
    here.hear(5)
    for _ in range(3):
        here.wait(60)
        here.hear(here.now_s - 7)
    assert here.robot_s == pytest.approx(here.now_s - 7)


@pytest.mark.parametrize("step_s", [-3600, -0.3, 0.3, 3600])
def test_a_step_of_this_machines_clock_does_not_change_the_robots_time(step_s: float) -> None:
    here = Machine()
    for number in range(100):
        assert here.hear(here.now_s + 2) is None
        if number == 50:
            here.step_ns = round(step_s * SECOND_NS)
        assert here.robot_s == pytest.approx(here.now_s + 2)
        here.wait(0.02)


def test_messages_of_two_clocks_are_reported_once() -> None:
    """Over Zenoh, the nodes of several machines send their own times."""
    here, found = Machine(), []
    for number in range(3000):
        found.append(here.hear(here.now_s + (3 if number % 200 < 100 else 0)))
        here.wait(0.01)
    lines = [str(one.body) for one in found if one is not None and one.body]
    assert len(lines) == 3
    assert lines[-1].endswith("again: the robot's messages carry the times of two clocks")
