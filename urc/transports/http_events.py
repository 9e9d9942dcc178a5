"""Parsers for ``text/event-stream`` and plain lines.

The parsers do no I/O: the input is bytes, and the output is messages.

Server-sent events follow the HTML standard (section 9.2.6, "Interpreting an event stream"), except
that data is not decoded to text. Sizes are limited: an event or line that is too long is skipped
and counted, and parsing continues.
"""

from typing import Final, NamedTuple

__all__ = ["Event", "EventStreamParser", "LineSplitter"]

_BOM: Final = b"\xef\xbb\xbf"
_MAX_NAME: Final = 200
"""Maximum length of a stored event name or id, in characters."""
_TOO_LONG: Final = b"\0 too long"
"""Placeholder for a line that is too long, compared by identity."""


class Event(NamedTuple):
    """One server-sent event."""

    name: str
    """Event name; "" for the default, which is called ``message`` in the standard."""
    data: bytes
    """The event's data lines, joined by LF characters."""
    id: str
    """The stream's newest event id, from which a new connection resumes."""


class LineSplitter:
    """An incremental splitter of a response body into lines without line ends (CR LF, LF or CR)."""

    def __init__(self, max_bytes: int, instead: bytes | None = None) -> None:
        """Create a splitter that replaces lines over `max_bytes` by `instead`; None skips them."""
        self._most = max_bytes
        self._instead = instead
        self._buffer = bytearray()
        self._is_skipping = False
        self._was_cr = False
        self.left_out = 0
        """Number of lines skipped so far, because they were too long."""

    def feed(self, data: bytes) -> list[bytes]:
        """Process the next part of the body and return the completed lines."""
        if self._was_cr and data.startswith(b"\n"):
            data = data[1:]
            self._was_cr = False
        if data:
            self._was_cr = data.endswith(b"\r")
        # Most bodies use only CR LF or LF, and can be split without scanning each byte.
        plain = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data
        first, *others = plain.split(b"\n")
        if not others:
            self._add(first)
            return []
        lines: list[bytes] = []
        self._add(first)
        self._finish(lines)
        *whole, last = others
        for line in whole:
            self._add(line)
            self._finish(lines)
        self._add(last)
        return lines

    def end(self) -> bytes:
        """Return the body's last line if it has no line end; otherwise, return b""."""
        rest = b"" if self._is_skipping else bytes(self._buffer)
        self._buffer.clear()
        return rest

    def _add(self, piece: bytes) -> None:
        if self._is_skipping:
            return
        self._buffer += piece
        if len(self._buffer) > self._most:
            self._is_skipping = True
            self._buffer.clear()
            self.left_out += 1

    def _finish(self, lines: list[bytes]) -> None:
        if not self._is_skipping:
            lines.append(bytes(self._buffer))
        elif self._instead is not None:
            lines.append(self._instead)
        self._is_skipping = False
        self._buffer.clear()


class EventStreamParser:
    """An incremental parser of an event stream."""

    def __init__(self, max_bytes: int, last_id: str = "") -> None:
        """Create a parser that skips events over `max_bytes`; `last_id` is the last received id."""
        self._most = max_bytes
        self._lines = LineSplitter(max_bytes + _MAX_NAME, _TOO_LONG)
        self._is_start = True
        self._name = ""
        self._data: list[bytes] = []
        self._size = 0
        self._is_too_long = False
        self._next_id = last_id
        self.last_id = last_id
        """The newest event's id, which a new connection sends in the Last-Event-ID header."""
        self.left_out = 0
        """Number of events skipped so far, because they were too long."""
        self.retry_s: float | None = None
        """Retry delay requested by the robot, in seconds; None if no delay was requested."""

    def feed(self, data: bytes) -> list[Event]:
        """Process the next part of the stream and return the completed events."""
        events: list[Event] = []
        for line in self._lines.feed(data):
            text = line.removeprefix(_BOM) if self._is_start else line
            self._is_start = False
            if text:
                self._field(text)
            else:
                self._dispatch(events)
        return events

    def _field(self, line: bytes) -> None:
        if line is _TOO_LONG:
            self._is_too_long = True
            return
        name, _, value = line.partition(b":")
        value = value.removeprefix(b" ")
        if name == b"data":
            self._size += len(value) + bool(self._data)
            self._is_too_long |= self._size > self._most
            if not self._is_too_long:
                self._data.append(value)
        elif name == b"event":
            self._name = value.decode("utf-8", "replace")[:_MAX_NAME]
        elif name == b"id" and b"\0" not in value:
            self._next_id = value.decode("utf-8", "replace")[:_MAX_NAME]
        elif name == b"retry" and value.isdigit() and len(value) < 10:
            self.retry_s = int(value) / 1000

    def _dispatch(self, events: list[Event]) -> None:
        self.last_id = self._next_id
        if self._is_too_long:
            self.left_out += 1
        elif self._data:
            events.append(Event(self._name, b"\n".join(self._data), self.last_id))
        self._name, self._size, self._is_too_long = "", 0, False
        self._data.clear()
