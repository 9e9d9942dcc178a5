"""What counts as a fault in the soak of a fleet."""

import pytest

from bench.rig.fleet_soak import Latch, judged_soak
from bench.rig.programs import Heard

MS = 1_000_000


def lines(*rows: tuple[int, int, int]) -> list[Heard]:
    """Return a robot's log of rows: time in ms, send time in ms or 0 for a stop, and the page."""
    return [
        Heard(time * MS, f"M {sent * 1000 // 16 * 16 + page}" if sent else "M 0")
        for time, sent, page in rows
    ]


def test_pages_may_drive_one_after_the_other() -> None:
    heard = lines((10, 9, 1), (60, 59, 1), (300, 0, 0), (400, 399, 2), (640, 0, 0))
    assert judged_soak(heard, [], []) == ("", 2, 241.0)


@pytest.mark.parametrize(
    ("heard", "said"),
    [
        (
            lines((10, 9, 1), (60, 59, 2), (300, 0, 0)),
            "two pages moved the robot without a stop between them",
        ),
        (
            lines((60, 59, 1), (70, 9, 1), (300, 0, 0)),
            "an older value arrived after a newer value",
        ),
        (lines((60, 59, 1)), "the last motion has no stop"),
    ],
)
def test_a_fault_is_told(heard: list[Heard], said: str) -> None:
    assert judged_soak(heard, [], [])[0] == said


@pytest.mark.parametrize(
    ("resets", "said"),
    [
        ((), "the robot moved while STOP was latched"),
        ((90,), "the robot moved while STOP was latched"),
        ((450,), "the robot moved while STOP was latched"),
        ((250,), ""),
    ],
)
def test_motion_after_a_stop_needs_a_later_reset(resets: tuple[int, ...], said: str) -> None:
    """A reset from before the press, or after the motion, is none."""
    heard = lines((10, 9, 1), (150, 0, 0), (400, 399, 1), (640, 0, 0))
    latches = [Latch(100 * MS, 160 * MS)]
    assert judged_soak(heard, latches, [one * MS for one in resets])[0] == said


def test_motion_may_end_after_the_press_and_before_the_confirmation() -> None:
    heard = lines((10, 9, 1), (120, 119, 1), (150, 0, 0))
    assert judged_soak(heard, [Latch(100 * MS, 160 * MS)], [])[0] == ""
