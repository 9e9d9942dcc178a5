"""The arm with ros2_control: it jogs while it is held, drives to goals, and stops for any reason.

Its tool is computed with the manufacturer's DH parameters, not with the emulated robot's formulas.
"""

import math
import operator
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from tests.contract.profiles import profile_of
from tests.contract.test_protocols import Conversation
from urc.protocol.events import Request

FILE = Path(__file__).parents[2] / "robots" / "ur-ros2.yaml"
PERIOD_S = 0.05
"""Interval at which the driver repeats a held command."""
DH = (
    (0.0, 0.1625, math.pi / 2),
    (-0.425, 0.0, 0.0),
    (-0.3922, 0.0, 0.0),
    (0.0, 0.1333, math.pi / 2),
    (0.0, 0.0997, -math.pi / 2),
    (0.0, 0.0996, 0.0),
)
"""a, d and alpha of a UR5e: Universal Robots, article 45257."""


def product(left: Sequence[Sequence[float]], right: Sequence[Sequence[float]]) -> list[list[float]]:
    columns = list(zip(*right, strict=True))
    return [[sum(map(operator.mul, row, column)) for column in columns] for row in left]


def tool_of(joints: Sequence[float]) -> tuple[list[float], list[float]]:
    """Return where the tool is, in m, and the direction in which it points."""
    whole: list[list[float]] = [[float(i == j) for j in range(4)] for i in range(4)]
    for angle, (a, d, alpha) in zip(joints, DH, strict=True):
        c, s, ca, sa = math.cos(angle), math.sin(angle), math.cos(alpha), math.sin(alpha)
        link = [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d]]
        whole = product(whole, [*link, [0.0, 0.0, 0.0, 1.0]])
    return [row[3] for row in whole[:3]], [row[2] for row in whole[:3]]


class Arm(Conversation):
    """The emulated arm, which says which commands it refuses."""

    def __init__(self) -> None:
        super().__init__(profile_of(FILE))
        self.numbers = iter(range(1, 10_000))
        self.begin()
        self.wait(1.5)

    def give(self, name: str, **arguments: object) -> list[str]:
        """Run a command, and return the failures until it has been sent."""
        self.faults.clear()
        given = {**arguments}
        request = Request(next(self.numbers), name, given)  # type: ignore[arg-type]  # any values
        self.perform(self.engine.command(request, self.now))
        self.wait(PERIOD_S)
        return list(self.faults)

    def mode(self, name: str) -> None:
        """Press the button that prepares the controllers."""
        assert self.give(name) == []
        self.wait(1.5)

    def hold(self, name: str, seconds: float, arguments: Mapping[str, float]) -> None:
        """Hold a control, and let it go."""
        for _ in range(round(seconds / PERIOD_S)):
            assert self.give(name, **arguments) == []
        hold = self.profile.driver.commands[name].hold
        assert hold is not None
        assert self.give(name, **hold.release) == []
        assert all(value == 0 for value in hold.release.values())
        self.wait(0.2)

    @property
    def joints(self) -> tuple[float, ...]:
        found = self.last["q"]
        assert isinstance(found, tuple)
        return found

    @property
    def tool(self) -> list[float]:
        found = [self.last[name] for name in ("tool_x", "tool_y", "tool_z")]
        assert all(isinstance(one, float) for one in found)
        return found  # type: ignore[return-value]  # floats, as the line above asserts


def is_still(arm: Arm) -> bool:
    """Return whether no joint moves for a second."""
    before = arm.joints
    arm.wait(1.0)
    return arm.joints == pytest.approx(before, abs=1e-9)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_held_stick_moves_the_tool_straight_and_lets_it_stand(axis: str, sign: int) -> None:
    """Along one axis of the base, with the tool pointing down all the way."""
    arm = Arm()
    arm.mode("tool_mode")
    start, down = tool_of(arm.joints)
    assert arm.tool == pytest.approx(start, abs=1e-3)
    arm.hold("jog", 1.0, {axis: 0.05 * sign})
    place, points = tool_of(arm.joints)
    assert arm.tool == pytest.approx(place, abs=2e-3)
    assert points == pytest.approx(down, abs=1e-3)
    moved = [after - before for after, before in zip(place, start, strict=True)]
    wanted = [0.05 * sign if name == axis else 0.0 for name in "xyz"]
    assert moved == pytest.approx(wanted, abs=0.006)
    assert is_still(arm)


def test_the_tool_turns_in_place() -> None:
    arm = Arm()
    arm.mode("tool_mode")
    start = arm.joints
    arm.hold("jog", 1.0, {"rz": 0.3})
    assert arm.joints[:5] == pytest.approx(start[:5], abs=1e-6)
    assert arm.joints[5] - start[5] == pytest.approx(-0.3, abs=0.03)


@pytest.mark.parametrize("joint", range(6))
def test_a_held_lever_moves_one_joint(joint: int) -> None:
    arm = Arm()
    arm.mode("joint_mode")
    start = arm.joints
    arm.hold("jog_joints", 1.0, {f"j{joint + 1}": 0.2})
    moved = [after - before for after, before in zip(arm.joints, start, strict=True)]
    assert moved == pytest.approx([0.2 if at == joint else 0.0 for at in range(6)], abs=0.025)
    assert is_still(arm)


@pytest.mark.parametrize(
    ("mode", "name", "argument"), [("tool_mode", "jog", "x"), ("joint_mode", "jog_joints", "j1")]
)
def test_without_commands_servo_stops_the_arm(mode: str, name: str, argument: str) -> None:
    """After incoming_command_timeout, as if the connection were lost."""
    arm = Arm()
    arm.mode(mode)
    for _ in range(5):
        assert arm.give(name, **{argument: 0.05}) == []
    moving = arm.joints
    arm.wait(0.25)
    assert arm.joints != moving
    assert is_still(arm)


def test_motion_needs_the_mode_that_belongs_to_it() -> None:
    arm = Arm()
    (told,) = arm.give("jog", x=0.05)
    assert "Press Jog the tool first" in told
    arm.mode("joint_mode")
    (told,) = arm.give("jog", x=0.05)
    assert "Press Jog the tool first" in told
    (told,) = arm.give("move", positions=list(arm.joints), seconds=10)
    assert "Press Goals first" in told
    arm.mode("goal_mode")
    (told,) = arm.give("jog_joints", j1=0.1)
    assert "Press Jog joints first" in told


def test_a_goal_is_reached_no_faster_than_the_setting_allows() -> None:
    arm = Arm()
    goal = [0.4, -1.4, 1.5, -1.6, -1.57, 0.3]
    (told,) = arm.give("move", positions=goal, seconds=1)
    assert "faster than the setting allows" in told
    assert arm.give("move", positions=goal, seconds=2) == []
    fastest = 0.0
    for _ in range(38):
        arm.wait(PERIOD_S)
        speeds = arm.last["qd"]
        assert isinstance(speeds, tuple)
        fastest = max(fastest, *(abs(one) for one in speeds))
    assert "move" not in arm.done
    arm.wait(0.5)
    assert arm.done.count("move") == 1
    assert arm.joints == pytest.approx(goal, abs=1e-6)
    assert 0.15 < fastest <= 0.3 * 1.05


@pytest.mark.parametrize("end", ["cancel", "tool_mode", "stop_program", "power_off"])
def test_a_goal_ends_when_it_is_cancelled_or_its_controller_stops(end: str) -> None:
    """STOP sends `cancel`; the other ends are those of controller_manager and of the arm."""
    arm = Arm()
    assert arm.profile.driver.commands["cancel"].stops
    arm.give("move", positions=[3, -1.57, 1.57, -1.57, -1.57, 0], seconds=60)
    arm.wait(3.0)
    on_its_way = arm.joints
    assert on_its_way[0] > 0.11
    arm.give(end)
    arm.wait(1.0)
    assert "move" not in arm.done
    assert is_still(arm)
    assert arm.joints[0] < 1.0


def test_it_goes_back_to_a_remembered_position() -> None:
    arm = Arm()
    kept = arm.joints
    assert arm.give("keep") == []
    arm.mode("joint_mode")
    arm.hold("jog_joints", 1.0, {"j1": 0.3, "j6": -0.3})
    arm.mode("goal_mode")
    assert arm.joints != pytest.approx(kept, abs=0.1)
    assert arm.give("go_back") == []
    arm.wait(4.0)
    assert arm.joints == pytest.approx(kept, abs=1e-6)


def test_the_arm_halts_close_to_a_singularity_and_at_the_limit_of_a_joint() -> None:
    arm = Arm()
    arm.mode("tool_mode")
    for _ in range(160):
        arm.give("jog", x=-0.1, z=0.0)
    assert arm.last["servo_status"] == "stopped at a singularity"
    assert is_still(arm)
    arm.mode("joint_mode")
    for _ in range(400):
        arm.give("jog_joints", j6=0.4)
    assert arm.joints[5] == pytest.approx(6.2832 - 0.1, abs=1e-3)
    assert arm.last["servo_status"] == "joint limit"
    for _ in range(200):
        arm.give("jog_joints", j3=0.4)
    assert arm.joints[2] == pytest.approx(3.1416 - 0.1, abs=1e-3), "the elbow has half the range"
