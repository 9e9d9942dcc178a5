"""The socket below a browser client, and the limit on its messages.

Floor 5.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol

from starlette.types import Message

from urc.motion.lease import Role

__all__ = ["Allowance", "Flow", "Guest", "Line"]


class Line(Protocol):
    """The part of an accepted WebSocket that a client needs."""

    async def receive(self) -> Message:
        """Return the next ASGI message."""

    async def send_text(self, data: str) -> None:
        """Send one text message."""

    async def send_bytes(self, data: bytes) -> None:
        """Send one binary message."""

    async def close(self, code: int = 1000, reason: str | None = None) -> None:
        """Begin the closing handshake."""


class Flow(Protocol):
    """The state of the socket below a client."""

    def is_free(self) -> bool:
        """Whether the kernel has taken everything written so far."""

    async def drained(self) -> None:
        """Return when the kernel has taken everything written so far."""

    def write(self, frame: bytes) -> None:
        """Write whole WebSocket frames."""

    def listen(self, sink: Callable[[bytes], bool]) -> None:
        """Let `sink` have each text that came whole, before `Line.receive`.

        It saves the turns of a task. What it does not take, returning False, is for `receive`.
        """

    def hold_back(self, is_held: bool) -> None:
        """Let nothing more be read for now, or let it go on: what comes waits where it is."""

    def abort(self) -> None:
        """Cut the connection without waiting for anything."""


class Allowance:
    """How many messages may come: a bucket that holds one second's worth."""

    def __init__(self, rate_hz: float, now_s: float) -> None:
        self._rate_hz = rate_hz
        self._left = rate_hz
        self._time_s = now_s

    def take(self, now_s: float) -> bool:
        """Count one message; False when it is one too many."""
        earned = (now_s - self._time_s) * self._rate_hz
        self._left = min(self._rate_hz, self._left + earned)
        self._time_s = now_s
        if self._left < 1:
            return False
        self._left -= 1
        return True


class Guest(NamedTuple):
    """The person or program at the other end."""

    place: str = ""
    """Address, for the others; "" for this machine."""
    role: Role = "driver"
    who: str = ""
    """Whose seats are counted together: one browser, program or address; "": nobody's."""
    is_known: bool = False
    """Whether it has a key; else `who` is an address."""
