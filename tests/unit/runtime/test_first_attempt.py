"""Commands that come while a line is connected for the first time, and STOP meanwhile."""

import asyncio

import pytest

from tests.unit.runtime.test_link import SETTINGS
from urc.model.driver import Command
from urc.model.sequence import RunStep
from urc.runtime.session import CommandFailed, Session
from urc.testing.clock import FakeClock, settle
from urc.testing.profile import line_profile
from urc.testing.transport import MemoryTransport, table_of

pytestmark = pytest.mark.anyio


class SlowLine(MemoryTransport):
    """It is connected when the test says so."""

    def __init__(self) -> None:
        super().__init__()
        self.is_there = asyncio.Event()

    async def open(self, timeout_s: float) -> None:
        """Wait."""
        await self.is_there.wait()
        await super().open(timeout_s)


async def test_what_moves_and_waits_for_the_first_connection_is_not_sent_after_a_stop() -> None:
    """Also when it was reset before the line is there; what does not move is sent."""
    profile = line_profile(every_s=None)
    say = profile.driver.commands["say"]
    commands = {"say": say, "go": say._replace(name="go", moves=True)}
    profile = profile._replace(driver=profile.driver._replace(commands=commands))
    clock, line = FakeClock(), SlowLine()
    table = table_of(tcp=line)
    async with Session(profile, SETTINGS, table, clock=clock, random=lambda: 0.0) as session:
        moving = asyncio.create_task(session.command("go", {"word": "on"}))
        saying = asyncio.create_task(session.command("say", {"word": "hello"}))
        await settle()
        session.latch("stopped by ann")
        session.latch("")
        line.is_there.set()
        await clock.advance(0.1)
        with pytest.raises(CommandFailed, match="STOP was pressed meanwhile"):
            await moving
        await saying
        assert line.sent == [b"say hello\n"]


async def test_a_sequence_waits_for_the_first_connection_of_every_line_it_talks_on() -> None:
    """Of each command that it runs, too: it names no line of its own."""
    profile = line_profile(every_s=None)
    driver = profile.driver
    wire, say = driver.transports["wire"], driver.commands["say"]
    away = wire._replace(name="away", type="udp")
    word = {"word": "hello"}
    driver = driver._replace(
        transports={"wire": wire, "away": away},
        commands={
            "say": say,
            "call": say._replace(name="call", transport="away"),
            "both": Command(
                "both", "", say.send, steps=(RunStep("say", word), RunStep("call", word))
            ),
        },
    )
    clock, near, far = FakeClock(), MemoryTransport(), SlowLine()
    table = table_of(tcp=near, udp=far)
    profile = profile._replace(driver=driver)
    async with Session(profile, SETTINGS, table, clock=clock, random=lambda: 0.0) as session:
        both = asyncio.create_task(session.command("both", {}))
        await clock.advance(0.5)
        assert not both.done()
        far.is_there.set()
        await clock.advance(0.1)
        await both
    assert (near.sent, far.sent) == ([b"say hello\n"], [b"say hello\n"])
