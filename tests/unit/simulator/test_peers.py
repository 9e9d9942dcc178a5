"""What programs of others expect of a robot, and URC by itself would not notice."""

from pathlib import Path

from tests.unit.simulator.test_auto import profile_of
from urc.model.payload import Envelope
from urc.simulator.emulated_robot import EmulatedRobot

ROS = """
transports:
  ros: { type: ros, host: 127.0.0.1 }
signals:
  v: { type: number, unit: m/s }
commands:
  drive:
    args: { v: { type: number }, turn: { type: number, default: 0 } }
    send:
      publish:
        topic: /cmd_vel
        type: geometry_msgs/Twist
        json: { linear: { x: "{{ v }}", y: 0 }, angular: { z: "{{ turn }}" } }
messages:
  speed: { from: ros, subscribe: { topic: /speed, type: std_msgs/Float64 }, json: { v: data } }
"""


def drive(folder: Path, body: object) -> tuple[int, object]:
    """Return the faults of a message, and the speed after it."""
    emulated_robot = EmulatedRobot(profile_of(folder, ROS), {})
    line = emulated_robot.line("ros")
    line.receive(Envelope("publish", {"topic": "/cmd_vel"}, body), 0.0)
    return line.faults, emulated_robot.readings(0.0)["v"]


def test_what_a_message_of_ros_leaves_out_is_zero(tmp_path: Path) -> None:
    """As rosbridge reads it."""
    assert drive(tmp_path, {"linear": {"x": 0.5}}) == (0, 0.5)


def test_a_zero_is_a_zero_however_it_is_written(tmp_path: Path) -> None:
    """JavaScript writes 0, Python 0.0."""
    body = {"linear": {"x": 0.5, "y": 0.0}, "angular": {"z": 0.0}}
    assert drive(tmp_path, body) == (0, 0.5)


def test_what_the_message_does_not_have_is_refused(tmp_path: Path) -> None:
    """As by rosbridge."""
    assert drive(tmp_path, {"linear": {"x": 0.5, "w": 1}})[0] == 1


GREETING = """
signals:
  release: { type: string }
messages:
  version: { json: { _class: class, release: release, _major: major }, when: "_class == 'VERSION'" }
simulator:
  signals: { release: "3.25" }
  state: { major: 7 }
  wire: [{ every: 1s, message: version }]
"""


def test_a_document_is_in_the_order_of_the_driver_and_knows_the_robots_state(
    tmp_path: Path,
) -> None:
    """Clients of gpsd look at the first key; `_major` is what the state calls `major`."""
    line = EmulatedRobot(profile_of(tmp_path, GREETING), {}).line("wire")
    said = [one for one in line.advance(1.0, 1.0) if isinstance(one, bytes)]
    assert said == [b'{"class":"VERSION","release":"3.25","major":7}\n'] or said == [
        b'{"class":"VERSION","release":"3.25","major":7}\r'
    ]
