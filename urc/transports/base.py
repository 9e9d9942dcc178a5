"""Interfaces of transports, and their errors.

A transport carries payloads without interpreting them: bytes for streams and datagrams, envelopes
for messages (topics, requests, calls). A transport translates every exception of a library into one
of the errors below.

`urc.runtime.link` is the only user; it is independent of the process in which a transport runs.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple, Protocol, runtime_checkable

from urc.model.payload import Payload
from urc.model.values import NOTHING, Value
from urc.problems import UrcError

__all__ = [
    "NOTICE",
    "ByteStream",
    "Tunnel",
    "ConnectFailed",
    "PeerClosed",
    "Prompt",
    "TransportSetup",
    "TopicSubscription",
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
"""Verb of envelopes that a transport itself creates. The body is a one-line text for people about
an error that the robot does not report. The notice goes to the log of the robot and does not prove
that the robot is alive."""


class TransportError(UrcError):
    """The connection is unusable, or no longer usable.

    TransportError ├── ConnectFailed    opening failed: refused, no such host, timed out └──
    PeerClosed       the robot closed the connection, in order or not
    """


class ConnectFailed(TransportError):
    """The connection could not be opened."""


class PeerClosed(TransportError):
    """The other side closed the connection, or it broke."""


class Transport(Protocol):
    """One connection to a robot.

    A transport may be opened again after `close`, but never twice at a time.
    """

    @property
    def address(self) -> str:
        """Target of the connection as text for people: ``tcp 192.168.1.5:6789``."""

    async def open(self, timeout_s: float) -> None:
        """Connect, or raise `ConnectFailed` within `timeout_s` seconds."""

    async def receive(self) -> Payload:
        """Return the next bytes, at least one, or the next envelope.

        Raises:
            PeerClosed: the stream has ended.
        """

    async def send(self, data: Payload) -> None:
        """Send `data`, waiting for buffer space; raise `TransportError` if the connection broke."""

    async def close(self) -> None:
        """Close at once. Never raises, may be called twice."""


def bytes_of(data: Payload) -> bytes:
    """Return `data` for a connection that carries bytes; raise `TransportError` for an envelope."""
    if isinstance(data, bytes):
        return data
    raise TransportError(f"a transport of bytes cannot carry a message ({data.verb})")


class ByteStream(Protocol):
    """One open connection inside a tunnel."""

    async def read(self) -> bytes:
        """Return the next bytes, at least one; raise `PeerClosed` at the end of the stream."""

    async def write(self, data: bytes) -> None:
        """Send `data`, waiting for buffer space; raise `PeerClosed` if the connection broke."""

    async def abort(self) -> None:
        """Close at once. Never raises, may be called twice."""


class Tunnel(Protocol):
    """A transport that tunnels others, such as SSH port forwarding."""

    async def connect(self, host: str, port: int, timeout_s: float) -> ByteStream:
        """Connect to `host` and `port` as seen from the far end; raise `ConnectFailed`."""


class TopicSubscription(NamedTuple):
    """A topic of a driver's messages, on a transport that carries messages."""

    topic: str
    attributes: Mapping[str, Value] = NOTHING
    """Options of the subscription: type, throttle, quality of service …"""


class TransportSetup(NamedTuple):
    """The input of a transport factory."""

    name: str
    """Name of the transport in the driver."""
    options: Mapping[str, object] = NOTHING
    """Evaluated options: plain values, and lists and mappings of them."""
    subscriptions: tuple[TopicSubscription, ...] = ()
    tunnel: Tunnel | None = None
    """Tunnel of the connection; None: the network of this machine."""


# Optional abilities. Users check them once with `isinstance`, and work without them.


@runtime_checkable
class SupportsSettle(Protocol):
    """A transport whose sent messages may not have arrived yet."""

    async def settle(self) -> str:
        """Keep the connection until all sent data has arrived, as far as the system tells.

        The wait is bounded to a few seconds.

        Returns:
            One line about data that has not arrived; "" if all arrived or the state is unknown.
        """


@runtime_checkable
class SupportsProbe(Protocol):
    """A transport that can probe the program at the other end."""

    async def probe(self) -> None:
        """Return when that program has sent anything since the call.

        Raises:
            TransportError: the connection broke.
        """


@runtime_checkable
class SupportsUnsent(Protocol):
    """A transport or stream that counts its unsent bytes."""

    def unsent(self) -> int:
        """Return the number of unacknowledged bytes; 0 if it is unknown."""


@runtime_checkable
class SupportsForget(Protocol):
    """A transport that may reorder messages."""

    def forget(self) -> None:
        """Discard unsent data, which could arrive after its stop."""


@runtime_checkable
class SupportsAbort(Protocol):
    """A transport that can be closed without sending the rest."""

    async def abort(self) -> None:
        """Close at once and discard unsent data. Never raises."""


@runtime_checkable
class SupportsOffer(Protocol):
    """A transport that can send without waiting."""

    def offer(self, data: bytes) -> bool:
        """Send `data` if no earlier data waits; return whether it was accepted. Never waits."""


@runtime_checkable
class Prompt(SupportsOffer, Protocol):
    """A byte transport that saves a task switch per message in both directions.

    The order of bytes is kept. `offer` refuses data while earlier data waits, and a sink receives
    nothing while `receive` has buffered data.
    """

    @property
    def is_clogged(self) -> bool:
        """Whether some accepted data is still to be written; ``send(b"")`` waits for it."""

    def divert(self, sink: Callable[[bytes], bool]) -> None:
        """Pass received data to `sink` until the connection is closed.

        The sink returns whether it accepted the data; `receive` returns refused data.
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
        """Make `take` and `put` raise `PeerClosed` with the reason `why` from now on."""


def unsent_of(stream: ByteStream | None) -> int:
    """Return the number of unsent bytes of a stream; 0 if the stream cannot count them."""
    if stream is not None and isinstance(stream, SupportsUnsent):
        return stream.unsent()
    return 0


async def reset(stream: ByteStream) -> None:
    """Close a stream, discarding unsent data if the stream supports it."""
    await (stream.reset() if isinstance(stream, SupportsReset) else stream.abort())
