"""Rights that end while a page is open: the robot stops, the lease ends, the page closes."""

import asyncio

import pytest

from tests.unit.web.test_client import FakeLine
from tests.unit.web.test_controls import Scene as ControlsScene
from tests.unit.web.test_controls import scene as controls_scene
from urc.guard.goal_reports import GoalReports
from urc.model.driver import Command
from urc.model.payload import WriteSpec
from urc.model.role import Role
from urc.model.sequence import WaitStep
from urc.protocol.events import Replied
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_recorder import AuditRecorder
from urc.runtime.command_failed import CommandFailed
from urc.testing.clock import FakeClock, settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.drive.operator_session import OperatorSession
from urc.web.feed.client_socket import SocketPeer
from urc.web.fleet.robots import Robot, RobotService
from urc.web.page_socket import SIGNED_OUT, BrowserClient
from urc.web.wire import messages as wire
from urc.wire.client_messages import CommandRequest, Drive, Stop, Verb

pytestmark = pytest.mark.anyio


class Rights:
    """Rights that a test changes."""

    def __init__(self, role: Role | None = "drive") -> None:
        self.now = role
        self.commands: tuple[str, ...] = ()

    def role(self) -> Role | None:
        """Return the present role."""
        return self.now

    def may_give(self, command: str) -> bool:
        """Return whether the scope contains a command."""
        return not self.commands or command in self.commands

    def limit(self) -> str:
        return ""


def has_stopped(it: ControlsScene) -> bool:
    """Return whether only stops followed the first frame."""
    first, *stops = it.backend.texts
    return first == "drive speed=0.5" and bool(stops) and set(stops) <= {"drive stop", "lift stop"}


def driving(it: ControlsScene, rights: Rights) -> OperatorSession:
    """Return a page that drives."""
    operator = it.controls.add_page(SocketPeer(rights=rights), lambda: None)
    it.say(operator, "take")
    it.tick(operator, 0.5)
    assert it.backend.texts == ["drive speed=0.5"]
    return operator


@pytest.mark.parametrize("left", ["watch", None])
async def test_a_look_at_withdrawn_rights_stops_the_robot_at_once(left: Role | None) -> None:
    """No tick is needed: the sockets look after each change of rights."""
    async with controls_scene() as it:
        rights = Rights()
        operator = driving(it, rights)
        rights.now = left
        it.controls.recheck(operator)
        assert has_stopped(it)
        assert it.controls.controller.lease.state.holder is None
        (lease,) = it.read(operator)
        assert lease["drives"] is False
        assert lease["role"] == left


async def test_a_tick_after_the_withdrawal_moves_nothing_even_without_a_look() -> None:
    async with controls_scene() as it:
        rights = Rights()
        operator = driving(it, rights)
        rights.now = "watch"
        it.tick(operator, 0.9)
        assert has_stopped(it)


async def test_returned_rights_start_no_motion() -> None:
    """The lease must be taken again."""
    async with controls_scene() as it:
        rights = Rights()
        operator = driving(it, rights)
        rights.now = None
        it.controls.recheck(operator)
        rights.now = "drive"
        it.tick(operator, 0.9)
        assert has_stopped(it)


async def test_a_token_without_the_command_moves_nothing() -> None:
    async with controls_scene() as it:
        rights = Rights()
        operator = driving(it, rights)
        rights.commands = ("lights",)
        await it.clock.advance(0.3)
        it.tick(operator, 0.9)
        assert "drive speed=0.9" not in it.backend.texts
        assert "this token does not permit the command" in [
            message.get("message") for message in it.read(operator)
        ]


async def test_stop_of_a_page_without_rights_still_stops() -> None:
    """Until its socket is closed; then the page posts STOP."""
    async with controls_scene() as it:
        driving(it, Rights())
        other = it.controls.add_page(SocketPeer(rights=Rights(None)), lambda: None)
        it.controls.handle(other, Stop())
        assert has_stopped(it)
        assert it.controls.controller.lease.latched
        it.say(other, "reset")
        assert it.controls.controller.lease.latched, "a reset needs the role drive"


async def test_the_page_of_a_revoked_visitor_closes_with_the_reason() -> None:
    clock = FakeClock()
    robot = FakeRobot(dashboard_profile(), clock)
    recorder = AuditRecorder("puppet", lambda _: None, utc=lambda: 99.0)
    service = RobotService(Robot(robot.profile, {}, robot.open), clock=clock, recorder=recorder)
    rights, line = Rights("watch"), FakeLine()
    client = BrowserClient(line, service, line, SocketPeer(rights=rights))
    running = asyncio.create_task(service.run())
    serving = asyncio.create_task(client.serve())
    await settle()
    client.recheck()
    await settle()
    assert not serving.done()
    rights.now = None
    client.recheck()
    await settle()
    assert serving.done()
    assert line.of_type("error")[-1]["message"] == SIGNED_OUT
    assert line.closed == (wire.CLOSE_NOT_LET_IN, SIGNED_OUT)
    running.cancel()


@pytest.mark.parametrize("verb", ["take", "ask", "force", "reset"])
async def test_a_token_for_other_commands_neither_takes_the_controls_nor_resets_stop(
    verb: Verb,
) -> None:
    async with controls_scene() as it:
        rights = Rights("maintain")
        rights.commands = ("lights",)
        operator = it.controls.add_page(SocketPeer(rights=rights), lambda: None)
        if verb == "reset":
            it.controls.stop("Ann")
        it.controls.handle(operator, Drive(verb))
        state = it.controls.controller.lease.state
        assert state.holder is None
        assert state.latched_by == ("Ann" if verb == "reset" else "")
        assert any("token" in str(message.get("message")) for message in it.read(operator))


async def test_a_token_for_a_held_command_takes_the_controls_and_resets_no_stop() -> None:
    async with controls_scene() as it:
        rights = Rights()
        rights.commands = ("drive",)
        operator = it.controls.add_page(SocketPeer(rights=rights), lambda: None)
        it.say(operator, "take")
        it.tick(operator, 0.5)
        assert it.backend.texts == ["drive speed=0.5"]
        it.controls.stop("Ann")
        it.say(operator, "reset")
        assert it.controls.controller.lease.state.latched_by == "Ann"


@pytest.mark.parametrize("left", ["watch", None])
async def test_a_sequence_ends_with_the_right_of_its_operator(left: Role | None) -> None:
    """A sequence sends commands for minutes; a removed tablet must not move the robot on."""
    clock, rights = FakeClock(), Rights()
    started, over = asyncio.Event(), asyncio.Event()
    tour = Command("tour", "wire", WriteSpec("text"), steps=(WaitStep(1.0),))
    robot = FakeRobot(dashboard_profile(commands={"tour": tour}), clock)
    audit: list[AuditEntry] = []
    recorder = AuditRecorder("puppet", audit.append, utc=lambda: 99.0)
    service = RobotService(Robot(robot.profile, {}, robot.open), clock=clock, recorder=recorder)
    operator = service.controls.add_page(SocketPeer(rights=rights), lambda: None)

    class Target:
        """A session with a sequence that lasts until it is ended."""

        goals = GoalReports(())

        async def command(self, name: str, *_: object, **__: object) -> Replied:
            started.set()
            await over.wait()
            raise CommandFailed("ended", "the sequence was ended")

        def pull(self, sequence: str, what: str) -> None:
            assert (sequence, what) == ("tour", "abort")
            over.set()

    asked = CommandRequest(1, "tour")
    running = asyncio.create_task(service.commands.run(operator, asked, Target()))
    await started.wait()
    service.controls.recheck(operator)
    assert not over.is_set()
    rights.now = left
    service.controls.recheck(operator)
    assert (await running).code == "ended"
    assert operator.on_role == set()
    assert any("ended, because" in entry.outcome for entry in audit)
