"""What is seen of a package by its documents alone, and which widgets one may use."""

from pathlib import Path

import pytest

from tests.unit.packages.made import DOCUMENTS, write_package
from urc.config.load import check
from urc.problems import ProblemsError, UrcError
from urc.runtime.package_preview import look
from urc.runtime.registries import built_in_catalog
from urc.runtime.widget_registry import widget_folder_of

LOOK = "widgets:\n  battery: { use: dial, bind: { level: battery } }\n"


def driver(folder: Path, old: str = "", new: str = "") -> Path:
    text = DOCUMENTS["driver"] + LOOK
    assert old in text
    return write_package(folder, "driver", "puppet", text=text.replace(old, new)) / "driver.yaml"


def test_what_goes_to_the_robot_is_seen_key_by_key(tmp_path: Path) -> None:
    """And nothing of how it looks, or is tested."""
    write_package(tmp_path, "widget", "dial")
    seen = look(driver(tmp_path), tmp_path, ["dial"])
    assert seen.wire["transports.wire.type"] == '"tcp"'
    assert seen.wire["transports.wire.port"] == "6789"
    assert seen.wire["commands.beep.send"] == '"beep"'
    assert seen.wire["settings.host.default"] == '"127.0.0.1"'
    assert not [path for path in seen.wire if path.startswith(("widgets", "name", "tests"))]
    assert "commands: beep" in seen.permissions


def test_one_changed_byte_is_one_changed_line(tmp_path: Path) -> None:
    """So an update can show it."""
    write_package(tmp_path, "widget", "dial")
    before = look(driver(tmp_path), tmp_path, ["dial"]).wire
    after = look(driver(tmp_path, 'send: "beep"', 'send: "BEEP"'), tmp_path, ["dial"]).wire
    assert {path for path in before if before[path] != after[path]} == {"commands.beep.send"}
    assert after["commands.beep.send"] == '"BEEP"'


@pytest.mark.parametrize("kind", ["widget", "interface"])
def test_what_talks_to_no_robot_has_no_wire(tmp_path: Path, kind: str) -> None:
    """Only what it may do is seen."""
    home = write_package(tmp_path, kind, "one")
    seen = look(home / f"{kind}.yaml", tmp_path, ["one"] if kind == "widget" else [])
    assert seen.wire == {}
    assert len(seen.permissions) == 1


def test_a_broken_document_or_one_that_reaches_out_is_not_looked_at(tmp_path: Path) -> None:
    """Its errors are told, and nothing of a file outside."""
    with pytest.raises(ProblemsError):
        look(driver(tmp_path / "a", "type: integer", "type: pigeon"), tmp_path, [])
    (tmp_path / "secret.yaml").write_text("urc: 1\nkind: driver\nname: secret\n")
    text = "driver: ../../../secret.yaml\n"
    robot = write_package(tmp_path / "b", "robot", "nosy", text=text) / "robot.yaml"
    with pytest.raises(UrcError, match="which is not in the package"):
        look(robot, tmp_path / "b", [])


def test_a_package_that_is_being_written_sees_what_stands_beside_it(tmp_path: Path) -> None:
    """Its document is right where it stands, and so is the name of its robot."""
    write_package(tmp_path, "widget", "dial")
    document = driver(tmp_path)
    robot = write_package(tmp_path, "robot", "my-puppet") / "robot.yaml"
    for path in (document, robot):
        checked = check(str(path), built_in_catalog(), widget_folder_of(path))
        assert {problem.code for problem in checked.problems} == {"unused-setting"}
        assert checked.profile is not None
        assert "dial" in checked.profile.widgets
    assert widget_folder_of(tmp_path / "else" / "driver.yaml").get("dial") is None
    assert widget_folder_of(document).get("battery") is not None


def test_a_robots_file_of_another_name_is_still_warned_of(tmp_path: Path) -> None:
    """Only in a folder of the robot's name is it always called `robot.yaml`."""
    write_package(tmp_path, "widget", "dial")
    driver(tmp_path)
    home = write_package(tmp_path, "robot", "my-puppet")
    other = home.rename(home.with_name("other")) / "robot.yaml"
    problems = check(str(other), built_in_catalog(), widget_folder_of(other)).problems
    assert "name-mismatch" in {problem.code for problem in problems}
