"""`stamped`: a ROS message in its stamped kind; params with choices of several types."""

from pathlib import Path

import pytest

from tests.unit.config.folder import Folder, head
from urc.runtime.document_tests import exercise

ROS = "transports: { ros: { type: ros, host: robot, stale_after: 3s, version: auto } }\n"
DRIVE = """
commands:
  drive:
    args: { x: { unit: m/s, min: -1, max: 1 } }
    hold: { repeat: 100ms, release: { x: 0 }, watchdog: 500ms }
    send:
      publish: { topic: /cmd_vel, type: TYPE, stamped: true, json: { linear: { x: "{{ x }}" } } }
tests:
  - name: stamped
    run: drive
    args: { x: 0.5 }
    sent: { ros: { publish: { topic: /cmd_vel, type: TYPEStamped, json: BODY } } }
"""
BODY = '{ header: { stamp: now, frame_id: "" }, FIELD: { linear: { x: 0.5 } } }'


def rover(kind: str, field: str) -> str:
    body = BODY.replace("FIELD", field)
    return head("robot", "rover") + ROS + DRIVE.replace("TYPE", kind).replace("BODY", body)


@pytest.mark.parametrize(
    ("kind", "field"),
    [("geometry_msgs/Twist", "twist"), ("geometry_msgs/msg/Vector3", "vector")],
)
def test_a_stamped_message_has_a_header_and_its_field(
    tmp_path: Path, kind: str, field: str
) -> None:
    """As common_interfaces names it; the bridge writes its own time for ``now``."""
    folder = Folder(tmp_path)
    folder.write(rover=rover(kind, field))
    checked = folder.check("rover")
    assert checked.profile is not None, checked.problems
    assert exercise(checked.profile).problems == []


def test_a_type_without_a_stamped_kind_is_refused(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    folder.write(rover=rover("std_msgs/Float64", "data"))
    (problem,) = (one for one in folder.found("rover") if one.severity == "error")
    assert (problem.code, problem.path) == ("bad-value", "commands.drive.send.publish.stamped")
    assert problem.message == "'std_msgs/Float64' has no known stamped type, or 'json' is missing"


@pytest.mark.parametrize("given", ["auto", "2"])
def test_choices_of_a_param_may_be_of_several_types(tmp_path: Path, given: str) -> None:
    """A word and numbers: the line of ros-base takes ``auto``, 1 and 2."""
    folder = Folder(tmp_path)
    folder.write(
        line=head("driver", "line")
        + "params: { ros: { choices: [auto, 1, 2], default: auto } }\n"
        + ROS.replace("auto", '"{params.ros}"'),
        bot=head("robot", "bot") + f"driver: {{ use: line.yaml, params: {{ ros: {given} }} }}\n",
    )
    profile = folder.check("bot").profile
    assert profile is not None
    assert str(profile.driver.transports["ros"].options["version"]) == given
