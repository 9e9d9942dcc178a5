"""Questions before a command, as the server sees them: who was asked, and who said yes."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from tests.unit.web.test_client import FakeLine
from urc.access.directory import NOBODY, Identity
from urc.model.driver import Command
from urc.model.exchange import Confirm
from urc.model.payload import WriteSpec
from urc.model.role import Role
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_recorder import AuditRecorder
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.drive.two_person import TOKEN_S, WAIT_S
from urc.web.feed.client_socket import FixedRights, SocketPeer
from urc.web.fleet.robots import Robot, RobotService
from urc.web.page_socket import BrowserClient

pytestmark = pytest.mark.anyio

DOCK = Command("dock", "wire", WriteSpec("text"), confirm=Confirm("normal", "Dock now?"))
ERASE = Command("erase", "wire", WriteSpec("text"), confirm=Confirm("hazardous", "All is lost"))
BEAM = Command(
    "beam",
    "wire",
    WriteSpec("text"),
    title="Beam",
    confirm=Confirm("hazardous", "The beam goes on", is_two_person=True),
)


class Screens:
    """Some screens that look at one robot."""

    def __init__(self, service: RobotService, robot: FakeRobot, clock: FakeClock) -> None:
        self.service, self.robot, self.clock = service, robot, clock
        self.audit: list[AuditEntry] = []
        self.lines: list[FakeLine] = []
        self._tasks: list[asyncio.Task[None]] = []

    async def come(self, role: Role = "drive", who: Identity = NOBODY) -> FakeLine:
        """Let one more look."""
        line = FakeLine()
        self.lines.append(line)
        peer = SocketPeer(identity=who, rights=FixedRights(role))
        client = BrowserClient(line, self.service, line, peer)
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
    commands = {"dock": DOCK, "beam": BEAM, "erase": ERASE}
    robot = FakeRobot(dashboard_profile(commands=commands), clock)
    audit: list[AuditEntry] = []
    recorder = AuditRecorder("puppet", audit.append, utc=lambda: 99.0)
    service = RobotService(Robot(robot.profile, {}, robot.open), clock=clock, recorder=recorder)
    running = asyncio.create_task(service.run())
    made = Screens(service, robot, clock)
    made.audit = audit
    try:
        yield made
    finally:
        await made.end()
        running.cancel()
        await settle()


async def token_for(line: FakeLine, command: str, **arguments: object) -> str:
    """Let somebody say yes to a command; return what the server gives for it."""
    line.say({"t": "prepare", "id": 5, "command": command, "arguments": arguments})
    await settle()
    return str(line.of_type("token")[-1]["token"])


def give(line: FakeLine, command: str, token: str, **arguments: object) -> None:
    """Let a screen give a command with a token."""
    said = {"id": 5, "command": command, "arguments": arguments, "token": token}
    line.say({"t": "run", **said})


async def run(line: FakeLine, command: str) -> None:
    """Let somebody at a screen say yes to a command, and give it."""
    give(line, command, await token_for(line, command))


async def test_a_command_that_asks_is_refused_when_nobody_was_asked() -> None:
    """And given once somebody was; the audit has who it was."""
    async with screens() as it:
        line = await it.come()
        give(line, "dock", "")
        await settle()
        assert it.robot.commands == []
        (reply,) = line.of_type("reply")
        assert (reply["code"], reply["message"]) == (
            "not-confirmed",
            "a confirmation is missing: Dock now?",
        )
        await run(line, "dock")
        await settle()
        assert it.robot.confirmed_by == [("screen 1",)]
        assert [entry.outcome for entry in it.audit] == [
            "not-confirmed: a confirmation is missing: Dock now?",
            "done; confirmed by screen 1",
        ]


async def test_stop_ends_questions_and_takes_back_what_was_agreed_to() -> None:
    """Whether it was reset since or not: nobody says yes to what was wished before it."""
    async with screens() as it:
        asker, other = await it.come(), await it.come()
        token = await token_for(asker, "dock")
        await run(asker, "beam")
        await settle()
        (asked,) = other.of_type("ask")
        it.service.controls.stop("screen 2")
        await settle()
        assert other.of_type("asked")[0]["n"] == asked["n"]
        other.say({"t": "agree", "n": asked["n"], "yes": True})
        give(asker, "dock", token)
        await settle()
        assert it.robot.commands == []
        assert [reply["message"] for reply in asker.of_type("reply")] == [
            "STOP was pressed meanwhile: send it again",
            "the confirmation is no longer valid: Dock now?",
        ]


async def test_a_second_screen_says_yes() -> None:
    """Every screen that may drive is asked, the asker is told, and the audit has both."""
    async with screens() as it:
        asker, other, viewer = await it.come(), await it.come(), await it.come("watch")
        await run(asker, "beam")
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


async def test_a_token_is_no_second_person() -> None:
    """Otherwise, one person with a token would approve the own command."""
    async with screens() as it:
        asker = await it.come(who=Identity("p1", "s1", "Ann", "person", "passphrase", "p1"))
        program = await it.come(who=Identity("p2", "s2", "script", "program", "token", "p2"))
        other = await it.come(who=Identity("p3", "s3", "Ben", "person", "passphrase", "p3"))
        await run(asker, "beam")
        await settle()
        assert program.of_type("ask") == []
        answer = {"t": "agree", "n": other.of_type("ask")[0]["n"], "yes": True}
        program.say(answer)
        await settle()
        assert it.robot.commands == []
        other.say(answer)
        await settle()
        assert it.audit[-1].outcome == "done; confirmed by screen 1, screen 3"


@pytest.mark.parametrize("who", ["asker", "other", "nobody"])
async def test_no_is_no_whoever_says_it(who: str) -> None:
    """So is silence."""
    async with screens() as it:
        asker, other = await it.come(), await it.come()
        await run(asker, "beam")
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
        assert ("within 30 s" if who == "nobody" else "refused by another") in reply["message"]
        other.say({"t": "agree", "n": number, "yes": True})  # too late
        await settle()
        assert it.robot.commands == []


async def test_a_question_is_over_when_its_asker_leaves() -> None:
    """Nobody can say yes to it any more."""
    async with screens() as it:
        asker, other = await it.come(), await it.come()
        await run(asker, "beam")
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
        line, viewer = await it.come(), await it.come("watch")
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


async def refused(it: Screens, line: FakeLine) -> str:
    """Return why the newest command was not given; nothing reached the robot."""
    await settle()
    assert it.robot.commands == []
    reply = line.of_type("reply")[-1]
    assert reply["code"] == "not-confirmed"
    return str(reply["message"])


async def test_a_yes_that_is_played_back_counts_no_second_time() -> None:
    """Not even when it was refused the first time."""
    async with screens() as it:
        line = await it.come()
        token = await token_for(line, "dock")
        give(line, "dock", token)
        await settle()
        assert len(it.robot.commands) == 1
        it.robot.commands.clear()
        for _ in range(3):
            give(line, "dock", token)
            assert await refused(it, line) == "the confirmation is no longer valid: Dock now?"
        token = await token_for(line, "dock")
        give(line, "dock", token, place="ceiling")
        await refused(it, line)
        give(line, "dock", token)
        assert await refused(it, line) == "the confirmation is no longer valid: Dock now?"


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        ("erase", {}),
        ("dock", {"place": "ceiling"}),
        ("dock", {}),
        ("dock", {"place": "home", "x": 1}),
    ],
)
async def test_a_yes_to_something_else_is_none(command: str, arguments: dict[str, object]) -> None:
    """Another command, other arguments, fewer or more of them."""
    async with screens() as it:
        line = await it.come()
        token = await token_for(line, "dock", place="home")
        give(line, command, token, **arguments)
        assert (await refused(it, line)).startswith("the confirmation does not match: ")


async def test_a_yes_that_was_held_up_on_its_way_is_none() -> None:
    """Five seconds; whoever meant it says it again."""
    async with screens() as it:
        line = await it.come()
        token = await token_for(line, "dock")
        await it.clock.advance(TOKEN_S)
        give(line, "dock", token)
        assert await refused(it, line) == "the confirmation is no longer valid: Dock now?"
        token = await token_for(line, "dock")
        await it.clock.advance(TOKEN_S - 0.1)
        give(line, "dock", token)
        await settle()
        assert len(it.robot.commands) == 1


async def test_a_yes_counts_on_its_own_screen_alone() -> None:
    """And one that was made up on none."""
    async with screens() as it:
        ann, bob = await it.come(), await it.come()
        give(bob, "dock", await token_for(ann, "dock"))
        await refused(it, bob)
        for forged in ("0", "A" * 22, "x" * 5000):
            give(ann, "dock", forged)
            await refused(it, ann)


async def test_a_screen_that_says_yes_to_everything_keeps_little() -> None:
    """The oldest are forgotten; the newest still counts, and so does that of another screen."""
    async with screens() as it:
        ann, bob = await it.come(), await it.come()
        other = await token_for(bob, "dock")
        first = await token_for(ann, "dock")
        for _ in range(50):
            token = await token_for(ann, "dock")
        give(ann, "dock", first)
        await refused(it, ann)
        give(ann, "dock", token)
        give(bob, "dock", other)
        await settle()
        assert len(it.robot.commands) == 2
