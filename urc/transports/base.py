"""The seam to the outside world: five members, and one small tree of errors.

A transport moves payloads and knows no meaning: bytes where the line is a stream or datagrams,
envelopes where it carries messages (topics, requests, calls). Whatever a library underneath raises
is translated at the transport's edge into one of the errors below; nothing foreign passes.
`urc.runtime.link` is the only user, and must not care in which process a transport lives.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple, Protocol, runtime_checkable

from urc.model.codec import Payload
from urc.model.values import NOTHING, Value
from urc.problems import UrcError

__all__ = [
    "NOTICE",
    "ByteStream",
    "Carrier",
    "ConnectFailed",
    "PeerClosed",
    "Prompt",
    "Setup",
    "Subscription",
    "SupportsAbort",
    "SupportsEnd",
    "SupportsForget",
    "SupportsOffer",
    "SupportsProbe",
    "SupportsReset",
    "SupportsSettle",
    "SupportsUnsent",
    "Transport",
    "TransportError",
    "bytes_of",
    "reset",
    "unsent_of",
]


NOTICE: Final = "notice"
"""Verb of an envelope that a transport itself gives: its body is one line for people, about a fault
that the robot does not tell. It goes to the robot's log and does not count as a heartbeat."""


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

    async def receive(self) -> Payload:
        """Return the next bytes, at least one, or the next envelope.

        Raises:
            PeerClosed: no more will come.
        """

    async def send(self, data: Payload) -> None:
        """Hand `data` over, waiting while the line is full; raise `TransportError` if it broke."""

    async def close(self) -> None:
        """Close at once. Never raises, may be called twice."""


def bytes_of(data: Payload) -> bytes:
    """Return `data` for a line that carries bytes alone; raise `TransportError` for a message."""
    if isinstance(data, bytes):
        return data
    raise TransportError(f"a line of bytes cannot carry a message ({data.verb})")


class ByteStream(Protocol):
    """One open connection that another transport carries."""

    async def take(self) -> bytes:
        """Return the next bytes, at least one; raise `PeerClosed` when no more will come."""

    async def put(self, data: bytes) -> None:
        """Hand `data` over, waiting while the stream is full; raise `PeerClosed` if it broke."""

    async def abort(self) -> None:
        """Close at once. Never raises, may be called twice."""


class Carrier(Protocol):
    """A transport that others go through: SSH, which forwards connections."""

    async def connect(self, host: str, port: int, timeout_s: float) -> ByteStream:
        """Connect to `host` and `port` as seen from the far end; raise `ConnectFailed`."""


class Subscription(NamedTuple):
    """What a driver's messages listen to on a transport that carries messages."""

    topic: str
    attributes: Mapping[str, Value] = NOTHING
    """What the transport's own way of subscribing takes: type, throttle, quality of service …"""


class Setup(NamedTuple):
    """What a transport's factory makes it from."""

    name: str
    """Of the transport in the driver."""
    options: Mapping[str, object] = NOTHING
    """As the document gives them, evaluated: plain values, and lists and mappings of them."""
    subscriptions: tuple[Subscription, ...] = ()
    via: Carrier | None = None
    """What it goes through; None: this machine's own network."""


# Optional abilities. Users ask with `isinstance` once, when they are made, and do without where an
# ability is missing.


@runtime_checkable
class SupportsSettle(Protocol):
    """A transport on which a message that was handed over may not have arrived yet."""

    async def settle(self) -> str:
        """Keep the line until all sent data has arrived, as far as the system tells.

        Bounded to a few seconds.

        Returns:
            What did not arrive, in one line; "" where all did, or nothing can be known.
        """


@runtime_checkable
class SupportsProbe(Protocol):
    """A transport that can probe the program at the other end."""

    async def probe(self) -> None:
        """Return when anything has come from that program since the call.

        Raises:
            TransportError: the line broke.
        """


@runtime_checkable
class SupportsUnsent(Protocol):
    """A transport or stream that counts its unsent bytes."""

    def unsent(self) -> int:
        """Return the bytes handed over that have not left for good; 0 where it is unknown."""


@runtime_checkable
class SupportsForget(Protocol):
    """A transport that does not keep the order of messages: a later one may arrive sooner."""

    def forget(self) -> None:
        """Discard unsent data: it would arrive after its stop."""


@runtime_checkable
class SupportsAbort(Protocol):
    """A transport that can be closed without sending the rest."""

    async def abort(self) -> None:
        """Close at once; what the robot has not got by now, it never gets. Never raises."""


@runtime_checkable
class SupportsOffer(Protocol):
    """A transport that can take bytes without waiting."""

    def offer(self, data: bytes) -> bool:
        """Hand `data` over if nothing waits before it; return whether it was taken. Never waits."""


@runtime_checkable
class Prompt(SupportsOffer, Protocol):
    """A transport of bytes that saves a task's turn for each message, both ways.

    The order of bytes is kept: `offer` takes none while others wait, and a sink gets none while
    `receive` has some to give.
    """

    @property
    def is_clogged(self) -> bool:
        """Whether some accepted data is still to be written; ``send(b"")`` waits for it."""

    def divert(self, sink: Callable[[bytes], bool]) -> None:
        """Let `sink` have what arrives until the line is closed; it returns whether it took it.

        What it does not take is for `receive`.
        """


@runtime_checkable
class SupportsReset(Protocol):
    """A stream that can be closed without sending the rest."""

    async def reset(self) -> None:
        """Close at once, without sending the rest. Never raises."""


@runtime_checkable
class SupportsEnd(Protocol):
    """A stream that this side can end with a reason for people."""

    def end(self, why: str) -> None:
        """Let `take` and `put` raise `PeerClosed` with `why` from now on."""


def unsent_of(stream: ByteStream | None) -> int:
    """Return the unsent bytes of a stream; 0 where it cannot count them."""
    if stream is not None and isinstance(stream, SupportsUnsent):
        return stream.unsent()
    return 0


async def reset(stream: ByteStream) -> None:
    """Close a stream, without sending the rest where it can do so."""
    await (stream.reset() if isinstance(stream, SupportsReset) else stream.abort())
