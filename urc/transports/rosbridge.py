"""ROS 1 and ROS 2 robots behind a rosbridge server: topics, services and actions.

Theory of operation. One WebSocket a connection, which is URC's own transport of that kind: opened,
watched by pings, closed. What is said on it is roslibpy's (`urc.transports.rosbridge_client`), and
is thrown away with the connection, so nothing can be said late. A task reads all the time, however
slowly the messages are taken: one reader that stalls freezes the topic for every client of the
bridge.

A bridge hands a first message on when its publisher is connected to the subscribers, and forgets it
when its client leaves before that. `settle` is for who leaves: it asks rosapi, whose answer also
says that the bridge has worked off all before it, and stays for the time of such a connection.

The bridge tells no errors: a topic that nobody publishes, a wrong type, a white-list, all are
silence. So rosapi is asked at the start which topics there are, and at the first message on a topic
who subscribes to it; `urc.transports.ros_graph` tells what is wrong. With ``ros: auto`` the answer
comes before the subscriptions, because it says how types are spelled.
"""

import asyncio
import logging
from collections.abc import Mapping
from contextlib import suppress
from importlib.util import find_spec
from typing import Any, Final, Literal

from urc.model.codec import Envelope, Payload
from urc.model.values import NOTHING, Value
from urc.transports.base import NOTICE, ConnectFailed, PeerClosed, Setup, Transport, TransportError
from urc.transports.ros_graph import TopicGraph, version_of
from urc.transports.rosbridge_client import KNOWN_TOPICS, Listening, RosClient
from urc.transports.rosbridge_frames import MAX_BYTES, BadFrame, FrameReader
from urc.transports.topics import Inbox
from urc.transports.websocket import WebSocketTransport

__all__ = ["RosbridgeTransport", "from_setup"]

DEFAULT_PORT = 9090
AUTO: Final = "auto"
_WEBSOCKET = ("auth", "headers")
"""Options that are the WebSocket's own."""

_ANSWER_S = 3.0
"""How long rosapi may take to answer, before it is taken to be missing."""
_CONNECTS_S = 1.0
"""How long a bridge keeps a message for subscribers that have not connected yet."""
_LOOK_S = 0.2

_TURN_S = 0.005
"""How long frames are read before others have their turn on the loop."""

log = logging.getLogger(__name__)


class RosbridgeTransport:
    """One connection to a rosbridge server, opened as often as it is needed."""

    def __init__(
        self,
        wire: WebSocketTransport,
        where: str,
        subscriptions: tuple[Listening, ...] = (),
        ros: int | Literal["auto"] | None = None,
    ) -> None:
        """Prepare a line; nothing is opened yet.

        Args:
            wire: leads to the bridge; ours from now on.
            where: for people: ``192.168.1.5:9090``.
            subscriptions: sent whenever the line is opened, one a topic.
            ros: 1 or 2: how the names of types are spelled; "auto": as the bridge's own are; None:
                as they are written.
        """
        self._wire = wire
        self._where = where
        self._subscriptions = subscriptions
        self._ros = ros
        self._session: _Session | None = None
        self._graph = TopicGraph(self._tell, None if ros == AUTO else ros)

    @property
    def address(self) -> str:
        """Where it leads, for people: ``rosbridge 192.168.1.5:9090``."""
        return f"rosbridge {self._where}"

    async def open(self, timeout_s: float) -> None:
        """Connect and subscribe, or raise `ConnectFailed` within `timeout_s` seconds."""
        await self.close()
        await self._wire.open(timeout_s)
        session = self._session = _Session(self._wire, self._ros, self._graph)
        try:
            async with asyncio.timeout(timeout_s):
                await session.begin(self._subscriptions)
        except BaseException as fault:
            self._session = None
            await session.end()
            await self._wire.close()
            if isinstance(fault, PeerClosed | TimeoutError):
                told = str(fault) or "it takes nothing"
                message = f"{self._where} took no subscription ({told})"
                raise ConnectFailed(message) from fault
            raise

    async def receive(self) -> Envelope:
        """Return the next message, response or feedback; `PeerClosed` when no more will come."""
        if self._session is None:
            raise PeerClosed("the line is closed")
        return await self._session.inbox.take()

    async def send(self, data: Payload) -> None:
        """Publish, call, start a goal or cancel it; return once the kernel has it.

        Raises:
            PeerClosed: the line broke.
            TransportError: it is nothing that rosbridge can send.
        """
        if self._session is None:
            raise PeerClosed("the line is closed")
        if not isinstance(data, Envelope):
            raise TransportError("rosbridge carries messages, not bytes; use publish or call")
        await self._session.perform(data)

    async def close(self) -> None:
        """Close at once, with all that is unsent or unanswered. Never raises, twice is fine."""
        session, self._session = self._session, None
        try:
            if session is not None:
                await session.end()
        finally:
            await self._wire.close()

    async def settle(self) -> str:
        """Stay until what was published first on a topic has reached its subscribers.

        Returns:
            The topics that nothing subscribes to, in one line, or "".
        """
        return "" if self._session is None else await self._session.settle()

    async def probe(self) -> None:
        """Ask the bridge for a sign of life, and return when anything has come since."""
        await self._wire.probe()

    def unsent(self) -> int:
        """Return the bytes handed over that have not left this machine for good."""
        return self._wire.unsent()

    async def abort(self) -> None:
        """Close at once; what the bridge has not got by now it never gets. Never raises."""
        session, self._session = self._session, None
        try:
            if session is not None:
                await session.end()
        finally:
            await self._wire.abort()

    def _tell(self, fault: str) -> None:
        if self._session is not None:
            self._session.inbox.answer(Envelope(NOTICE, {}, fault))


def from_setup(setup: Setup) -> Transport:
    """Make a transport out of a document's options; see docs/transports/rosbridge.md.

    Raises:
        TransportError: an option is missing or not usable.
    """
    options = setup.options
    host, port = options.get("host"), options.get("port", DEFAULT_PORT)
    if not isinstance(host, str) or not host.strip():
        raise TransportError(f"rosbridge needs a host name or address, not {host!r}")
    if isinstance(port, bool) or not isinstance(port, int) or not 1 <= port <= 65535:
        raise TransportError(f"rosbridge needs a port from 1 to 65535, not {port!r}")
    path, tls = options.get("path", "/"), options.get("tls") or None
    if not isinstance(path, str) or not path.startswith("/"):
        raise TransportError(f"rosbridge needs a path that starts with /, not {path!r}")
    ros = options.get("ros")
    if ros is not None and (isinstance(ros, bool) or ros not in (1, 2, AUTO)):
        raise TransportError(f"rosbridge needs 1, 2 or auto as ros, not {ros!r}")
    host = host.strip()
    where = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
    url = f"{'ws' if tls is None else 'wss'}://{where}{path}"
    given = {name: options[name] for name in _WEBSOCKET if name in options}
    wire = WebSocketTransport(
        setup._replace(options={"url": url, "tls": tls, "max_message": MAX_BYTES, **given})
    )
    wanted = [_listening(one.topic, one.attributes) for one in setup.subscriptions]
    return RosbridgeTransport(wire, where, _merged(wanted), ros)


def _listening(topic: str, attributes: Mapping[str, Value]) -> Listening:
    def number(name: str, factor: float = 1) -> int:
        value = attributes.get(name) or 0
        if isinstance(value, bool) or not isinstance(value, int | float) or value < 0:
            raise TransportError(f"rosbridge: {name} of {topic} is no number, not {value!r}")
        return round(value * factor)

    compression = attributes.get("compression") or "none"
    if compression not in ("none", "png", "cbor"):
        raise TransportError(f"rosbridge: {compression!r} of {topic} is not none, png or cbor")
    if compression == "cbor" and find_spec("cbor2") is None:
        raise TransportError("cbor needs the package cbor2: pip install 'urc[cbor]'")
    return Listening(
        topic,
        str(attributes.get("type") or ""),
        number("throttle", 1000),
        number("queue_length"),
        str(compression),
    )


def _merged(wanted: list[Listening]) -> tuple[Listening, ...]:
    """Return one subscription a topic: a second one would cancel the first one's throttle."""
    found: dict[str, Listening] = {}
    for one in wanted:
        other = found.setdefault(one.topic, one)
        if other is not one:
            found[one.topic] = one._replace(
                type=other.type or one.type,
                throttle_ms=min(other.throttle_ms, one.throttle_ms),
                queue_length=max(other.queue_length, one.queue_length),
                compression="none" if "none" in (one.compression, other.compression) else other[4],
            )
    return tuple(found.values())


class _Session:
    """What belongs to one open connection, and goes with it."""

    def __init__(
        self, wire: WebSocketTransport, ros: int | Literal["auto"] | None, graph: TopicGraph
    ) -> None:
        self.inbox = Inbox()
        self._wire = wire
        self._client = RosClient(self.inbox, None if ros == AUTO else ros)
        self._is_auto = ros == AUTO
        self._frames = FrameReader()
        self._graph = graph
        self._learnt = asyncio.Event()
        """Set once rosapi has said which topics there are, or that it cannot."""
        self._bad = 0
        self._reader: asyncio.Task[None] | None = None
        self._fresh: dict[str, None] = {}
        """Topics on which something was published that may not have arrived yet, in order."""

    async def begin(self, subscriptions: tuple[Listening, ...]) -> None:
        """Ask which topics there are, subscribe, and read from now on."""
        self._reader = asyncio.create_task(self._read())
        # Asked first: later, ROS 1 would count our own subscriptions.
        asked = self._client.ask(
            "/rosapi/topics", lambda said: self._learn(subscriptions, said), errback=self._unknown
        )
        await self._write(asked)
        if self._is_auto:
            with suppress(TimeoutError):  # rosapi is missing: types go out as they are written
                async with asyncio.timeout(_ANSWER_S):
                    await self._learnt.wait()
        for one in subscriptions:
            await self._write(self._client.listen(one))

    async def perform(self, envelope: Envelope) -> None:
        """Send what an envelope asks for."""
        frames = self._client.perform(envelope)
        if envelope.verb == "publish":
            topic = str(envelope.attributes.get("topic"))
            if len(self._fresh) < KNOWN_TOPICS:
                self._fresh[topic] = None
            if self._learnt.is_set():
                frames += self._look_at(topic, str(envelope.attributes.get("type") or ""))
        await self._write(frames)

    def _look_at(self, topic: str, kind: str) -> list[bytes]:
        """Return what asks who subscribes to a topic, at its first message."""
        if not self._graph.publishes(topic, kind):
            return []

        def told(said: Mapping[str, Any]) -> None:
            nodes = said.get("subscribers")
            if isinstance(nodes, list):
                self._graph.subscribers(topic, nodes)

        return self._client.ask("/rosapi/subscribers", told, {"topic": topic})

    async def settle(self) -> str:
        """Stay until what was published has arrived; return what did not."""
        topics = list(self._fresh)
        self._fresh.clear()
        heard = await asyncio.gather(*map(self._is_heard, topics))
        lost = [topic for topic, is_heard in zip(topics, heard, strict=True) if not is_heard]
        return f"nothing subscribes to {', '.join(lost)}" if lost else ""

    async def _is_heard(self, topic: str) -> bool:
        """Stay until a topic's publisher is connected; return False where nothing subscribes."""
        clock = asyncio.get_running_loop().time
        subscribers = await self._subscribers(topic)
        ends_s = clock() + _CONNECTS_S
        while subscribers is not None and not subscribers:
            if clock() >= ends_s:
                return False
            await asyncio.sleep(_LOOK_S)
            subscribers = await self._subscribers(topic)
        await asyncio.sleep(_CONNECTS_S)
        return True

    async def _subscribers(self, topic: str) -> list[object] | None:
        """Return the nodes that subscribe to a topic; None where rosapi does not say."""
        said: asyncio.Future[Mapping[str, Any]] = asyncio.get_running_loop().create_future()

        def told(values: Mapping[str, Any]) -> None:
            if not said.done():
                said.set_result(values)

        await self._write(
            self._client.ask(
                "/rosapi/subscribers", told, {"topic": topic}, lambda problem: told(NOTHING)
            )
        )
        try:
            async with asyncio.timeout(_ANSWER_S):
                found = (await said).get("subscribers")
        except TimeoutError:
            return None
        return found if isinstance(found, list) else None

    async def end(self) -> None:
        """Stop reading, and give up whoever waits."""
        self.inbox.end("the line is closed")
        if self._reader is not None:
            self._reader.cancel()
            await asyncio.gather(self._reader, return_exceptions=True)

    async def _write(self, frames: list[bytes]) -> None:
        for frame in frames:
            await self._wire.send(frame)

    async def _read(self) -> None:
        """Take every frame as it comes, until the connection ends."""
        clock = asyncio.get_running_loop().time
        began_s = clock()
        try:
            while True:
                self._take(await self._wire.receive())
                # Frames that are there already are not waited for, and some take long to read.
                if self.inbox.is_filling or clock() - began_s > _TURN_S:
                    await asyncio.sleep(0)
                    began_s = clock()
        except TransportError as ended:
            self.inbox.end(str(ended))

    def _take(self, frame: bytes) -> None:
        try:
            operation = self._frames.read(frame)
            if operation is not None:
                self._client.arrived(operation, len(frame))
        except BadFrame as problem:
            self._bad += 1
            if self._bad & (self._bad - 1) == 0:  # the 1st, 2nd, 4th, 8th …
                log.warning("rosbridge: %s (%d such frames)", problem, self._bad)

    def _learn(self, subscriptions: tuple[Listening, ...], said: Mapping[str, Any]) -> None:
        """Take the topics that rosapi names, with their types."""
        names, types = said.get("topics"), said.get("types")
        if isinstance(names, list):
            kinds = types if isinstance(types, list) and len(types) == len(names) else []
            found = dict(zip(names, kinds or [""] * len(names), strict=True))
            self._graph.learn({str(name): str(kind) for name, kind in found.items()})
            self._graph.subscribed({one.topic: one.type for one in subscriptions})
            if self._is_auto:
                self._client.spell(version_of(map(str, kinds)))
        self._learnt.set()

    def _unknown(self, problem: object) -> None:
        self._learnt.set()
