"""The frames to be sent to one Foxglove client, in order.

Layer 5. Pure. Announcements are sent first, then responses, then statuses, and finally the robots'
messages, one robot after another. The number of frames of each kind is limited.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Final

from urc.web.foxglove.robot_feed import RobotFeed
from urc.web.wire.picture import as_frame
from urc.wire import foxglove as wire

__all__ = ["DROPPED_EVERY_S", "MOST_ANSWERS", "Outbox"]

MOST_ANSWERS: Final = 32
"""Maximum number of unsent responses; one more response closes the socket."""
DROPPED_EVERY_S: Final = 10.0
"""Minimum time between two reports of dropped messages, in seconds."""


class Outbox:
    """The unsent frames of one Foxglove client, in sending order."""

    def __init__(self, wake: Callable[[], None], now: Callable[[], float]) -> None:
        """Start without frames.

        Args:
            wake: callback that is called when a frame can be sent.
            now: function that returns the time in seconds.
        """
        self._wake = wake
        self._now = now
        self._texts: deque[bytes] = deque()
        self._answers: deque[tuple[bytes, bool]] = deque()
        self._statuses: dict[str, bytes] = {}
        """Newest unsent status, keyed by the status's id."""
        self._warned: dict[str, str] = {}
        """Text of each robot's status, until the status is withdrawn."""
        self._ready: dict[str, RobotFeed] = {}
        """Robots with unsent messages, in the order in which their messages are sent."""
        self._dropped = 0
        self._told_dropped = 0
        self._told_dropped_s = float("-inf")

    # What to send

    def announce(self, texts: Iterable[bytes]) -> None:
        """Add announcements."""
        before = len(self._texts)
        self._texts.extend(texts)
        if len(self._texts) > before:
            self._wake()

    def answer(self, data: bytes, *, is_text: bool) -> bool:
        """Add the response to a call; return False if too many responses are unsent."""
        if len(self._answers) >= MOST_ANSWERS:
            return False
        self._answers.append((data, is_text))
        self._wake()
        return True

    def tell(self, status: str, text: str, *, level: wire.Level = "warning") -> None:
        """Add a status, which replaces an earlier status with the same id."""
        self._statuses[status] = wire.encode_status(level, text, status)
        self._wake()

    def warn(self, robot: str, text: str) -> None:
        """Add the status of a robot, unless its last status has the same text."""
        if self._warned.get(robot) != text:
            self._warned[robot] = text
            self.tell(f"robot {robot}", text)

    def end_warning(self, robot: str) -> None:
        """Withdraw the status of a robot."""
        if self._warned.pop(robot, None) is not None:
            status = f"robot {robot}"
            self._statuses[status] = wire.encode_status_end([status])
            self._wake()

    def ready(self, robot: str, feed: RobotFeed) -> None:
        """Record that a message of a robot is ready."""
        self._ready.setdefault(robot, feed)
        self._wake()

    def forget(self, robot: str, feed: RobotFeed) -> None:
        """Drop the unsent messages of a robot that is no longer offered."""
        self._ready.pop(robot, None)
        self._dropped += feed.take_dropped()
        self.end_warning(robot)

    # What is sent

    def frames(self, *, has_messages: bool) -> Iterator[bytes]:
        """Remove and yield WebSocket frames; with `has_messages`, also the robots' messages."""
        while (frame := self._next(has_messages=has_messages)) is not None:
            yield frame
            self._report_dropped()

    def _next(self, *, has_messages: bool) -> bytes | None:
        if self._texts:
            return as_frame(self._texts.popleft(), is_text=True)
        if self._answers:
            answer, is_text = self._answers.popleft()
            return as_frame(answer, is_text=is_text)
        if self._statuses:
            return as_frame(self._statuses.pop(next(iter(self._statuses))), is_text=True)
        while self._ready and has_messages:
            robot = next(iter(self._ready))
            feed = self._ready.pop(robot)
            message = feed.next_message()
            self._dropped += feed.take_dropped()
            if message is not None:
                self._ready[robot] = feed  # the robots take turns
                return as_frame(message)
        return None

    def _report_dropped(self) -> None:
        """Report the number of dropped messages, at most once per `DROPPED_EVERY_S`."""
        now_s = self._now()
        if self._dropped > self._told_dropped and now_s >= self._told_dropped_s + DROPPED_EVERY_S:
            self._told_dropped, self._told_dropped_s = self._dropped, now_s
            text = f"{self._dropped} messages were dropped because this client reads too slowly"
            self.tell("dropped", text)
