"""Whatever an engine does, the session lives and its timer goes on."""

import asyncio
from collections.abc import Sequence

import pytest

from urc.protocol.events import (
    Event,
    Failed,
    MotionRefused,
    NumbersUsed,
    Replied,
    Request,
    Send,
    Violation,
)
from urc.runtime.dispatcher import MAX_WAITING, Dispatcher
from urc.runtime.hub import Hub
from urc.testing.clock import FakeClock

pytestmark = pytest.mark.anyio


class BrokenEngine:
    """Raises in every verb, and always wants to be called at once."""

    calm_s = 0.0

    def __init__(self) -> None:
        self.calls = 0

    @property
    def deadline(self) -> float:
        return float("-inf")

    def start(self, transport: str, now: float) -> Sequence[Event]:
        raise ZeroDivisionError

    def closed(self, transport: str, reason: str, now: float) -> Sequence[Event]:
        raise ZeroDivisionError

    def receive(
        self, transport: str, data: bytes, now: float, *, is_new: bool = True
    ) -> Sequence[Event]:
        raise ZeroDivisionError

    def command(self, request: Request, now: float) -> Sequence[Event]:
        return []

    def tick(self, now: float) -> Sequence[Event]:
        self.calls += 1
        raise ZeroDivisionError


class GreedyEngine(BrokenEngine):
    """Wants to be called at once, again and again, and never has anything to say."""

    def tick(self, now: float) -> Sequence[Event]:
        self.calls += 1
        return []


class Port:
    """Records what it is asked for."""

    is_full = False

    def __init__(self) -> None:
        self.reasons: list[str] = []

    def want_open(self) -> None: ...

    def want_close(self, reason: str) -> None: ...

    def queue(self, data: bytes, *, is_secret: bool = False) -> None: ...

    def send(self, data: bytes, *, is_secret: bool = False) -> None: ...

    def heard(self) -> None: ...

    def count(self, fault: Violation) -> None: ...

    def publish(self) -> None: ...

    def hang_up(self, reason: str) -> None:
        self.reasons.append(reason)


def limit_s(command: str) -> float:
    return 10.0


async def test_mistake_in_the_engine_is_told_and_the_line_begun_anew() -> None:
    """Our own bug is one error line, not the end of the session, and the timer goes on slowly."""
    clock, hub, engine, port = FakeClock(), Hub({}), BrokenEngine(), Port()
    dispatcher = Dispatcher(engine, hub, clock, {}, limit_s)
    dispatcher.attach("wire", port)
    dispatcher.start("wire")
    expected = "internal error (ZeroDivisionError): please report it with the log"
    assert [(note.level, note.text) for note in hub.notes] == [("error", expected)]
    assert port.reasons == [expected]
    dispatcher.wind_up()
    await clock.advance(3)
    assert 2 <= engine.calls <= 4


async def test_engine_that_is_always_due_does_not_hold_the_loop() -> None:
    """Ticks that leave work overdue come at most a thousand times a second."""
    clock, engine = FakeClock(), GreedyEngine()
    dispatcher = Dispatcher(engine, Hub({}), clock, {}, limit_s)
    dispatcher.wind_up()
    await clock.advance(0.1)
    assert 50 < engine.calls <= 102


async def test_events_of_motion_are_handed_on_in_their_order() -> None:
    """Stops with the numbers after a frame go to the guard before the frame does."""
    engine, port, told = GreedyEngine(), Port(), list[object]()
    events = [NumbersUsed("wire"), Send("wire", b"7 ping"), MotionRefused("wire", "drive", "no")]
    engine.start = lambda transport, now: events  # type: ignore[method-assign]
    port.send = told.append  # type: ignore[method-assign, assignment]
    dispatcher = Dispatcher(engine, Hub({}), FakeClock(), {}, limit_s, motion=told.append)
    dispatcher.attach("wire", port)
    dispatcher.start("wire")
    assert told == events


async def test_waiting_commands_are_bounded() -> None:
    """One more than may wait is refused at once; a stop fails all that wait."""
    dispatcher = Dispatcher(GreedyEngine(), Hub({}), FakeClock(), {}, limit_s)
    waiting = [dispatcher.command(Request(n, "ask")) for n in range(MAX_WAITING)]
    refused = await dispatcher.command(Request(MAX_WAITING, "ask"))
    assert isinstance(refused, Failed)
    assert refused.code == "queue-full"
    dispatcher.stop("over")
    answers = await asyncio.gather(*waiting)
    assert {type(answer) for answer in answers} == {Failed}
    assert not any(isinstance(answer, Replied) for answer in answers)
