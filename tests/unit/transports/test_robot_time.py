"""The robot's clock: `/clock` in each encoding, and bytes with the time."""

import json
import struct

import pytest

from urc.model.payload import RESTARTED
from urc.transports.ros.robot_time import RobotTime

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
