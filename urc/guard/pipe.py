"""One end of the pipe between the engine's process and the guard process.

Each message on the wire is a four-byte length followed by the body. Writing never waits: unsent
messages are queued. Urgent messages are sent first, and a newer message replaces an older message
in the same slot. The senders limit the length of the queue: flow-control credit limits replies, and
the maximum number of pending requests limits requests.
"""

import asyncio
import socket
import struct
from collections import deque
from collections.abc import Callable
from typing import Any

import msgspec

__all__ = ["Pipe"]

_HEAD = 4
_put_head, _head_of = struct.Struct("<I").pack_into, struct.Struct("<I").unpack_from
_READ_BYTES = 65536
_AT_ONCE = 64
"""Maximum number of messages handled before other tasks of the event loop run."""
UNFIT = (TypeError, OverflowError, NotImplementedError, msgspec.MsgspecError)
"""Exceptions that `post` raises for a message that cannot be encoded."""


class Pipe:
    """A message reader and writer on a connected socket, which the pipe owns."""

    def __init__(
        self,
        line: socket.socket,
        encoder: msgspec.msgpack.Encoder,
        decoder: msgspec.msgpack.Decoder[Any],
        *,
        take: Callable[[Any], None],
        settle: Callable[[], None],
        gone: Callable[[], None],
    ) -> None:
        """Start reading; requires a running event loop that can watch sockets.

        Args:
            line: the connected socket.
            encoder: encoder of posted messages.
            decoder: decoder of received messages.
            take: callback for each received message.
            settle: callback after each batch of messages.
            gone: callback that is called once, when the other side has closed the pipe.
        """
        line.setblocking(False)
        self._line = line
        self._send, self._receive = line.send, line.recv_into
        self._encode = encoder.encode_into
        self._decode = decoder.decode
        self._take = take
        self._settle = settle
        self._gone = gone
        self._loop = asyncio.get_running_loop()
        self._frame = bytearray(256)
        self._space = memoryview(bytearray(_READ_BYTES))
        self._held = bytearray()
        self._is_behind = False
        """Whether received messages are waiting for the event loop's next iteration."""
        self._rest = b""
        """Unsent bytes of a partly written message."""
        self._urgent: deque[bytes] = deque()
        self._queue: deque[bytes] = deque()
        self._newest: dict[str, bytes] = {}
        self._is_writing = False
        self.is_open = True
        self.taken_bytes = 0
        """Size of the message being handled, in bytes, as `post` returned it to the sender.
        """
        self._loop.add_reader(line, self._readable)

    @property
    def is_backed_up(self) -> bool:
        """Whether messages are posted faster than the other side reads them."""
        return self._is_writing

    def post(self, message: object, *, slot: str = "", is_urgent: bool = False) -> int:
        """Queue a message and write it as soon as possible; return its size in bytes.

        Args:
            message: a message for the encoder.
            slot: a newer message replaces an unsent message with the same slot.
            is_urgent: whether to send the message before all unsent messages.

        Raises:
            UNFIT: the message cannot be encoded.
        """
        frame = self._frame
        self._encode(message, frame, _HEAD)
        size = len(frame) - _HEAD
        _put_head(frame, 0, size)
        if not self.is_open:
            return size
        if not self._is_writing:
            try:
                taken = self._send(frame)
            except OSError:
                taken = self._write(frame)  # handles the error
            if taken == size + _HEAD:
                return size
            if taken:
                self._rest = bytes(frame[taken:])
                self._watch()
                return size
        data = bytes(frame)
        if slot:
            self._newest[slot] = data
        else:
            (self._urgent if is_urgent else self._queue).append(data)
        self._watch()
        return size

    def drop(self, slot: str) -> None:
        """Discard a slot's unsent message."""
        self._newest.pop(slot, None)

    def close(self) -> None:
        """Close the pipe without calling `gone`; a second call does nothing."""
        if self.is_open:
            self.is_open = False
            self._loop.remove_reader(self._line)
            self._loop.remove_writer(self._line)
            self._line.close()

    def end(self) -> None:
        """Signal to the other side that no more messages follow."""
        if self.is_open:
            try:
                self._line.shutdown(socket.SHUT_WR)
            except OSError:
                self._lose()

    # -- writing

    def _write(self, data: bytes | bytearray) -> int:
        try:
            return self._line.send(data)
        except (BlockingIOError, InterruptedError):
            return 0
        except OSError:
            self._loop.call_soon(self._lose)
            return len(data)

    def _watch(self) -> None:
        if not self._is_writing and self.is_open:
            self._is_writing = True
            self._loop.add_writer(self._line, self._writable)

    def _writable(self) -> None:
        while self.is_open:
            data = self._rest or self._next()
            if not data:
                self._is_writing = False
                self._loop.remove_writer(self._line)
                return
            taken = self._write(data)
            self._rest = data[taken:]
            if self._rest:
                return

    def _next(self) -> bytes:
        for waiting in (self._urgent, self._queue):
            if waiting:
                return waiting.popleft()
        if self._newest:
            return self._newest.pop(next(iter(self._newest)))
        return b""

    # -- reading

    def _readable(self) -> None:
        if self._is_behind or not self.is_open:
            return
        try:
            count = self._receive(self._space)
        except (BlockingIOError, InterruptedError):
            return
        except OSError:
            count = 0
        if not count:
            self._lose()
        elif self._held:
            self._held += self._space[:count]
            self._read_held()
        else:
            done = self._handle(self._space[:count])
            if done < count:
                self._held += self._space[done:count]
                self._look_behind()

    def _read_held(self) -> None:
        done = self._handle(memoryview(bytes(self._held)) if _is_whole(self._held) else _NONE)
        del self._held[:done]
        self._look_behind()

    def _look_behind(self) -> None:
        """Let other tasks run before handling the remaining complete messages."""
        is_behind = _is_whole(self._held) and self.is_open
        if is_behind:
            self._loop.call_soon(self._resume)
        if is_behind is not self._is_behind:
            self._is_behind = is_behind
            if is_behind:
                self._loop.remove_reader(self._line)
            elif self.is_open:
                self._loop.add_reader(self._line, self._readable)

    def _resume(self) -> None:
        if self.is_open:
            self._read_held()

    def _handle(self, data: memoryview) -> int:
        """Handle the complete messages in `data`; return the number of bytes handled."""
        at, size = 0, len(data)
        for _ in range(_AT_ONCE):
            if size - at < _HEAD or not self.is_open:
                break
            (length,) = _head_of(data, at)
            end = at + _HEAD + length
            if end > size:
                break
            self.taken_bytes = length
            self._take(self._decode(data[at + _HEAD : end]))
            at = end
        if at:
            self._settle()
        return at

    def _lose(self) -> None:
        if self.is_open:
            self.close()
            self._gone()


_NONE = memoryview(b"")


def _is_whole(held: bytearray) -> bool:
    return len(held) >= _HEAD and len(held) >= _HEAD + int.from_bytes(held[:_HEAD], "little")
