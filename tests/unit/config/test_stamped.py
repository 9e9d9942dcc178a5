"""`stamped`: a ROS message in its stamped kind; params with choices of several types."""

import shutil
from pathlib import Path

import pytest

from tests.unit.config.folder import ROOT, Folder, head
from urc.config.load import check
from urc.config.parse.widget import WidgetFolder
from urc.model.payload import WriteSpec
from urc.protocol.forms.table import build_writer
from urc.protocol.forms.topics import published
from urc.protocol.values.payload import CodecContext, Frame
from urc.runtime.document_tests import exercise
from urc.runtime.registries import built_in_catalog

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


CHOSEN = """
settings: { new: { type: boolean, default: false } }
tests:
  - name: plain
    run: drive
    args: { x: 0.5 }
    sent: { ros: { publish: { topic: /cmd_vel, type: geometry_msgs/Twist, json: PLAIN } } }
  - name: stamped
    settings: { new: true }
    run: drive
    args: { x: 0.5 }
    sent: { ros: { publish: { topic: /cmd_vel, type: geometry_msgs/TwistStamped, json: BODY } } }
"""


def choosing(expression: str) -> str:
    """Return a rover that chooses between the two types."""
    command = DRIVE.replace("TYPE", "geometry_msgs/Twist").partition("tests:")[0]
    command = command.replace("stamped: true", f"stamped: {expression}")
    tests = CHOSEN.replace("BODY", BODY.replace("FIELD", "twist"))
    tests = tests.replace("PLAIN", "{ linear: { x: 0.5 } }")
    return head("robot", "rover") + ROS + command + tests


def test_a_setting_chooses_the_stamped_message(tmp_path: Path) -> None:
    """The emulated robot reads both, and topics are compared with the chosen type."""
    folder = Folder(tmp_path)
    folder.write(rover=choosing("settings.new"))
    checked = folder.check("rover")
    assert checked.profile is not None, checked.problems
    assert exercise(checked.profile).problems == []
    driver = checked.profile.driver
    for new, kind in ((False, "geometry_msgs/Twist"), (True, "geometry_msgs/TwistStamped")):
        assert [one.type for one in published(driver, "ros", {"new": new})] == [kind]
        write = driver.commands["drive"].send
        assert isinstance(write, WriteSpec)
        writer = build_writer(write, CodecContext(settings={"new": new}))
        said = writer.write({"x": 0.25, "settings": {"new": new}})
        assert writer.read(Frame(said, "utf-8")) == {"x": 0.25}


@pytest.mark.parametrize(
    ("expression", "code"),
    [
        ("x > 0", "unknown-name"),
        ("settings.old", "unknown-setting"),
        ("settings.new ==", "bad-expression"),
        ("'{{ settings.new }}'", "bad-expression"),
    ],
)
def test_an_expression_that_is_no_choice_is_refused(
    tmp_path: Path, expression: str, code: str
) -> None:
    folder = Folder(tmp_path)
    folder.write(rover=choosing(expression))
    found = [one for one in folder.found("rover") if one.severity == "error"]
    assert found
    assert all("commands.drive.send.publish" in one.path for one in found)
    assert found[0].code == code


def test_a_type_without_a_stamped_kind_is_refused(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    folder.write(rover=rover("std_msgs/Float64", "data"))
    (problem,) = (one for one in folder.found("rover") if one.severity == "error")
    assert (problem.code, problem.path) == ("bad-value", "commands.drive.send.publish.stamped")
    assert problem.message == "'std_msgs/Float64' has no known stamped type, or 'json' is missing"


@pytest.mark.parametrize("word", ["true", "false"])
def test_a_test_states_the_message_as_the_command_does(tmp_path: Path, word: str) -> None:
    """One param sets both, so a driver's test passes with and without the header."""
    plain = rover("geometry_msgs/Twist", "twist")
    _, _, sent = plain.partition("    sent: ")
    same = "type: geometry_msgs/Twist, stamped: true, json: { linear: { x: 0.5 } }"
    text = plain.replace(sent, f"{{ ros: {{ publish: {{ topic: /cmd_vel, {same} }} }} }}\n")
    folder = Folder(tmp_path)
    folder.write(rover=text.replace("stamped: true", f"stamped: {word}"))
    checked = folder.check("rover")
    assert checked.profile is not None, checked.problems
    assert exercise(checked.profile).problems == []


def test_a_test_that_expects_another_stamp_fails(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    body = "json: { linear: { x: 0.5 } }"
    text = rover("geometry_msgs/Twist", "twist").partition("    sent: ")[0]
    text += f"    sent: {{ ros: {{ publish: {{ topic: /cmd_vel, {body} }} }} }}\n"
    folder.write(rover=text)
    profile = folder.check("rover").profile
    assert profile is not None
    assert len(exercise(profile).problems) == 1


def test_a_test_with_a_type_without_a_stamped_kind_is_refused(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    plain = rover("geometry_msgs/Twist", "twist")
    text = plain.replace("TwistStamped", "Twist2, stamped: true")
    folder.write(rover=text.replace("type: geometry_msgs/Twist2", "type: std_msgs/String"))
    (problem,) = (one for one in folder.found("rover") if one.severity == "error")
    assert (problem.code, problem.path) == ("bad-value", "tests.0.sent.ros.publish.stamped")


@pytest.mark.parametrize("robot", ["turtlebot3", "turtlebot4", "generic-ros2"])
def test_shipped_robots_pass_their_tests_with_stamped_commands(tmp_path: Path, robot: str) -> None:
    """As the documentation tells users of Jazzy to set them up."""
    shipped = ROOT / "robots"
    for name in ("drivers", "interfaces"):
        shutil.copytree(shipped / name, tmp_path / name)
    text = (shipped / f"{robot}.yaml").read_text("utf-8")
    assert "params: { ros: 2" in text
    folder = Folder(tmp_path)
    folder.write(**{robot: text.replace("params: { ros: 2", "params: { stamped: true, ros: 2")})
    checked = check(tmp_path / f"{robot}.yaml", built_in_catalog(), WidgetFolder(ROOT / "widgets"))
    assert checked.profile is not None, checked.problems
    assert exercise(checked.profile).problems == []


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
