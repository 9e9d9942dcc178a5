"""The robots that ship: whole documents, whose tests leave nothing out and whose pages render."""

import os
import re
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from tests.contract.profiles import profile_of
from tests.contract.test_protocols import Conversation
from urc.config.load import WidgetFolder, check
from urc.model.payload import Envelope
from urc.problems import to_text
from urc.protocol.engine import Engine
from urc.protocol.events import Noted
from urc.runtime.coverage import measure
from urc.runtime.document_tests import exercise, sample_settings
from urc.runtime.registries import built_in_catalog
from urc.testing.dashboard import FakeRobot
from urc.testing.entry import ACCESS, HERE
from urc.web.app import DashboardOptions, build_app
from urc.web.fleet.robots import Robot

FOLDER = Path(__file__).parents[2] / "robots"
WIDGETS = FOLDER.parent / "widgets"
FILES = sorted(FOLDER.glob("*.yaml"))
SHARED = sorted([*FOLDER.glob("drivers/*.yaml"), *FOLDER.glob("interfaces/*.yaml")])

ON_THE_WAY = {"plan", "plan_frame", "map_plan", "goal_x", "goal_y", "waypoint"}
"""Signals that a robot has only while it drives by itself; see `test_worlds`."""
GIVEN = {"kept", "servo", "motors_requested"}
"""Signals that only commands set; see `test_arm`."""
LISTENED_S = 20.0
"""How long the emulated robot is listened to: more than twice the slowest poll."""


@pytest.fixture(params=FILES, ids=lambda file: file.stem)
def file(request: pytest.FixtureRequest) -> Path:
    """The document of one robot."""
    path: Path = request.param
    return path


def test_every_shipped_document_has_no_finding() -> None:
    """What ships is an example, so not even a warning is left in it."""
    files = [*FOLDER.glob("**/*.yaml"), *WIDGETS.glob("*/widget.yaml")]
    registry = WidgetFolder(WIDGETS)
    found = {os.fspath(file): check(file, built_in_catalog(), registry).problems for file in files}
    assert len(found) >= 2
    assert {name: problems for name, problems in found.items() if problems} == {}


def test_the_robots_of_the_thesis_and_those_that_people_own_are_there() -> None:
    """By the names that the documentation gives them."""
    owned = "ardupilot-rover create-2 esp32-cam generic-ros1 generic-ros2 gpsd nmea-gps tello"
    owned += " spot turtlebot3 turtlebot4 ur-e-series ur-ros2"
    thesis = "absolem amphibot-ii amphibot-iii puppet roveo-mini salamandra-i salamandra-ii"
    assert {file.stem for file in FILES} >= {*owned.split(), *thesis.split()}


@pytest.mark.parametrize("shared", SHARED, ids=lambda file: f"{file.parent.name}-{file.stem}")
def test_what_robots_share_is_without_a_finding(shared: Path) -> None:
    """A driver or interface that is shipped can be built on."""
    checked = check(os.fspath(shared), built_in_catalog())
    assert [to_text(problem) for problem in checked.problems] == []


def test_its_own_tests_pass_and_leave_nothing_out(file: Path) -> None:
    """No finding, and every command, poll and message is exercised."""
    profile = profile_of(file)
    outcome = exercise(profile)
    assert [to_text(problem) for problem in outcome.problems] == []
    assert measure(os.fspath(file), profile.driver, outcome.exercised).untested == ()


def test_motion_says_what_the_robot_does_when_commands_stop(file: Path) -> None:
    """In the summary, which the page of the robot begins with."""
    profile = profile_of(file)
    if any(command.hold for command in profile.driver.commands.values()):
        assert "fail-safe" in profile.summary.lower()


def test_what_steers_it_is_seen_on_a_phone_that_lies(file: Path) -> None:
    """Two rows fit there without a background; all that is held on a wide screen is shown."""
    profile = profile_of(file)
    holds = {name for name, one in profile.driver.commands.items() if one.hold is not None}
    steers = {
        name for name, use in profile.slots.items() if not holds.isdisjoint(use.outputs.values())
    }
    pages = [(page, each) for each in profile.interfaces.values() for page in each.pages]
    assert pages
    for page, interface in pages:
        shown = page.layouts.get("phone_landscape", page.layouts["landscape"])
        filled = [slot for slot in shown.slots if slot.name in profile.slots]
        rows = {row for slot in filled for row in range(slot.row, slot.row + slot.row_span)}
        assert interface.background or len(rows) <= 2
        wide = {slot.name for slot in page.layouts["landscape"].slots}
        assert steers & wide <= {slot.name for slot in filled}


def test_the_drone_has_no_button_that_cuts_the_motors_next_to_land() -> None:
    """On no screen: a thumb that misses Land must not make the drone fall."""
    profile = profile_of(FOLDER / "tello.yaml")
    layouts = profile.interfaces["default"].layouts
    assert len(layouts) == 4
    for name, layout in layouts.items():
        slots = {slot.name: slot for slot in layout.slots}
        cut, land = slots["cut"], slots["land"]
        rows = max(land.row - cut.row - cut.row_span, cut.row - land.row - land.row_span)
        columns = max(
            land.column - cut.column - cut.column_span, cut.column - land.column - land.column_span
        )
        assert max(rows, columns) >= 1, name


def test_the_button_that_cuts_the_motors_has_one_place_on_all_pages_of_the_drone() -> None:
    """Above “Takeoff”, or to its left on a phone in portrait; never like a chosen button."""
    profile = profile_of(FOLDER / "tello.yaml")
    assert profile.slots["cut"].options["look"] == "danger"
    for interface in profile.interfaces.values():
        for name, layout in interface.layouts.items():
            slots = {slot.name: slot for slot in layout.slots}
            cut, takeoff = slots["cut"], slots["takeoff"]
            place = (takeoff.row - cut.row, takeoff.column - cut.column)
            assert place == ((0, 4) if name == "phone_portrait" else (1, 0)), name


def test_its_page_is_made_with_every_slot_of_each_interface(file: Path) -> None:
    """The default interface and all others, the one for finding faults among them."""
    profile = profile_of(file)
    robot = Robot(profile, sample_settings(profile.settings), FakeRobot(profile).open)
    app = build_app({profile.name: robot}, DashboardOptions(access=ACCESS))
    with TestClient(app, base_url="http://localhost:8080", cookies=HERE) as client:
        for name, interface in profile.interfaces.items():
            page = client.get(f"/robots/{profile.name}/?interface={name}")
            assert page.status_code == 200, name
            cells = re.findall(
                r'class="urc-cell[^"]*" data-cell="[^>]*data-error="([^"]*)"', page.text
            )
            assert cells == [""] * len(interface.shown), name


@pytest.mark.cases(6)
def test_its_emulated_robot_says_all_that_there_is(file: Path) -> None:
    """Greetings, polls and messages without a fault on either side; every signal gets a value."""
    profile = profile_of(file)
    talk = Conversation(profile)
    talk.begin()
    talk.wait(LISTENED_S)
    refused = {name: line.last_fault for name, line in talk.lines.items() if line.faults}
    assert (talk.faults, refused) == ([], {})
    assert set(profile.driver.signals) - talk.read - ON_THE_WAY - GIVEN == set()


@pytest.mark.parametrize("least", ["info", "warning", "error"])
@pytest.mark.parametrize("name", ["generic-ros1", "generic-ros2", "ur-ros2"])
def test_the_log_of_ros_nodes_begins_at_the_level_of_the_setting(name: str, least: str) -> None:
    """The levels are those of rosgraph_msgs/Log and rcl_interfaces/Log, from debug to fatal."""
    profile = profile_of(FOLDER / f"{name}.yaml")
    settings = {**sample_settings(profile.settings), "log_level": least}
    engine = Engine(profile.driver, settings)
    engine.start("ros", 0.0)
    levels = [1, 2, 4, 8, 16] if name == "generic-ros1" else [10, 20, 30, 40, 50]
    found = []
    for level in levels:
        body = {"level": level, "name": "/node", "msg": "text"}
        said = Envelope("message", {"topic": "/rosout"}, body)
        found += [one for one in engine.receive("ros", said, 1.0) if isinstance(one, Noted)]
    words = ["info", "warning", "error", "error"]
    assert [one.level for one in found] == words[words.index(least) :]
    assert {one.text for one in found} == {"/node: text"}
