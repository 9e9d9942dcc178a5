"""A transport for robots behind an MQTT broker, with MQTT version 5 or 3.1.1.

Theory of operation. The library paho implements the protocol, but URC opens the network connection.
Each `open` connects a socket and creates a paho client for this connection only. A message from an
earlier connection can therefore never be sent late. A reused paho client would store unacknowledged
messages and send them again. The transport starts no threads.

Every connection starts a clean MQTT session. The broker publishes the will whenever the connection
ends, even if URC closes the connection. A will that repeats a stop is harmless.
"""

import asyncio
import logging
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from paho.mqtt.client import MQTT_CLEAN_START_FIRST_ONLY, Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from paho.mqtt.reasoncodes import ReasonCode

from urc.model.payload import Envelope, Payload
from urc.transports._bodies import body_bytes
from urc.transports._faults import CLOSED, HUNG_UP, broke, late, reason
from urc.transports.base import ConnectFailed, PeerClosed, TransportError
from urc.transports.mqtt_options import MqttOptions
from urc.transports.topic_queue import TopicReceiveQueue
from urc.transports.web_dial import Dialer

__all__ = ["MqttTransport"]

KEEPALIVE_S = 5
"""Keepalive interval, in seconds. If no data arrives for twice this time, the connection is
considered lost."""
MAX_BYTES = 16 * 1024 * 1024
"""Maximum size of a received message, in bytes."""
MAX_UNACKNOWLEDGED = 256
"""Maximum number of published messages that the broker has not acknowledged."""
MAX_HALF = 64
"""Maximum number of incomplete deliveries with quality of service 2."""
MAX_UNTAKEN = 4096
"""Maximum number of unsent packets, including acknowledgements."""
_CHECK_S = 1.0
_READ_BYTES = 65536
_PACKETS_A_TURN = 64
"""Maximum number of packets handled in one turn of the event loop."""
_WITH_WILL = "Disconnect with will message"

log = logging.getLogger(__name__)


class MqttTransport:
    """A reusable transport to one broker."""

    def __init__(self, options: MqttOptions, dialer: Dialer) -> None:
        """Store the options and the dialer for a broker, without connecting."""
        self._options = options
        self._dialer = dialer
        self._session: _MqttSession | None = None

    @property
    def address(self) -> str:
        """The transport's target in readable form, such as ``mqtt 192.168.1.5:1883``."""
        return f"mqtt {self._options.where}"

    async def open(self, timeout_s: float) -> None:
        """Connect, log in and subscribe within `timeout_s` seconds, or raise `ConnectFailed`."""
        await self.close()
        where = self._options.where
        try:
            async with asyncio.timeout(timeout_s):
                self._session = await self._begin(timeout_s)
        except TimeoutError as fault:
            raise ConnectFailed(late(where, timeout_s)) from fault
        except OSError as fault:
            raise ConnectFailed(broke(fault)) from fault
        finally:
            if self._session is None:
                await self._dialer.close()

    async def receive(self) -> Envelope:
        """Return the next message; raise `PeerClosed` when the connection has ended."""
        if self._session is None:
            raise PeerClosed(CLOSED)
        return await self._session.queue.pop()

    async def send(self, data: Payload) -> None:
        """Publish a message; return after the kernel has accepted the message.

        Raises:
            PeerClosed: the connection broke.
            TransportError: MQTT cannot send `data`.
        """
        if self._session is None:
            raise PeerClosed(CLOSED)
        if not isinstance(data, Envelope):
            raise TransportError("mqtt carries messages, not bytes; use publish")
        if data.verb != "publish":
            raise TransportError(f"mqtt cannot {data.verb}; supported: publish")
        await self._session.publish(data)

    async def close(self) -> None:
        """Close the connection immediately, discarding unsent data.

        The method never raises and may be called twice.
        """
        session, self._session = self._session, None
        if session is not None:
            session.end()
        await self._dialer.close()

    def unsent(self) -> int:
        """Return the number of unacknowledged bytes."""
        return 0 if self._session is None else self._dialer.unsent(self._session.line)

    async def abort(self) -> None:
        """Close the connection immediately and discard unsent data. Never raises."""
        session, self._session = self._session, None
        if session is not None:
            await self._dialer.reset(session.line)
            session.end(has_farewell=False)
        await self.close()

    async def _begin(self, timeout_s: float) -> "_MqttSession":
        line = await self._dialer.plug(timeout_s)
        try:
            session = _MqttSession(self._options, line)
        except BaseException:
            line.close()
            raise
        try:
            await session.start()
        except BaseException:
            session.end()
            raise
        return session


class _MqttSession:
    """One open connection to the broker, with its paho client."""

    def __init__(self, options: MqttOptions, line: socket.socket) -> None:
        self.queue = TopicReceiveQueue()
        self._options = options
        self.line = line
        self._loop = asyncio.get_running_loop()
        self._answered: asyncio.Future[str] = self._loop.create_future()
        """Result of the login: "" for success, otherwise the reason for the refusal."""
        self._granted: dict[int | None, asyncio.Future[list[ReasonCode]]] = {}
        self._seen = 0
        self._writable: asyncio.Future[None] | None = None
        """Future that completes when the kernel accepts more data; None if no task is waiting."""
        self._check: asyncio.TimerHandle | None = None
        self._client = self._make()

    def _make(self) -> "_PahoClient":
        options = self._options
        client = _PahoClient(options, self.line)
        client.max_inflight_messages_set(MAX_UNACKNOWLEDGED)
        client.max_queued_messages_set(MAX_UNACKNOWLEDGED)
        if options.username:
            client.username_pw_set(options.username, options.password)
        if options.will is not None:
            will = options.will
            client.will_set(will.topic, will.payload, will.qos, will.retain)
        client.on_connect = self._on_connect
        client.on_disconnect = self._on_disconnect
        client.on_subscribe = self._on_subscribe
        client.on_message = self._on_message
        client.on_socket_close = lambda _client, _data, line: self._forget(line)
        return client

    async def start(self) -> None:
        """Log in and subscribe; raise `ConnectFailed` with the broker's reason."""
        options = self._options
        self._client.start()
        self._loop.add_reader(self.line, self._readable)
        self._check = self._loop.call_later(_CHECK_S, self._tick)
        refused = await self._answered
        if refused:
            raise ConnectFailed(f"{options.where} refuses the connection ({refused})")
        if not options.subscriptions:
            return
        _, number = self._client.subscribe([(one.topic, one.qos) for one in options.subscriptions])
        granted: asyncio.Future[list[ReasonCode]] = self._loop.create_future()
        self._granted[number] = granted
        for one, code in zip(options.subscriptions, await granted, strict=False):
            if code.is_failure:
                raise ConnectFailed(
                    f"{options.where} refuses the topic {one.topic!r} ({_low(code)})"
                )

    async def publish(self, envelope: Envelope) -> None:
        """Pass one message to the kernel, or raise `TransportError`."""
        self._raise_if_ended()
        attributes = envelope.attributes
        topic, qos = attributes.get("topic"), attributes.get("qos") or 0
        if not isinstance(topic, str) or not topic or qos not in (0, 1, 2):
            raise TransportError(f"mqtt cannot publish to {topic!r} with qos {qos!r}")
        try:
            done = self._client.publish(
                topic, body_bytes(envelope.body), int(qos), attributes.get("retain") is True
            )
        except (ValueError, UnicodeEncodeError) as problem:
            raise TransportError(f"mqtt cannot publish to {topic!r} ({problem})") from problem
        if done.rc == MQTTErrorCode.MQTT_ERR_QUEUE_SIZE:
            text = f"message dropped: {MAX_UNACKNOWLEDGED} earlier messages are unacknowledged"
            raise TransportError(text)
        while self._client.want_write() and self.queue.ended is None:
            await self._until_writable()
            if self.queue.ended is None:
                self._client.loop_write()
        self._raise_if_ended()

    def end(self, *, has_farewell: bool = True) -> None:
        """Close immediately. The broker publishes the will, if one is declared.

        Args:
            has_farewell: whether to send DISCONNECT, which also flushes earlier data.
        """
        is_open = self.queue.ended is None
        self.queue.end(CLOSED)
        if self._check is not None:
            self._check.cancel()
        client = self._client
        client.on_disconnect = None
        if has_farewell and is_open and client.is_connected():
            with suppress(OSError, ValueError):
                if self._options.will is None:
                    client.disconnect()
                elif self._options.is_v5:
                    client.disconnect(ReasonCode(PacketTypes.DISCONNECT, _WITH_WILL))
        self._forget(self.line)
        client.drop()

    def _raise_if_ended(self) -> None:
        if self.queue.ended is not None:
            raise PeerClosed(self.queue.ended)

    def _forget(self, line: Any) -> None:
        """Stop waiting for events of a socket that is about to be closed."""
        if line.fileno() >= 0:
            self._loop.remove_reader(line)
            self._loop.remove_writer(line)
        self._release()

    async def _until_writable(self) -> None:
        """Wait until the kernel accepts more data or the connection ends."""
        if self._writable is None:
            self._writable = self._loop.create_future()
            self._loop.add_writer(self.line, self._drained)
        await asyncio.shield(self._writable)

    # -- called by the event loop

    def _drained(self) -> None:
        self._loop.remove_writer(self.line)
        self._release()

    def _release(self) -> None:
        writable, self._writable = self._writable, None
        if writable is not None and not writable.done():
            writable.set_result(None)

    def _readable(self) -> None:
        """Make paho read received packets; each call of `loop_read` reads at most one packet."""
        try:
            for _ in range(_PACKETS_A_TURN):
                before = self._seen
                self._client.loop_read()
                if excess := self._client.excess():
                    self._lose(excess)
                    return
                if self._seen == before:
                    return
        except Exception as fault:  # paho hardly validates its input
            self._lose(f"the broker sent an invalid packet ({reason(fault)})")

    def _tick(self) -> None:
        """Send keepalives; close the connection if the broker does not reply."""
        self._check = self._loop.call_later(_CHECK_S, self._tick)
        self._client.loop_misc()

    # -- called by paho

    def _on_connect(
        self, client: Client, data: object, flags: object, code: ReasonCode, properties: object
    ) -> None:
        self._seen += 1
        if not self._answered.done():
            self._answered.set_result(_low(code) if code.is_failure else "")

    def _on_subscribe(
        self, client: Client, data: object, number: int, codes: list[ReasonCode], properties: object
    ) -> None:
        self._seen += 1
        granted = self._granted.pop(number, None)
        if granted is not None and not granted.done():
            granted.set_result(codes)

    def _on_message(self, client: Client, data: object, message: MQTTMessage) -> None:
        self._seen += 1
        topic = message.topic
        attributes = {"topic": topic, "retain": message.retain, "qos": message.qos}
        envelope = Envelope("message", attributes, message.payload)
        self.queue.message(topic, envelope, len(topic) + len(message.payload))

    def _on_disconnect(
        self, client: Client, data: object, flags: Any, code: ReasonCode, properties: object
    ) -> None:
        if flags.is_disconnect_packet_from_server:
            self._lose(f"{HUNG_UP} ({_low(code)})")
        elif code == "Keep alive timeout":
            self._lose(f"the broker has not replied for {2 * KEEPALIVE_S} s")
        else:
            self._lose(self._client.fault or HUNG_UP)

    def _lose(self, reason: str) -> None:
        """Record why the connection ended, and wake all waiting tasks."""
        self.queue.end(reason)
        self._forget(self.line)
        if not self._answered.done():
            self._answered.set_result(reason)
        for granted in self._granted.values():
            if not granted.done():
                granted.set_exception(ConnectFailed(reason))
        self._granted.clear()


class _PahoClient(Client):
    """A paho client that uses an existing socket."""

    def __init__(self, options: MqttOptions, line: socket.socket) -> None:
        version = MQTTProtocolVersion.MQTTv5 if options.is_v5 else MQTTProtocolVersion.MQTTv311
        super().__init__(
            CallbackAPIVersion.VERSION2,
            client_id=options.client_id,
            clean_session=None if options.is_v5 else True,
            protocol=version,
            reconnect_on_failure=False,
        )
        self._options = options
        self._given = line
        self.fault = ""
        """The operating system's reason for the end of the connection, which paho only logs."""

    def start(self) -> None:
        """Send the login request (CONNECT) to the broker."""
        options = self._options
        properties: Properties | None = None
        if options.is_v5:
            properties = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
            properties.MaximumPacketSize = MAX_BYTES
            properties.ReceiveMaximum = MAX_HALF
        self.connect_async(
            options.host,
            options.port,
            KEEPALIVE_S,
            clean_start=True if options.is_v5 else MQTT_CLEAN_START_FIRST_ONLY,
            properties=properties,
        )
        self.reconnect()

    def drop(self) -> None:
        """Close the socket, regardless of paho's state."""
        self._sock_close()
        self._given.close()

    def excess(self) -> str:
        """Return a message about an exceeded limit, which paho itself would ignore, or ""."""
        if self._in_packet["remaining_length"] > MAX_BYTES:
            return f"the broker sent a message of more than {MAX_BYTES} bytes"
        if len(self._out_packet) > MAX_UNTAKEN:
            return f"the broker has not read {MAX_UNTAKEN} acknowledgements"
        half = self._in_messages
        if half and (
            len(half) > MAX_HALF or sum(len(one.payload) for one in half.values()) > MAX_BYTES
        ):
            return "the broker does not complete its message deliveries"
        return ""

    def _create_socket(self) -> Any:
        return self._given

    def _sock_recv(self, bufsize: int) -> bytes:
        """Read only part of a message; paho itself would allocate the whole declared size.

        Raises:
            BlockingIOError: the declared size exceeds the limit (see `excess`); nothing is read.
        """
        if bufsize > MAX_BYTES:
            raise BlockingIOError
        with self._explained():
            return super()._sock_recv(min(bufsize, _READ_BYTES))

    def _sock_send(self, buf: bytes | bytearray) -> int:
        """Send part of `buf`; if sending fails, record the reason."""
        with self._explained():
            return super()._sock_send(buf)

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except BlockingIOError:
            raise
        except OSError as fault:
            self.fault = broke(fault)
            raise


def _low(code: ReasonCode) -> str:
    return str(code).lower()
