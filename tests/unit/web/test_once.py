"""Commands that are given once: by whom, what STOP does to them, and what a session hears of it."""

import asyncio

import pytest

from tests.unit.web.test_client import FakeLine, scene
from urc.expressions import compile_expression
from urc.model.driver import Argument, Command
from urc.model.payload import Envelope, WriteSpec
from urc.model.sequence import WaitStep
from urc.protocol.events import Replied
from urc.runtime.motion_controller import MotionController
from urc.runtime.one_shot_commands import OneShotCommands
from urc.runtime.running_goals import MAX_GOALS, RunningGoal, RunningGoals
from urc.runtime.session import CommandFailed
from urc.testing.clock import settle
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.transports.base import GoalRecord
from urc.web.feed.client_socket import SocketPeer
from urc.web.page_socket import BrowserClient
from urc.web.wire.drive import Drive

pytestmark = pytest.mark.anyio

FOLD = {
    "fold": Command("fold", "wire", WriteSpec("text", {}), moves=True),
    "show": Command("show", "wire", WriteSpec("text", {}), moves=True, steps=(WaitStep(1.0),)),
    "ask": Command("ask", "wire", WriteSpec("text", {})),
}
WATCHES = "this page only watches"


def refusals(line: FakeLine) -> list[str]:
    """Return why commands were refused."""
    return [one["message"] for one in line.of_type("reply") if one.get("code") == "refused"]


async def test_a_page_that_only_watches_gives_no_command_and_may_stop() -> None:
    """Whatever the command does; nothing of it reaches the robot."""
    async with scene(commands=FOLD, role="watch") as it:
        for number, command in enumerate(("ask", "fold")):
            it.line.say({"t": "run", "id": number, "command": command})
        for verb in ("pause", "step", "resume", "abort"):
            it.line.say({"t": "steer", "command": "show", "verb": verb})
        await settle()
        assert refusals(it.line) == [WATCHES, WATCHES]
        assert (it.robot.commands, it.robot.pulls) == ([], [])
        assert {(one.what, one.outcome) for one in it.audit} == {("refused", WATCHES)}
        it.line.say({"t": "stop"})
        await settle()
        assert it.service.controls.controller.lease.state.latched_by == "screen 1"


async def test_what_moves_by_itself_needs_no_lease_and_is_refused_after_a_stop() -> None:
    """Until somebody resets it; what does not move is given all the same."""
    async with scene(commands=FOLD) as it:
        it.line.say({"t": "run", "id": 1, "command": "fold"})
        await settle()
        it.line.say({"t": "stop"})
        it.line.say({"t": "run", "id": 2, "command": "fold"})
        it.line.say({"t": "run", "id": 3, "command": "ask"})
        it.line.say({"t": "steer", "command": "show", "verb": "resume"})
        it.line.say({"t": "steer", "command": "show", "verb": "abort"})
        await settle()
        assert refusals(it.line) == ["Stopped by screen 1. Reset to drive again."]
        assert [name for name, _ in it.robot.commands] == ["fold", "ask"]
        assert it.robot.pulls == [("show", "abort")]
        it.line.say({"t": "drive", "verb": "reset"})
        it.line.say({"t": "run", "id": 4, "command": "fold"})
        await settle()
        assert [name for name, _ in it.robot.commands] == ["fold", "ask", "fold"]


async def test_what_moves_by_itself_is_refused_while_somebody_else_drives() -> None:
    """Whoever has the controls may give it."""
    async with scene(commands=FOLD) as it:
        other = it.service.controls.add_page(SocketPeer("10.0.0.7"), lambda: None)
        it.service.controls.handle(other, Drive("take"))
        it.line.say({"t": "run", "id": 1, "command": "fold"})
        it.line.say({"t": "run", "id": 2, "command": "ask"})
        await settle()
        assert refusals(it.line) == ["screen 2 at 10.0.0.7 has the controls"]
        assert [name for name, _ in it.robot.commands] == ["ask"]
        it.service.controls.handle(other, Drive("leave"))
        it.line.say({"t": "drive", "verb": "take"})
        it.line.say({"t": "run", "id": 3, "command": "fold"})
        await settle()
        assert [name for name, _ in it.robot.commands] == ["ask", "fold"]


async def test_what_was_given_before_a_stop_and_came_late_is_refused_after_the_reset() -> None:
    """What does not move is given all the same."""
    async with scene(commands=FOLD) as it:
        (lease,) = it.line.of_type("lease")
        for verb in ({"t": "stop"}, {"t": "drive", "verb": "reset"}):
            it.line.say(verb)
        for number, name in enumerate(("fold", "ask")):
            said = {"id": number, "command": name, "stops": lease["stops"]}
            it.line.say({"t": "run", **said})
        await settle()
        assert refusals(it.line) == ["STOP was pressed meanwhile: send it again"]
        now = it.line.of_type("lease")[-1]["stops"]
        it.line.say({"t": "run", "id": 3, "command": "fold", "stops": now})
        await settle()
        assert [name for name, _ in it.robot.commands] == ["ask", "fold"]


async def test_what_moves_for_some_values_is_refused_for_those_while_somebody_else_drives() -> None:
    """As the robot is given them; what it cannot be given is the engine's to refuse."""
    mode = Argument("mode", "integer", choices=(4, 10))
    moves_if = compile_expression("mode == 10")
    text = WriteSpec("text", {})
    command = Command("steer", "wire", text, {"mode": mode}, moves=True, moves_if=moves_if)
    async with scene(commands={"steer": command}) as it:
        other = it.service.controls.add_page(SocketPeer("10.0.0.7"), lambda: None)
        it.service.controls.handle(other, Drive("take"))
        for number, given in enumerate((4, 10, 10.0, "fast")):
            it.line.say(
                {"t": "run", "id": number, "command": "steer", "arguments": {"mode": given}}
            )
        await settle()
        assert refusals(it.line) == ["screen 2 at 10.0.0.7 has the controls"] * 2
        assert [values["mode"] for _, values in it.robot.commands] == [4, "fast"]


async def test_the_session_is_told_of_a_stop_and_of_its_reset() -> None:
    """It ends its sequences, and refuses what waits in it."""
    async with scene(commands=FOLD) as it:
        for message in ({"t": "stop"}, {"t": "stop"}, {"t": "drive", "verb": "reset"}):
            it.line.say(message)
        await settle()
        why = "Stopped by screen 1. Reset to drive again."
        assert it.robot.latched == [why, why, ""]


async def test_a_stop_that_is_latched_holds_in_the_next_session() -> None:
    """The robot was disconnected meanwhile."""
    async with scene(commands=FOLD) as it:
        it.line.say({"t": "stop"})
        await settle()
        it.line.leave()
        await it.clock.advance(10)
        assert not it.robot.is_open
        it.robot.latched.clear()
        line = FakeLine()
        task = asyncio.create_task(BrowserClient(line, it.service, line).serve())
        await settle()
        assert it.robot.latched == ["Stopped by screen 1. Reset to drive again."]
        line.leave()
        await task


HALT = {"halt": Command("halt", "wire", WriteSpec("text", {}), stops=True)}


def confirmed(line: FakeLine) -> bool:
    """Return whether the page was told that the robot has heard the stop."""
    return bool(line.of_type("lease")[-1]["confirmed"])


async def test_a_robot_with_a_stop_of_its_own_is_given_it_once_for_each_press() -> None:
    """By the server, and the page is told that the robot has heard it."""
    async with scene(commands=FOLD | HALT) as it:
        it.line.say({"t": "stop"})
        await settle()
        assert it.robot.commands == [("halt", {})]
        assert confirmed(it.line)
        await it.clock.advance(10)
        assert it.robot.commands == [("halt", {})]
        it.line.say({"t": "stop"})
        await settle()
        assert it.robot.commands == [("halt", {})] * 2
        ran = [(one.who, one.command, one.outcome) for one in it.audit if one.what == "ran"]
        assert ran == [("STOP", "halt", "done")] * 2


async def test_a_robot_is_not_at_rest_while_it_may_follow_a_goal() -> None:
    """New settings could lead STOP to another robot."""
    async with scene(commands=FOLD | HALT) as it:
        hub = it.robot.hub
        number = hub.begin_goal(RunningGoal(0, "fold"))
        hub.sent_goal(number, "/dock")
        assert not it.service.is_at_rest
        hub.end_goal(number, is_lost=True)
        assert not it.service.is_at_rest, "its reply is lost, but the robot may go on"
        it.line.say({"t": "stop"})
        await it.clock.advance(2)
        assert it.service.is_at_rest


async def test_a_full_list_of_goals_drops_a_lost_one_first() -> None:
    goals = RunningGoals()
    first = goals.begin(RunningGoal(0, "fold"))
    second = goals.begin(RunningGoal(0, "fold"))
    goals.sent(second, "/dock")
    goals.end(second, is_lost=True)
    for _ in range(MAX_GOALS - 1):
        goals.begin(RunningGoal(0, "fold"))
    numbers = [one.number for one in goals]
    assert first in numbers
    assert second not in numbers


GOALS = Envelope("cancel", {"action": "/dock"})
ABANDON = {"abandon": Command("abandon", "wire", WriteSpec("json", {"verb": "cancel"}), stops=True)}


async def test_a_stop_that_cancels_goals_is_confirmed_when_the_robot_has_answered() -> None:
    """The transport repeats the cancellation; the other stop commands do not wait for it."""
    async with scene(commands=FOLD | HALT | ABANDON) as it:
        it.robot.payloads["abandon"] = GOALS
        it.robot.on_command = lambda name, _: report(it.robot, "/dock") if name != "halt" else {}
        it.line.say({"t": "stop"})
        await it.clock.advance(30)
        assert [name for name, _ in it.robot.commands] == ["halt", "abandon"]
        assert not confirmed(it.line)
        assert it.service.is_at_rest, "nothing is left to be sent"
        report(it.robot)
        await it.clock.advance(0.2)
        assert confirmed(it.line)
        assert [name for name, _ in it.robot.commands] == ["halt", "abandon"]


async def test_a_reset_ends_the_cancellations_of_stop_but_not_those_of_commands() -> None:
    """An operator has cancelled the goals of another action, and nobody has withdrawn that."""
    leave = Command("leave", "wire", WriteSpec("json", {"verb": "cancel"}))
    async with scene(commands=FOLD | ABANDON | {"leave": leave}) as it:
        it.robot.payloads["abandon"] = GOALS
        it.robot.payloads["leave"] = Envelope("cancel", {"action": "/follow"})
        it.line.say({"t": "run", "id": 1, "command": "leave", "arguments": {}})
        await settle()
        for _ in range(2):
            it.line.say({"t": "stop"})
            await it.clock.advance(1)
            it.line.say({"t": "drive", "verb": "reset"})
            await settle()
        assert [name for name, _ in it.robot.commands][:2] == ["leave", "abandon"]
        assert it.robot.ended == [("/dock",), ("/dock",)]


async def test_a_cancellation_that_never_left_is_sent_again_and_not_confirmed() -> None:
    """As when the guard ends between the command and its frame; older reports prove nothing."""
    async with scene(commands=FOLD | ABANDON) as it:
        it.robot.payloads["abandon"] = GOALS
        report(it.robot, "/dock")
        report(it.robot)
        it.line.say({"t": "stop"})
        await it.clock.advance(5)
        assert 3 <= len(it.robot.commands) <= 5
        assert not confirmed(it.line)
        it.robot.on_command = lambda name, _: report(it.robot, "/dock")
        await it.clock.advance(2)
        it.robot.commands.clear()
        await it.clock.advance(5)
        assert it.robot.commands == []
        report(it.robot)
        await it.clock.advance(0.2)
        assert confirmed(it.line)


async def test_a_cancellation_that_a_goal_has_ended_is_sent_again_while_stop_is_latched() -> None:
    """A goal that moves nothing may be sent then; it must not confirm STOP."""
    async with scene(commands=FOLD | ABANDON) as it:
        it.robot.payloads["abandon"] = GOALS
        it.robot.on_command = lambda name, _: report(it.robot, "/dock")
        it.line.say({"t": "stop"})
        await it.clock.advance(2)
        assert len(it.robot.commands) == 1
        it.robot.goals.changed("wire", GoalRecord(dropped=("/dock",)))
        await it.clock.advance(2)
        assert [name for name, _ in it.robot.commands] == ["abandon"] * 2
        assert not confirmed(it.line)
        report(it.robot)
        await it.clock.advance(0.2)
        assert confirmed(it.line)


@pytest.mark.parametrize("is_reset", [False, True])
async def test_an_unanswered_cancellation_is_sent_again_in_the_next_session_of_a_latched_stop(
    is_reset: bool,
) -> None:
    async with scene(commands=FOLD | HALT | ABANDON) as it:
        it.robot.payloads["abandon"] = GOALS
        it.robot.on_command = lambda name, _: report(it.robot, "/dock") if name != "halt" else {}
        it.line.say({"t": "stop"})
        await it.clock.advance(1)
        if is_reset:
            it.line.say({"t": "drive", "verb": "reset"})
        it.robot.commands.clear()
        controls = it.service.controls
        driver, recorder = it.robot.profile.driver, controls.recorder
        again = OneShotCommands(driver, lambda: controls.controller, it.clock, recorder)
        serving = asyncio.create_task(again.serve(it.robot))
        await it.clock.advance(1)
        sent = [name for name, _ in it.robot.commands]
        assert sent == ([] if is_reset else ["abandon"])
        assert not controls.controller.is_certain or is_reset
        report(it.robot)
        await it.clock.advance(1)
        serving.cancel()
        await settle()
        assert confirmed(it.line) or is_reset


async def test_a_session_without_pages_stays_open_until_the_robot_has_answered() -> None:
    """The transport repeats the cancellation only while the session is open."""
    async with scene(commands=FOLD | ABANDON) as it:
        it.robot.payloads["abandon"] = GOALS
        it.robot.on_command = lambda name, _: report(it.robot, "/dock")
        it.line.say({"t": "stop"})
        await it.clock.advance(1)
        it.line.leave()
        await settle()
        await it.clock.advance(120)
        assert it.robot.is_open
        report(it.robot)
        await it.clock.advance(1)
        assert not it.robot.is_open


def report(robot: FakeRobot, *owed: str) -> dict[str, int]:
    """Report which actions owe an answer; return the reply of a command."""
    robot.goals.changed("wire", GoalRecord((), owed))
    return {}


def test_after_a_restart_a_latched_stop_that_cancels_goals_is_not_confirmed() -> None:
    driver = dashboard_profile(commands=FOLD | ABANDON).driver
    first = MotionController(driver)
    first.stop("Ann")
    first.given("abandon")
    assert first.is_certain
    later = MotionController(driver, kept=first.lease.state)
    assert (later.is_certain, later.owed) == (False, [])
    later.owe_unanswered()
    assert later.owed == ["abandon"], "the first session sends it again"
    plain = MotionController(dashboard_profile(commands=HALT).driver, kept=first.lease.state)
    assert plain.is_certain


async def test_a_stop_that_did_not_reach_the_robot_is_given_until_it_does() -> None:
    """Also after a reset: it was pressed, and has not been sent."""
    async with scene(commands=FOLD | HALT) as it:

        async def lost(name: str, arguments: object, **more: object) -> Replied:
            raise CommandFailed("disconnected", "the robot is not connected")

        known, it.robot.command = it.robot.command, lost  # type: ignore[method-assign]
        it.line.say({"t": "stop"})
        await settle()
        assert not confirmed(it.line)
        it.line.say({"t": "drive", "verb": "reset"})
        it.robot.command = known  # type: ignore[method-assign]
        await it.clock.advance(2)
        assert it.robot.commands == [("halt", {})]
        assert it.service.controls.controller.is_confirmed


async def test_a_stop_that_the_robot_refuses_is_repeated_and_not_confirmed() -> None:
    """The robot may go on, as when another program owns its lease."""
    async with scene(commands=FOLD | HALT) as it:

        def refuse(name: str, arguments: object) -> dict[str, int]:
            raise CommandFailed("refused", "the lease is owned by the tablet")

        it.robot.on_command = refuse  # type: ignore[assignment]
        it.line.say({"t": "stop"})
        await it.clock.advance(1.5)
        assert [name for name, _ in it.robot.commands] == ["halt"] * 2
        assert not confirmed(it.line)
        it.robot.on_command = lambda name, arguments: {}
        await it.clock.advance(1.5)
        assert confirmed(it.line)


async def test_a_stop_without_an_answer_is_given_again_until_somebody_resets_it() -> None:
    """Then the one that was sent counts: a later one would stop what was begun since."""
    async with scene(commands=FOLD | HALT) as it:

        def mute(name: str, arguments: object) -> dict[str, int]:
            raise CommandFailed("timed-out", "no answer")

        it.robot.on_command = mute  # type: ignore[assignment]
        it.line.say({"t": "stop"})
        await it.clock.advance(1.5)
        assert [name for name, _ in it.robot.commands] == ["halt"] * 2
        assert not confirmed(it.line)
        it.line.say({"t": "drive", "verb": "reset"})
        await it.clock.advance(10)
        assert [name for name, _ in it.robot.commands] == ["halt"] * 3
