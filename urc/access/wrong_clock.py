"""Detection of a clock that is behind, such as the clock of a Raspberry Pi without a network.

Layer 4. Pure. A clock is wrong if it shows a time earlier than a known event. A clock that is ahead
cannot be detected.
"""

import time
from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Final, NamedTuple

__all__ = ["RELEASED", "KnownTime", "clock_fault"]

RELEASED: Final = datetime(2026, 11, 1, tzinfo=UTC)
"""Release day of this version; a clock that shows an earlier time is wrong."""
_SLACK_S: Final = 120.0
"""Tolerated difference in seconds, because time servers set clocks back in small steps."""


class KnownTime(NamedTuple):
    """A past event and its time; a correct clock shows a later time."""

    at: float
    """UTC time of the event, in seconds since 1970."""
    event: str
    """Event at that time, such as “the newest entry of the audit log”."""


def clock_fault(now: float, known: Iterable[KnownTime] = ()) -> str:
    """Return one line about a clock that is behind; "" if no fault is detected.

    Args:
        now: UTC time of the machine's clock, in seconds since 1970.
        known: times of past events; the release day is always included.
    """
    release = KnownTime(RELEASED.timestamp(), "the release of this version of URC")
    newest = max([release, *known])
    if now >= newest.at - _SLACK_S:
        return ""
    return (
        f"the clock of this computer shows {_text(now)}, earlier than {newest.event}"
        f" ({_text(newest.at)}): the clock is wrong now, or was wrong then. Sign-ins and tokens can"
        " last too long, certificates can be invalid, and the audit log has wrong times. Set the"
        " clock, or connect a time server"
    )


def _text(at: float) -> str:
    try:
        return time.strftime("%Y-%m-%d %H:%M", time.localtime(at))
    except (OverflowError, ValueError, OSError):
        return f"{at:.0f} s since 1970"
