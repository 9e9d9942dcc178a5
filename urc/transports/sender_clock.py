"""The sender's clock, from the sender reports of RTCP (RFC 3550, 6.4.1).

Pure. A report states the time of day that belongs to an RTP time stamp. From then on, each time
stamp states when the image was captured, on the sender's clock.
"""

from typing import Final

__all__ = ["SenderClock"]

_1900_TO_1970_S: Final = 2_208_988_800
_STAMPS: Final = 1 << 32
_NEAR_S: Final = 600.0
"""Largest time between a report and an image, in seconds; a larger one shows two clocks."""


class SenderClock:
    """The clock of one sender."""

    def __init__(self, rate_hz: int) -> None:
        """Create a clock without a report, for time stamps that count `rate_hz` times a second."""
        self._rate_hz = rate_hz
        self._report: tuple[float, int] | None = None
        """Seconds since 1970, and the time stamp of the same moment."""

    def hear(self, ntp_time: int, stamp: int) -> None:
        """Take a report.

        Args:
            ntp_time: seconds since 1900, times 2³²; 0 if the sender has no clock.
            stamp: RTP time stamp of the same moment.
        """
        seconds = ntp_time / _STAMPS - _1900_TO_1970_S
        self._report = (seconds, stamp) if seconds > 0 else None

    def captured_s(self, stamp: int) -> float | None:
        """Return when an image was captured, in seconds since 1970; None if unknown."""
        if self._report is None:
            return None
        seconds, known = self._report
        ticks = (stamp - known) % _STAMPS
        if ticks >= _STAMPS // 2:
            ticks -= _STAMPS
        passed_s = ticks / self._rate_hz
        return seconds + passed_s if abs(passed_s) <= _NEAR_S else None
