"""The seam to the outside world: five members, and one small tree of errors.

A transport moves bytes and knows no meaning. Whatever a library underneath raises is translated at
the transport's edge into one of the errors below; nothing foreign passes. `urc.runtime.link` is the
only user, and must not care in which process a transport lives.
"""

from typing import Protocol

from urc.problems import UrcError

__all__ = ["ConnectFailed", "PeerClosed", "Transport", "TransportError"]


class TransportError(UrcError):
    """The line cannot be used, or not any more.

    TransportError
    ├── ConnectFailed    it could not be opened: refused, no such host, timed out
    └── PeerClosed       the robot closed it, in good order or not
    """


class ConnectFailed(TransportError):
    """The line could not be opened."""


class PeerClosed(TransportError):
    """The other side closed the line, or it broke."""


class Transport(Protocol):
    """One line to a robot. Opened at most once at a time; may be opened again after `close`."""

    @property
    def address(self) -> str:
        """Where it leads, for people: ``tcp 192.168.1.5:6789``."""

    async def open(self, timeout_s: float) -> None:
        """Connect, or raise `ConnectFailed` within `timeout_s` seconds."""

    async def receive(self) -> bytes:
        """Return the next bytes, at least one; raise `PeerClosed` when no more will come."""

    async def send(self, data: bytes) -> None:
        """Hand `data` over, waiting while the line is full; raise `TransportError` if it broke."""

    async def close(self) -> None:
        """Close at once. Never raises, may be called twice."""
