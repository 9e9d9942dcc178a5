"""A robot's clock, for the times in published messages. No I/O.

With ``use_sim_time``, the clock is the newest message on ``/clock``, as for a node of ROS. The time
stands still between two messages, and is zero before the first one. No lease, timeout or age
depends on it; all of them use this machine's monotonic clock.

Otherwise, the clock is an estimate from the times in the robot's messages. Transmission delays
reduce the measured difference (robot time minus this machine's time). The largest difference in the
last two seconds is therefore the best estimate.
"""

import struct
from collections.abc import Iterable, Mapping
from typing import Any, Final

import msgspec

from urc.model.payload import RESTARTED, Envelope

__all__ = ["CLOCK_TOPIC", "CLOCK_TYPE", "RobotTime"]

CLOCK_TOPIC: Final = "/clock"
CLOCK_TYPE: Final = "rosgraph_msgs/Clock"
_NAMES: Final = (("sec", "nanosec"), ("secs", "nsecs"))
"""Names of the parts of a time in ROS 2 and in ROS 1."""

_KEPT_NS: Final = 2_000_000_000
"""Time for which a measured difference stays valid, in nanoseconds."""


class RobotTime:
    """The robot's time; an estimate is this machine's time before the first message."""

    def __init__(self, clock_only: bool | None = None) -> None:
        """Begin without a known time.

        Args:
            clock_only: None for an estimate. Otherwise, the time is that of ``/clock`` and nothing
                else, and true means that the driver does not read this topic.
        """
        self.is_simulated = clock_only is not None
        self.is_clock_only = clock_only is True
        self._difference_ns = 0
        self._taken_ns: int | None = None
        self._clock_ns = 0
        self.names = _NAMES[0]
        """Names of the parts of a time in the robot's messages."""

    def clock(self, encoding: object, body: object) -> Envelope | None:
        """Set the simulated time from a message on ``/clock``; ignore an invalid message.

        Args:
            encoding: encoding of the message; None if `body` is a mapping.
            body: the message.

        Returns:
            A message for the engine if the clock went back, because the simulation was restarted.
        """
        found = self._parts(encoding, body)
        if found is None:
            return None
        before_ns, self._clock_ns = self._clock_ns, found[0] * 1_000_000_000 + found[1]
        back_s = (before_ns - self._clock_ns) / 1e9
        if back_s <= 0:
            return None
        return Envelope(RESTARTED, {}, f"the simulated clock went back by {back_s:.3f} s")

    def _parts(self, encoding: object, body: object) -> tuple[int, int] | None:
        if isinstance(body, bytes):
            if encoding in ("cdr", "ros1"):
                start = 4 if encoding == "cdr" else 0
                if len(body) < start + 8:
                    return None
                order = ">" if start and body[1] == 0 else "<"
                self.names = _NAMES[0 if start else 1]
                return struct.unpack_from(f"{order}II", body, start)
            try:
                body = msgspec.json.decode(body)
            except (msgspec.MsgspecError, UnicodeError, RecursionError):
                return None
        clock: Any = body.get("clock") if isinstance(body, Mapping) else None
        for names in _NAMES if isinstance(clock, Mapping) else ():
            parts = tuple(clock.get(name) for name in names)
            if all(isinstance(one, int) and 0 <= one < 2**32 for one in parts):
                self.names = names
                return parts
        return None

    def told(self, robot_ns: int, here_ns: int) -> None:
        """Record the robot time `robot_ns`, which arrived at this machine's time `here_ns`.

        The simulated time ignores it.
        """
        difference = robot_ns - here_ns
        is_old = self._taken_ns is None or here_ns - self._taken_ns > _KEPT_NS
        if is_old or difference >= self._difference_ns:
            self._difference_ns, self._taken_ns = difference, here_ns

    def now(self, here_ns: int) -> tuple[int, int]:
        """Return the robot's time in seconds and nanoseconds; never negative."""
        if self.is_simulated:
            return divmod(self._clock_ns, 1_000_000_000)
        return divmod(max(here_ns + self._difference_ns, 0), 1_000_000_000)

    def timed(self, body: Any, here_ns: int) -> Any:
        """Return a message with the robot's time in place of each text ``now``."""
        parts = dict(zip(self.names, self.now(here_ns), strict=True))

        def replaced(value: Any) -> Any:
            if isinstance(value, Mapping):
                return {name: replaced(inner) for name, inner in value.items()}
            return parts if value == "now" else value

        return replaced(body)

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
