"""A line that is kept alive, on a memory transport and a clock that the test moves."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager

import pytest

from urc.model.driver import Backoff, Timeouts
from urc.model.profile import Profile
from urc.model.sequence import WaitStep
from urc.runtime.link import SLICE_BYTES
from urc.runtime.output_buffer import MAX_QUEUED_BYTES
from urc.runtime.session import CommandFailed, Session
from urc.testing.clock import FakeClock, settle
from urc.testing.profile import line_profile
from urc.testing.transport import MemoryTransport, table_of

pytestmark = pytest.mark.anyio

ASK = b"Give me the battery %\n"
SETTINGS = {"host": "robot", "port": 6789}


def says_42(data: bytes) -> Iterable[bytes]:
    """Answer every question, and nothing else."""
    return [b"42\n"] * data.count(ASK)


@asynccontextmanager
async def opened(
    line: MemoryTransport, clock: FakeClock, profile: Profile | None = None
) -> AsyncIterator[Session]:
    """Open a session whose one transport is `line`; the jitter is left out."""
    table = table_of(tcp=line)
    profile = profile or line_profile()
    async with Session(profile, SETTINGS, table, clock=clock, random=lambda: 0.0) as session:
        await clock.advance(0)
        yield session


def state_of(session: Session) -> tuple[str, str]:
    status = session.hub.links["wire"]
    return status.state, status.detail


def value_of(session: Session, signal: str = "battery") -> object:
    sample = session.hub.latest(signal)
    return sample and sample.value


async def test_persistent_line_connects_and_polls_by_itself() -> None:
    """Nobody asks for anything, and the hub has the reading, with the time of its arrival."""
    clock, line = FakeClock(), MemoryTransport(answer=says_42)
    async with opened(line, clock) as session:
        assert value_of(session) == 42
        assert state_of(session) == ("live", "")
        await clock.advance(3)
        assert line.sent == [ASK] * 4
        assert line.opens == 1
    assert not line.is_open


async def test_line_per_request_is_opened_and_closed_for_each() -> None:
    """The state stays live between two requests, though nothing is connected."""
    clock, line = FakeClock(), MemoryTransport(answer=says_42)
    async with opened(line, clock, line_profile(is_per_request=True)) as session:
        await clock.advance(2.5)
        assert (line.opens, line.sent, line.is_open) == (3, [ASK] * 3, False)
        assert state_of(session) == ("live", "")
        assert [note.text for note in session.hub.notes] == [
            "connecting to memory",
            "live",
        ]


async def test_refused_line_is_tried_again_with_growing_waits() -> None:
    """Waits double from 0.25 s to 5 s; the state is told once, the attempts are counted."""
    clock, line = FakeClock(), MemoryTransport(answer=says_42)
    line.refuse("nothing listens", times=9)
    begin_s, times = clock.now(), []
    async with opened(line, clock) as session:
        while line.opens < 10:
            before = line.opens
            await clock.advance(0.25)
            times += [clock.now() - begin_s] * (line.opens - before)
            if line.opens == 5:
                assert state_of(session) == ("lost", "nothing listens")
                assert session.hub.links["wire"].attempts == 5
        assert times == [0.25, 0.75, 1.75, 3.75, 7.75, 12.75, 17.75, 22.75, 27.75]
        assert state_of(session) == ("live", "")
        assert session.hub.links["wire"].attempts == 0
        assert len(session.hub.notes) == 3


async def test_waits_have_jitter() -> None:
    """A share of each wait is taken off at random, so that not all clients call at once."""
    clock, line = FakeClock(), MemoryTransport()
    line.refuse(times=2)
    profile = line_profile(backoff=Backoff(initial_s=1.0, jitter=0.5))
    session = Session(profile, SETTINGS, table_of(tcp=line), clock=clock, random=lambda: 0.5)
    async with session:
        await clock.advance(0.74)
        assert line.opens == 1
        await clock.advance(0.02)
        assert line.opens == 2


async def test_wait_for_the_guard_is_not_taken_for_a_silent_robot() -> None:
    """The limit for a connection attempt begins when the transport is ready."""

    class Waiting(MemoryTransport):
        is_ready = asyncio.Event()

        async def ready(self) -> None:
            await self.is_ready.wait()

    clock, line = FakeClock(), Waiting(answer=says_42)
    async with opened(line, clock, line_profile(timeouts=Timeouts(connect_s=3.0))) as session:
        await clock.advance(30)
        assert state_of(session) == ("connecting", "")
        line.is_ready.set()
        await clock.advance(0)
        assert state_of(session) == ("live", "")
        assert [note.text for note in session.hub.notes] == ["connecting to memory", "live"]


@pytest.mark.parametrize("is_per_request", [False, True])
async def test_robot_that_closes_at_once_is_not_hammered(is_per_request: bool) -> None:
    """To be accepted is no success: only a good frame resets the waits."""
    clock = FakeClock()

    class Closer(MemoryTransport):
        async def open(self, timeout_s: float) -> None:
            await super().open(timeout_s)
            self.hang_up()

    line = Closer()
    async with opened(line, clock, line_profile(is_per_request=is_per_request)) as session:
        await clock.advance(60)
        assert 10 <= line.opens <= 18
        assert state_of(session) == ("lost", "the robot closed the connection")
        assert session.hub.links["wire"].attempts == line.opens
        assert len(session.hub.notes) < 10


async def test_robot_that_says_one_thing_and_closes_floods_no_log() -> None:
    """It is called again soon, as it has proved itself, but its coming and going is told seldom."""
    clock = FakeClock()

    class Flapper(MemoryTransport):
        async def open(self, timeout_s: float) -> None:
            await super().open(timeout_s)
            self.feed(b"note hello\n")
            self.hang_up()

    line = Flapper()
    async with opened(line, clock) as session:
        await clock.advance(60)
        assert 200 < line.opens < 250
        assert len(session.hub.notes) < 25
        assert "more like it" in session.hub.notes[-1].text


async def test_silent_robot_is_shown_and_called_anew() -> None:
    """Accepted and never answered: silent, and after some answers overdue a fresh connection."""
    clock, line = FakeClock(), MemoryTransport()
    async with opened(line, clock) as session:
        await clock.advance(1)
        assert state_of(session)[0] == "connecting"
        await clock.advance(1.5)
        assert state_of(session) == ("silent", "no answer to polls.0 within 2 s")
        await clock.advance(20)
        assert line.opens > 1
        assert state_of(session)[0] == "silent"
        assert session.hub.links["wire"].faults >= 3
        line.feed(b"note I am back\n")
        await settle()
        assert state_of(session) == ("live", "")


async def test_robot_that_is_asked_nothing_and_says_nothing_any_more_is_silent() -> None:
    """Its line says how long it may be; with the next frame it is live again."""
    clock, line = FakeClock(), MemoryTransport()
    profile = line_profile()
    wire = profile.driver.transports["wire"]._replace(stale_after_s=2.0)
    driver = profile.driver._replace(transports={"wire": wire}, polls=())
    async with opened(line, clock, profile._replace(driver=driver)) as session:
        line.feed(b"note hello\n")
        await clock.advance(1.9)
        assert state_of(session) == ("live", "")
        await clock.advance(0.2)
        assert state_of(session) == ("silent", "nothing received for 2 s")
        texts = [note.text for note in session.hub.notes if "nothing received" in note.text]
        assert texts == ["silent: nothing received for 2 s"], "told once"
        line.feed(b"note I am back\n")
        await settle()
        assert state_of(session) == ("live", "")


async def test_silent_robot_that_then_refuses_is_lost() -> None:
    """Silent means connected; a refused connection is not."""
    clock, line = FakeClock(), MemoryTransport()
    async with opened(line, clock, line_profile(is_per_request=True)) as session:
        await clock.advance(2.5)
        assert state_of(session)[0] == "silent"
        line.refuse("nothing listens", times=100)
        await clock.advance(10)
        assert state_of(session) == ("lost", "nothing listens")


async def test_broken_line_comes_back_by_itself() -> None:
    """The robot is killed and started again; polls go on without anybody's help."""
    clock, line = FakeClock(), MemoryTransport(answer=says_42)
    async with opened(line, clock) as session:
        line.refuse("nothing listens", times=3)
        line.hang_up()
        await clock.advance(1)
        assert state_of(session) == ("lost", "nothing listens")
        sent = len(line.sent)
        await clock.advance(5)
        assert state_of(session) == ("live", "")
        assert len(line.sent) > sent


async def test_open_that_breaks_its_promise_is_given_up() -> None:
    """A transport that does not come back in time is no reason to wait for ever."""
    clock, line = FakeClock(), MemoryTransport(answer=says_42)
    line.stall_open = True
    async with opened(line, clock) as session:
        await clock.advance(4.5)
        assert state_of(session) == ("lost", "no answer from memory within 3 s")
        line.stall_open = False
        await clock.advance(10)
        assert state_of(session) == ("live", "")


async def test_foreign_exception_of_a_transport_is_a_lost_line() -> None:
    """A transport of somebody else may raise what it likes; the session lives on."""
    clock = FakeClock()

    class Buggy(MemoryTransport):
        async def receive(self) -> bytes:
            raise ZeroDivisionError("oops")

    async with opened(Buggy(), clock) as session:
        await clock.advance(1)
        expected = "the transport failed in an unexpected way (ZeroDivisionError: oops)"
        assert state_of(session) == ("lost", expected)


async def test_commands_of_one_turn_are_one_write() -> None:
    """Joined writes cost a tenth of single ones."""
    clock, line = FakeClock(), MemoryTransport()
    async with opened(line, clock, line_profile(every_s=None)) as session:
        async with asyncio.TaskGroup() as group:
            for word in "abc":
                group.create_task(session.command("say", {"word": word}))
        await settle()
        assert line.sent == [b"say a\nsay b\nsay c\n"]


async def test_robot_that_takes_no_bytes_is_given_up() -> None:
    """What waits is bounded: commands are refused by name, then the line is opened anew."""
    clock, line = FakeClock(), MemoryTransport()
    async with opened(line, clock, line_profile(every_s=None)) as session:
        line.stall_sends()
        word = "x" * 10_000
        asked = [session.command("say", {"word": word}) for _ in range(100)]
        answers = await asyncio.gather(*asked, return_exceptions=True)
        refused = [answer for answer in answers if isinstance(answer, CommandFailed)]
        assert {answer.code for answer in refused} == {"queue-full"}
        assert 0 < (len(answers) - len(refused)) * len(word) <= MAX_QUEUED_BYTES
        await clock.advance(5.01)
        assert state_of(session) == ("lost", "the robot has accepted no bytes for 5 s")
        line.stall_sends(False)
        await clock.advance(5)
        assert line.opens == 2
        await session.command("say", {"word": "again"})
        await settle()
        assert line.sent[-1] == b"say again\n"


async def test_bytes_of_a_command_leave_before_the_line_is_closed() -> None:
    """A command without a reply, on a line for each request, is written before the end."""
    clock, line = FakeClock(), MemoryTransport()
    profile = line_profile(is_per_request=True, every_s=None)
    async with opened(line, clock, profile) as session:
        done = asyncio.create_task(session.command("say", {"word": "bye"}))
        await clock.advance(0)
        await done
        assert (line.sent, line.is_open) == ([b"say bye\n"], False)
        assert state_of(session) == ("live", "")


async def test_two_requests_have_two_connections() -> None:
    """The second connection is opened when the first is closed, in the order asked for."""
    clock, line = FakeClock(), MemoryTransport(answer=says_42)
    profile = line_profile(is_per_request=True, every_s=None)
    async with opened(line, clock, profile) as session:
        asked = [asyncio.create_task(session.command("ask")) for _ in range(2)]
        await clock.advance(0)
        assert [task.result().values for task in asked] == [{"battery": 42}] * 2
        assert line.opens == 2


async def test_readings_of_one_chunk_reach_the_hub_in_one_go() -> None:
    """Readers are woken once a chunk, however many frames it holds."""
    clock, line = FakeClock(), MemoryTransport()
    async with opened(line, clock, line_profile(every_s=None)) as session:
        line.feed(b"note a\n")
        await settle()
        before = session.hub.revision
        line.feed(b"note b\nnote c\nnote d\n")
        await settle()
        assert session.hub.revision == before + 1
        assert value_of(session, "note") == "d"


async def test_garbage_is_counted_and_told_seldom() -> None:
    """A thousand bad frames are a thousand faults and a handful of lines."""
    clock, line = FakeClock(), MemoryTransport()
    async with opened(line, clock, line_profile(every_s=None)) as session:
        line.feed(*[b"\xff\xfe rubbish\n"] * 1000)
        for _ in range(10):
            await settle()
        assert session.hub.links["wire"].faults == 1000
        notes = [note for note in session.hub.notes if note.level == "warning"]
        assert len(notes) == 4


async def test_flood_leaves_the_loop_to_others() -> None:
    """Others have their turn after every slice of what a robot sends."""
    clock, line = FakeClock(), MemoryTransport()
    async with opened(line, clock, line_profile(every_s=None)) as session:
        line.feed(b"note x\n" * 100_000)
        turns = 0
        while value_of(session, "note") is None or session.hub.revision < 100:
            await asyncio.sleep(0)
            turns += 1
            assert turns < 1000
        assert turns > 50
    assert SLICE_BYTES <= 4096


async def test_traffic_is_recorded_only_while_somebody_watches() -> None:
    """Both directions, as they were handed over."""
    clock, line = FakeClock(), MemoryTransport(answer=says_42)
    async with opened(line, clock) as session:
        assert not session.hub.traffic
        session.hub.traffic_watchers += 1
        await clock.advance(1)
        seen = [(entry.direction, entry.data) for entry in session.hub.traffic]
        assert seen == [("sent", ASK), ("received", b"42\n")]


async def test_idle_line_is_opened_anew() -> None:
    """A robot that must talk and does not is called again after `timeouts.idle`."""
    clock, line = FakeClock(), MemoryTransport()
    profile = line_profile(every_s=None, timeouts=Timeouts(idle_s=4))
    async with opened(line, clock, profile) as session:
        await clock.advance(3)
        line.feed(b"note a\n")
        await clock.advance(3.5)
        assert line.opens == 1
        await clock.advance(0.6)
        assert state_of(session) == ("lost", "nothing received for 4 s; reconnecting")
        await clock.advance(1)
        assert line.opens == 2


async def test_closing_the_session_leaves_nothing_behind() -> None:
    """No open line, no task, and every command that waits is answered."""
    clock, line = FakeClock(), MemoryTransport()
    before = asyncio.all_tasks()
    async with opened(line, clock, line_profile(every_s=None)) as session:
        waiting = asyncio.create_task(session.command("ask"))
        await settle()
    with pytest.raises(CommandFailed, match="the session was closed"):
        await waiting
    assert asyncio.all_tasks() == before
    assert not line.is_open
    with pytest.raises(CommandFailed, match="the session is closed"):
        await session.command("ask")


async def test_error_of_the_block_passes_as_it_is() -> None:
    """A failed command inside `async with` is caught as itself, not inside a group."""
    with pytest.raises(CommandFailed) as failed:
        async with opened(MemoryTransport(), FakeClock()) as session:
            await session.command("nix")
    assert failed.value.code == "unknown-command"


FAILURES: list[tuple[str, Callable[[MemoryTransport], None], float, str]] = [
    ("no answer", lambda line: None, 3, "timed-out"),
    ("hangs up", lambda line: line.hang_up(), 0.1, "disconnected"),
]


@pytest.mark.parametrize(("name", "act", "wait_s", "code"), FAILURES)
async def test_command_fails_with_a_code(
    name: str, act: Callable[[MemoryTransport], None], wait_s: float, code: str
) -> None:
    """One request, one answer, within a bounded time."""
    clock, line = FakeClock(), MemoryTransport()
    async with opened(line, clock, line_profile(every_s=None)) as session:
        waiting = asyncio.create_task(session.command("ask"))
        await settle()
        act(line)
        await clock.advance(wait_s)
        with pytest.raises(CommandFailed) as failed:
            await waiting
        assert failed.value.code == code


async def test_operator_tries_a_lost_line_at_once_and_cannot_flood_the_robot() -> None:
    """The backoff is left out once a second at most, and grows on as before."""
    clock, line = FakeClock(), MemoryTransport(answer=says_42)
    line.refuse("nothing listens", times=9)
    async with opened(line, clock) as session:
        await clock.advance(3.75)
        assert line.opens == 5  # the next attempt would be after 4 s
        session.reconnect()
        await clock.advance(0)
        assert line.opens == 6
        session.reconnect()
        await clock.advance(0.9)
        assert line.opens == 6
        session.reconnect()
        await clock.advance(0.1)
        session.reconnect()
        await clock.advance(0)
        assert line.opens == 7
        line.refuse(times=0)


async def test_a_good_line_is_left_alone_by_a_request_to_try_it() -> None:
    clock, line = FakeClock(), MemoryTransport(answer=says_42)
    async with opened(line, clock) as session:
        session.reconnect()
        await clock.advance(1)
        assert (line.opens, state_of(session)) == (1, ("live", ""))


async def test_a_session_cancelled_during_its_goodbye_leaves_no_connection() -> None:
    """A link that stays would connect to the robot again, with nobody to close it."""
    profile = line_profile()
    wire = profile.driver.transports["wire"]
    slow = wire._replace(on_close=(WaitStep(1.0),))
    profile = profile._replace(driver=profile.driver._replace(transports={"wire": slow}))
    clock, line = FakeClock(), MemoryTransport(answer=says_42)
    before = asyncio.all_tasks()
    is_leaving = asyncio.Event()

    async def use() -> None:
        async with opened(line, clock, profile):
            is_leaving.set()

    using = asyncio.create_task(use())
    await is_leaving.wait()
    await settle()
    assert line.is_open
    using.cancel()
    await clock.advance(0)
    assert using.cancelled()
    assert not line.is_open
    assert asyncio.all_tasks() == before
