"""What ships with URC, named from any folder: a driver, a robot, an interface."""

from pathlib import Path

import pytest

from tests.unit.config.folder import WIRE, Folder, head
from urc.config.load import check
from urc.config.parse.widget import WidgetFolder
from urc.problems import Problem
from urc.runtime.registries import built_in_catalog
from urc.shipped import shipped

PARAMS = "params: { ros: 1, speed: 0.5, back: -0.5, turn: 1.0, right: -1.0, watchdog: none }"

NAMES = sorted(file.stem for file in shipped("robots").glob("*.yaml"))


@pytest.fixture
def folder(tmp_path: Path) -> Folder:
    return Folder(tmp_path)


def found(folder: Folder, name: str) -> tuple[Problem, ...]:
    """Return what is found in a document that has the widgets of URC."""
    file = folder.folder / f"{name}.yaml"
    return tuple(check(file, built_in_catalog(), WidgetFolder(shipped("widgets"))).problems)


def test_a_driver_is_used_by_its_name(folder: Folder) -> None:
    """From a folder that knows nothing of where URC is."""
    folder.write(
        mine=head("robot", "mine")
        + "settings: { host: { type: host }, port: { type: port, default: 9090 } }\n"
        + f"driver:\n  use: ros-base\n  {PARAMS}\n"
        + "interfaces: { default: ros-base }\n"
    )
    assert found(folder, "mine") == ()
    loaded = check(
        folder.folder / "mine.yaml", built_in_catalog(), WidgetFolder(shipped("widgets"))
    )
    assert loaded.profile is not None
    assert "drive" in loaded.profile.driver.commands
    assert loaded.profile.interfaces["default"].name == "default"


def test_a_robot_is_extended_by_its_name(folder: Folder) -> None:
    """With the driver and the interfaces that it names, relative to where it stands."""
    folder.write(mine=head("robot", "mine") + "extends: generic-ros1\ntitle: Mine\n")
    assert found(folder, "mine") == ()


@pytest.mark.parametrize("name", NAMES)
def test_each_shipped_robot_is_extended_by_its_name(name: str, folder: Folder) -> None:
    """The files of its widgets, such as a model, are in the folder of the shipped robot."""
    folder.write(mine=head("robot", "mine") + f"extends: {name}\ntitle: Mine\n")
    assert [problem for problem in found(folder, "mine") if problem.severity == "error"] == []


def test_a_robot_that_extends_one_changes_its_driver(folder: Folder) -> None:
    """Which driver it is needs not be said again."""
    over = "driver: { params: { speed: 0.2 }, overrides: { signals: { x: { title: East } } } }\n"
    folder.write(mine=head("robot", "mine") + "extends: generic-ros1\n" + over)
    assert found(folder, "mine") == ()
    loaded = check(
        folder.folder / "mine.yaml", built_in_catalog(), WidgetFolder(shipped("widgets"))
    )
    assert loaded.profile is not None
    driver = loaded.profile.driver
    assert driver.signals["x"].title == "East"
    assert driver.commands["drive"].arguments["speed"].max == 0.2


def test_a_driver_that_is_only_named_is_changed_as_well(folder: Folder) -> None:
    """`driver: line.yaml` is short for `driver: { use: line.yaml }`."""
    folder.write(
        line=head("driver", "line")
        + WIRE
        + "signals: { j: { type: integer } }\n"
        + "messages: { j: { regex: '^(?P<j>[0-9]+)$' } }\n",
        base=head("robot", "base") + "driver: line.yaml\n",
        mine=head("robot", "mine")
        + "extends: base.yaml\ndriver: { overrides: { signals: { j: { title: Joint } } } }\n",
    )
    assert [one for one in folder.found("mine") if one.severity == "error"] == []
    profile = folder.check("mine").profile
    assert profile is not None
    assert profile.driver.signals["j"].title == "Joint"


def test_a_driver_that_nothing_names_is_asked_for(folder: Folder) -> None:
    """Changes alone say not of what."""
    folder.write(
        mine=head("robot", "mine") + "driver: { overrides: { signals: { j: { title: J } } } }\n"
    )
    (problem,) = folder.found("mine")
    assert (problem.code, problem.path) == ("missing-key", "driver")
    assert "'use' is missing" in problem.message


@pytest.mark.parametrize(
    ("text", "message", "hint"),
    [
        (
            "extends: generic-ros11\n",
            "no robot named 'generic-ros11' ships with URC",
            "did you mean 'generic-ros1'?",
        ),
        (
            "driver: { use: nothing-like-it }\n",
            "no driver named 'nothing-like-it' ships with URC",
            "the path of a document must end with .yaml; shipped drivers: absolem, ",
        ),
        (
            "interfaces: { default: ros-bas }\n" + WIRE,
            "no interface named 'ros-bas' ships with URC",
            "did you mean 'ros-base'?",
        ),
    ],
)
def test_a_name_that_nothing_has_says_what_there_is(
    text: str, message: str, hint: str, folder: Folder
) -> None:
    """And that a path looks otherwise."""
    folder.write(mine=head("robot", "mine") + text)
    (problem,) = folder.found("mine")
    assert (problem.code, problem.message) == ("no-such-file", message)
    assert problem.hint.startswith(hint)


@pytest.mark.parametrize("wild", ["../ros-base", "/ros-base", "~/x", "a:b", "Ros Base"])
def test_what_is_neither_a_name_nor_a_path_is_refused(wild: str, folder: Folder) -> None:
    """No name leads anywhere else."""
    folder.write(mine=head("robot", "mine") + f"extends: '{wild}'\n")
    (problem,) = folder.found("mine")
    assert problem.code == "bad-text"
    assert "such as drivers/biorob-dongle.yaml" in problem.hint
