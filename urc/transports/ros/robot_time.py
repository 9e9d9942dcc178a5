"""A robot's clock, for the times in published messages. No I/O.

With ``use_sim_time``, the clock is the newest message on ``/clock``, as for a node of ROS. The time
stands still between two messages, and is zero before the first one. No lease, timeout or age
depends on it; all of them use this machine's monotonic clock.

Otherwise, the clock is an estimate from the times in the robot's messages. Transmission delays
reduce the measured difference (robot time minus this machine's time). The largest difference in the
last two seconds is therefore the best estimate. If all differences are far below the estimate for a
moment, a clock was set. The estimate then follows at once, or stamps would lie in the future.

Two programs that publish ``/clock`` let the time go back with each message. They are reported once,
not with one line for each message.
"""

import struct
import time
from collections.abc import Callable, Iterable, Mapping
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
_STEP_NS: Final = 500_000_000
"""Difference below the estimate that a delay rarely causes for long, in nanoseconds."""
_SET_NS: Final = 300_000_000
"""Time for which all differences are so far below the estimate if a clock was set, in ns."""
_LOCAL_NS: Final = 100_000_000
"""Change of this machine's clock against its monotonic clock that is a step, in nanoseconds."""
RIVALS: Final = 3
"""Number of steps back in a row after which two programs publish ``/clock``."""
RIVAL_S: Final = 10.0
"""Maximum time between two steps back in a row, in seconds."""


class RobotTime:
    """The robot's time; an estimate is this machine's time before the first message."""

    def __init__(
        self, clock_only: bool | None = None, monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        """Begin without a known time.

        Args:
            clock_only: None for an estimate. Otherwise, the time is that of ``/clock`` and nothing
                else, and true means that the driver does not read this topic.
            monotonic: monotonic clock, in seconds.
        """
        self.is_simulated = clock_only is not None
        self.is_clock_only = clock_only is True
        self._difference_ns = 0
        self._taken_ns: int | None = None
        self._newest_ns = 0
        """Newest time of the robot, in nanoseconds."""
        self._low: tuple[int, int] | None = None
        """Beginning of a series of differences far below the estimate, and the largest of them."""
        self._clock_ns = 0
        self._lead_ns: int | None = None
        """This machine's time minus its monotonic time, in nanoseconds."""
        self._monotonic = monotonic
        self._stepped_s = float("-inf")
        """Time of the last step back, in seconds."""
        self._steps = 0
        """Number of steps back in a row."""
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
        return None if back_s <= 0 else self._stepped("the simulated clock", back_s)

    def _stepped(self, clock: str, back_s: float) -> Envelope:
        """Return the message for the engine after a step back; its text is "" if it is known."""
        now_s, last_s = self._monotonic(), self._stepped_s
        self._stepped_s = now_s
        self._steps = self._steps + 1 if now_s - last_s < RIVAL_S else 1
        text = f"{clock} went back by {back_s:.3f} s"
        if self._steps < RIVALS:
            return Envelope(RESTARTED, {"level": "info"}, text)
        if self.is_simulated:
            text += f" again: two programs publish {CLOCK_TOPIC}; stop one of them"
        else:
            text += " again: the robot's messages carry the times of two clocks"
        return Envelope(RESTARTED, {"level": "warning"}, text if self._steps == RIVALS else "")

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

    def told(self, robot_ns: int, here_ns: int) -> Envelope | None:
        """Record the robot time `robot_ns`, which arrived at this machine's time `here_ns`.

        The simulated time ignores it.

        Returns:
            A message for the engine if the robot's clock was set back; otherwise, None.
        """
        self._follow(here_ns)
        difference = robot_ns - here_ns
        if self._taken_ns is not None and self._difference_ns - difference >= _STEP_NS:
            return self._far_below(robot_ns, difference, here_ns)
        is_old = self._taken_ns is None or here_ns - self._taken_ns > _KEPT_NS
        if is_old or difference >= self._difference_ns:
            self._difference_ns, self._taken_ns = difference, here_ns
        self._newest_ns, self._low = max(self._newest_ns, robot_ns), None
        return None

    def _far_below(self, robot_ns: int, difference: int, here_ns: int) -> Envelope | None:
        """Record a difference far below the estimate: a delay, or a clock that was set back."""
        since_ns, largest = self._low or (here_ns, difference)
        self._low = since_ns, max(largest, difference)
        if here_ns - since_ns < _SET_NS:
            return None
        back_ns, self._newest_ns = self._newest_ns - robot_ns, robot_ns
        self._difference_ns, self._taken_ns, self._low = self._low[1], here_ns, None
        if back_ns <= 0 or self.is_simulated:
            return None
        return self._stepped("the robot's clock", back_ns / 1e9)

    def _follow(self, here_ns: int) -> None:
        """Correct the estimate after a step of this machine's clock."""
        lead_ns = here_ns - int(self._monotonic() * 1e9)
        step_ns = 0 if self._lead_ns is None else lead_ns - self._lead_ns
        self._lead_ns = lead_ns
        if self._taken_ns is not None and abs(step_ns) > _LOCAL_NS:
            self._difference_ns -= step_ns
            self._taken_ns += step_ns
            self._low = None

    def now(self, here_ns: int) -> tuple[int, int]:
        """Return the robot's time in seconds and nanoseconds; never negative."""
        if self.is_simulated:
            return divmod(self._clock_ns, 1_000_000_000)
        self._follow(here_ns)
        return divmod(max(here_ns + self._difference_ns, 0), 1_000_000_000)

    def timed(self, body: Any, here_ns: int) -> Any:
        """Return a message with the robot's time in place of each text ``now``."""
        parts = dict(zip(self.names, self.now(here_ns), strict=True))

        def replaced(value: Any) -> Any:
            if isinstance(value, Mapping):
                return {name: replaced(inner) for name, inner in value.items()}
            if isinstance(value, (list, tuple)):
                return [replaced(inner) for inner in value]
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
