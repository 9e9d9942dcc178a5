"""Interfaces for transports, and the errors that transports raise.

A transport carries payloads without interpreting them: bytes for streams and datagrams, envelopes
for messages. A transport converts every library exception into one of the errors in this module.

Only `urc.runtime.link` uses transports, including transports in another process.
"""

from collections.abc import Callable, Collection, Mapping
from typing import Final, NamedTuple, Protocol, runtime_checkable

from urc.model.payload import Payload
from urc.model.values import NOTHING, Value
from urc.problems import UrcError

__all__ = [
    "GoalRecord",
    "LOW_STREAM",
    "NOTICE",
    "TOPICS",
    "ByteStream",
    "Tunnel",
    "ConnectFailed",
    "MissingPackage",
    "PeerClosed",
    "Prompt",
    "TransportSetup",
    "TopicSubscription",
    "SupportsAbort",
    "SupportsArrivals",
    "SupportsEnd",
    "SupportsEnds",
    "SupportsForget",
    "SupportsGoals",
    "SupportsOffer",
    "SupportsProbe",
    "SupportsReady",
    "SupportsReset",
    "SupportsSettle",
    "SupportsUnsent",
    "Transport",
    "TransportError",
    "bytes_of",
    "ends_of",
    "reset",
    "unsent_of",
]


NOTICE: Final = "notice"
"""The verb of notices, which are envelopes that the transport itself creates. A notice's body is
one line of text about an error that the robot does not report. Notices are written to the robot's
log and do not prove that the robot is alive.
"""

LOW_STREAM: Final = "low-stream"
"""The verb of an envelope with an access unit of a camera's low stream. Requests to open or close
this stream have it as their topic."""

TOPICS: Final = "topics"
"""The verb of a request for the robot's topics, and of the answer, which the transport itself
creates (`urc.transports.ros.topic_list`). An answer does not prove that the robot is alive.
"""


class TransportError(UrcError):
    """A transport error: an invalid option, unsuitable data, or a failed or lost connection.

    - `ConnectFailed`: the attempt was refused or timed out, or the host is unknown.
    - `PeerClosed`: the robot closed the connection, or the connection broke.
    - `MissingPackage`: an extra is not installed.
    """


class MissingPackage(TransportError):
    """Raised if a transport needs a package of an extra that is not installed."""


class ConnectFailed(TransportError):
    """Raised if a connection cannot be opened."""


class PeerClosed(TransportError):
    """Raised if the peer has closed the connection, or the connection is broken."""


class Transport(Protocol):
    """Carries payloads to and from one robot.

    A transport may be reopened after `close` but has at most one connection at a time.
    """

    @property
    def address(self) -> str:
        """The connection's target in readable form, such as ``tcp 192.168.1.5:6789``."""

    async def open(self, timeout_s: float) -> None:
        """Open the connection within `timeout_s` seconds, or raise `ConnectFailed`."""

    async def receive(self) -> Payload:
        """Return at least one received byte, or the next envelope.

        Raises:
            PeerClosed: the stream has ended.
        """

    async def send(self, data: Payload) -> None:
        """Wait for buffer space, then send `data`; raise `TransportError` on a connection error."""

    async def close(self) -> None:
        """Close immediately. The method never raises and may be called twice."""


def bytes_of(data: Payload) -> bytes:
    """Return `data` as bytes; raise `TransportError` for an envelope."""
    if isinstance(data, bytes):
        return data
    raise TransportError(f"a byte transport cannot carry a message ({data.verb})")


class ByteStream(Protocol):
    """One open connection that carries bytes, direct or through a tunnel."""

    async def read(self) -> bytes:
        """Return at least one received byte; raise `PeerClosed` when the stream has ended."""

    async def write(self, data: bytes) -> None:
        """Wait for buffer space, then send `data`; raise `PeerClosed` on a broken connection."""

    async def abort(self) -> None:
        """Close immediately. The method never raises and may be called twice."""


class Tunnel(Protocol):
    """A transport that carries other connections, such as SSH port forwarding."""

    async def connect(self, host: str, port: int, timeout_s: float) -> ByteStream:
        """Connect to `host` and `port` through the tunnel; raise `ConnectFailed` on failure."""


class TopicSubscription(NamedTuple):
    """A topic that a driver's messages need on a transport such as MQTT or ROS."""

    topic: str
    attributes: Mapping[str, Value] = NOTHING
    """The subscription's options, such as type, throttle and quality of service."""


class TransportSetup(NamedTuple):
    """The arguments that a transport factory receives."""

    name: str
    """The transport's name in the driver."""
    options: Mapping[str, object] = NOTHING
    """Options after template evaluation: plain values, and lists and mappings of values."""
    subscriptions: tuple[TopicSubscription, ...] = ()
    tunnel: Tunnel | None = None
    """Tunnel that carries the connection; None for this machine's own network."""


# Optional capabilities. Callers check for each capability once with `isinstance`, and also work
# without it.


@runtime_checkable
class SupportsReady(Protocol):
    """A transport that URC must prepare before connecting.

    The connection timeout does not include the preparation.
    """

    async def ready(self) -> None:
        """Wait until the transport can connect; raise `ConnectFailed` if it cannot be prepared."""


@runtime_checkable
class SupportsSettle(Protocol):
    """A transport that can wait until its sent messages have arrived."""

    async def settle(self) -> str:
        """Keep the connection open until all sent data has arrived, as far as the system can tell.

        The wait is limited to a few seconds.

        Returns:
            One line about data that has not arrived; "" if all data has arrived or its state is
            unknown.
        """


@runtime_checkable
class SupportsProbe(Protocol):
    """A transport that can probe the program at the other end."""

    async def probe(self) -> None:
        """Wait until the remote program sends data after this call.

        Raises:
            TransportError: the connection broke.
        """


@runtime_checkable
class SupportsArrivals(Protocol):
    """A transport that also delivers its own envelopes, or delivers messages after their arrival.

    These deliveries do not prove that the robot is alive (`urc.transports.arrival_check`).
    """

    def arrivals(self) -> int:
        """Return the number of messages that have arrived over this connection."""


@runtime_checkable
class SupportsUnsent(Protocol):
    """A transport or stream that can count its unsent bytes."""

    def unsent(self) -> int:
        """Return the number of unacknowledged bytes; 0 if the number is unknown."""


@runtime_checkable
class SupportsForget(Protocol):
    """A transport that may reorder messages."""

    def forget(self) -> None:
        """Discard unsent data, which could otherwise arrive after a later stop."""


@runtime_checkable
class SupportsAbort(Protocol):
    """A transport that can be closed without sending the remaining data."""

    async def abort(self) -> None:
        """Close the connection immediately and discard unsent data. Never raises."""


@runtime_checkable
class SupportsOffer(Protocol):
    """A transport that can send without waiting."""

    def offer(self, data: bytes) -> bool:
        """Send `data` unless earlier data is waiting; return whether `data` was accepted.

        Never waits.
        """


@runtime_checkable
class Prompt(SupportsOffer, Protocol):
    """A byte transport that avoids one task switch per message in both directions.

    The order of all bytes is preserved. `offer` refuses data while earlier data is waiting, and the
    sink receives nothing while data is buffered for `receive`.
    """

    @property
    def is_clogged(self) -> bool:
        """Whether accepted data is unwritten; ``send(b"")`` waits until all data is written."""

    def divert(self, sink: Callable[[bytes], bool]) -> None:
        """Pass received data to `sink` until the connection is closed.

        The sink returns whether it accepted the data; `receive` returns data that the sink refused.
        """


class GoalRecord(NamedTuple):
    """The goals of a transport that drive the robot on, even if the transport's process ends."""

    goals: tuple[tuple[str, str, bool], ...] = ()
    """Id and action of each unfinished goal, oldest first, and whether it was cancelled."""
    owed: tuple[str, ...] = ()
    """Actions that owe an answer to the cancellation of all goals, oldest first."""
    dropped: tuple[str, ...] = ()
    """Actions whose last cancellation of all goals has ended without an answer, oldest first."""


@runtime_checkable
class SupportsGoals(Protocol):
    """A transport whose goals outlive its connections and its process."""

    def keep_goals(self, record: GoalRecord, changed: Callable[[GoalRecord], None]) -> None:
        """Take over the goals of an earlier process, and report each later change.

        Args:
            record: the goals of the earlier process.
            changed: function that receives the whole record after each change. A new goal is
                reported before it is sent.
        """

    def end_cancellations(self, actions: Collection[str]) -> None:
        """End the repetition of unanswered cancellations of all goals of `actions`; never raises.

        A reset of STOP permits new goals, which such a cancellation would end, too. Goals that were
        cancelled by their ids are still cancelled.
        """


@runtime_checkable
class SupportsReset(Protocol):
    """A stream that can be closed without sending the remaining data."""

    async def reset(self) -> None:
        """Close the stream immediately, without sending the remaining data. Never raises."""


@runtime_checkable
class SupportsEnd(Protocol):
    """A stream that URC can end, with a reason for the user."""

    def end(self, why: str) -> None:
        """Make `read` and `write` raise `PeerClosed` with the reason `why` from now on."""


@runtime_checkable
class SupportsEnds(Protocol):
    """A stream that knows the IP addresses of its two ends."""

    def ends(self) -> tuple[str, str]:
        """Return the IP addresses of this computer's end and of the peer's end.

        Raises:
            OSError: the connection has ended.
        """


def ends_of(stream: ByteStream | None) -> tuple[str, str]:
    """Return the IP addresses of both ends of a stream.

    Raises:
        ConnectFailed: the addresses are unknown, or the connection has ended.
    """
    if stream is None or not isinstance(stream, SupportsEnds):
        raise ConnectFailed("the addresses of the connection are unknown")
    try:
        return stream.ends()
    except OSError as fault:
        raise ConnectFailed("the robot closed the connection") from fault


def unsent_of(stream: ByteStream | None) -> int:
    """Return the number of unsent bytes of a stream; 0 if the number is unknown."""
    if stream is not None and isinstance(stream, SupportsUnsent):
        return stream.unsent()
    return 0


async def reset(stream: ByteStream) -> None:
    """Close a stream, and discard its unsent data if the stream implements `SupportsReset`."""
    await (stream.reset() if isinstance(stream, SupportsReset) else stream.abort())
