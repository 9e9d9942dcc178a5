"""What goes wrong on demand: late, lost, noisy, missing, stuck; and right again."""

import math
from pathlib import Path

import pytest

from urc.config.load import load_profile
from urc.problems import UrcError
from urc.runtime.registries import built_in_catalog
from urc.simulator.emulated_robot import EmulatedConnection, EmulatedRobot
from urc.simulator.faults import MOST_LATE, DelayLine, parse_fault

ROVER = r"""
urc: 1
kind: robot
name: rover
transports:
  wire: { type: tcp, host: 127.0.0.1, port: 1, framing: { type: delimiter, tx: LF, rx: LF } }
signals:
  x: { unit: m }
  level: { unit: "%" }
  range: { unit: m }
  mood: { type: integer }
messages:
  at: { regex: '^AT (?P<x>[-0-9.]+)$' }
polls:
  - { name: level, every: 1s, send: "L?", reply: { regex: '^L (?P<level>[0-9.]+)$' } }
  - { name: mood, every: 1s, send: "M?", reply: { regex: '^M (?P<mood>\d+)$' } }
commands:
  go: { send: "GO {{ speed }}", args: { speed: {} }, reply: { equals: OK } }
simulator:
  signals: { mood: 1 }
  state: { v: 0.0 }
  world:
    body: { type: differential, acceleration: 100 }
    map: { walls: [{ from: [3, -3], to: [3, 3] }] }
    drive: { forward: "{{ v }}" }
    laser: { rays: 1, from: 0, to: 1, noise: 0.1 }
    signals:
      x: "{{ world.x }}"
      level: "{{ world.battery.level }}"
      range: "{{ world.laser.ahead }}"
  wire:
    - { command: go, set: { v: "{{ speed }}" } }
    - { every: 1s, message: at }
    - { every: 1s, send: "R {{ range }}" }
    - { poll: mood, set: { mood: "{{ mood + 1 }}" } }
"""


@pytest.fixture
def rover(tmp_path: Path) -> EmulatedRobot:
    """A rover 3 m before a wall."""
    file = tmp_path / "rover.yaml"
    file.write_text(ROVER)
    return EmulatedRobot(load_profile(file, built_in_catalog()), {})


def test_late_is_whole_and_in_order(rover: EmulatedRobot) -> None:
    """Nothing before its time, and then everything."""
    line = rover.line("wire")
    assert line.advance(0.1, 0.1) == []
    rover.inject("delay=200ms", 0.1)
    assert line.receive(b"GO 0.5\nL?\n", 0.2) == []
    assert line.due_in_s == pytest.approx(0.2)
    assert line.advance(0.1, 0.3) == []
    assert [one[:5] for one in line.advance(0.1, 0.4)] == [b"OK\n", b"L 89."]
    rover.mend()
    assert line.receive(b"GO 0\n", 0.5) == [b"OK\n"]


def test_what_is_late_is_bounded() -> None:
    """Beyond it the newest are lost, and counted."""
    late = DelayLine()
    late.push([b"x"] * (MOST_LATE + 3), 1.0)
    assert late.lost == 3
    assert late.pop_due(0.9) == []
    assert len(late.pop_due(1.0)) == MOST_LATE
    assert late.due_s == math.inf


def answers(line: EmulatedConnection, count: int) -> int:
    """Return how many of so many questions, fifty a second, are answered."""
    return sum(bool(line.receive(b"L?\n", place / 50)) for place in range(count))


def test_lost_is_a_share_of_both_directions_and_the_same_ones_again(tmp_path: Path) -> None:
    """Of a question and its answer each gets through with the same chance."""
    file = tmp_path / "rover.yaml"
    file.write_text(ROVER)
    profile = load_profile(file, built_in_catalog())
    shares = []
    for _ in range(2):
        robot = EmulatedRobot(profile, {})
        robot.inject("loss=20%", 0.0)
        shares.append(answers(robot.line("wire"), 1000) / 1000)
    assert shares[0] == pytest.approx(0.8**2, abs=0.05)
    assert shares[0] == shares[1]
    robot.inject("loss=0%", 0.0)
    assert answers(robot.line("wire"), 50) == 50


def test_a_silent_robot_hears(rover: EmulatedRobot) -> None:
    """It says nothing at all, and does what it is told."""
    line = rover.line("wire")
    rover.inject("silent", 0.0)
    assert line.receive(b"GO 0.5\n", 0.0) == []
    assert line.advance(1.0, 1.0) == []
    rover.mend()
    assert line.advance(1.0, 2.0)[0] == b"AT 1\n"


def test_noise_is_so_many_times_as_loud(rover: EmulatedRobot) -> None:
    """Ranges about 3 m: a hundred times as noisy is far off."""
    line = rover.line("wire")

    def errors() -> list[float]:
        said = [line.advance(1.0, float(second))[1] for second in range(1, 30)]
        return [abs(float(one[2:]) - 3.0) for one in said if one != b"R \n"]

    before = max(errors())
    rover.inject("noise=0x", 0.0)
    assert max(errors()) == 0.0
    rover.inject("noise=10x", 0.0)
    assert max(errors()) > 2 * before > 0
    assert rover.faults == ("noise=10x",)


def test_a_signal_that_drops_out_is_not_told(rover: EmulatedRobot) -> None:
    """Neither by a message, nor by an answer, nor by a rule of its own; all others are."""
    line = rover.line("wire")
    rover.inject("dropout=level", 0.0)
    assert line.receive(b"L?\nM?\n", 0.0) == [b"M 2\n"]
    rover.inject("dropout=x", 0.0)
    assert [one[:1] for one in line.advance(1.0, 1.0)] == [b"R"]
    rover.inject("dropout=laser", 0.0)  # a sensor takes all signals with it that it tells
    assert line.advance(1.0, 2.0) == []
    assert line.faults == 0
    rover.mend()
    assert len(line.advance(1.0, 3.0)) == 2


def test_what_a_rule_reads_of_a_sensor_that_failed_is_not_told(tmp_path: Path) -> None:
    """Without a fault: the robot has nothing to say. Whatever else goes wrong is still told."""
    file = tmp_path / "rover.yaml"
    file.write_text(ROVER.replace('"R {{ range }}"', '"G {{ world.gps.fix }}"'))
    robot = EmulatedRobot(load_profile(file, built_in_catalog()), {})
    line = robot.line("wire")
    assert line.advance(1.0, 1.0)[1] == b"G 3\n"
    robot.inject("dropout=gps", 1.0)
    assert len(line.advance(1.0, 2.0)) == 1
    assert line.faults == 0
    robot.mend()
    assert len(line.advance(1.0, 3.0)) == 2


def test_a_signal_that_is_stuck_stays(rover: EmulatedRobot) -> None:
    """As it was when it began, whatever becomes of the robot."""
    line = rover.line("wire")
    line.receive(b"GO 0.5\n", 0.0)
    first = line.advance(1.0, 1.0)[0]
    rover.inject("stuck=x", 1.0)
    assert line.advance(1.0, 2.0)[0] == first
    rover.mend()
    assert line.advance(1.0, 3.0)[0] != first


def test_a_low_battery_is_low_at_once(rover: EmulatedRobot) -> None:
    """And stays so."""
    line = rover.line("wire")
    assert line.receive(b"L?\n", 0.0) == [b"L 90\n"]
    rover.inject("low-battery", 0.0)
    assert line.receive(b"L?\n", 0.0) == [b"L 12\n"]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("lag=2s", "unknown fault 'lag'; known faults: delay=200ms, loss=5%, silent, noise=2x"),
        ("delay", "fault delay: expected delay=200ms, found 'delay'"),
        ("delay=2h", "fault delay: expected delay=200ms, found 'delay=2h'"),
        ("loss=120%", "fault loss: expected loss=5%, found 'loss=120%'"),
        ("noise=-1x", "fault noise: expected noise=2x, found 'noise=-1x'"),
        ("silent=1", "fault silent: expected silent, found 'silent=1'"),
        ("dropout=levl", "fault dropout: there is no signal 'levl'; did you mean 'level'?"),
        ("stuck=y", "fault stuck: there is no signal 'y'"),
    ],
)
def test_what_is_no_fault_is_refused_in_one_line(rover: EmulatedRobot, text: str, why: str) -> None:
    """It says what was found and what there is; nothing becomes wrong."""
    with pytest.raises(UrcError) as caught:
        rover.inject(text, 0.0)
    assert str(caught.value).startswith(why)
    assert "\n" not in str(caught.value)
    assert rover.faults == ()


def test_a_robot_without_a_world_has_no_noise(tmp_path: Path) -> None:
    """Nor a battery that could be low."""
    file = tmp_path / "rover.yaml"
    file.write_text(ROVER.partition("simulator:")[0])
    robot = EmulatedRobot(load_profile(file, built_in_catalog()), {})
    for text in ("noise=2x", "low-battery"):
        with pytest.raises(UrcError, match="this robot has no world"):
            robot.inject(text, 0.0)
    assert robot.top_view(32, 32, 0.0) is None
    assert robot.camera(0.0) is None


def test_amounts_are_what_is_written() -> None:
    """Seconds, a share, a factor."""
    amounts = [parse_fault(text).amount for text in ("delay=200ms", "loss=2.5%", "noise=3")]
    assert amounts == pytest.approx([0.2, 0.025, 3.0])
