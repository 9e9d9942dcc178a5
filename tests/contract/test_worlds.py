"""The robots that ship move in their worlds as they are told, and stop as the real ones do."""

import math
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.contract.profiles import profile_of
from tests.contract.test_protocols import Conversation
from urc.protocol.events import Request
from urc.simulator.simulated_body import SimulatedBody
from urc.simulator.world.world import World

FOLDER = Path(__file__).parents[2] / "robots"

BEFORE: Mapping[str, list[tuple[str, Mapping[str, object]]]] = {
    "amphibot-ii": [("start", {}), ("steer", {"turn": 0.5})],
    "amphibot-iii": [("start", {}), ("steer", {"turn": 0.5})],
    "salamandra-i": [("start", {}), ("steer", {"turn": 0.5})],
    "salamandra-ii": [("start", {}), ("steer", {"turn": 0.5})],
    "ardupilot-rover": [("arm", {"armed": True})],
    "tello": [("takeoff", {})],
}
"""What must come before it moves."""
DRIVES: Mapping[str, tuple[str, Mapping[str, object]]] = {
    "absolem": ("drive", {"speed": 0.3, "turn": 0.3}),
    "amphibot-ii": ("swim", {"drive": 1.0}),
    "amphibot-iii": ("swim", {"drive": 1.0}),
    "ardupilot-rover": ("sticks", {"forward": 0.5, "turn": -0.5}),
    "create-2": ("wheels", {"forward": 200, "turn": 60}),
    "generic-ros1": ("drive", {"speed": 0.3, "turn": 0.3}),
    "generic-ros2": ("drive", {"speed": 0.3, "turn": 0.3}),
    "roveo-mini": ("drive", {"forward": 60, "left": 30}),
    "salamandra-i": ("swim", {"drive": 1.0}),
    "salamandra-ii": ("swim", {"drive": 1.0}),
    "spot": ("drive", {"speed": 0.3, "turn": 0.3}),
    "tello": ("fly", {"forward": 50, "clockwise": -40}),
    "turtlebot3": ("drive", {"speed": 0.2, "turn": 0.3}),
    "turtlebot4": ("drive", {"speed": 0.2, "turn": 0.3}),
}
"""Ahead, and to the left."""
STOPS_AFTER_S = {
    "absolem": 1.0,
    "ardupilot-rover": 3.0,
    "spot": 0.5,
    "tello": 15.0,
    "turtlebot4": 0.5,
}
"""What the robots themselves do when commands stop, as their pages say; all others go on."""


def command(talk: Conversation, name: str, arguments: Mapping[str, object]) -> None:
    """Run a command, which must not be refused."""
    before = len(talk.faults)
    request = Request(1, name, {**arguments})  # type: ignore[dict-item]  # values of documents
    talk.perform(talk.engine.command(request, talk.now))
    assert talk.faults[before:] == []


def body_of(talk: Conversation) -> SimulatedBody:
    """Return what moves."""
    body = talk.emulated_robot.body
    assert body is not None
    return body


def pose(world: World) -> tuple[float, float, float]:
    """Return where it is, and its direction."""
    return world.motion.x, world.motion.y, world.motion.yaw


@pytest.mark.cases(4)
@pytest.mark.parametrize("name", sorted(DRIVES))
def test_it_goes_ahead_and_to_the_left_and_stops_when_it_is_let_go(name: str) -> None:
    """By the bytes of its own driver, over the framing of its own line."""
    profile = profile_of(FOLDER / f"{name}.yaml")
    talk = Conversation(profile)
    talk.begin()
    talk.wait(3.0)
    for action, arguments in BEFORE.get(name, []):
        command(talk, action, arguments)
        talk.wait(2.5)
    world = body_of(talk).world
    start = pose(world)
    action, arguments = DRIVES[name]
    for _ in range(10):
        command(talk, action, arguments)
        talk.wait(0.2)
    x, y, yaw = pose(world)
    ahead = (x - start[0]) * math.cos(start[2]) + (y - start[1]) * math.sin(start[2])
    assert ahead > 0.1, "it did not go ahead"
    assert math.remainder(yaw - start[2], 2 * math.pi) > 0.02, "it did not turn to the left"
    hold = profile.driver.commands[action].hold
    assert hold is not None
    command(talk, action, hold.release)
    talk.wait(3.0)
    there = pose(world)
    talk.wait(1.0)
    assert pose(world) == pytest.approx(there, abs=1e-3), "it did not stop"


@pytest.mark.cases(4)
@pytest.mark.parametrize("name", sorted(DRIVES))
def test_when_commands_stop_it_does_what_the_real_one_does(name: str) -> None:
    """Its fail-safe, or nothing at all: then it goes on until something is in its way."""
    profile = profile_of(FOLDER / f"{name}.yaml")
    talk = Conversation(profile)
    talk.begin()
    talk.wait(3.0)
    for action, arguments in BEFORE.get(name, []):
        command(talk, action, arguments)
        talk.wait(2.5)
    command(talk, *DRIVES[name])
    body = body_of(talk)
    now_s = talk.now
    expected = STOPS_AFTER_S.get(name)
    assert (body.failsafe and body.failsafe.after_s) == expected
    body.world.advance(now_s + 0.4)
    assert abs(body.world.motion.forward) > 0.05
    if expected is None:
        body.world.advance(now_s + 20)
        assert body.world.motion.told_forward != 0
        return
    body.world.advance(now_s + expected + 3.0)
    assert abs(body.world.motion.forward) < 1e-6
    if name == "tello":
        assert body.world.motion.z == 0.0  # it has landed


def test_every_robot_that_moves_or_senses_has_a_world() -> None:
    """All but the arms and the toy of the tutorial; see `test_arm`."""
    files = list(FOLDER.glob("*.yaml"))
    without = {file.stem for file in files if profile_of(file).world is None}
    assert without == {"puppet", "ur-e-series", "ur-ros2"}
    assert {*DRIVES} == {file.stem for file in files} - without - {"esp32-cam", "gpsd", "nmea-gps"}


@pytest.mark.parametrize("name", ["generic-ros2", "turtlebot3", "turtlebot4"])
def test_it_drives_to_a_goal_stops_when_it_is_cancelled_and_refuses_others(name: str) -> None:
    """With Nav2: the map, the plan and the place on the map come from the same world."""
    talk = Conversation(profile_of(FOLDER / f"{name}.yaml"))
    talk.begin()
    talk.wait(6.0)
    goal = {"to_x": 1.5, "to_y": 1.0, "to_yaw": 0.0}
    command(talk, "navigate", goal)
    talk.wait(1.5)
    assert {"plan", "goal_x", "goal_y", "floor", "costs", "map_x"} <= talk.read
    assert "navigate" not in talk.done, "it cannot be there yet"
    talk.wait(20.0)
    world = body_of(talk).world
    assert talk.done.count("navigate") == 1
    assert math.hypot(world.motion.x - 1.5, world.motion.y - 1.0) < 0.3
    on_map = [talk.last[axis] for axis in ("map_x", "map_y")]
    assert on_map == pytest.approx([world.motion.x, world.motion.y], abs=0.1)

    command(talk, "navigate", {**goal, "to_x": -2.0, "to_y": -1.0})
    talk.wait(5.0)
    assert abs(world.motion.forward) > 0.05
    command(talk, "stop_navigation", {})
    talk.wait(2.0)
    there = pose(world)
    talk.wait(2.0)
    assert pose(world) == pytest.approx(there, abs=1e-3), "STOP did not end the way"
    assert math.hypot(world.motion.x + 2.0, world.motion.y + 1.0) > 0.5

    talk.faults.clear()
    request = Request(9, "navigate", {"to_x": 100.0, "to_y": 0.0, "to_yaw": 0.0})
    talk.perform(talk.engine.command(request, talk.now))
    assert talk.faults == ["refused: the robot refused it"]
