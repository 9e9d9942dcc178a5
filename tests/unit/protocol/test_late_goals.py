"""Goals that wait for their services: conditions, rights and STOP still count."""

from pathlib import Path

import pytest

from urc.client.local import load
from urc.model.payload import Envelope
from urc.protocol.engine import Engine
from urc.protocol.events import Event, Failed, Request, Send

ROVER = """
urc: 1
kind: robot
name: rover
transports:
  ros: { type: ros, via: foxglove, host: 127.0.0.1 }
signals:
  door: { type: boolean }
messages:
  door: { subscribe: { topic: /door, type: std_msgs/Bool }, json: { door: data } }
commands:
  dock:
    moves: true
    requires: [{ expr: door, else: The door is closed }]
    send: { goal: { action: /dock, type: my_robot_msgs/action/Dock, json: {} } }
  stay: { stop: true, send: { cancel: { action: /dock } } }
sequences:
  tour: { moves: true, steps: [{ run: dock }] }
"""
TYPE = ["my_robot_msgs/action/Dock_SendGoal_Request", "json", "jsonschema", "{}"]


@pytest.fixture
def engine(tmp_path: Path) -> Engine:
    path = tmp_path / "rover.yaml"
    path.write_text(ROVER)
    profile = load(path)
    made = Engine(profile.driver, {})
    made.start("ros", 0.0)
    return made


def door(engine: Engine, is_open: bool, now: float) -> None:
    body = b'{"data": true}' if is_open else b'{"data": false}'
    engine.receive("ros", Envelope("message", {"topic": "/door", "encoding": "json"}, body), now)


def returned(events: list[Event]) -> Envelope:
    """Return a goal as the transport does that has found the services of its action."""
    goal = next(one.data for one in events if isinstance(one, Send))
    assert isinstance(goal, Envelope)
    said = {"id": goal.attributes["id"], "goal": "00" * 16, "stops": goal.attributes["stops"]}
    types = {"request": TYPE, "response": TYPE}
    attributes = {"service": "/dock/_action/send_goal", **said, **types}
    return Envelope("unencoded", attributes, {"goal": {}})


def test_goal_is_encoded_while_its_condition_holds(engine: Engine) -> None:
    door(engine, True, 0.1)
    waiting = returned(engine.command(Request(1, "dock"), 0.2))
    events = engine.receive("ros", waiting, 1.1)
    assert [one.data.verb for one in events if isinstance(one, Send)] == ["call"]  # type: ignore[union-attr]


def test_goal_is_refused_if_its_condition_no_longer_holds(engine: Engine) -> None:
    door(engine, True, 0.1)
    waiting = returned(engine.command(Request(1, "dock"), 0.2))
    door(engine, False, 0.6)
    events = engine.receive("ros", waiting, 1.1)
    assert [one for one in events if isinstance(one, Send)] == []
    failed = [one for one in events if isinstance(one, Failed)]
    assert [one.message for one in failed] == ["The door is closed"]


def refused_with(events: list[Event]) -> list[str]:
    """Return why the goal failed, after checking that nothing was sent."""
    assert [one for one in events if isinstance(one, Send)] == []
    return [one.message for one in events if isinstance(one, Failed)]


def test_goal_is_refused_if_its_operator_may_no_longer_send_it(engine: Engine) -> None:
    """The check runs twice: when the goal leaves the queue, and when its services are known."""
    door(engine, True, 0.1)
    why_not = ""
    request = Request(1, "dock", unless=lambda: why_not)
    waiting = returned(engine.command(request, 0.2))
    why_not = "another screen has the controls"
    assert refused_with(engine.receive("ros", waiting, 1.1)) == [why_not]
    assert refused_with(engine.command(request._replace(id=2), 1.2)) == [why_not]


def test_goal_whose_command_has_failed_meanwhile_is_never_sent(engine: Engine) -> None:
    """Nobody would know of it."""
    door(engine, True, 0.1)
    waiting = returned(engine.command(Request(1, "dock"), 0.2))
    events = engine.tick(1000.0)
    assert [one.code for one in events if isinstance(one, Failed)] == ["timed-out"]
    assert refused_with(engine.receive("ros", waiting, 1000.1)) == []


def test_goal_of_a_sequence_is_refused_if_its_operator_may_no_longer_send_it(
    engine: Engine,
) -> None:
    """Other steps of the sequence go on, for example those that let go of a load."""
    door(engine, True, 0.1)
    why_not = ""
    request = Request(1, "tour", unless=lambda: why_not)
    waiting = returned(engine.command(request, 0.2) + engine.tick(0.2))
    why_not = "another screen has the controls"
    events = engine.receive("ros", waiting, 1.1)
    assert refused_with(events + engine.tick(1.2)) == [why_not]
