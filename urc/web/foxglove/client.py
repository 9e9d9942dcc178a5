"""One client of the Foxglove server, with its subscriptions and service calls.

Layer 5. One task reads, another writes, and each robot with subscriptions has a task that keeps the
robot connected. The writer sends messages while the kernel accepts them. While the writer waits,
new readings replace the oldest unsent readings. A client that reads nothing for `STALL_S` seconds
is disconnected.
"""

import asyncio
import logging
from collections.abc import Coroutine
from contextlib import ExitStack
from typing import Final

from starlette.types import Message
from starlette.websockets import WebSocketDisconnect

from urc import __version__
from urc.runtime.clock import Clock
from urc.web.api.sessions import opened
from urc.web.feed.client_socket import ClientSocket, FlowControl, TokenBucket
from urc.web.foxglove.calls import CallFailed, FoxgloveCalls
from urc.web.foxglove.offers import Offer, Offers
from urc.web.foxglove.outbox import Outbox
from urc.web.foxglove.services import STOP, RobotServiceType
from urc.web.serve.replies import ApiError
from urc.web.wire.messages import CLOSE_BAD_MESSAGES, CLOSE_NOT_LET_IN, CLOSE_TOO_FAST
from urc.wire import foxglove as wire

__all__ = ["CALLS_AT_ONCE", "MESSAGES_PER_S", "MOST_FAULTS", "FoxgloveClient"]

MESSAGES_PER_S: Final = 500
"""Maximum number of messages per second from a client; a higher rate closes the socket. A viewer
sends a separate message for each topic that it subscribes to."""
MOST_FAULTS: Final = 32
"""Number of invalid messages after which the socket is closed."""
CALLS_AT_ONCE: Final = 16
"""Maximum number of a client's running calls."""
MOST_ENDED: Final = 4096
"""Maximum number of stored subscriptions that ended together with their channels."""
STALL_S: Final = 15.0
RETRY_S: Final = 1.0
"""Interval between attempts to open a session and between checks for changed robots, in seconds."""
GOODBYE_S: Final = 2.0
_BURST: Final = 64
"""Maximum number of messages that are sent before other tasks run."""
_SIGNED_OUT: Final = "your sign-in has ended, or you no longer have the right to watch a robot"

log = logging.getLogger(__name__)


class FoxgloveClient:
    """The server side of one Foxglove client's socket."""

    def __init__(
        self,
        line: ClientSocket,
        flow: FlowControl,
        offers: Offers,
        calls: FoxgloveCalls,
        clock: Clock,
        *,
        session: str,
    ) -> None:
        """Prepare the connection.

        Args:
            line: the accepted socket.
            flow: flow control of the socket.
            offers: the robots, channels and services that are offered to the visitor.
            calls: object that runs the visitor's calls.
            clock: the clock.
            session: identifier that changes each time the server starts.
        """
        self._line = line
        self._flow = flow
        self._offers = offers
        self._calls = calls
        self._clock = clock
        self._news = asyncio.Event()
        self._outbox = Outbox(self._news.set, clock.now)
        self._outbox.announce([wire.encode_server_info("URC", __version__, session)])
        self._subscriptions: dict[int, tuple[Offer, int]] = {}
        """Robot and channel, keyed by the client's subscription id."""
        self._ended: dict[int, None] = {}
        """Subscriptions that ended with their channels; the client may still unsubscribe."""
        self._running: set[asyncio.Task[None]] = set()
        self._allowance = TokenBucket(MESSAGES_PER_S, clock.now())
        self._group: asyncio.TaskGroup | None = None
        self._closing: tuple[int, str] | None = None
        self.faults = 0
        """Number of invalid messages from the client."""

    async def serve(self) -> None:
        """Serve the client until either side closes."""
        try:
            async with asyncio.TaskGroup() as group:
                self._group = group
                self.recheck()
                writing = group.create_task(self._write())
                reading = group.create_task(self._read())
                watching = group.create_task(self._watch())
                await asyncio.wait((writing, reading), return_when=asyncio.FIRST_COMPLETED)
                if self._closing and not writing.done():
                    await asyncio.wait((writing,), timeout=GOODBYE_S)
                following = [one.task for one in self._offers.robots.values() if one.task]
                for task in (writing, reading, watching, *following, *self._running):
                    task.cancel()
        except* WebSocketDisconnect:
            pass
        except* TimeoutError:
            log.warning("a Foxglove client read nothing for %g s and was disconnected", STALL_S)
            self._flow.abort()

    def recheck(self) -> None:
        """Apply changes to the visitor's rights or to the served robots."""
        if self._closing:
            return
        if not self._offers.is_let_in:
            self._close(CLOSE_NOT_LET_IN, _SIGNED_OUT)
            return
        changes = self._offers.update(self._outbox.ready)
        for offer in changes.ended:
            self._forget(offer)
        self._outbox.announce(changes.texts)

    async def _watch(self) -> None:
        """Check for added, removed and changed robots until cancelled."""
        while True:
            await self._clock.sleep(RETRY_S)
            if self._offers.is_outdated:
                self.recheck()

    def _forget(self, offer: Offer) -> None:
        """End the subscriptions to the channels of a robot that is no longer offered."""
        if offer.task is not None:
            offer.task.cancel()
        self._outbox.forget(offer.name, offer.feed)
        for subscription, (other, _) in list(self._subscriptions.items()):
            if other is offer:
                del self._subscriptions[subscription]
                self._ended[subscription] = None
        while len(self._ended) > MOST_ENDED:
            self._ended.pop(next(iter(self._ended)))

    # Writing

    async def _write(self) -> None:
        while True:
            async with asyncio.timeout(STALL_S):
                await self._flow.drained()
            self._news.clear()
            if self._send():
                await asyncio.sleep(0)  # the other tasks run between two bursts
            elif self._closing:
                await self._line.close(*self._closing)
                return
            else:
                await self._news.wait()

    def _send(self) -> bool:
        """Send messages while the kernel accepts them; return whether messages may be left."""
        frames = self._outbox.frames(has_messages=not self._closing)
        for _ in range(_BURST):
            if not self._flow.is_free():
                return True
            frame = next(frames, None)
            if frame is None:
                return False
            self._flow.write(frame)
        return True

    # Reading

    async def _read(self) -> None:
        while not self._closing:
            message = await self._line.receive()
            if message["type"] == "websocket.disconnect":
                return
            self._handle(message)

    def _handle(self, message: Message) -> None:
        text = message.get("text")
        said: wire.ClientFrame | None = None
        fault = ""
        try:
            said = wire.decode(text if text is not None else message.get("bytes") or b"")
        except wire.BadClientMessage as error:
            fault = str(error)
        is_within = self._allowance.allow(self._clock.now())
        if isinstance(said, wire.ServiceCall) and self._is_stop(said):
            self._stop(said)  # no limit refuses STOP
        if not is_within:
            self._close(CLOSE_TOO_FAST, f"more than {MESSAGES_PER_S} messages a second")
        elif said is None:
            self._count(fault)
        elif isinstance(said, wire.Subscribe):
            self._subscribe(said)
        elif isinstance(said, wire.Unsubscribe):
            self._unsubscribe(said)
        elif not self._is_stop(said):
            self._call(said)

    def _subscribe(self, said: wire.Subscribe) -> None:
        faults: list[str] = []
        for one in said.subscriptions:
            fault = self._subscribed(one.id, one.channel)
            if fault:
                faults.append(fault)
        self._count_all(faults)

    def _subscribed(self, subscription: int, channel: int) -> str:
        """Start one subscription; return the error in the request, "" on success."""
        if subscription in self._subscriptions:
            return f"the subscription {subscription} already exists"
        found = self._offers.channels.get(channel)
        if found is None:
            return "" if self._offers.was_offered(channel) else f"there is no channel {channel}"
        offer, topic = found
        if offer.feed.has(topic.source):
            return f"there is already a subscription to {topic.topic}"
        self._subscriptions[subscription] = (offer, channel)
        self._ended.pop(subscription, None)
        signals = offer.service.robot.profile.driver.signals
        signal = signals.get(topic.source.name) if topic.source.kind == "signal" else None
        offer.feed.subscribe(topic.source, subscription, signal)
        if offer.task is None and self._group is not None:
            offer.task = self._group.create_task(self._follow(offer))
        return ""

    def _unsubscribe(self, said: wire.Unsubscribe) -> None:
        faults: list[str] = []
        for subscription in said.ids:
            found = self._subscriptions.pop(subscription, None)
            if found is None:
                if subscription not in self._ended:
                    faults.append(f"there is no subscription {subscription}")
                self._ended.pop(subscription, None)
                continue
            offer, channel = found
            offer.feed.unsubscribe(self._offers.channels[channel][1].source)
            if not offer.feed.is_used and offer.task is not None:
                offer.task.cancel()
                offer.task = None
        self._count_all(faults)

    def _count_all(self, faults: list[str]) -> None:
        if faults:
            more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
            self._count(faults[0] + more)

    def _count(self, fault: str) -> None:
        """Count an invalid message, and report the error to the client."""
        self.faults += 1
        if self.faults >= MOST_FAULTS:
            self._close(CLOSE_BAD_MESSAGES, f"{MOST_FAULTS} messages were invalid")
        else:
            self._outbox.tell("fault", fault, level="error")

    # Robots

    async def _follow(self, offer: Offer) -> None:
        """Keep a robot connected, and collect its messages, until cancelled."""
        while True:
            with ExitStack() as stack:
                try:
                    live = await opened(offer.service, offer.peer, stack)
                except ApiError as failure:
                    self._outbox.warn(offer.name, f"{offer.name}: {failure.line}")
                else:
                    self._outbox.end_warning(offer.name)
                    hub = live.session.hub
                    with offer.feed.attached(hub, self._offers.messages(offer, hub)):
                        await live.ended.wait()
            await self._clock.sleep(RETRY_S)

    # Calls

    def _is_stop(self, said: wire.ServiceCall) -> bool:
        found = self._offers.services.get(said.service)
        return found is not None and found[1].command == STOP

    def _stop(self, said: wire.ServiceCall) -> None:
        """Press STOP immediately; respond when the robot has received the stop, or soon after."""
        offer, _ = self._offers.services[said.service]
        try:
            self._calls.press_stop(offer)
        except ApiError as failure:
            self._fail(said, failure.line)
            return
        self._start(self._delivered(said, offer))

    async def _delivered(self, said: wire.ServiceCall, offer: Offer) -> None:
        data = await self._calls.delivered_stop(offer)
        self._answer(wire.encode_response(said.service, said.call, data), is_text=False)

    def _call(self, said: wire.ServiceCall) -> None:
        found = self._offers.services.get(said.service)
        if found is None:
            self._fail(said, f"there is no service {said.service}")
            if not self._offers.was_offered(said.service):
                self._count(f"there is no service {said.service}")
        elif said.encoding != wire.ENCODING:
            self._fail(said, f"expected the encoding {wire.ENCODING!r}, found {said.encoding!r}")
        elif len(self._running) >= CALLS_AT_ONCE:
            self._fail(said, f"{CALLS_AT_ONCE} calls are still running")
        else:
            self._start(self._run(said, *found))

    async def _run(self, said: wire.ServiceCall, offer: Offer, kind: RobotServiceType) -> None:
        try:
            data = await self._calls.run(offer, kind.command, said.data)
        except CallFailed as failure:
            self._fail(said, str(failure))
        else:
            self._answer(wire.encode_response(said.service, said.call, data), is_text=False)

    def _start(self, work: Coroutine[object, object, None]) -> None:
        if self._group is None:
            raise RuntimeError("the client is not being served")
        task = self._group.create_task(work)
        self._running.add(task)
        task.add_done_callback(self._running.discard)

    def _fail(self, said: wire.ServiceCall, reason: str) -> None:
        self._answer(wire.encode_failure(said.service, said.call, reason), is_text=True)

    def _answer(self, data: bytes, *, is_text: bool) -> None:
        if not self._outbox.answer(data, is_text=is_text):
            self._close(CLOSE_TOO_FAST, "the client does not read its responses")

    def _close(self, code: int, reason: str) -> None:
        """Close the socket as soon as the reason is sent."""
        if self._closing is None:
            self._closing = (code, reason)
            self._outbox.tell("closing", reason, level="error")
