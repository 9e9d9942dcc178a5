"""The server side of one page's WebSocket, which checks messages and never waits for other pages.

Layer 5. One task reads, and another task in the same group writes. The writer sends the newest
state as soon as the socket is free, so a slow page skips frames. A page that reads no data for
`STALL_S` seconds is disconnected.
"""

import asyncio
import logging
import math
from collections import deque
from functools import partial
from time import time

from starlette.types import Message
from starlette.websockets import WebSocketDisconnect

from urc.motion.driving_lock import SentImages
from urc.runtime.one_shot_commands import OUT_OF_SCOPE
from urc.web.drive.command_runner import CommandOutcome
from urc.web.drive.control_service import OperatorSession
from urc.web.feed.alarm_feed import AlarmPlace
from urc.web.feed.client_socket import ClientSocket, FlowControl, SocketPeer, TokenBucket
from urc.web.feed.fanout import Place
from urc.web.feed.picture_line import PictureLine
from urc.web.fleet.robots import LiveSession, RobotService, SessionFailed, missing_settings
from urc.web.wire import messages as wire
from urc.web.wire.ask import Approval, ApprovalRequest, SequenceAction, encode_token
from urc.web.wire.drive import Drive, Driving, Release, Stop, Tick
from urc.web.wire.text import close_reason
from urc.wire.client_messages import GoalDismissal, ImageSelection, Reconnect, ScreenName

__all__ = ["TokenBucket", "BrowserClient", "FlowControl", "SocketPeer", "ClientSocket"]

MESSAGES_PER_S = 100
TICKS_PER_S = 2000
"""Maximum number of ticks per second from a page; a higher rate closes the socket. Below this rate,
newer ticks replace excess ticks, and the socket stays open."""
TICK = b'{"t":"tick",'
"""First bytes of a page's tick; ticks that begin differently take longer to decode."""
EARLY_MESSAGES = 100
"""Maximum number of messages that wait while the robot's session opens. Meanwhile, ticks are
dropped, and STOP takes effect immediately."""
BAD_MESSAGES = 10
COMMANDS_AT_ONCE = 16
STALL_S = 15.0
GOODBYE_S = 2.0

SIGNED_OUT = "your sign-in has ended, or you no longer have the right to watch this robot"

log = logging.getLogger(__name__)


class BrowserClient:
    """The server side of a page's connection."""

    def __init__(
        self,
        line: ClientSocket,
        service: RobotService,
        flow: FlowControl,
        peer: SocketPeer = SocketPeer(),  # noqa: B008 - the default is immutable
    ) -> None:
        self._line = line
        self._service = service
        self._flow = flow
        self._peer = peer
        self._operator: OperatorSession | None = None
        self._news = asyncio.Event()
        self._answers: deque[str] = deque()
        self._pong = ""
        self._early: deque[Message] = deque()
        """Messages that arrived before the session was open."""
        self._place = Place()
        self._alarm_place = AlarmPlace()
        self._pictures: PictureLine | None = None
        """The page's socket for images; None if it has none at present."""
        self._is_apart = False
        """Whether images come only over the socket for images."""
        self._live: LiveSession | None = None
        """The robot's open session; None until the page has received the session's signal
        indexes."""
        self._is_listening = False
        self._closing: tuple[int, str] | None = None
        self._commands: set[asyncio.Task[None]] = set()
        self._allowance = TokenBucket(MESSAGES_PER_S, service.clock.now())
        self._ticks = TokenBucket(TICKS_PER_S, service.clock.now())
        self.bad_messages = 0

    async def serve(self) -> None:
        """Serve the page over the accepted socket until either side closes."""
        missing = missing_settings(self._service.robot)
        if missing:
            names = ", ".join(setting.name for setting in missing)
            await self._refuse(wire.CLOSE_NOT_READY, f"missing settings: {names}")
        elif self._service.is_full:
            await self._refuse(wire.CLOSE_FULL, "too many clients are watching this robot")
        elif not self._service.has_room_for(self._peer):
            await self._refuse(wire.CLOSE_FULL, "too many of your screens are watching this robot")
        else:
            with self._service.visit(self._peer.who):
                await self._visit()

    def recheck(self) -> None:
        """Check the visitor's rights again: stop forbidden motion and close a page without rights.

        If the visitor no longer has any right for the robot, the page's motion stops before this
        method returns and the socket closes.
        """
        if self._operator is not None:
            self._service.controls.recheck(self._operator)
        if self._peer.rights.role() is None and not self._closing:
            self._close(wire.CLOSE_NOT_LET_IN, self._peer.rights.limit() or SIGNED_OUT)

    async def _visit(self) -> None:
        controls = self._service.controls
        self._operator = controls.add_page(self._peer, self._news.set)
        try:
            live = await self._opened()
            if live is not None:
                await self._converse(live, self._operator)
        except SessionFailed as error:
            await self._refuse(wire.CLOSE_FAILED, str(error))
        finally:
            controls.remove_page(self._operator)

    async def _opened(self) -> LiveSession | None:
        """Return the open session; None if the page disconnects or floods the server first."""
        opening = asyncio.ensure_future(self._service.live())
        reading = asyncio.ensure_future(self._read_early())
        # A page that leaves while the session is still opening must not count as a client.
        try:
            await asyncio.wait((opening, reading), return_when=asyncio.FIRST_COMPLETED)
            if not reading.done():
                return await opening
        finally:
            opening.cancel()
            reading.cancel()
        if reading.result():
            await self._refuse(wire.CLOSE_TOO_FAST, reading.result())
        return None

    async def _read_early(self) -> str:
        """Read while the session opens; return why to close the page, "" if the page disconnected.

        STOP is handled immediately and cancels waiting requests about the lease, so that an earlier
        reset cannot undo the STOP. Ticks are dropped, because they would be outdated. All messages
        except STOP and ticks wait until the session is open.
        """
        while len(self._early) < EARLY_MESSAGES:
            message = await self._line.receive()
            if message["type"] == "websocket.disconnect":
                return ""
            asked = _decoded(message)
            if isinstance(asked, Stop):
                self._drive(asked)
                kept = (one for one in self._early if not isinstance(_decoded(one), Drive))
                self._early = deque(kept)
            elif not self._ticks.allow(self._service.clock.now()):
                return f"more than {TICKS_PER_S} messages a second"
            elif not isinstance(asked, Tick):
                self._early.append(message)
        return f"more than {EARLY_MESSAGES} messages before hello"

    async def _converse(self, live: LiveSession, operator: OperatorSession) -> None:
        self._place = live.fanout.join(self._flushed)
        self._place.images = operator.images = SentImages(self._service.controls.images.signals)
        self._alarm_place = self._service.alarm_feed.join(self._news.set)
        pages = self._service.picture_pages
        key = pages.add(partial(self._take_line, live))
        try:
            self._service.consent.welcome(operator)
            async with asyncio.TaskGroup() as group:
                writing = group.create_task(self._write(live, key))
                reading = group.create_task(self._read(live, group))
                await asyncio.wait((writing, reading), return_when=asyncio.FIRST_COMPLETED)
                if self._closing and not writing.done():
                    await asyncio.wait((writing,), timeout=GOODBYE_S)
                for task in (writing, reading, *self._commands):
                    task.cancel()
        except* WebSocketDisconnect:
            pass
        except* TimeoutError:
            log.warning("a client read nothing for %g s and was disconnected", STALL_S)
            self._flow.abort()
        finally:
            pages.remove(key)
            self._take_line(live, None)
            live.fanout.leave(self._flushed, self._place)
            self._service.alarm_feed.leave(self._news.set)

    async def _refuse(self, code: int, reason: str) -> None:
        try:
            await self._line.send_text(wire.encode_error("refused", reason))
            await self._line.close(code, close_reason(reason))
        except WebSocketDisconnect:
            pass

    # Writing

    def _take_line(self, live: LiveSession, line: PictureLine | None) -> None:
        """Send the page's images over a socket of their own; None if this socket has ended."""
        before, self._pictures = self._pictures, line
        if before is not None:
            before.end()
        live.fanout.restart(self._place, line.window if line is not None else None)
        if line is not None:
            line.wake = partial(self._pump, live)
            self._pump(live)

    def _pump(self, live: LiveSession) -> None:
        """Send images over the socket for images, as far as the line bears them."""
        if self._pictures is not None and self._place.shown:
            self._pictures.pump(partial(live.fanout.next_message, self._place))

    async def _write(self, live: LiveSession, key: str) -> None:
        robot, now_s = self._service.robot, self._service.clock.now()
        is_playback = robot.playback is not None
        hello = wire.encode_hello(
            robot.profile, live.number, now_s, is_playback=is_playback, pictures=key
        )
        await self._line.send_text(hello)
        self._live = live
        while True:
            async with asyncio.timeout(STALL_S):
                # Values read before the socket is free would be outdated when sent.
                await self._flow.drained()
                self._news.clear()
                self._send_shared(live)
                told = self._service.controls.changes(self._operator) if self._operator else []
                alarms = self._service.alarm_feed.news(self._alarm_place)
                for text in (*told, *alarms, *self._take_answers()):
                    await self._line.send_text(text)
            if live.ended.is_set() and not self._closing:
                self._closing = (wire.CLOSE_FAILED, "the robot's session ended")
            if self._closing:
                code, reason = self._closing
                await self._line.close(code, close_reason(reason))
                return
            await self._news.wait()

    def _flushed(self) -> None:
        """Send a flush of the fan-out if the socket is free; leave all other work to the writer.

        Waking the writer for every flush would take three times as long as sending directly.
        """
        live = self._live
        if live is not None and self._flow.is_free() and not self._closing:
            self._send_shared(live)
            if self._flow.is_free() and not live.ended.is_set():
                return
        self._news.set()

    def _send_shared(self, live: LiveSession) -> None:
        """Send the data that all pages share, then images until the kernel accepts no more data."""
        if frames := live.fanout.frames_for(self._place):
            self._flow.write(frames)
        if self._is_apart or self._pictures is not None:
            self._pump(live)
            return
        while self._place.shown and self._flow.is_free():
            frame = live.fanout.next_picture(self._place)
            if frame is None:
                break
            self._flow.write(frame)

    def _take_answers(self) -> list[str]:
        answers = list(self._answers)
        self._answers.clear()
        # Sent last, so that the page's round-trip time includes the wait in the buffer.
        if self._pong:
            answers.append(self._pong)
            self._pong = ""
        return answers

    # Reading

    async def _read(self, live: LiveSession, group: asyncio.TaskGroup) -> None:
        self._flow.listen(self._offered)
        if self._operator is not None:
            self._operator.hold_back = self._flow.hold_back
        while self._early and not self._closing:
            self._handle(self._early.popleft(), live, group)
        while not self._closing:
            message = await self._listen()
            if message["type"] == "websocket.disconnect":
                return
            self._handle(message, live, group)

    async def _listen(self) -> Message:
        self._is_listening = True
        try:
            return await self._line.receive()
        finally:
            self._is_listening = False

    def _offered(self, data: bytes) -> bool:
        """Handle a tick if no earlier message is pending; return whether the tick was handled."""
        operator = self._operator
        if operator is None or not (self._is_listening and data.startswith(TICK)) or self._closing:
            return False
        how = self._service.controls.offer(operator, data)
        # Ticks within the rate are not counted: they are far fewer than the limit.
        return how == "in time" or (
            how == "one more" and self._ticks.allow(self._service.clock.now())
        )

    def _handle(self, message: Message, live: LiveSession, group: asyncio.TaskGroup) -> None:
        now_s = self._service.clock.now()
        asked: wire.Inbound | None = None
        fault = ""
        try:
            asked = wire.decode(_body(message))
        except wire.BadMessage as error:
            fault = str(error)
        self.recheck()
        if not self._ticks.allow(now_s):
            self._close(wire.CLOSE_TOO_FAST, f"more than {TICKS_PER_S} messages a second")
            if not isinstance(asked, Stop):
                return
        if isinstance(asked, (Tick, Release, Stop)):
            self._drive(asked)  # no limit refuses STOP
        elif not self._allowance.allow(now_s):
            self._close(wire.CLOSE_TOO_FAST, f"more than {MESSAGES_PER_S} messages a second")
        elif asked is None:
            self._count_bad(fault)
        elif isinstance(asked, Drive):
            self._drive(asked)
        elif isinstance(asked, ImageSelection):
            self._news.set()
            self._is_apart = asked.apart
            live.fanout.show(self._place, asked.signals, asked.stills)
        elif isinstance(asked, (Approval, ApprovalRequest, SequenceAction)):
            self._advise(asked, live)
        elif isinstance(asked, GoalDismissal):
            if self._operator is not None:
                self._service.commands.dismiss(self._operator, asked.goal, live.session.hub)
        elif isinstance(asked, ScreenName):
            if self._operator is not None:
                self._service.controls.name_screen(self._operator, asked.name)
        elif isinstance(asked, Reconnect):
            live.session.reconnect()
        elif isinstance(asked, wire.Ping):
            if math.isfinite(asked.c):
                self._pong = wire.encode_pong(asked, now_s, time())
                self._news.set()
        else:
            self._start(asked, live, group)

    def _drive(self, said: Driving) -> None:
        if isinstance(said, Stop) and self._service.robot.playback is not None:
            return  # nothing moves in a recording, and no robot could acknowledge a stop
        if self._operator is not None:
            self._service.controls.handle(self._operator, said)

    def _advise(self, said: Approval | ApprovalRequest | SequenceAction, live: LiveSession) -> None:
        if self._operator is None:
            return
        controls, consent, who = (
            self._service.controls,
            self._service.consent,
            self._operator.client,
        )
        if isinstance(said, ApprovalRequest):
            self._answer(encode_token(said.id, consent.prepare(self._operator, said)))
        elif isinstance(said, Approval):
            consent.handle(self._operator, said)
        elif refused := self._pull_refusal(self._operator, said):
            controls.recorder.refused(who, said.command, refused, self._service.clock.now())
        else:
            live.session.pull(said.command, said.verb)
            controls.recorder.ran(who, said.command, {}, f"told to {said.verb}")

    def _pull_refusal(self, operator: OperatorSession, said: SequenceAction) -> str:
        if not operator.rights.may_give(said.command):
            return OUT_OF_SCOPE
        return self._service.controls.once.pull_refusal(operator.client, said.command, said.verb)

    def _count_bad(self, reason: str) -> None:
        self.bad_messages += 1
        if self.bad_messages >= BAD_MESSAGES:
            self._close(wire.CLOSE_BAD_MESSAGES, f"{BAD_MESSAGES} messages were invalid")
        else:
            self._answer(wire.encode_error("bad-message", reason))

    def _close(self, code: int, reason: str) -> None:
        self._closing = (code, reason)
        self._answer(wire.encode_error("closing", reason))

    def _answer(self, text: str) -> None:
        self._answers.append(text)
        self._news.set()

    def _start(
        self, asked: wire.CommandRequest, live: LiveSession, group: asyncio.TaskGroup
    ) -> None:
        if len(self._commands) + len(self._answers) >= COMMANDS_AT_ONCE:
            # The refusal closes and queues nothing: it is the page's only reply.
            text = f"{COMMANDS_AT_ONCE} commands are still running"
            if len(self._answers) < 2 * COMMANDS_AT_ONCE and self._operator is not None:
                self._reply(
                    asked, self._service.commands.refuse(self._operator, asked, "busy", text)
                )
            else:
                self._close(wire.CLOSE_TOO_FAST, text)
            return
        task = group.create_task(self._run(asked, live))
        self._commands.add(task)
        task.add_done_callback(self._commands.discard)

    async def _run(self, asked: wire.CommandRequest, live: LiveSession) -> None:
        if self._operator is not None:
            outcome = await self._service.commands.run(self._operator, asked, live.session)
            self._reply(asked, outcome)

    def _reply(self, asked: wire.CommandRequest, outcome: CommandOutcome) -> None:
        """Send the reply to a command."""
        values, code, message = outcome.values, outcome.code, outcome.message
        self._answer(wire.encode_reply(asked, values=values, code=code, message=message))


def _decoded(message: Message) -> wire.Inbound | None:
    """Return the decoded message; None for an invalid message."""
    try:
        return wire.decode(_body(message))
    except wire.BadMessage:
        return None


def _body(message: Message) -> str | bytes:
    """Return the text or the bytes of a received WebSocket message."""
    body: str | bytes = message.get("text") or message.get("bytes") or ""
    return body
