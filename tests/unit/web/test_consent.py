"""Questions before a command, as the server sees them: who was asked, and who said yes."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from tests.unit.web.test_client import FakeLine
from urc.model.codec import WriteSpec
from urc.model.driver import Command
from urc.model.flow import Confirm
from urc.motion.lease import Role
from urc.runtime.audit import Entry
from urc.runtime.trail import Trail
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.consent import WAIT_S
from urc.web.robots import Robot, Station
from urc.web.socket import Client, Guest

pytestmark = pytest.mark.anyio

DOCK = Command("dock", "wire", WriteSpec("text"), confirm=Confirm("normal", "Dock now?"))
BEAM = Command(
    "beam",
    "wire",
    WriteSpec("text"),
    title="Beam",
    confirm=Confirm("hazardous", "The beam goes on", is_two_person=True),
)


class Screens:
    """Some screens that look at one robot."""

    def __init__(self, station: Station, robot: FakeRobot, clock: FakeClock) -> None:
        self.station, self.robot, self.clock = station, robot, clock
        self.audit: list[Entry] = []
        self.lines: list[FakeLine] = []
        self._tasks: list[asyncio.Task[None]] = []

    async def come(self, role: Role = "driver") -> FakeLine:
        """Let one more look."""
        line = FakeLine()
        self.lines.append(line)
        client = Client(line, self.station, line, Guest("", role))
        self._tasks.append(asyncio.create_task(client.serve()))
        await settle()
        return line

    async def end(self) -> None:
        """Let all go."""
        for line in self.lines:
            line.leave()
        await settle()
        for task in self._tasks:
            task.cancel()


@asynccontextmanager
async def screens() -> AsyncIterator[Screens]:
    """Serve a robot with questions."""
    clock = FakeClock()
    commands = {"dock": DOCK, "beam": BEAM}
    robot = FakeRobot(dashboard_profile(commands=commands), clock)
    audit: list[Entry] = []
    trail = Trail("puppet", audit.append, utc=lambda: 99.0)
    station = Station(Robot(robot.profile, {}, robot.open), clock=clock, trail=trail)
    running = asyncio.create_task(station.run())
    made = Screens(station, robot, clock)
    made.audit = audit
    try:
        yield made
    finally:
        await made.end()
        running.cancel()
        await settle()


def run(line: FakeLine, command: str, *, confirmed: bool = True) -> None:
    """Let a screen give a command."""
    line.say({"t": "run", "id": 5, "command": command, "confirmed": confirmed})


async def test_a_command_that_asks_is_refused_when_nobody_was_asked() -> None:
    """And given once somebody was; the audit has who it was."""
    async with screens() as it:
        line = await it.come()
        run(line, "dock", confirmed=False)
        await settle()
        assert it.robot.commands == []
        (reply,) = line.of_type("reply")
        assert (reply["code"], reply["message"]) == (
            "not-confirmed",
            "nobody was asked first: Dock now?",
        )
        run(line, "dock")
        await settle()
        assert it.robot.confirmed_by == [("screen 1",)]
        assert [entry.outcome for entry in it.audit] == [
            "not-confirmed: nobody was asked first: Dock now?",
            "done; confirmed by screen 1",
        ]


async def test_a_second_screen_says_yes() -> None:
    """Every screen that may drive is asked, the asker is told, and the audit has both."""
    async with screens() as it:
        asker, other, viewer = await it.come(), await it.come(), await it.come("viewer")
        run(asker, "beam")
        await settle()
        late = await it.come()
        (mine,), (asked,) = asker.of_type("ask"), other.of_type("ask")
        assert (mine["id"], asked["id"]) == (5, 0)
        assert (asked["who"], asked["command"], asked["text"], asked["level"], asked["left"]) == (
            "screen 1",
            "Beam",
            "The beam goes on",
            "hazardous",
            WAIT_S * 1000,
        )
        assert len(late.of_type("ask")) == 1
        assert viewer.of_type("ask") == []
        answer = {"t": "agree", "n": asked["n"], "yes": True}
        viewer.say(answer)  # it only watches
        asker.say(answer)  # it is the same person
        await settle()
        assert it.robot.commands == []
        other.say(answer)
        await settle()
        assert it.robot.confirmed_by == [("screen 1", "screen 2")]
        assert [line.of_type("asked")[0]["n"] for line in (asker, other)] == [asked["n"]] * 2
        assert it.audit[-1].outcome == "done; confirmed by screen 1, screen 2"


@pytest.mark.parametrize("who", ["asker", "other", "nobody"])
async def test_no_is_no_whoever_says_it(who: str) -> None:
    """So is silence."""
    async with screens() as it:
        asker, other = await it.come(), await it.come()
        run(asker, "beam")
        await settle()
        number = asker.of_type("ask")[0]["n"]
        if who == "nobody":
            await it.clock.advance(WAIT_S + 1)
        else:
            line = asker if who == "asker" else other
            line.say({"t": "agree", "n": number, "yes": False})
        await settle()
        assert it.robot.commands == []
        (reply,) = asker.of_type("reply")
        assert reply["code"] == "not-confirmed"
        assert ("within 30 s" if who == "nobody" else "somebody said no") in reply["message"]
        other.say({"t": "agree", "n": number, "yes": True})  # too late
        await settle()
        assert it.robot.commands == []


async def test_a_question_is_over_when_its_asker_leaves() -> None:
    """Nobody can say yes to it any more."""
    async with screens() as it:
        asker, other = await it.come(), await it.come()
        run(asker, "beam")
        await settle()
        asker.leave()
        await settle()
        assert len(other.of_type("asked")) == 1
        other.say({"t": "agree", "n": other.of_type("ask")[0]["n"], "yes": True})
        await settle()
        assert it.robot.commands == []


async def test_what_is_wanted_of_a_sequence_reaches_the_session() -> None:
    """And the audit; a word that nobody knows is no message."""
    async with screens() as it:
        line, viewer = await it.come(), await it.come("viewer")
        viewer.say({"t": "steer", "command": "take_off", "verb": "abort"})
        await settle()
        line.say({"t": "steer", "command": "take_off", "verb": "pause"})
        line.say({"t": "steer", "command": "take_off", "verb": "faster"})
        await settle()
        assert it.robot.pulls == [("take_off", "pause")]
        assert [(one.what, one.command, one.outcome) for one in it.audit] == [
            ("refused", "take_off", "this page only watches"),
            ("ran", "take_off", "told to pause"),
        ]
        assert len(line.of_type("error")) == 1
