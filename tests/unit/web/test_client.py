"""One browser client: limits on what it sends, newest values for what it gets."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from starlette.types import Message

from urc.model.driver import Command
from urc.model.profile import Setting
from urc.model.role import Role
from urc.protocol.events import Replied
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_recorder import AuditRecorder
from urc.runtime.session import CommandFailed
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.feed.client_socket import FixedRights, SocketPeer
from urc.web.fleet.robots import Robot, RobotService
from urc.web.page_socket import (
    BAD_MESSAGES,
    EARLY_MESSAGES,
    MESSAGES_PER_S,
    TICKS_PER_S,
    BrowserClient,
    TokenBucket,
)
from urc.web.wire.messages import CLOSE_TOO_FAST

pytestmark = pytest.mark.anyio


TEXT = 0x81
"""First byte of a WebSocket frame of text."""


def frames_in(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Give the first byte and the message of each WebSocket frame."""
    while data:
        size, at = data[1], 2
        if size > 125:
            at = 4 if size == 126 else 10
            size = int.from_bytes(data[2:at])
        yield data[0], data[at : at + size]
        data = data[at + size :]


class FakeLine:
    """A WebSocket whose other side is the test."""

    def __init__(self) -> None:
        self.receiver: asyncio.Queue[Message] = asyncio.Queue()
        self.sent: list[dict[str, Any]] = []
        self.closed: tuple[int, str | None] | None = None
        self.free = asyncio.Event()
        self.free.set()
        self.was_aborted = False
        self.frames: list[bytes] = []
        self.is_held_back = False

    async def receive(self) -> Message:
        return await self.receiver.get()

    async def send_text(self, data: str) -> None:
        self.sent.append(json.loads(data))

    async def send_bytes(self, data: bytes) -> None:
        self.frames.append(data)

    def is_free(self) -> bool:
        return self.free.is_set()

    def write(self, frame: bytes) -> None:
        for kind, body in frames_in(frame):
            if kind == TEXT:
                self.sent.append(json.loads(body))
            else:
                self.frames.append(body)

    async def close(self, code: int = 1000, reason: str | None = None) -> None:
        self.closed = (code, reason)
        self.leave()

    def listen(self, sink: Callable[[bytes], bool]) -> None:
        self.sink = sink

    def notify(self, freed: Callable[[], None]) -> None:
        self.freed = freed

    def hold_back(self, is_held: bool) -> None:
        self.is_held_back = is_held

    async def drained(self) -> None:
        await self.free.wait()

    def abort(self) -> None:
        self.was_aborted = True

    def say(self, message: object) -> None:
        text = message if isinstance(message, str) else json.dumps(message)
        self.receiver.put_nowait({"type": "websocket.receive", "text": text})

    def leave(self) -> None:
        self.receiver.put_nowait({"type": "websocket.disconnect", "code": 1001})

    def of_type(self, kind: str) -> list[dict[str, Any]]:
        return [message for message in self.sent if message["t"] == kind]


class Scene:
    """A client that is connected to a fake robot."""

    def __init__(
        self, service: RobotService, robot: FakeRobot, clock: FakeClock, role: Role = "drive"
    ) -> None:
        self.robot = robot
        self.clock = clock
        self.service = service
        self.audit: list[AuditEntry] = []
        self.line = FakeLine()
        self.client = BrowserClient(
            self.line, service, self.line, SocketPeer(rights=FixedRights(role))
        )
        self.task = asyncio.create_task(self.client.serve())


@asynccontextmanager
async def scene(
    settings: dict[str, Setting] | None = None,
    *,
    commands: dict[str, Command] | None = None,
    role: Role = "drive",
    start_lock: asyncio.Lock | None = None,
) -> AsyncIterator[Scene]:
    """Serve one client; it and the service are gone after the test."""
    clock = FakeClock()
    robot = FakeRobot(dashboard_profile(settings=settings, commands=commands), clock)
    audit: list[AuditEntry] = []
    recorder = AuditRecorder("puppet", audit.append, utc=lambda: 99.0)
    service = RobotService(
        Robot(robot.profile, {}, robot.open), clock=clock, recorder=recorder, start_lock=start_lock
    )
    running = asyncio.create_task(service.run())
    made = Scene(service, robot, clock, role)
    made.audit = audit
    await settle()
    try:
        yield made
    finally:
        made.line.leave()
        await settle()
        running.cancel()
        made.task.cancel()
        await settle()


async def test_a_client_gets_hello_then_links_then_values() -> None:
    """What an index means comes before any index."""
    async with scene() as it:
        it.robot.set_reading("battery", 42)
        await settle()
        assert [message["t"] for message in it.line.sent] == ["hello", "links", "v"]
        assert it.line.of_type("v")[0]["v"] == [42]


async def test_a_blocked_line_gets_only_the_newest_value() -> None:
    """While the kernel takes nothing, nothing is taken from the hub either."""
    async with scene() as it:
        it.line.free.clear()
        it.robot.set_reading("battery", 0)
        await settle()
        before = len(it.line.of_type("v"))
        for level in range(1, 50):
            it.robot.set_reading("battery", level)
            await it.clock.advance(0.02)
        it.line.free.set()
        await settle()
        assert [frame["v"] for frame in it.line.of_type("v")[before:]][-1] == [49]
        assert len(it.line.of_type("v")) - before <= 2


async def test_a_ping_is_answered_with_its_own_number() -> None:
    """The page measures the way there and back."""
    async with scene() as it:
        it.line.say({"t": "ping", "c": 12.5})
        await settle()
        (pong,) = it.line.of_type("pong")
        assert pong.pop("u") > 0
        assert pong == {"t": "pong", "c": 12.5, "n": 1_000_000}


async def test_a_command_gets_exactly_one_reply() -> None:
    """Done with its values, or failed with the session's own code."""
    async with scene() as it:
        it.robot.on_command = lambda name, arguments: {"battery": 7}
        it.line.say({"t": "run", "id": 3, "command": "ask", "arguments": {"x": 1}})
        await settle()

        def refuse(name: str, arguments: object) -> dict[str, int]:
            raise CommandFailed("refused", "not now")

        it.robot.on_command = refuse  # type: ignore[assignment]
        it.line.say({"t": "run", "id": 4, "command": "ask"})
        await settle()
        assert it.robot.commands == [("ask", {"x": 1}), ("ask", {})]
        assert it.line.of_type("reply") == [
            {"t": "reply", "id": 3, "ok": True, "values": {"battery": 7}},
            {"t": "reply", "id": 4, "ok": False, "code": "refused", "message": "not now"},
        ]
        assert {e.data for e in it.audit} == {b"ask".hex()}
        assert [(e.what, e.who, e.command, e.arguments, e.outcome) for e in it.audit] == [
            ("ran", "screen 1", "ask", '{"x": 1}', 'done: {"battery": 7}'),
            ("ran", "screen 1", "ask", "{}", "refused: not now"),
        ]


async def test_a_command_whose_page_has_gone_is_in_the_audit() -> None:
    """It was given, whoever waits for its answer."""
    async with scene() as it:

        async def wait(name: str, arguments: object, **people: object) -> Replied:
            await asyncio.Event().wait()
            raise AssertionError

        it.robot.command = wait  # type: ignore[method-assign]
        it.line.say({"t": "run", "id": 3, "command": "ask"})
        await settle()
        it.line.leave()
        await settle()
        (entry,) = it.audit
        assert (entry.what, entry.outcome) == ("ran", "no client waited for the answer")


async def test_bad_messages_are_counted_answered_and_then_close_the_line() -> None:
    """Each is answered; the tenth closes with a code of its own."""
    async with scene() as it:
        for _ in range(BAD_MESSAGES - 1):
            it.line.say("{")
        await settle()
        assert len(it.line.of_type("error")) == it.client.bad_messages == BAD_MESSAGES - 1
        assert it.line.closed is None
        it.line.say("[]")
        await settle()
        assert it.line.closed == (4400, "10 messages were invalid")


async def test_too_many_messages_close_the_line() -> None:
    """A hundred a second pass, one more does not."""
    async with scene() as it:
        for number in range(MESSAGES_PER_S):
            it.line.say({"t": "ping", "c": number})
        await settle()
        await it.clock.advance(0.5)
        assert it.line.closed is None
        for number in range(MESSAGES_PER_S):
            it.line.say({"t": "ping", "c": number})
        await settle()
        await settle()
        await settle()
        await settle()
        assert it.line.closed == (4429, "more than 100 messages a second")


def test_the_allowance_comes_back_with_time() -> None:
    """A second's worth at once, then the rate."""
    allowance = TokenBucket(100, 0.0)
    assert [allowance.allow(0.0) for _ in range(101)] == [True] * 100 + [False]
    assert [allowance.allow(0.011) for _ in range(2)] == [True, False]
    assert sum(allowance.allow(100.0) for _ in range(500)) == 100


async def test_a_robot_that_is_not_ready_refuses_with_the_settings_names() -> None:
    """No session is opened while a setting is undefined."""
    async with scene(settings={"host": Setting("host", "host")}) as it:
        assert it.line.closed == (4409, "missing settings: host")
        assert it.robot.opened == 0


async def test_a_page_that_leaves_ends_its_client() -> None:
    """Its tasks end, and the service counts it no more."""
    async with scene() as it:
        it.line.leave()
        await settle()
        assert it.task.done()
        await it.clock.advance(2.1)
        assert not it.robot.is_open


async def test_the_end_of_the_session_is_told_to_the_page() -> None:
    """The line is closed with a code, so that the page comes back by itself."""
    async with scene() as it:
        live = await it.service.live()
        live.ended.set()
        live.fanout.flush()
        await settle()
        assert it.line.closed == (4500, "the robot's session ended")


async def test_commands_at_once_are_bounded() -> None:
    """One more than may be under way is answered busy, and nothing piles up."""
    async with scene() as it:
        gate = asyncio.Event()

        async def slow(name: str, arguments: object, **people: object) -> object:
            await gate.wait()
            raise CommandFailed("refused", "late")

        it.robot.command = slow  # type: ignore[assignment, method-assign]
        for number in range(17):
            it.line.say({"t": "run", "id": number, "command": "ask"})
        await settle()
        await settle()
        replies = it.line.of_type("reply")
        assert [(reply["id"], reply["code"]) for reply in replies] == [(16, "busy")]
        gate.set()
        await settle()
        assert len(it.line.of_type("reply")) == 17


async def test_ticks_do_not_count_as_messages_until_they_are_a_flood() -> None:
    """A stick that is moved quickly must not close its own line; a hostile page must."""
    tick = {"t": "tick", "command": "drive", "epoch": 1, "number": 1, "echo": 1}
    async with scene() as it:
        for _ in range(5):
            for _ in range(200):
                it.line.say(tick)
            await it.clock.advance(0.2)
        assert it.line.closed is None
        for _ in range(2 * TICKS_PER_S):
            it.line.say(tick)
        await settle()
        assert it.line.closed is not None
        assert it.line.closed[0] == CLOSE_TOO_FAST


async def test_a_stop_is_taken_however_much_else_was_said() -> None:
    """It is not one of the hundred messages a second."""
    async with scene() as it:
        for _ in range(MESSAGES_PER_S):
            it.line.say({"t": "ping", "c": 1})
        it.line.say({"t": "stop"})
        await settle()
        assert it.line.closed is None
        assert it.service.controls.controller.lease.state.latched_by == "screen 1"


async def test_stop_does_not_wait_for_the_session() -> None:
    turn = asyncio.Lock()
    await turn.acquire()
    async with scene(start_lock=turn) as it:
        it.line.say({"t": "ping", "c": 7.0})
        it.line.say({"t": "stop"})
        await settle()
        assert it.service.controls.controller.lease.state.latched_by == "screen 1"
        assert it.robot.opened == 0
        assert not it.line.sent
        turn.release()
        await settle()
        assert [told["c"] for told in it.line.of_type("pong")] == [7.0]


async def test_page_that_floods_a_closed_session_is_closed_and_its_stop_counts() -> None:
    turn = asyncio.Lock()
    await turn.acquire()
    async with scene(start_lock=turn) as it:
        it.line.say({"t": "stop"})
        for _ in range(EARLY_MESSAGES):
            it.line.say({"t": "tick", "command": "drive", "epoch": 1, "number": 1, "echo": 1})
            it.line.say("{")
        await settle()
        assert it.line.closed == (
            CLOSE_TOO_FAST,
            f"more than {EARLY_MESSAGES} messages before hello",
        )
        assert it.service.controls.controller.lease.state.latched_by == "screen 1"
        assert it.service.controls.operators == ()


async def test_reset_that_was_sent_before_stop_does_not_undo_it() -> None:
    """STOP overtakes the messages that wait, so an earlier reset must not be handled after it."""
    turn = asyncio.Lock()
    await turn.acquire()
    async with scene(start_lock=turn) as it:
        it.line.say({"t": "drive", "verb": "reset"})
        it.line.say({"t": "stop"})
        await settle()
        turn.release()
        await settle()
        assert it.line.of_type("hello")
        assert it.service.controls.controller.lease.state.latched_by == "screen 1"


async def test_page_that_ticks_too_fast_before_hello_is_closed() -> None:
    turn = asyncio.Lock()
    await turn.acquire()
    async with scene(start_lock=turn) as it:
        for _ in range(TICKS_PER_S + 1):
            it.line.say({"t": "tick", "command": "drive", "epoch": 1, "number": 1, "echo": 1})
        await settle()
        assert it.line.closed is not None
        assert it.line.closed[0] == CLOSE_TOO_FAST


async def test_page_that_leaves_before_the_session_opens_leaves_no_operator() -> None:
    turn = asyncio.Lock()
    await turn.acquire()
    async with scene(start_lock=turn) as it:
        await settle()
        assert len(it.service.controls.operators) == 1
        it.line.leave()
        await settle()
        assert it.service.controls.operators == ()
        assert not it.service.is_used


async def test_a_stop_beyond_every_limit_still_stops() -> None:
    """The line closes afterwards."""
    tick = {"t": "tick", "command": "drive", "epoch": 1, "number": 1, "echo": 1}
    async with scene() as it:
        for _ in range(TICKS_PER_S):
            it.line.say(tick)
        it.line.say({"t": "stop"})
        await settle()
        assert it.service.controls.controller.lease.state.latched_by == "screen 1"
        assert it.line.closed is not None
        assert it.line.closed[0] == CLOSE_TOO_FAST


@pytest.mark.parametrize(
    "message",
    [
        {"t": "tick", "command": "drive", "epoch": 1, "number": 1},
        {"t": "tick", "command": "drive", "epoch": 1, "number": 1, "echo": 1, "more": 1},
        {"t": "tick", "command": "drive", "epoch": 1, "number": 1, "echo": 1, "arguments": [1]},
        '{"t":"tick","command":"drive","epoch":1,"number":1,"echo":1,"arguments":{"speed":NaN}}',
        '{"t":"tick","command":"drive","epoch":1,"number":1,"echo":1,"arguments":{"speed":1e999}}',
        {"t": "drive", "verb": "grab"},
        {"t": "release"},
    ],
)
async def test_what_is_no_message_about_the_controls_is_counted_as_bad(message: object) -> None:
    """Not-a-number and infinity are no values either."""
    async with scene() as it:
        it.line.say(message)
        await settle()
        assert it.client.bad_messages == 1


async def test_a_tick_that_has_just_come_is_taken_at_once_and_nothing_else() -> None:
    """Not before something that waits, not what is no tick, and not one too many."""
    async with scene() as it:
        tick = b'{"t":"tick","command":"go","epoch":1,"number":1,"echo":1}'
        assert it.line.sink(tick)
        await settle()
        (refused,) = it.line.of_type("refused")
        assert "'go' is not a held command" in refused["message"]
        for other in (b'{"t":"stop"}', b"", b"\xff", tick[:-1], b'{"t":"tick","a":1}', b"[" * 9999):
            assert not it.line.sink(other)
        it.line.say({"t": "ping", "n": 1, "c": 2.0})
        await asyncio.sleep(0)
        await settle()
        assert it.line.sink(tick)
        for _ in range(TICKS_PER_S):
            it.line.sink(tick)
        assert not it.line.sink(tick), "the usual way closes the line over it"
        it.line.leave()
        await settle()
        assert not it.line.sink(tick)


async def test_a_page_asks_to_try_the_robot_now() -> None:
    """A page that only watches may: it connects the robot by being open."""
    async with scene(role="watch") as it:
        it.line.say({"t": "reconnect"})
        await settle()
        assert it.robot.reconnects == 1


async def test_a_screen_without_a_sign_in_has_the_name_that_it_gives() -> None:
    async with scene() as it:
        it.line.say({"t": "name", "name": " Tablet in\tthe  lab\u202e "})
        await settle()
        assert [one.client.name for one in it.service.controls.operators] == [
            "Tablet in the lab\\u202e"
        ]
        it.line.say({"t": "name", "name": "x" * 41})
        await settle()
        assert it.line.of_type("error")[-1]["code"] == "bad-message"
        it.line.say({"t": "name", "name": ""})
        await settle()
        assert it.service.controls.operators[0].client.name == "screen 1"
