"""The WebSocket that sends a robot's traffic to one developer page and answers the page's requests.

Layer 5. Each page has its own backlog of traffic; when a backlog is full, its oldest rows are
dropped and counted. A page that reads no data for `STALL_S` seconds is disconnected. A thread
handles the page's requests one by one; the number of pending requests is limited.
"""

import asyncio
import logging
from collections import deque
from typing import NamedTuple

from starlette.types import Message
from starlette.websockets import WebSocketDisconnect

from urc.config.messaging import MESSAGING
from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import UrcError
from urc.runtime.document_tests import sample_settings
from urc.runtime.hub import EventTap, LogEntry, Traffic
from urc.runtime.redaction import stand_ins
from urc.transports.ros.topic_list import TopicList
from urc.web.dev import wire
from urc.web.dev.preview import Preview, preview
from urc.web.dev.rows import TrafficRow, note_row, traffic_row
from urc.web.dev.topics import encode_topic_table
from urc.web.dev.tryout import pasted_bytes, try_out
from urc.web.dev.watch import ProfileWatch
from urc.web.fleet.robots import LiveSession, SessionFailed, missing_settings
from urc.web.page_socket import STALL_S, ClientSocket, FlowControl, TokenBucket
from urc.web.wire.messages import (
    CLOSE_BAD_MESSAGES,
    CLOSE_TOO_FAST,
    BadMessage,
    Ping,
    encode_error,
    encode_pong,
)

__all__ = ["Backlog", "DevClient"]

MESSAGES_PER_S = 20
BAD_MESSAGES = 10
QUESTIONS = 8
MOST_ANSWERS = 32
"""Maximum number of replies in the send queue."""
ROWS_KEPT = 1000
BYTES_KEPT = 1 << 20
ROWS_AT_ONCE = 200
BEHIND_S = 0.05
"""Interval between messages with rows, in seconds; a robot may produce 1000 rows per second."""
HELD_S = 0.5
"""Maximum delay of text that may be the beginning of a secret, in seconds."""
RETRY_S = 1.0
TOPICS_S = 0.5
"""Interval between two checks whether the list of topics has changed, in seconds."""

log = logging.getLogger(__name__)


class Backlog:
    """The queue of traffic rows for one page."""

    def __init__(self) -> None:
        self.first = 0
        """Number of the oldest row in the queue."""
        self._rows: deque[TrafficRow] = deque()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._rows)

    def push(self, row: TrafficRow) -> None:
        """Append a row; if the queue exceeds its limit, drop the oldest rows."""
        row.n = self.first + len(self._rows)
        self._rows.append(row)
        self._bytes += row.weight
        while len(self._rows) > ROWS_KEPT or (self._bytes > BYTES_KEPT and len(self._rows) > 1):
            self._pop()

    def pop(self) -> list[TrafficRow]:
        """Remove and return the oldest rows, at most `ROWS_AT_ONCE`."""
        return [self._pop() for _ in range(min(ROWS_AT_ONCE, len(self._rows)))]

    def _pop(self) -> TrafficRow:
        row = self._rows.popleft()
        self._bytes -= row.weight
        self.first += 1
        return row


class _RunningProfile(NamedTuple):
    """The profile and settings with which the page's requests are answered."""

    profile: Profile
    settings: dict[str, Value]
    """Setting values, with placeholders for secrets and sample values for missing settings."""


class DevClient:
    """The server side of a developer page's connection."""

    def __init__(self, line: ClientSocket, watch: ProfileWatch, flow: FlowControl) -> None:
        self._line = line
        self._watch = watch
        self._service = watch.service
        self._clock = watch.service.clock
        self._flow = flow
        self._news = asyncio.Event()
        self._backlog = Backlog()
        self._answers: deque[str] = deque()
        self._questions: asyncio.Queue[wire.ParseRequest | wire.PreviewRequest] = asyncio.Queue(
            QUESTIONS
        )
        self._closing: tuple[int, str] | None = None
        self._allowance = TokenBucket(MESSAGES_PER_S, self._clock.now())
        self._bad = 0
        self._edition = -1
        self._shows_topics = asyncio.Event()
        """Event that is set while the page shows the robot's topics."""

    async def serve(self) -> None:
        """Serve the developer page over the accepted socket until either side closes."""
        self._watch.listeners.add(self._news.set)
        try:
            async with asyncio.TaskGroup() as group:
                ending = [group.create_task(work) for work in (self._read(), self._write())]
                others = [group.create_task(work) for work in (self._follow(), self._answer())]
                await asyncio.wait(ending, return_when=asyncio.FIRST_COMPLETED)
                for task in (*ending, *others):
                    task.cancel()
        except* WebSocketDisconnect:
            pass
        except* TimeoutError:
            log.warning("a developer page read nothing for %g s and was disconnected", STALL_S)
            self._flow.abort()
        finally:
            self._watch.listeners.discard(self._news.set)

    # -- traffic

    async def _follow(self) -> None:
        """Append the traffic of the robot's sessions to the backlog, one session after another."""
        while True:
            if missing_settings(self._service.robot) or self._service.is_full:
                await self._clock.sleep(RETRY_S)
                continue
            with self._service.visit():
                try:
                    live = await self._service.live()
                except SessionFailed as error:
                    self._push(note_row(self._log_entry(str(error))))
                    await self._clock.sleep(RETRY_S)
                    continue
                with live.session.hub.tap(with_traffic=True) as tap:
                    for note in live.session.hub.notes:
                        self._push(note_row(note))
                    listening = asyncio.ensure_future(self._listen(tap))
                    ended = asyncio.ensure_future(live.ended.wait())
                    topics = asyncio.ensure_future(self._list_topics(live))
                    try:
                        await asyncio.wait((listening, ended), return_when=asyncio.FIRST_COMPLETED)
                    finally:
                        for task in (listening, ended, topics):
                            task.cancel()

    async def _list_topics(self, live: LiveSession) -> None:
        """Send the robot's topics whenever they change, while the page shows them."""
        watch, hub = live.topics, live.session.hub
        while True:
            await self._shows_topics.wait()
            sent: dict[str, TopicList] | None = None
            with watch.shown():
                while self._shows_topics.is_set():
                    # A page that reads slowly gets fewer lists.
                    if hub.topic_lists != sent and not self._answers:
                        sent = dict(hub.topic_lists)
                        self._log(encode_topic_table(sent, watch.uses, watch.rates))
                    await self._clock.sleep(TOPICS_S)

    async def _listen(self, tap: EventTap) -> None:
        dropped = 0
        while True:
            await tap.filled()
            for one in tap.drain():
                if isinstance(one, Traffic):
                    self._push(traffic_row(one))
                elif isinstance(one, LogEntry):
                    self._push(note_row(one))
            if tap.dropped > dropped:
                lost, dropped = tap.dropped - dropped, tap.dropped
                text = f"traffic rows lost because the server cannot keep up: {lost}"
                self._push(note_row(self._log_entry(text)))

    def _log_entry(self, text: str) -> LogEntry:
        return LogEntry(self._clock.now(), "warning", "URC", text)

    def _push(self, row: TrafficRow) -> None:
        self._backlog.push(row)
        self._news.set()

    # -- writing

    async def _write(self) -> None:
        await self._send(wire.encode_hello(self._service.robot.profile.name, self._clock.now()))
        while True:
            self._news.clear()
            for text in self._news_of_profile():
                await self._send(text)
            while self._answers:
                await self._send(self._answers.popleft())
            if self._closing:
                await self._line.close(*self._closing)
                return
            if len(self._backlog):
                first = self._backlog.first
                rows = self._backlog.pop()
                await self._send(wire.encode_rows(rows, first, self._clock.now()))
                await self._clock.sleep(BEHIND_S)
            else:
                await self._news.wait()

    async def _send(self, text: str) -> None:
        async with asyncio.timeout(STALL_S):
            await self._flow.drained()
            await self._line.send_text(text)

    def _news_of_profile(self) -> list[str]:
        watch = self._watch
        if watch.edition == self._edition:
            return []
        self._edition = watch.edition
        robot = watch.robot
        missing = ", ".join(setting.name for setting in missing_settings(robot))
        told = watch.told or (f"is not connected; missing settings: {missing}" if missing else "")
        text = wire.encode_profile(
            robot.profile.driver,
            MESSAGING,
            edition=watch.edition,
            state=watch.state,
            file=watch.file,
            told=told,
            problems=watch.problems,
        )
        return [text]

    # -- reading

    async def _read(self) -> None:
        message: Message = await self._line.receive()
        while message["type"] != "websocket.disconnect":
            if not self._closing:
                self._handle(message)
            message = await self._line.receive()

    def _handle(self, message: Message) -> None:
        now_s = self._clock.now()
        if not self._allowance.allow(now_s):
            self._close(CLOSE_TOO_FAST, f"more than {MESSAGES_PER_S} messages a second")
            return
        try:
            asked = wire.decode(message.get("text") or message.get("bytes") or "")
        except BadMessage as error:
            self._bad += 1
            if self._bad >= BAD_MESSAGES:
                self._close(CLOSE_BAD_MESSAGES, f"{BAD_MESSAGES} messages were invalid")
            else:
                self._log(encode_error("bad-message", str(error)))
            return
        if len(self._answers) > MOST_ANSWERS:
            self._close(CLOSE_TOO_FAST, "the page does not read its replies")
            return
        if isinstance(asked, Ping):
            self._log(encode_pong(asked, now_s))
            return
        if isinstance(asked, wire.TopicsRequest):
            if asked.shown:
                self._shows_topics.set()
            else:
                self._shows_topics.clear()
            return
        try:
            self._questions.put_nowait(asked)
        except asyncio.QueueFull:
            self._log(_refused(asked, f"{QUESTIONS} requests are already pending"))

    def _close(self, code: int, reason: str) -> None:
        self._closing = (code, reason)
        self._log(encode_error("closing", reason))

    def _log(self, text: str) -> None:
        self._answers.append(text)
        self._news.set()

    async def _answer(self) -> None:
        """Handle the requests one by one, in a thread."""
        while True:
            asked = await self._questions.get()
            robot = self._watch.robot
            settings = sample_settings(robot.profile.settings) | dict(robot.settings)
            known = _RunningProfile(robot.profile, stand_ins(robot.profile, settings))
            self._log(await asyncio.to_thread(_answered, asked, known))


def _answered(asked: wire.ParseRequest | wire.PreviewRequest, known: _RunningProfile) -> str:
    try:
        return (
            _tried(asked, known) if isinstance(asked, wire.ParseRequest) else _shown(asked, known)
        )
    except Exception as bug:  # a supervisor: a bug must not end the page's connection
        log.exception("a request from a developer page failed")
        return _refused(asked, f"internal error in URC ({type(bug).__name__}: {bug})")


def _refused(asked: wire.ParseRequest | wire.PreviewRequest, text: str) -> str:
    if isinstance(asked, wire.ParseRequest):
        return wire.encode_tried(asked.id, None, text)
    return wire.encode_shown(asked.id, Preview(text))


def _tried(asked: wire.ParseRequest, known: _RunningProfile) -> str:
    spec = known.profile.driver.transports.get(asked.transport)
    encoding = spec.encoding if spec else "utf-8"
    try:
        data = pasted_bytes(asked.text, is_hex=asked.hex, encoding=encoding)
        found = try_out(known.profile.driver, known.settings, asked.transport, data, asked.topic)
    except UrcError as error:
        return wire.encode_tried(asked.id, None, str(error))
    return wire.encode_tried(asked.id, found)


def _shown(asked: wire.PreviewRequest, known: _RunningProfile) -> str:
    found = preview(known.profile.driver, known.settings, asked.command, asked.arguments)
    return wire.encode_shown(asked.id, found)
