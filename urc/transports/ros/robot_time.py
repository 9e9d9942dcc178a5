"""An estimate of a robot's clock, from the times in its messages. No I/O.

A robot's clock may differ from this machine's clock, and a simulation's clock may be paused.
Transmission delays reduce the measured difference (robot time minus this machine's time). The
largest difference in the last two seconds is therefore the best estimate.
"""

import struct
from collections.abc import Iterable
from typing import Final

__all__ = ["RobotTime"]

_KEPT_NS: Final = 2_000_000_000
"""Time for which a measured difference stays valid, in nanoseconds."""


class RobotTime:
    """An estimate of the robot's time; before the first message, this machine's time."""

    def __init__(self) -> None:
        self._difference_ns = 0
        self._taken_ns: int | None = None

    def told(self, robot_ns: int, here_ns: int) -> None:
        """Record the robot time `robot_ns`, which arrived at this machine's time `here_ns`."""
        difference = robot_ns - here_ns
        is_old = self._taken_ns is None or here_ns - self._taken_ns > _KEPT_NS
        if is_old or difference >= self._difference_ns:
            self._difference_ns, self._taken_ns = difference, here_ns

    def now(self, here_ns: int) -> tuple[int, int]:
        """Return the robot's time in seconds and nanoseconds; never negative."""
        return divmod(max(here_ns + self._difference_ns, 0), 1_000_000_000)

    def stamped(
        self, data: bytes, offsets: Iterable[int], here_ns: int, *, is_protobuf: bool = False
    ) -> bytes:
        """Return the message `data` with the robot's time written at each offset.

        In Protocol Buffers, each of the two numbers follows a tag and has five bytes.
        """
        out, (seconds, nanos) = bytearray(data), self.now(here_ns)
        for offset in offsets:
            if is_protobuf:
                out[offset + 1 : offset + 6] = _five(seconds)
                out[offset + 7 : offset + 12] = _five(nanos)
            else:
                struct.pack_into("<II", out, offset, seconds & 0x7FFFFFFF, nanos)
        return bytes(out)


def _five(value: int) -> bytes:
    """Return a number below 2 ** 35 as a varint of five bytes."""
    return bytes([*(value >> shift & 127 | 128 for shift in (0, 7, 14, 21)), value >> 28 & 127])
