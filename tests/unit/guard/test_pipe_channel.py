"""The engine's side of a guard that is a process: it is told all, watched, and replaced."""

import asyncio
import logging
import socket
from collections.abc import AsyncIterator, Callable

import pytest

from tests.unit.guard.lines import HELD, STOP, TERMS, CountedWire
from urc.guard import messages, pipe_channel
from urc.guard.channel import GuardedLineSpec
from urc.guard.guard_client import GuardClient
from urc.guard.pipe import Pipe
from urc.guard.pipe_channel import PipeChannel
from urc.guard.process import CAN_INHERIT, GuardAcceptor, ProcessState
from urc.guard.start_turns import StartTurns
from urc.testing.clock import settle
from urc.transports.base import ConnectFailed, PeerClosed

pytestmark = pytest.mark.anyio

BOUND_S = 10.0
MAKE = messages.MakeTransport("wire", "urc.transports.tcp:from_setup", {}, [], "", 0.22, False)
TURN = TERMS._replace(stop=b"halt")


class Process:
    """A guard's process and its end of the pipe; it ends when the pipe does, or does not."""

    def __init__(self, number: int, line: socket.socket) -> None:
        self.pid = number
        self.heard: list[messages.ToGuard] = []
        self.is_killed = self.is_over = False
        self.is_stubborn = False
        self._changed = asyncio.Event()
        self.pipe = Pipe(
            line,
            messages.encoder(),
            messages.decoder_of_guard(),
            take=self._take,
            settle=lambda: None,
            gone=self._gone,
        )

    def _take(self, said: messages.ToGuard) -> None:
        self.heard.append(said)
        self._changed.set()

    def _gone(self) -> None:
        self.is_over = not self.is_stubborn
        self._changed.set()

    def die(self) -> None:
        self.is_over = True
        self.pipe.close()

    def poll(self) -> int | None:
        return 0 if self.is_over else None

    def kill(self) -> None:
        self.is_killed = True
        self.die()

    async def hears(self, count: int) -> list[messages.ToGuard]:
        """Return all that it was told, once that is `count` things."""
        async with asyncio.timeout(BOUND_S):
            while len(self.heard) < count:
                self._changed.clear()
                await self._changed.wait()
        return self.heard


class House:
    """Where guards are started; keeps each."""

    def __init__(self) -> None:
        self.started: list[Process] = []
        self.fault: OSError | None = None
        self._news = asyncio.Event()
        self.guard = GuardClient([GuardedLineSpec(MAKE, CountedWire())], HELD, PipeChannel)
        self.is_inherited = CAN_INHERIT

    def launch(self, *, is_inherited: bool) -> tuple[Process, socket.socket]:
        assert is_inherited is self.is_inherited
        self._news.set()
        if self.fault is not None:
            raise self.fault
        ours, theirs = socket.socketpair()
        self.started.append(Process(len(self.started) + 1, theirs))
        return self.started[-1], ours

    async def until(self, condition: Callable[[], object]) -> None:
        async with asyncio.timeout(BOUND_S):
            while not condition():
                await settle()

    async def nth(self, number: int) -> Process:
        await self.until(lambda: len(self.started) >= number)
        return self.started[number - 1]

    @property
    def channel(self) -> PipeChannel:
        assert isinstance(self.guard.channel, PipeChannel)
        return self.guard.channel

    def begin(self) -> Process:
        self.guard.start()
        return self.started[-1]

    async def open(self) -> None:
        """Open the line, which the guard says it has done."""
        opening = asyncio.ensure_future(self.guard.transports["wire"].open(BOUND_S))
        process = self.started[-1]
        await self.until(lambda: any(isinstance(one, messages.OpenLine) for one in process.heard))
        process.pipe.post(messages.LineOpened("wire", 1, "robot:1", {}))
        await opening


@pytest.fixture
async def house(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[House]:
    made = House()
    monkeypatch.setattr(pipe_channel, "launch", made.launch)
    monkeypatch.setattr(pipe_channel, "_AGAIN_S", 0.02)
    yield made
    made.fault = None
    await made.guard.finish()
    for one in made.started:
        one.die()


async def test_guard_is_told_what_there_is(house: House) -> None:
    """Its lines, and what was armed before it ran."""
    assert house.channel.pid == 0
    house.guard.arm("drive", TERMS)
    process = house.begin()
    assert house.channel.pid == process.pid
    assert await process.hears(2) == [MAKE, messages.ArmControl("wire", "drive", TERMS)]


@pytest.fixture
async def turns(monkeypatch: pytest.MonkeyPatch) -> StartTurns:
    """One turn, which another guard has."""
    made = StartTurns(1)
    made.take("other", lambda: None)
    monkeypatch.setattr(pipe_channel, "start_turns", lambda: made)
    return made


async def test_guard_starts_in_its_turn_and_keeps_it_until_its_first_message(
    house: House, turns: StartTurns
) -> None:
    house.guard.start()
    assert house.started == []
    turns.end("other")
    process = await house.nth(1)
    later: list[str] = []
    turns.take("later", lambda: later.append("launched"))
    await process.hears(1)
    assert later == []
    process.pipe.post(messages.Heartbeat(0.0))
    await house.until(lambda: later)


async def test_guard_that_must_stop_its_robot_waits_for_no_turn(
    house: House, turns: StartTurns
) -> None:
    house.guard.start()
    house.guard.arm("drive", TERMS)
    assert house.started == []
    house.guard.stop({"drive": STOP})
    await settle()
    assert len(house.started) == 1, "the other guard still has the only turn"
    process = await house.nth(1)
    assert await process.hears(2) == [
        MAKE,
        messages.RecoverStop("wire", "drive", TERMS._replace(stop=STOP)),
    ]


async def test_stop_without_a_guard_is_no_fault(house: House) -> None:
    """The session has not started its guard yet; nothing can move."""
    house.guard.arm("drive", TERMS)
    house.guard.stop({"drive": STOP})
    house.channel.post(MAKE, is_urgent=True)
    assert house.started == []


async def test_guard_that_is_not_needed_any_more_is_never_started(
    house: House, turns: StartTurns
) -> None:
    house.guard.start()
    await house.guard.finish()
    turns.end("other")
    await settle()
    assert house.started == []


async def test_guard_that_cannot_be_launched_or_has_ended_gives_its_turn_back(
    house: House, turns: StartTurns
) -> None:
    later: list[str] = []
    house.fault = OSError("no process")
    house.guard.start()
    turns.take("second", lambda: later.append("second"))
    turns.end("other")
    await house.until(lambda: later == ["second"])
    house.fault = None
    process = await house.nth(1)
    turns.take("third", lambda: later.append("third"))
    turns.end("second")
    assert later == ["second", "third"], "the retry has no turn"
    process.die()
    await house.nth(2)


async def test_guard_is_told_what_controls_do(house: House) -> None:
    process = house.begin()
    house.guard.tick("drive", b"nobody armed it")
    house.guard.arm("drive", TERMS)
    house.guard.tick("drive", b"go 1")
    house.guard.tick("drive", b"go 2")
    house.guard.renew("drive", b"stop 2")
    house.guard.release("drive")
    house.guard.stop({"drive": STOP})
    _, armed, first, second, *rest = await process.hears(7)
    assert armed == messages.ArmControl("wire", "drive", TERMS)
    assert isinstance(first, messages.RenewLease)
    assert isinstance(second, messages.RenewLease)
    assert (first.control, first.number, first.data) == ("drive", 1, b"go 1")
    assert (second.number, second.data) == (2, b"go 2")
    assert first.at_s <= second.at_s
    assert rest == [
        messages.ReplaceStop("drive", b"stop 2"),
        messages.ReleaseControl("drive"),
        messages.StopMotion([("wire", "drive", TERMS)]),
    ]


async def test_stop_goes_before_what_waits_and_no_old_tick_after_it(house: House) -> None:
    """A guard that reads late finds the stop first, of each control the newest, and no more."""
    process = house.begin()
    await house.open()
    for control, terms in (("drive", TERMS), ("turn", TURN), ("lift", TERMS)):
        house.guard.arm(control, terms)
    known = len(await process.hears(5))
    while not house.channel._pipe.is_backed_up:  # type: ignore[union-attr]
        assert house.guard.transports["wire"].offer(b"x" * 60000)
        house.guard.transports["wire"]._under_way_bytes = 0
    for number in range(3):
        for control in ("drive", "turn", "lift"):
            house.guard.tick(control, f"{control} {number}".encode())
    house.guard.renew("turn", b"halt 1")
    house.guard.renew("turn", b"halt 2")
    house.guard.release("lift")
    house.guard.stop({"drive": STOP})
    await house.until(lambda: any(isinstance(one, messages.ReplaceStop) for one in process.heard))
    told = [one for one in process.heard[known:] if not isinstance(one, messages.SendBytes)]
    stop, release, tick, renewed = told
    assert stop == messages.StopMotion([("wire", "drive", TERMS)])
    assert release == messages.ReleaseControl("lift")
    assert isinstance(tick, messages.RenewLease)
    assert (tick.control, tick.number, tick.data) == ("turn", 3, b"turn 2")
    assert renewed == messages.ReplaceStop("turn", b"halt 2")


async def test_next_guard_is_told_what_may_move(house: House) -> None:
    """It stops that first; what only was armed stays so; what stands needs nothing."""
    first = house.begin()
    await house.open()
    for control, terms in (("drive", TERMS), ("turn", TURN), ("lift", TERMS), ("aim", TERMS)):
        house.guard.arm(control, terms)
        if control != "turn":
            house.guard.tick(control, b"go")
    first.pipe.post(messages.StopWritten("lift", "released", 1))
    first.pipe.post(messages.StopWritten("aim", "expired", 1))
    async with asyncio.timeout(BOUND_S):
        stops: list[tuple[str, str]] = []
        while len(stops) < 2:
            stops += await house.guard.stops()
    assert stops == [("lift", "released"), ("aim", "expired")]
    first.die()
    second = await house.nth(2)
    assert house.channel.pid == second.pid
    assert await second.hears(4) == [
        MAKE,
        messages.RecoverStop("wire", "drive", TERMS),
        messages.ArmControl("wire", "turn", TURN),
        messages.ArmControl("wire", "lift", TERMS),
    ]
    with pytest.raises(
        PeerClosed, match="the guard of this connection ended; a new guard is starting"
    ):
        await house.guard.transports["wire"].receive()
    house.guard.arm("drive", TERMS)
    house.guard.tick("drive", b"go on")
    tick = (await second.hears(6))[-1]
    assert isinstance(tick, messages.RenewLease)
    assert tick.number == 1, "the new guard counts from the beginning"


async def test_stop_of_an_older_tick_leaves_a_control_in_doubt(house: House) -> None:
    """A newer one was under way; whether it moves only the next stop tells."""
    first = house.begin()
    house.guard.arm("drive", TERMS)
    house.guard.tick("drive", b"go 1")
    house.guard.tick("drive", b"go 2")
    first.pipe.post(messages.StopWritten("drive", "released", 1))
    async with asyncio.timeout(BOUND_S):
        await house.guard.stops()
    first.die()
    assert await (await house.nth(2)).hears(2) == [
        MAKE,
        messages.RecoverStop("wire", "drive", TERMS),
    ]


async def test_guard_that_died_is_killed_for_good(house: House) -> None:
    """There are never two of them on one line."""
    first = house.begin()
    first.pipe.close()
    await house.nth(2)
    assert first.is_killed
    await house.until(lambda: not house.channel._reaping)


async def test_guards_that_end_at_once_are_started_at_a_pace(
    house: House, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second and the third right away."""
    monkeypatch.setattr(pipe_channel, "_AGAIN_S", 60.0)
    house.begin()
    for number in (1, 2):
        house.started[-1].die()
        await house.nth(number + 1)
    monkeypatch.setattr(pipe_channel, "_AGAIN_S", 0.02)
    house.started[-1].die()
    await house.until(lambda: house.channel.pid == 0)
    assert len(house.started) == 3
    opening = asyncio.ensure_future(house.guard.transports["wire"].open(BOUND_S))
    fourth = await house.nth(4)
    assert await fourth.hears(2) == [MAKE, messages.OpenLine("wire", 1, BOUND_S)]
    fourth.pipe.post(messages.OpenFailed("wire", 1, "no robot"))
    with pytest.raises(ConnectFailed, match="no robot"):
        await opening
    assert [one.levelno for one in caplog.records] == [logging.ERROR] * 3


async def test_guard_that_opened_a_line_was_started_well(house: House) -> None:
    """The next ones are started at once again."""
    house.begin()
    for _ in range(2):
        count = len(house.started)
        house.started[-1].die()
        await house.nth(count + 1)
    opening = asyncio.ensure_future(house.guard.transports["wire"].open(BOUND_S))
    await house.started[-1].hears(2)
    house.started[-1].pipe.post(messages.LineOpened("wire", 1, "robot:1", {}))
    await opening
    house.started[-1].pipe.post(messages.BytesReceived("wire", 1, b"hello"))
    assert await house.guard.transports["wire"].receive() == b"hello"
    for _ in range(3):
        count = len(house.started)
        house.started[-1].die()
        await house.until(lambda: house.channel.pid != count)  # noqa: B023 - awaited here
        assert len(house.started) == count + 1


async def test_guard_that_cannot_be_started_is_tried_again(
    house: House, caplog: pytest.LogCaptureFixture
) -> None:
    house.fault = OSError("no more processes")
    house.guard.start()
    assert house.channel.pid == 0
    house.guard.arm("drive", TERMS)
    house.guard.release("drive")
    house.guard.stop({"drive": STOP})
    house.guard.renew("drive", b"later")
    assert "no more processes" in caplog.text
    house.fault = None
    first = await house.nth(1)
    assert await first.hears(2) == [
        MAKE, messages.RecoverStop("wire", "drive", TERMS._replace(stop=b"later")),
    ]  # fmt: skip


async def test_what_a_line_brings_is_counted_as_on_the_other_side(house: House) -> None:
    """The guard waits for that before it reads on."""
    process = house.begin()
    await house.open()
    sizes = [process.pipe.post(messages.BytesReceived("wire", 1, b"y" * 9000)) for _ in range(2)]
    for _ in sizes:
        assert await house.guard.transports["wire"].receive() == b"y" * 9000
    assert (await process.hears(3))[-1] == messages.FlowCredit("wire", 1, sum(sizes))


async def test_end_lets_the_guard_stop_what_moves(house: House) -> None:
    """It is told by the end of the pipe, and waited for."""
    process = house.begin()
    house.guard.arm("drive", TERMS)
    house.guard.tick("drive", b"go")
    await process.hears(3)
    await house.guard.finish()
    assert (process.is_over, process.is_killed) == (True, False)
    assert len(house.started) == 1, "nothing is started after the end"
    assert house.channel.pid == 0


async def test_end_of_a_guard_that_has_hardly_begun_is_at_once(house: House) -> None:
    process = house.begin()
    await house.guard.finish()
    assert process.is_killed


async def test_end_waits_for_a_guard_that_has_spoken(house: House) -> None:
    process = house.begin()
    await house.open()
    await house.guard.finish()
    assert not process.is_killed
    with pytest.raises(PeerClosed, match=r"^the session was closed$"):
        await house.guard.transports["wire"].receive()


async def test_guard_that_does_not_end_is_killed(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pipe_channel, "_FINISH_S", 0.01)
    process = house.begin()
    process.is_stubborn = True
    house.guard.arm("drive", TERMS)
    house.guard.tick("drive", b"go")
    await process.hears(3)
    await house.guard.finish()
    assert process.is_killed


async def test_a_cancelled_end_still_ends_the_guard(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A server that stops cancels a session that is just closing."""
    monkeypatch.setattr(pipe_channel, "_FINISH_S", 0.01)
    process = house.begin()
    process.is_stubborn = True
    house.guard.arm("drive", TERMS)
    house.guard.tick("drive", b"go")
    await process.hears(3)
    finishing = asyncio.ensure_future(house.guard.finish())
    await settle()
    finishing.cancel()
    await asyncio.wait({finishing})
    assert finishing.cancelled()
    await house.until(lambda: process.is_killed)


async def test_deaf_guard_is_killed(house: House, monkeypatch: pytest.MonkeyPatch) -> None:
    """It does not see the end of the pipe, and still has its time."""
    monkeypatch.setattr(pipe_channel, "_FINISH_S", 0.01)
    process = house.begin()
    house.guard.arm("drive", TERMS)
    house.guard.tick("drive", b"go")
    await process.hears(3)
    process.pipe._loop.remove_reader(process.pipe._line)
    await house.guard.finish()
    assert process.is_killed


class StubDoor(GuardAcceptor):
    """One to which a guard comes when it is told to, or never."""

    def __init__(self) -> None:
        self.coming: asyncio.Future[socket.socket] = asyncio.get_running_loop().create_future()
        self.closed = 0

    async def admitted(self) -> socket.socket:
        return await self.coming

    def close(self) -> None:
        self.closed += 1


async def test_guard_comes_to_its_door(house: House, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that does not come is another death; what it is to know it is told when it is in."""
    doors: list[StubDoor] = []
    lines: list[socket.socket] = []

    def launch(*, is_inherited: bool) -> tuple[Process, GuardAcceptor]:
        process, line = house.launch(is_inherited=is_inherited)
        lines.append(line)
        doors.append(StubDoor())
        return process, doors[-1]

    monkeypatch.setattr(pipe_channel, "launch", launch)
    first = house.begin()
    await asyncio.sleep(0)
    doors[0].coming.set_exception(TimeoutError())
    second = await house.nth(2)
    assert first.is_killed
    opening = asyncio.ensure_future(house.guard.transports["wire"].open(BOUND_S))
    await asyncio.sleep(0)
    assert not opening.done()
    doors[1].coming.set_result(lines[1])
    assert await second.hears(2) == [MAKE, messages.OpenLine("wire", 1, BOUND_S)]
    second.pipe.post(messages.LineOpened("wire", 1, "robot:1", {}))
    await opening
    assert first.heard == []
    lines[0].close()


async def test_guard_at_its_door_is_killed_before_it_is_waited_for(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    process, line = house.launch(is_inherited=house.is_inherited)
    waited: list[bool] = []

    async def wait(process: Process) -> None:
        waited.append(process.is_killed)

    monkeypatch.setattr(pipe_channel, "launch", lambda is_inherited: (process, StubDoor()))
    monkeypatch.setattr(pipe_channel, "reap", wait)
    house.guard.start()
    await house.guard.finish()
    assert waited == [True]
    line.close()


async def test_end_waits_for_each_guard_that_died(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, is_last = house.begin(), asyncio.Event()
    gone: list[Process] = []

    async def wait(process: Process) -> None:
        if process is first:
            await is_last.wait()
            await settle()
        is_last.set()
        gone.append(process)

    monkeypatch.setattr(pipe_channel, "reap", wait)
    first.die()
    second = await house.nth(2)
    await house.guard.finish()
    assert gone == [second, first]


async def test_end_does_not_wait_for_a_guard_at_its_door(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    door = StubDoor()
    process, line = house.launch(is_inherited=house.is_inherited)
    monkeypatch.setattr(pipe_channel, "launch", lambda is_inherited: (process, door))
    house.guard.start()
    await house.guard.finish()
    assert (process.is_killed, door.closed) == (True, 1)
    line.close()


async def test_guard_that_falls_silent_is_replaced(
    house: House, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is looked at again and again, as long as it lives."""
    monkeypatch.setattr(pipe_channel, "_LOOK_S", 0.02)
    monkeypatch.setattr(pipe_channel, "standing", lambda pid: ProcessState())
    monkeypatch.setattr(pipe_channel, "_START_LOOKS", 3)
    first = house.begin()
    first.pipe.post(messages.Heartbeat(0.0))
    second = await house.nth(2)
    assert first.is_killed
    await house.nth(3)
    assert second.is_killed, "that one has never spoken"


async def test_guard_that_is_gone_when_it_is_to_be_killed_is_replaced(house: House) -> None:
    process = house.begin()

    def kill() -> None:
        raise ProcessLookupError

    process.kill = kill  # type: ignore[method-assign]
    process.die()
    await house.nth(2)
