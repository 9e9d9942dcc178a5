"""Goals of commands and sequences: the engine reports those that the robot may still follow."""

from pathlib import Path

import pytest

from urc.client.local import load
from urc.model.payload import UNKNOWN_END, Envelope
from urc.protocol.engine import Engine
from urc.protocol.events import Event, Failed, Replied, Request, Send

ROVER = """
urc: 1
kind: robot
name: rover
transports:
  ros: { type: ros, via: rosbridge, host: 127.0.0.1 }
commands:
  undock:
    moves: true
    send: { goal: { action: /undock, type: a/action/Undock, json: {} } }
    reply: { json: { _done: done } }
  beep: { send: { publish: { topic: /beep, type: std_msgs/Empty, json: {} } } }
  stay: { stop: true, send: { cancel: { action: /undock } } }
  halt: { stop: true, send: { cancel: { action: /follow } } }
sequences:
  leave: { moves: true, steps: [{ run: undock }] }
  tour:
    moves: true
    steps:
      - { run: leave }
      - { run: beep }
      - { send: { goal: { action: /follow, type: a/action/Follow, json: {} } } }
      - { expect: { json: { _done: done } }, timeout: 60s }
  launch:
    moves: true
    steps: [{ send: { goal: { action: /follow, type: a/action/Follow, json: {} } } }, { wait: 1s }]
"""


class Told:
    """A running sequence, and the engine's reports of its goals."""

    def __init__(self, engine: Engine, command: str) -> None:
        self.engine = engine
        self.goals: list[tuple[str, bool]] = []
        request = Request(1, command, on_goal=lambda *goal: self.goals.append(goal))
        self.events: list[Event] = engine.command(request, 0.0) + engine.tick(0.0)

    def reply(self, action: str, *, is_ok: bool = True, is_end_unknown: bool = False) -> None:
        """Answer the newest goal of an action as a bridge does."""
        sent = [one.data for one in self.events if isinstance(one, Send)]
        (goal, *_) = [
            one
            for one in reversed(sent)
            if isinstance(one, Envelope) and one.attributes.get("action") == action
        ]
        said = {"id": goal.attributes["id"], "ok": is_ok, "reason": "" if is_ok else "no way"}
        if is_end_unknown:
            said[UNKNOWN_END] = True
        self.events += self.engine.receive("ros", Envelope("response", said, {"done": True}), 0.1)

    @property
    def codes(self) -> list[str]:
        """Codes of the ends of the sequence; "" for success."""
        ends = [one for one in self.events if isinstance(one, Replied | Failed)]
        return [one.code if isinstance(one, Failed) else "" for one in ends]


@pytest.fixture
def engine(tmp_path: Path) -> Engine:
    path = tmp_path / "rover.yaml"
    path.write_text(ROVER)
    made = Engine(load(path).driver, {})
    made.start("ros", 0.0)
    return made


def test_the_start_and_the_end_of_each_goal_are_told(engine: Engine) -> None:
    """Also of the goal of a command that a nested sequence runs; other steps are not told."""
    tour = Told(engine, "tour")
    assert tour.goals == [("/undock", False)]
    tour.reply("/undock")
    assert tour.goals == [("/undock", False), ("/undock", True), ("/follow", False)]
    tour.reply("/follow")
    assert tour.goals[3:] == [("/follow", True)]


def test_a_goal_that_the_robot_has_not_reached_has_ended_too(engine: Engine) -> None:
    tour = Told(engine, "tour")
    tour.reply("/undock", is_ok=False)
    assert (tour.goals, tour.codes) == ([("/undock", False), ("/undock", True)], ["refused"])


@pytest.mark.parametrize("end", ["disconnected", "timed-out", "stopped"])
def test_the_end_of_a_goal_whose_reply_is_lost_is_not_told(engine: Engine, end: str) -> None:
    tour = Told(engine, "tour")
    if end == "disconnected":
        tour.events += engine.closed("ros", "the cable was pulled", 1.0)
    elif end == "timed-out":
        tour.events += engine.tick(10_000.0)
    else:
        tour.events += engine.latch("Stopped by screen 1", 1.0)
    assert tour.codes == [end]
    assert tour.goals == [("/undock", False)]


def test_a_reply_after_the_end_of_the_sequence_is_told(engine: Engine) -> None:
    tour = Told(engine, "tour")
    tour.events += engine.latch("Stopped by screen 1", 1.0)
    tour.reply("/undock", is_ok=False)
    assert tour.goals == [("/undock", False), ("/undock", True)]


def test_the_end_of_a_goal_that_no_step_awaits_is_told_when_it_is_known(engine: Engine) -> None:
    launch = Told(engine, "launch")
    launch.events += engine.tick(2.0)
    assert (launch.goals, launch.codes) == ([("/follow", False)], [""])
    launch.reply("/follow")
    assert launch.goals == [("/follow", False), ("/follow", True)]


def test_a_result_after_the_time_limit_of_a_command_is_told(engine: Engine) -> None:
    """The command has failed, but its goal stays shown as lost until then."""
    leave = Told(engine, "undock")
    leave.events += engine.tick(10_000.0)
    assert (leave.goals, leave.codes) == ([("/undock", False)], ["timed-out"])
    leave.reply("/undock")
    assert leave.goals == [("/undock", False), ("/undock", True)]


@pytest.mark.parametrize("command", ["undock", "leave"])
def test_a_goal_whose_end_is_unknown_is_not_refused(engine: Engine, command: str) -> None:
    """The bridge reports that it cannot say how the goal ends, so the robot may follow it."""
    told = Told(engine, command)
    told.reply("/undock", is_ok=False, is_end_unknown=True)
    assert told.goals == [("/undock", False)]
    (failed,) = [one for one in told.events if isinstance(one, Failed)]
    assert (failed.code, "no way" in failed.message) == ("timed-out", True)
