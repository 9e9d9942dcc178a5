"""One session of the Zenoh library over one open connection.

The library runs in its own threads. Received samples wait in the library until the event loop
collects them, soon after the relay has passed on data from the router. The library's threads run no
Python for a sample: they would keep the event loop waiting, because they have a lower priority than
a guard. For rare events, such as tokens and replies, the library calls back, and hands them over in
one bounded queue. Calls that may wait run in a thread.
"""

import asyncio
import json
import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, Final, NamedTuple
from urllib.parse import quote

import zenoh

from urc.key_expressions import is_key_expression, key_fault
from urc.model.payload import Envelope
from urc.transports._bodies import body_bytes
from urc.transports._faults import CLOSED, late, one_line
from urc.transports.base import ByteStream, ConnectFailed, PeerClosed, TransportError
from urc.transports.topic_queue import TopicReceiveQueue
from urc.transports.zenoh_options import KeySubscription, ZenohOptions
from urc.transports.zenoh_relay import GATHER_S, ZenohRelay

__all__ = ["Inbox", "ZenohSession"]

MAX_BYTES: Final = 16 * 1024 * 1024
"""Maximum size of a received value, in bytes."""
MAX_HANDOVER: Final = 4096
"""Maximum number of events between the library's thread and the event loop; above the limit, the
oldest event is dropped."""
MAX_WAITING: Final = 256
"""Maximum number of samples of one subscription that wait in the library; above the limit, the
oldest sample is dropped."""
COLLECT_S: Final = 0.002
"""Time that the library usually needs for received data, in seconds."""
_LINGER_S: Final = 1.0
"""Time for which samples are collected after received data, in seconds: on a busy machine, the
library needs longer. Later, the keep-alive messages of the router start the next collection."""
_TURN: Final = 64
"""Maximum number of samples of one subscription in one turn of the event loop."""
MAX_GETS: Final = 64
"""Maximum number of unanswered requests."""
GET_S: Final = 30.0
"""Time after which the library abandons a request, in seconds."""
PING_S: Final = 5.0
"""Silence of the router before a ping, in seconds. After twice this time, the router is lost."""
_CHECK_S: Final = 1.0
_PASS_S: Final = 5.0
"""Time in which the library must pass a value on to the relay, in seconds."""
_FAREWELL_S: Final = 0.5
MAX_KEY_BYTES: Final = 1024
"""Maximum size of a received key, in bytes; samples and tokens with longer keys are ignored."""
_LARGE_BYTES: Final = 32_768
"""Size of a value that does not fit into one batch of the library, in bytes."""
_ENDED: Final = "the router ended the session"
_DEAF: Final = "the router accepts no data"
_ALIVE: Final = b'{"alive":true}'
_GONE: Final = b'{"alive":false}'
_NOTHING: Final = "@urc/ping"
"""Key of a ping. No token has this key, so the router replies at once and with no data."""


class Inbox(NamedTuple):
    """A subscription whose samples the event loop collects."""

    subscriber: Any
    take: Callable[[Any], None]

    def collect(self) -> bool:
        """Process the waiting samples; return whether more may be waiting."""
        with suppress(zenoh.ZError):  # the connection has ended
            for _ in range(_TURN):
                sample = self.subscriber.try_recv()
                if sample is None:
                    return False
                self.take(sample)
            return True
        return False


class ZenohSession:
    """The session of one connection; it is discarded with the connection."""

    def __init__(self, options: ZenohOptions, stream: ByteStream) -> None:
        """Create the session over `stream`, which the session owns from now on."""
        self.queue = TopicReceiveQueue()
        self._options = options
        self._loop = asyncio.get_running_loop()
        self._relay = ZenohRelay(stream, self._relay_ended, self._collect_soon)
        self._inboxes: list[Inbox] = []
        self._collection: asyncio.Handle | None = None
        self._collects_at_s = 0.0
        self._collects_until_s = 0.0
        self._session: Any = None
        self._declared: list[object] = []
        """The library's subscriptions and tokens, which end when nothing refers to them."""
        self._tokens: set[str] = set()
        """Subscribed tokens that have been seen."""
        self._turn = asyncio.Lock()
        self._gets: set[_Get] = set()
        self._is_over = threading.Event()
        self._came: deque[Callable[[], None]] = deque(maxlen=MAX_HANDOVER)
        self._is_woken = False
        self._ping: asyncio.Future[None] | None = None
        self._check: asyncio.TimerHandle | None = None

    async def start(self, timeout_s: float) -> None:
        """Open the session, subscribe and declare the token; raise `ConnectFailed` on failure."""
        until_s = self._loop.time() + 0.9 * timeout_s
        try:
            endpoint = self._relay.listen()
            config = _config(self._options, endpoint, timeout_s)
            opening = self._loop.run_in_executor(None, self._open, config)
            self._session = await opening
            if self.queue.ended is not None:
                raise ConnectFailed(self.queue.ended)
            for one in self._options.subscriptions:
                self._subscribe(one)
            if self._options.liveliness:
                token = self._session.liveliness().declare_token(self._options.liveliness)
                self._declared.append(token)
            self._raise_if_ended()
        except zenoh.ZError as fault:
            is_late = self._loop.time() >= until_s
            raise ConnectFailed(self._explain(timeout_s if is_late else None)) from fault
        except TransportError as fault:
            raise ConnectFailed(str(fault)) from fault
        self._relay.is_gathering = True
        self._check = self._loop.call_later(_CHECK_S, self._look)

    async def publish(self, envelope: Envelope) -> None:
        """Put one value; return when the kernel has accepted it, or raise `TransportError`."""
        key = _key_of(envelope, "publish to")
        await self.put(key, body_bytes(envelope.body), _encoding_of(envelope.body))

    async def put(
        self, key: str, body: bytes, encoding: Any = None, attachment: bytes | None = None
    ) -> None:
        """Put `body`; return when the kernel has accepted it, or raise `TransportError`."""
        put = partial(
            self.library.put,
            key,
            body,
            encoding=encoding,
            attachment=attachment,
            congestion_control=zenoh.CongestionControl.DROP,
            express=True,
            allowed_destination=zenoh.Locality.REMOTE,
        )
        await self._leave(put, len(key.encode()) + len(body) + len(attachment or b""))

    async def get(self, envelope: Envelope) -> None:
        """Ask for the value of one key; the reply arrives as a response."""
        key = _key_of(envelope, "get")
        if len(self._gets) >= MAX_GETS:
            raise TransportError(f"request dropped: {MAX_GETS} earlier requests have no reply")
        body = None if envelope.body is None else body_bytes(envelope.body)
        asked = _Get(self, envelope.attributes.get("id"), key)
        get = partial(
            self._session.get,
            _selector(key, envelope.attributes.get("parameters")),
            zenoh.handlers.Callback(asked.replied, asked.ended, indirect=False),
            consolidation=zenoh.ConsolidationMode.NONE,
            timeout=GET_S,
            payload=body,
            encoding=None if body is None else _encoding_of(envelope.body),
        )
        self._gets.add(asked)
        await self._leave(get, len(key.encode()) + len(body or b""))

    async def ping(self) -> None:
        """Return when the router has replied; raise `PeerClosed` if the connection has ended."""
        self._raise_if_ended()
        if self._ping is None:
            self._ping = self._loop.create_future()
            self._send_ping()
        await asyncio.shield(self._ping)
        self._raise_if_ended()

    @property
    def library(self) -> Any:
        """The library's session; raise `PeerClosed` if the connection has ended."""
        self._raise_if_ended()
        return self._session

    def keep(self, declared: object) -> None:
        """Keep a subscription or token of the library until the connection ends."""
        self._declared.append(declared)

    def receive(self, declare: Callable[[Any], Any], take: Callable[[Any], None]) -> Inbox:
        """Subscribe, and pass each sample to `take` on the event loop.

        Args:
            declare: function that declares the subscriber with a handler of the library.
            take: function that processes a sample.
        """
        inbox = Inbox(declare(zenoh.handlers.RingChannel(MAX_WAITING)), take)
        self._inboxes.append(inbox)
        return inbox

    def stop_receiving(self, inbox: Inbox) -> None:
        """Process the samples that have arrived, and undeclare the subscriber."""
        inbox.collect()
        if inbox in self._inboxes:
            self._inboxes.remove(inbox)
        inbox.subscriber.undeclare()

    def hand_over(self, work: Callable[[], None]) -> None:
        """Run `work` on the event loop; called from the library's threads."""
        self._came.append(work)
        if not self._is_woken:
            self._is_woken = True
            self._from_thread(self._arrived)

    def unsent(self) -> int:
        """Return the number of bytes that the router has not acknowledged."""
        return self._relay.unsent()

    async def close(self) -> None:
        """Undeclare everything and close the connection; the method never raises."""
        self._end(CLOSED)
        session, self._session = self._session, None
        if session is not None and not self._relay.unsent():
            closing = self._loop.run_in_executor(None, session.close)
            with suppress(TimeoutError, zenoh.ZError):
                async with asyncio.timeout(_FAREWELL_S):
                    await asyncio.shield(closing)
        await self._finish(session, self._relay.close)

    async def abort(self) -> None:
        """Close the connection immediately and discard unsent data. Never raises."""
        self._end(CLOSED)
        session, self._session = self._session, None
        await self._finish(session, self._relay.abort)

    async def _finish(self, session: Any, cut: Callable[[], Any]) -> None:
        await cut()  # a call of the library that still waits ends now
        self._declared.clear()
        self._inboxes.clear()
        if session is not None:
            with suppress(zenoh.ZError):
                await self._loop.run_in_executor(None, session.close)

    # -- sending

    async def _leave(self, work: Callable[[], object], least_bytes: int) -> None:
        """Make the library send one message of at least `least_bytes`; wait until it has left.

        The library's own queue is empty before and after the message, so no message waits there.
        """
        async with self._turn:
            self._raise_if_ended()
            await self._passed(self._relay.read)
            target = self._relay.read + least_bytes
            try:
                if least_bytes > _LARGE_BYTES:
                    await self._loop.run_in_executor(None, work)
                else:
                    work()
            except zenoh.ZError as fault:
                raise TransportError(f"zenoh cannot send ({_words(fault)})") from fault
            await self._passed(target)

    async def _passed(self, count: int) -> None:
        """Wait until the kernel has accepted the library's first `count` bytes.

        If the kernel accepts nothing for `_PASS_S`, the connection is reset, because the library or
        the kernel would deliver the message later.

        Raises:
            PeerClosed: the connection has ended, or has been reset.
        """
        try:
            await self._relay.passed(count, _PASS_S)
        except TimeoutError:
            self._end(_DEAF)
            await self._relay.abort()
        self._raise_if_ended()

    def _send_ping(self) -> None:
        """Ask the router for tokens that do not exist; it replies with the end of the list."""
        if self._session is None:
            return
        done = partial(self._from_thread, self._ponged)
        handler = zenoh.handlers.Callback(_ignore, done, indirect=False)
        with suppress(zenoh.ZError):  # the relay reports the end of the connection
            self._session.liveliness().get(_NOTHING, handler, timeout=GET_S)

    def _ponged(self) -> None:
        ping, self._ping = self._ping, None
        if ping is not None and not ping.done():
            ping.set_result(None)

    def _look(self) -> None:
        """Ping a silent router; report a router that does not reply."""
        silent_s = self._loop.time() - self._relay.heard_s
        if silent_s > 2 * PING_S:
            self._end(f"the router has not replied for {silent_s:.0f} s")
            return
        self._check = self._loop.call_later(_CHECK_S, self._look)
        if silent_s > PING_S and self._ping is None:
            self._ping = self._loop.create_future()
            self._send_ping()

    # -- the library's threads

    def _open(self, config: Any) -> Any:
        """Open a session in a thread; close the session if the attempt has been abandoned."""
        session: Any = zenoh.open(config)
        if self._is_over.is_set():
            session.close()
        return session

    def _subscribe(self, one: KeySubscription) -> None:
        if not one.is_liveliness:
            declare = partial(
                self._session.declare_subscriber, one.topic, allowed_origin=zenoh.Locality.REMOTE
            )
            self.receive(declare, self._sample)
            return
        handler = zenoh.handlers.Callback(partial(self._token, one.topic), indirect=False)
        liveliness = self._session.liveliness()
        self._declared.append(liveliness.declare_subscriber(one.topic, handler, history=True))
        if not is_key_expression(one.topic):  # an absent token causes no sample
            absent = partial(self._absent, one.topic)
            handler = zenoh.handlers.Callback(_ignore, absent, indirect=False)
            liveliness.get(one.topic, handler, timeout=GET_S)

    def _absent(self, key: str) -> None:
        """Report a missing token after the list of tokens, unless its subscriber has seen it."""
        if key not in self._tokens:
            self._hand_over(key, _GONE)

    def _token(self, topic: str, sample: Any) -> None:
        key = str(sample.key_expr)
        if len(key.encode()) > MAX_KEY_BYTES:
            return
        if topic == key:
            self._tokens.add(key)
        self._hand_over(key, _ALIVE if sample.kind == zenoh.SampleKind.PUT else _GONE)

    def _hand_over(self, key: str, body: bytes) -> None:
        self.hand_over(partial(self._message, {"topic": key, "liveliness": True}, body))

    # -- the event loop

    def _sample(self, sample: Any) -> None:
        key = str(sample.key_expr)
        is_put = sample.kind == zenoh.SampleKind.PUT  # a deletion has no value
        if is_put and len(key.encode()) <= MAX_KEY_BYTES:
            self._message({"topic": key}, sample.payload.to_bytes())

    def _message(self, attributes: dict[str, object], body: bytes) -> None:
        self.queue.note_arrival()
        key = str(attributes["topic"])
        self.queue.message(key, Envelope("message", attributes, body), len(key) + len(body))

    def _collect_soon(self) -> None:
        """Collect samples after the time that the library needs for received data."""
        now_s = self._loop.time()
        self._collects_until_s = now_s + _LINGER_S
        if self._collection is None or self._collects_at_s > now_s + COLLECT_S:
            self._collect_in(COLLECT_S)

    def _collect_in(self, wait_s: float) -> None:
        if self._collection is not None:
            self._collection.cancel()
        self._collects_at_s = self._loop.time() + wait_s
        self._collection = self._loop.call_later(wait_s, self._collect)

    def _collect(self) -> None:
        self._collection = None
        if self._session is None:
            return
        is_more = False
        for inbox in tuple(self._inboxes):
            is_more |= inbox.collect()
        if is_more:
            self._collect_in(0)
        elif self._loop.time() < self._collects_until_s:
            self._collect_in(GATHER_S)

    def _arrived(self) -> None:
        self._is_woken = False
        while self._came:
            self._came.popleft()()

    def _from_thread(self, work: Callable[[], object]) -> None:
        with suppress(RuntimeError):  # the event loop has ended
            self._loop.call_soon_threadsafe(work)

    # -- the end

    def _relay_ended(self, reason: str, by_library: bool) -> None:
        silent_s = self._loop.time() - self._relay.heard_s
        if by_library and silent_s < PING_S:
            reason = _ENDED
        elif by_library:
            reason = f"the router has not replied for {silent_s:.0f} s"
        self._end(reason)

    def _end(self, reason: str) -> None:
        """Wake all waiting tasks, and tell them why the connection ended."""
        self._is_over.set()
        self.queue.end(reason)
        if self._check is not None:
            self._check.cancel()
        if self._collection is not None:
            self._collection.cancel()
        self._ponged()
        self._gets.clear()

    def _raise_if_ended(self) -> None:
        if self.queue.ended is not None or self._session is None:
            raise PeerClosed(self.queue.ended or CLOSED)

    def _explain(self, late_s: float | None) -> str:
        """Return why the library could not open the session; `late_s` is a time that has passed."""
        where, reason = self._options.where, self.queue.ended or _ENDED
        if late_s is not None and self.queue.ended is None:
            return late(where, late_s)
        if self._options.username or self._options.tls is not None:
            return f"{where} refuses the connection ({reason})"
        return f"{where} is not a Zenoh router, or refuses the connection ({reason})"


class _Get:
    """One request, whose first value is the response; called from the library's threads."""

    def __init__(self, session: ZenohSession, number: object, key: str) -> None:
        self._session = session
        self._number = number
        self._key = key
        self._reason = f"nothing answers {one_line(key)!r}"
        self._is_answered = False

    def replied(self, reply: Any) -> None:
        sample = reply.ok
        if sample is None:
            said = reply.err.payload.to_bytes()[:800].decode("utf-8", "replace")
            self._reason = one_line(said) or "refused"
        elif not self._is_answered:
            self._is_answered = True
            self._tell("", str(sample.key_expr), sample.payload.to_bytes())

    def ended(self) -> None:
        if not self._is_answered:
            self._tell(self._reason, self._key, None)

    def _tell(self, reason: str, key: str, body: bytes | None) -> None:
        self._session._from_thread(partial(self._answer, reason, key, body))  # noqa: SLF001

    def _answer(self, reason: str, key: str, body: bytes | None) -> None:
        session = self._session
        if self not in session._gets:  # noqa: SLF001
            return
        session._gets.discard(self)  # noqa: SLF001
        attributes: dict[str, object] = {"id": self._number, "ok": not reason, "topic": key}
        if reason:  # perhaps the library's own, after a timeout
            attributes["reason"] = reason
        else:
            session.queue.note_arrival()
        session.queue.answer(Envelope("response", attributes, body), len(body or b""))


def _config(options: ZenohOptions, endpoint: str, timeout_s: float) -> Any:
    """Return the library's configuration: one attempt, no scouting and no open port."""
    wait_ms = max(1, int(timeout_s * 1000))
    wait_us = int(_PASS_S * 1_000_000)
    settings: dict[str, Any] = {
        "mode": "client",
        "connect": {"endpoints": [endpoint], "timeout_ms": 0, "exit_on_failure": True},
        "listen": {"endpoints": []},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {
            "shared_memory": {"enabled": False},
            "unicast": {"open_timeout": wait_ms},
            "link": {
                "rx": {"max_message_size": MAX_BYTES},
                "tx": {
                    "queue": {
                        "congestion_control": {
                            "drop": {
                                "wait_before_drop": wait_us,
                                "max_wait_before_drop_fragments": wait_us,
                            }
                        }
                    }
                },
            },
        },
    }
    if options.username:
        login = {"user": options.username, "password": options.password}
        settings["transport"]["auth"] = {"usrpwd": login}
    return zenoh.Config.from_json5(json.dumps(settings))


def _key_of(envelope: Envelope, verb: str) -> str:
    key = envelope.attributes.get("topic")
    fault = key_fault(key) if isinstance(key, str) else "it must be text"
    if fault:
        raise TransportError(f"zenoh cannot {verb} {one_line(str(key))!r}: {fault}")
    return str(key)


def _selector(key: str, parameters: object) -> str:
    if not isinstance(parameters, Mapping) or not parameters:
        return key
    pairs = [
        f"{quote(str(name), '')}={quote(str(value), '')}" for name, value in parameters.items()
    ]
    return f"{key}?{';'.join(pairs)}"


def _encoding_of(body: object) -> Any:
    return (
        zenoh.Encoding.ZENOH_BYTES if isinstance(body, bytes) else zenoh.Encoding.APPLICATION_JSON
    )


def _words(fault: Exception) -> str:
    """Return the library's reason without source positions."""
    return one_line(str(fault).partition(" at /")[0])


def _ignore(_: object) -> None:
    pass
