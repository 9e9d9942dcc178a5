"""Demos of widgets, the gallery's pages, and which files of a widget's folder are served."""

import base64
import json
import os
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from urc.config.parse.widget import WidgetFolder
from urc.model.widget import Widget, WidgetPort
from urc.problems import UrcError
from urc.shipped import shipped
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS, HERE
from urc.web.app import DashboardOptions, Robot, build_app
from urc.web.load.assets import MOST_FILES, widget_assets
from urc.web.show.demos import WidgetState, colour_bars, demo_states

DEMO = """
signals:
  level: { type: number, unit: V }
  series: [{ type: number }, { type: number, title: Second }]
  eye: { type: image }
outputs:
  moved: drive
  press: { command: go, title: Go, arguments: { power: { type: number, max: 2 } }, reply: true }
states:
  normal:
    values: { level: 1, series: [2, 3], eye: { picture: [4, 2] } }
    alarms: { level: low }
    age_s: { level: 7 }
    history: { level: [[3, 0.5]] }
    shows: [one]
  none: { values: {} }
"""


def made(folder: Path, demo: str = DEMO) -> Widget:
    """Return a widget of a folder with this demo."""
    (folder / "demo.yaml").write_text(demo, "utf-8")
    inputs = {
        name: WidgetPort(name, is_multiple=name == "series") for name in ("level", "series", "eye")
    }
    outputs = {
        "moved": WidgetPort("moved", is_held=True, arguments=("x",)),
        "press": WidgetPort("press"),
    }
    return Widget("lamp", "Lamp", folder, inputs, outputs)


def states(folder: Path, demo: str = DEMO) -> dict[str, WidgetState]:
    """Return the states of that demo."""
    return {state.name: state for state in demo_states(made(folder, demo))}


def test_a_demo_is_a_robot_with_just_that_widget(tmp_path: Path) -> None:
    """Lists bind lists, what is held is held, and what is answered is answered."""
    state = states(tmp_path)["normal"]
    assert dict(state.use.inputs) == {"level": "level", "eye": "eye"}
    assert dict(state.use.lists) == {"series": ("series_0", "series_1")}
    assert state.profile.driver.signals["series_1"].title == "Second"
    drive, go = (state.profile.driver.commands[name] for name in ("drive", "go"))
    assert drive.hold is not None
    assert (drive.arguments["x"].min, drive.arguments["x"].max) == (-1, 1)
    assert (go.title, go.hold, go.arguments["power"].max) == ("Go", None, 2)
    assert go.reply is not None
    assert state.shows == ("one",)


def test_a_demo_says_a_reading_for_each_signal_that_has_a_value(tmp_path: Path) -> None:
    """With age, alarm, and images as their bytes; those without a value are not named."""
    news = json.loads(states(tmp_path)["normal"].news)
    assert [signal["name"] for signal in news["hello"]["signals"]][:2] == ["level", "series_0"]
    level, first, second, eye = news["readings"]
    assert level == {"signal": "level", "age": 7, "alarm": "low", "value": 1}
    assert (first["value"], second["value"]) == (2, 3)
    assert eye["type"] == "image/png"
    assert base64.b64decode(eye["picture"]) == colour_bars(4, 2)
    assert news["history"] == {"level": [[3, 0.5]]}
    assert json.loads(states(tmp_path)["none"].news)["readings"] == []


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ("{ file: ../secret.png }", "there is no file '../secret.png'"),
        ("{ file: missing.png }", "there is no file 'missing.png'"),
        ("{ base64: '?' }", "base64"),
        ("{ picture: [0, 1] }", "1 to 2048 pixels"),
        ("{ picture: [1, 2, 3] }", "[width, height]"),
    ],
)
def test_an_image_that_cannot_be_had_is_told_in_one_line(
    tmp_path: Path, value: str, told: str
) -> None:
    """No file outside of the widget's folder is read."""
    (tmp_path / "secret.png").write_bytes(b"secret")
    folder = tmp_path / "lamp"
    folder.mkdir()
    demo = DEMO.replace("{ picture: [4, 2] }", value)
    with pytest.raises(UrcError) as caught:
        states(folder, demo)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_widget_serves_its_modules_and_small_files_and_nothing_else(tmp_path: Path) -> None:
    """No hidden file, no template, no manifest, and no link that leads out."""
    folder = tmp_path / "lamp"
    (folder / "parts").mkdir(parents=True)
    outside = tmp_path / "outside.js"
    outside.write_text("secret", "utf-8")
    for name in ("widget.js", "widget.css", "more.js", "parts/a.svg", ".b.js", "_c.js", "d.yaml"):
        (folder / name).write_text("", "utf-8")
    os.symlink(outside, folder / "link.js")
    files = widget_assets([Widget("lamp", "Lamp", folder)]).files
    names = ("more.js", "parts/a.svg", "widget.css", "widget.js")
    assert sorted(files) == [f"lamp/{name}" for name in names]


def test_a_widget_with_too_many_files_is_refused(tmp_path: Path) -> None:
    """A folder is no place for a library."""
    for number in range(MOST_FILES + 1):
        (tmp_path / f"f{number}.js").write_text("", "utf-8")
    with pytest.raises(UrcError, match=f"at most {MOST_FILES} are allowed"):
        widget_assets([Widget("lamp", "Lamp", tmp_path)])


@pytest.fixture
def client() -> TestClient:
    """Return a client of a dashboard; its robot has no part in the gallery."""
    robot = FakeRobot(dashboard_profile())
    app = build_app(
        {"puppet": Robot(robot.profile, {}, robot.open)}, DashboardOptions(access=ACCESS)
    )
    return TestClient(app, base_url="http://localhost", cookies=HERE)


def test_the_gallery_lists_every_widget_and_the_menu_leads_there(client: TestClient) -> None:
    """With its title and what it is for."""
    page = client.get("/widgets").text
    registry = WidgetFolder(shipped("widgets"))
    for name in registry.names():
        assert f'href="/widgets/{name}/"' in page
    assert 'href="/widgets"' in client.get("/").text


def test_a_page_shows_each_state_of_the_widgets_that_it_names(client: TestClient) -> None:
    """And serves their files, whether a robot uses them or not."""
    page = client.get("/widgets/value+button/")
    assert page.status_code == 200
    for name in ("value", "button"):
        widget = WidgetFolder(shipped("widgets")).get(name)
        assert widget is not None
        assert page.text.count(f'data-widget="{name}"') == len(demo_states(widget))
        assert client.get(f"/widgets/{name}/widget.js").status_code == 200
    assert client.get("/widgets/value/widget.yaml").status_code == 404


def test_a_widgets_page_is_found_without_its_last_slash(client: TestClient) -> None:
    """As a robot's page is."""
    answer = client.get("/widgets/plot", follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (308, "/widgets/plot/")


def test_what_a_widget_is_for_is_told_in_the_readers_language(client: TestClient) -> None:
    """Its examples, too, as far as most widgets have them; the rest is marked as English."""
    german = {"accept-language": "de"}
    page = client.get("/widgets/plot/", headers=german).text
    assert '<p class="urc-gallery-summary">Zeichnet Zahlen der letzten Minuten' in page
    assert ">veraltet</h2>" in page
    listed = client.get("/widgets", headers=german).text
    assert "Zeigt, wo der Roboter ist" in listed
    assert "Shows the robot on a map" not in listed
    assert (
        'class="urc-card-summary" lang="en">Shows the robot on a map' in client.get("/widgets").text
    )


@pytest.mark.parametrize(
    "path", ["/widgets/nothing/", "/widgets/value+nothing/", "/widgets/..%2fx/", "/widgets/+/"]
)
def test_a_widget_that_there_is_not_has_no_page(client: TestClient, path: str) -> None:
    """Also when the others on the page are there."""
    assert client.get(path).status_code == 404


def test_only_a_page_for_developers_asks_whether_a_file_was_saved(client: TestClient) -> None:
    """Without --dev nobody can make the server look at files again and again."""
    assert client.get("/widgets/value/stamp").status_code == 404
    assert 'data-stamp=""' in client.get("/widgets/value/").text


def test_a_page_for_developers_sees_every_file_that_is_saved(tmp_path: Path) -> None:
    """Also one that is new; and nothing when nothing was saved."""
    folder = tmp_path / "battery"
    folder.mkdir()
    widget = made(folder)._replace(name="battery")
    robot = FakeRobot(dashboard_profile(widgets=[widget]))
    served = Robot(robot.profile, {}, robot.open)
    app = build_app(
        {"puppet": served}, DashboardOptions(access=ACCESS, remake={"puppet": lambda _: served})
    )
    browser = TestClient(app, base_url="http://localhost", cookies=HERE)
    seen = [browser.get("/widgets/battery/stamp").text for _ in range(2)]
    (folder / "widget.js").write_text("// new", "utf-8")
    seen.append(browser.get("/widgets/battery/stamp").text)
    (folder / "widget.js").write_text("// and longer", "utf-8")
    seen.append(browser.get("/widgets/battery/stamp").text)
    assert seen[0] == seen[1]
    assert len(set(seen)) == 3


def test_a_widget_of_a_robot_stands_before_the_shipped_one(tmp_path: Path) -> None:
    """What the gallery shows is what the robot's page shows."""
    folder = tmp_path / "battery"
    folder.mkdir()
    (folder / "template.html.j2").write_text("<p>mine</p>", "utf-8")
    (folder / "demo.yaml").write_text("states: { normal: { values: {} } }", "utf-8")
    own = Widget("battery", "Mine", folder, {"level": WidgetPort("level")})
    robot = FakeRobot(dashboard_profile(widgets=[own]))
    app = build_app(
        {"puppet": Robot(robot.profile, {}, robot.open)}, DashboardOptions(access=ACCESS)
    )
    page = TestClient(app, base_url="http://localhost", cookies=HERE).get("/widgets/battery/").text
    assert "&lt;p&gt;mine&lt;/p&gt;" in page  # for its frame


MANIFEST = """\
urc: 1
kind: widget
name: lamp
title: Lamp
summary: Shines.
inputs: { level: { type: number } }
"""
LAMP_DEMO = """\
signals: { level: { type: number } }
states: { normal: { values: { level: 1 } } }
"""


def lamp_beside_a_robot(folder: Path, *, is_dev: bool = True) -> TestClient:
    """Return a client of a dashboard that serves a robot beside which there is a widget."""
    lamp = folder / "widgets" / "lamp"
    lamp.mkdir(parents=True)
    (lamp / "widget.yaml").write_text(MANIFEST, "utf-8")
    (lamp / "template.html.j2").write_text("<p>lamp</p>", "utf-8")
    (lamp / "demo.yaml").write_text(LAMP_DEMO, "utf-8")
    widget = WidgetFolder(lamp.parent).get("lamp")
    assert widget is not None
    profile = dashboard_profile(widgets=[widget])._replace(file=str(folder / "robot.yaml"))
    robot = FakeRobot(profile)
    served = Robot(robot.profile, {}, robot.open)
    remake = {"puppet": lambda _: served} if is_dev else None
    app = build_app({"puppet": served}, DashboardOptions(access=ACCESS, remake=remake))
    return TestClient(app, base_url="http://localhost", cookies=HERE)


@pytest.mark.parametrize(
    ("name", "before", "after", "told"),
    [
        ("demo.yaml", "{ level: 1 }", "{ levl: 1 }", "demo.yaml:2:31: error unknown-key"),
        ("demo.yaml", "states: {", "states: {{", "demo.yaml:2:9: error"),
        ("widget.yaml", "summary:", "sumary:", "widget.yaml:5:1: error unknown-key sumary"),
        ("widget.yaml", "inputs: {", "inputs: [", "widget.yaml:6:"),
    ],
)
def test_a_page_for_developers_says_what_is_wrong_and_waits_until_it_is_mended(
    tmp_path: Path,
    name: str,
    before: str,
    after: str,
    told: str,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """With the place, on the page and in the log; the stamp of the page asks for a new one."""
    browser = lamp_beside_a_robot(tmp_path)
    file = tmp_path / "widgets" / "lamp" / name
    sound = file.read_text("utf-8")
    file.write_text(sound.replace(before, after), "utf-8")
    answer = browser.get("/widgets/lamp/")
    assert answer.status_code == 409
    assert told in answer.text
    assert [told in record.getMessage() for record in caplog.records][:1] == [True]
    stamp = browser.get("/widgets/lamp/stamp").text
    assert f'data-stamp-now="{stamp}"' in answer.text
    file.write_text(sound, "utf-8")
    assert browser.get("/widgets/lamp/stamp").text != stamp
    assert browser.get("/widgets/lamp/").status_code == 200


def test_a_broken_widget_of_several_costs_no_other_its_place(tmp_path: Path) -> None:
    """The page shows the rest of them."""
    browser = lamp_beside_a_robot(tmp_path)
    (tmp_path / "widgets" / "lamp" / "demo.yaml").write_text("states: {}", "utf-8")
    page = browser.get("/widgets/lamp+value/").text
    assert "missing-key states" in page
    assert 'data-widget="value"' in page


def test_without_dev_a_widget_is_shown_as_its_robot_knows_it(tmp_path: Path) -> None:
    """A manifest that was broken since does not matter before URC is started anew."""
    browser = lamp_beside_a_robot(tmp_path, is_dev=False)
    (tmp_path / "widgets" / "lamp" / "widget.yaml").write_text("urc: 1", "utf-8")
    page = browser.get("/widgets/lamp/")
    assert page.status_code == 200
    assert 'data-stamp=""' in page.text


def test_a_broken_widget_beside_a_robot_is_in_the_list(tmp_path: Path) -> None:
    """And says that its manifest cannot be read."""
    browser = lamp_beside_a_robot(tmp_path)
    (tmp_path / "widgets" / "lamp" / "widget.yaml").write_text("urc: 1", "utf-8")
    assert "its manifest cannot be read" in browser.get("/widgets").text
