"""What a card shows of a robot: a picture, values, or nothing; and nobody is connected for it."""

from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep

import pytest
from starlette.testclient import TestClient

from urc.model.driver import Driver
from urc.model.interface import WidgetUse
from urc.model.values import Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS, HERE
from urc.web.app import DashboardOptions, build_app
from urc.web.feed.client_socket import SocketFlow
from urc.web.fleet.robots import Glimpse, Robot
from urc.web.show.card import VALUES, small_values

JPEG = b"\xff\xd8\xff\xe0 a picture"
SVG = b'<svg xmlns="http://www.w3.org/2000/svg"/>'


def until(holds: Callable[[], bool], within_s: float = 10.0) -> None:
    """Wait until something holds."""
    end_s = monotonic() + within_s
    while not holds():
        assert monotonic() < end_s
        sleep(0.02)


def client_of(robot: FakeRobot, glimpse: Glimpse | str = "real") -> TestClient:
    """Return a client of a dashboard; "real": the robot is not emulated."""
    look = None if isinstance(glimpse, str) else lambda: glimpse
    app = build_app(
        {"puppet": Robot(robot.profile, {}, robot.open, glimpse=look)},
        DashboardOptions(access=ACCESS, linger_s=0.01),
    )
    client = TestClient(app, base_url="http://localhost:8080", cookies=HERE)
    client.app_state["flow"] = SocketFlow()
    return client


def test_an_emulated_robot_shows_its_picture_and_is_not_connected() -> None:
    robot = FakeRobot(dashboard_profile())
    answer = client_of(robot, JPEG).get("/robots/puppet/card")
    assert (answer.status_code, answer.content) == (200, JPEG)
    assert answer.headers["content-type"] == "image/jpeg"
    assert answer.headers["cache-control"] == "no-store"
    assert robot.opened == 0


def test_one_without_a_world_shows_its_values() -> None:
    robot = FakeRobot(dashboard_profile())
    answer = client_of(robot, {"battery": 42}).get("/robots/puppet/card")
    assert answer.json() == [["Battery", "42 %"]]


def test_of_a_real_robot_that_nobody_looks_at_nothing_is_known() -> None:
    robot = FakeRobot(dashboard_profile())
    client = client_of(robot)
    assert client.get("/robots/puppet/card").status_code == 204
    assert client.get("/robots/nobody/card").status_code == 404
    assert robot.opened == 0


def test_a_real_robot_is_shown_while_somebody_is_connected() -> None:
    robot = FakeRobot(dashboard_profile())
    ours = {"origin": "http://localhost:8080"}
    with (
        client_of(robot) as client,
        client.websocket_connect("ws://localhost:8080/ws?robot=puppet", headers=ours) as line,
    ):
        assert line.receive_json()["t"] == "hello"
        assert client.portal is not None
        client.portal.call(robot.set_reading, "battery", 77)
        assert client.get("/robots/puppet/card").json() == [["Battery", "77 %"]]


def test_the_last_picture_of_a_real_robot_stays_and_is_marked_as_old() -> None:
    uses = (WidgetUse("view", "image", {"image": "view"}),)
    profile = dashboard_profile(signals={"view": Signal("view", "image")}, uses=uses)
    robot = FakeRobot(profile)
    ours = {"origin": "http://localhost:8080"}
    with client_of(robot) as client:
        with client.websocket_connect("ws://localhost:8080/ws?robot=puppet", headers=ours) as line:
            assert line.receive_json()["t"] == "hello"
            assert client.portal is not None
            client.portal.call(robot.set_reading, "view", JPEG)
            assert "x-urc-old" not in client.get("/robots/puppet/card").headers
        until(lambda: client.get("/robots/puppet/card").headers.get("x-urc-old") == "1")
        assert client.get("/robots/puppet/card").content == JPEG


def with_picture(tmp_path: Path) -> FakeRobot:
    """Return a robot with a picture and a camera."""
    place = tmp_path / "puppet.svg"
    place.write_bytes(SVG)
    uses = (WidgetUse("view", "image", {"image": "view"}),)
    profile = dashboard_profile(signals={"view": Signal("view", "image")}, uses=uses)
    return FakeRobot(profile._replace(picture=str(place)))


@pytest.mark.parametrize("glimpse", ["real", JPEG])
def test_a_robot_with_a_picture_shows_it_instead_of_its_world(
    tmp_path: Path, glimpse: Glimpse | str
) -> None:
    robot = with_picture(tmp_path)
    answer = client_of(robot, glimpse).get("/robots/puppet/card")
    assert (answer.status_code, answer.content) == (200, SVG)
    assert answer.headers["content-type"].startswith("image/svg+xml")
    assert answer.headers["x-urc-picture"] == "1"
    assert robot.opened == 0


def test_a_camera_takes_the_place_of_the_picture_while_it_is_connected(tmp_path: Path) -> None:
    robot = with_picture(tmp_path)
    ours = {"origin": "http://localhost:8080"}
    with client_of(robot, JPEG) as client:
        with client.websocket_connect("ws://localhost:8080/ws?robot=puppet", headers=ours) as line:
            assert line.receive_json()["t"] == "hello"
            assert client.portal is not None
            assert client.get("/robots/puppet/card").content == SVG
            client.portal.call(robot.set_reading, "view", JPEG)
            assert client.get("/robots/puppet/card").content == JPEG
        until(lambda: client.get("/robots/puppet/card").content == SVG)


def test_a_picture_whose_file_is_gone_is_not_found(tmp_path: Path) -> None:
    robot = with_picture(tmp_path)
    (tmp_path / "puppet.svg").unlink()
    assert client_of(robot).get("/robots/puppet/card").status_code == 404


def test_the_whole_card_leads_to_the_robot() -> None:
    page = client_of(FakeRobot(dashboard_profile()), JPEG).get("/").text
    assert 'data-look="/robots/puppet/card"' in page
    assert '<a class="urc-robot-link" href="/robots/puppet/" aria-label="Connect to Puppet"' in page
    assert page.count("/static/manage/menu.js") == 1


def test_values_are_the_first_few_that_fit_and_are_known() -> None:
    signals = {
        "speed": Signal("speed", "number", unit="m/s", precision=2),
        "scan": Signal("scan", "array"),
        "on_ground": Signal("on_ground", "boolean"),
        "far": Signal("far", "number"),
        **{f"s{place}": Signal(f"s{place}", "integer") for place in range(9)},
    }
    known = {"speed": 0.123, "scan": (1, 2), "on_ground": True, **{f"s{n}": n for n in range(9)}}
    found = small_values(Driver(signals=signals), known)
    assert found[:2] == [("Speed", "0.12 m/s"), ("On ground", "yes")]
    assert len(found) == VALUES
