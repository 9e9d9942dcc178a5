"""What the guard says of a line, message by message, and in which order things go out."""

import asyncio
from collections.abc import AsyncIterator

import pytest

from tests.unit.guard.lines import STOP, TERMS, Bench, CountedWire, GatedWire, Prompter, Wire
from urc.guard import messages
from urc.guard.guarded_connection import WINDOW_BYTES
from urc.model.payload import Envelope
from urc.testing.clock import settle
from urc.transports.base import PeerClosed, TransportError

pytestmark = pytest.mark.anyio

HELLO = Envelope("publish", {"topic": "/hello"}, {"x": 1})


@pytest.fixture
async def benches() -> AsyncIterator[list[Bench]]:
    made: list[Bench] = []
    yield made
    for bench in made:
        finishing = asyncio.ensure_future(bench.host.finish())
        while not finishing.done():
            await bench.clock.advance(0.1)


@pytest.fixture
async def bench(benches: list[Bench]) -> Bench:
    benches.append(Bench(Prompter()))
    await benches[-1].open()
    return benches[-1]


def send(number: int, data: bytes | Envelope, turn: int = 1) -> messages.SendBytes:
    return messages.SendBytes("wire", turn, number, data)


async def test_what_is_taken_at_once_is_told_once(bench: Bench) -> None:
    """Of all that came together the newest number stands for the others."""
    bench.tell(send(1, b"a"), send(2, b"b"))
    assert bench.robot.written == [b"a", b"b"]
    assert bench.heard() == [messages.SendDone("wire", 1, 2)]
    bench.tell(messages.FlowCredit("wire", 1, 1))
    assert bench.heard() == []


async def test_what_has_to_wait_is_told_when_it_is_out(bench: Bench) -> None:
    """And nothing overtakes it."""
    robot = bench.robot
    assert isinstance(robot, Prompter)
    robot.is_prompt = False
    bench.tell(send(1, b"a"))
    robot.is_prompt = True
    bench.tell(send(2, b"b"), send(3, HELLO))
    await settle()
    assert (robot.written, bench.heard()) == ([], [])
    robot.let_through(2)
    await settle()
    assert robot.written == [b"a", b"b"]
    assert bench.heard() == [messages.SendDone("wire", 1, 1), messages.SendDone("wire", 1, 2)]
    robot.let_through()
    await settle()
    assert robot.written == [b"a", b"b", HELLO]
    assert bench.heard() == [messages.SendDone("wire", 1, 3)]


async def test_clogged_line_is_waited_for(bench: Bench) -> None:
    """It has taken the bytes; whoever sent them goes on when the line is free."""
    robot = bench.robot
    assert isinstance(robot, Prompter)
    robot.is_clogged = True
    bench.tell(send(1, b"a"))
    await settle()
    assert (robot.written, bench.heard()) == ([b"a"], [])
    robot.let_through()
    await settle()
    assert robot.written == [b"a", b""]
    assert bench.heard() == [messages.SendDone("wire", 1, 1)]


async def test_stop_goes_before_what_waits_and_behind_what_moves(bench: Bench) -> None:
    robot = bench.robot
    assert isinstance(robot, Prompter)
    bench.tell(messages.ArmControl("wire", "drive", TERMS))
    robot.is_prompt = False
    bench.tick(b"go 1")
    bench.tell(send(1, b"hello"))
    robot.is_prompt = True
    bench.tell(messages.ReleaseControl("drive"))
    bench.tell(send(2, b"again"))
    robot.let_through(9)
    await settle()
    assert robot.written == [b"go 1", STOP, b"hello", b"again"]


async def test_message_waits_behind_motion(bench: Bench) -> None:
    """An envelope is never offered as bytes are."""
    robot = bench.robot
    assert isinstance(robot, Prompter)
    bench.tell(messages.ArmControl("wire", "drive", TERMS), send(1, HELLO))
    bench.tick(b"go 1")
    assert robot.written == [b"go 1"]
    robot.let_through()
    await settle()
    assert robot.written == [b"go 1", HELLO]


async def test_what_cannot_be_sent_is_told(benches: list[Bench]) -> None:
    """And whether the line is gone with it."""

    class Refusing(Wire):
        fault: TransportError | Exception = TransportError("too long")

        async def send(self, data: object) -> None:
            raise self.fault

    robot = Refusing()
    benches.append(bench := Bench(robot))
    await bench.open()
    for number, fault in enumerate((robot.fault, PeerClosed("gone"), KeyError("bug")), 1):
        robot.fault = fault
        bench.tell(send(number, b"a"))
        await settle()
    strange = "the transport failed in an unexpected way (KeyError: 'bug')"
    assert bench.heard() == [
        messages.SendRefused("wire", 1, 1, "too long", is_closed=False),
        messages.SendRefused("wire", 1, 2, "gone", is_closed=True),
        messages.SendRefused("wire", 1, 3, strange, is_closed=True),
    ]


async def test_earlier_connection_is_nobodys(bench: Bench) -> None:
    bench.tell(messages.CloseLine("wire", 1))
    await settle()
    assert bench.heard() == [messages.LineClosed("wire", 1)]
    bench.tell(send(1, b"late"))
    await bench.open(2)
    bench.tell(send(2, b"old", turn=1), send(1, b"new", turn=2))
    assert bench.robot.written == [b"new"]
    assert bench.heard() == [messages.SendDone("wire", 2, 1)]
    bench.tell(messages.CloseLine("wire", 1))
    await settle()
    assert bench.heard() == [messages.LineClosed("wire", 1)]
    assert bench.robot.is_open


async def test_what_arrives_is_passed_on(bench: Bench) -> None:
    """What has just come goes by no task, where one waits for it and nothing comes before it."""
    robot = bench.robot
    assert isinstance(robot, Prompter)
    assert robot.sink is not None
    assert robot.sink(b"at once")
    robot.arriving.put_nowait(b"in turn")
    await settle()
    assert bench.heard() == [
        messages.BytesReceived("wire", 1, b"at once"),
        messages.BytesReceived("wire", 1, b"in turn"),
    ]


async def test_robot_is_not_read_while_the_engine_takes_nothing(bench: Bench) -> None:
    """And nothing is lost, or comes out of its order."""
    robot = bench.robot
    assert isinstance(robot, Prompter)
    assert robot.sink is not None
    robot.arriving.put_nowait(b"x" * WINDOW_BYTES)
    robot.arriving.put_nowait(b"y")
    await settle()
    assert len(bench.heard()) == 1
    assert not robot.sink(b"z")
    bench.tell(messages.FlowCredit("wire", 2, 100), messages.FlowCredit("wire", 0, 100))
    await settle()
    assert bench.heard() == []
    bench.tell(messages.FlowCredit("wire", 1, 1))
    await settle()
    assert bench.heard() == [messages.BytesReceived("wire", 1, b"y")]
    robot.arriving.put_nowait(b"z")
    await settle()
    assert bench.heard() == []
    bench.tell(messages.FlowCredit("wire", 1, 2))
    await settle()
    assert bench.heard() == [messages.BytesReceived("wire", 1, b"z")]


async def test_what_the_engine_may_be_behind_is_bounded_to_the_byte(bench: Bench) -> None:
    """However it arrives; what was too much is made up for before anything else comes."""
    robot = bench.robot
    assert isinstance(robot, Prompter)
    assert robot.sink is not None
    assert robot.sink(b"x" * (WINDOW_BYTES - 1))
    assert robot.sink(b"y")
    assert not robot.sink(b"z")
    robot.arriving.put_nowait(b"in turn")
    robot.arriving.put_nowait(b"later")
    await settle()
    assert len(bench.heard()) == 3, "it was waited for already"
    bench.tell(messages.FlowCredit("wire", 1, 5), messages.FlowCredit("wire", 1, 2))
    await settle()
    assert bench.heard() == []
    bench.tell(messages.FlowCredit("wire", 1, 1))
    await settle()
    assert bench.heard() == [messages.BytesReceived("wire", 1, b"later")]


async def test_engine_is_told_whether_the_robot_has_sent_anything(benches: list[Bench]) -> None:
    """Where the transport counts it; the first envelope of a connection is always new."""

    class Counting(Wire):
        count = 7

        def arrivals(self) -> int:
            return self.count

    robot = Counting()
    benches.append(bench := Bench(robot))
    envelopes = [Envelope("message", {"topic": "a"}, at) for at in range(4)]
    bench.host._lines["wire"]._emit = lambda said: bench.said.append(said) or 1  # type: ignore[func-returns-value]
    await bench.open()
    for at, envelope in enumerate(envelopes):
        robot.count += at == 2
        robot.arriving.put_nowait(envelope)
        await settle()
    new = [said.is_new for said in bench.heard() if isinstance(said, messages.BytesReceived)]
    assert new == [True, False, True, False]


async def test_end_of_a_line_is_told_in_the_robots_words(bench: Bench) -> None:
    bench.robot.cut("cable pulled")
    await settle()
    assert bench.heard() == [messages.LineLost("wire", 1, "cable pulled")]
    assert not bench.robot.is_open
    await bench.open(2)


async def test_bug_of_a_transport_ends_its_line(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def broken() -> bytes:
        raise KeyError("bug")

    monkeypatch.setattr(bench.robot, "receive", broken)
    bench.robot.arriving.put_nowait(b"last")
    await settle()
    strange = "the transport failed in an unexpected way (KeyError: 'bug')"
    assert bench.heard() == [
        messages.BytesReceived("wire", 1, b"last"),
        messages.LineLost("wire", 1, strange),
    ]


async def test_body_that_no_message_carries_ends_the_line(
    benches: list[Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    benches.append(bench := Bench(Wire()))

    def refuse(said: messages.FromGuard) -> int:
        bench.said.append(said)
        if isinstance(said, messages.BytesReceived):
            raise TypeError("a set")
        return 0

    monkeypatch.setattr(bench.host._lines["wire"], "_emit", refuse)
    await bench.open()
    bench.robot.arriving.put_nowait(b"strange")
    await settle()
    assert bench.heard()[1:] == [
        messages.LineLost("wire", 1, "the received data cannot be passed on (a set)")
    ]


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (None, "nothing listens"),
        (KeyError("bug"), "the transport failed in an unexpected way (KeyError: 'bug')"),
    ],
)
async def test_refusal_is_told(benches: list[Bench], fault: Exception | None, words: str) -> None:
    benches.append(bench := Bench(Wire()))
    if fault is None:
        bench.robot.refusal = words
    else:

        async def broken(timeout_s: float) -> None:
            raise fault

        bench.robot.open = broken  # type: ignore[method-assign]
    bench.tell(messages.OpenLine("wire", 3, 1.0))
    await settle()
    assert bench.heard() == [messages.OpenFailed("wire", 3, words)]


async def test_line_at_rest_is_closed_at_once(benches: list[Bench]) -> None:
    """Nothing is in doubt, so nothing is waited for, and nothing is reset."""
    for robot in (CountedWire(), Prompter(), Wire()):
        benches.append(bench := Bench(robot))
        await bench.drive()
        bench.tell(messages.ReleaseControl("drive"))
        await settle()
        assert robot.written == [b"go 1", STOP]
        bench.heard()
        bench.tell(messages.CloseLine("wire", 1))
        await settle()
        assert bench.heard()[-1:] == [messages.LineClosed("wire", 1)], type(robot)
        assert not robot.is_open
        assert robot.aborts == 0


async def test_closing_stops_at_once_and_repeats_it_where_it_may_be_lost(
    benches: list[Bench],
) -> None:
    """Within the time of the repeats; a tick meanwhile moves nothing."""
    benches.append(bench := Bench(CountedWire()))
    await bench.drive(TERMS._replace(is_lossy=True))
    bench.tell(messages.ArmControl("wire", "turn", TERMS._replace(stop=b"halt")))
    bench.tell(messages.CloseLine("wire", 1))
    assert bench.robot.written == [b"go 1", STOP]
    assert bench.heard() == [messages.StopWritten("drive", "revoked", 1)]
    for control in ("turn", "drive"):
        bench.tick(b"go on", control=control, number=2)
    await bench.clock.advance(0.3)
    assert bench.robot.is_open
    await bench.clock.advance(0.4)
    assert bench.robot.written == [b"go 1"] + [STOP] * 11
    assert not bench.robot.is_open


@pytest.mark.parametrize("is_lossy", [False, True])
async def test_end_of_the_guard_waits_for_what_is_to_be_repeated(is_lossy: bool) -> None:
    bench = Bench(CountedWire())
    await bench.drive(TERMS._replace(is_lossy=is_lossy))
    finishing = asyncio.ensure_future(bench.host.finish())
    await bench.clock.advance(0.05)
    assert bench.robot.written[:2] == [b"go 1", STOP]
    assert bench.robot.is_open is is_lossy
    await bench.clock.advance(1.0)
    await finishing
    assert bench.robot.written == [b"go 1"] + [STOP] * (11 if is_lossy else 1)
    assert not bench.robot.is_open


async def test_end_of_the_guard_does_not_wait_for_ever() -> None:
    bench = Bench(GatedWire(), stalled_s=9.0)
    await bench.drive()
    finishing = asyncio.ensure_future(bench.host.finish())
    await bench.clock.advance(1.9)
    assert not finishing.done()
    await bench.clock.advance(0.2)
    await finishing
    assert not bench.robot.is_open
