"""Environment of a process whose clock shows another time."""

from typing import Final

from scripts.needs import faketime_library

__all__ = ["WEEK_S", "clock"]

WEEK_S: Final = 7 * 86400


def clock(seconds: float) -> dict[str, str]:
    """Return the environment of a process whose clock is ahead; negative if it is behind.

    Only the time of day is wrong, as on a computer with a wrong clock: event loops use another one.
    """
    library = faketime_library()
    assert library is not None
    return {
        "LD_PRELOAD": library,
        "FAKETIME": f"{seconds:+.0f}s",
        "FAKETIME_DONT_FAKE_MONOTONIC": "1",
        "NO_FAKE_STAT": "1",
    }
