"""The state of robots on the menu: battery, alarms, order and last use."""

import html
import json
import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from urc.model.driver import Driver, TransportSpec
from urc.model.interface import WidgetUse
from urc.model.values import Signal
from urc.runtime.contact_times import ContactStore
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS, HERE, person
from urc.web.api.overview import battery_signal, in_order
from urc.web.api.wire import ActiveAlarms, RobotSummary
from urc.web.app import DashboardOptions, build_app
from urc.web.feed.client_socket import SocketFlow
from urc.web.fleet.contact_watch import ContactWatch
from urc.web.fleet.robots import Robot, RobotService

OURS = {"origin": "http://localhost:8080"}
NAMES = ("arm", "puppet", "rover")


@pytest.fixture
def robots() -> dict[str, FakeRobot]:
    return {name: FakeRobot(dashboard_profile(name=name)) for name in NAMES}


@pytest.fixture
def client(robots: dict[str, FakeRobot], tmp_path: Path) -> Iterator[TestClient]:
    served = {
        name: Robot(one.profile, {}, one.open, is_emulated=name == "rover")
        for name, one in robots.items()
    }
    app = build_app(served, DashboardOptions(access=ACCESS, data=tmp_path, linger_s=0.01))
    with TestClient(app, base_url="http://localhost:8080", cookies=HERE) as started:
        started.app_state["flow"] = SocketFlow()
        yield started


def states(client: TestClient) -> dict[str, dict[str, object]]:
    """Return the state of each robot by name, in the order of the answer."""
    return {one["name"]: one for one in client.get("/api/v1/robots").json()["robots"]}


def test_without_a_session_only_the_past_is_known(client: TestClient) -> None:
    found = states(client)["puppet"]
    assert found["connected"] is False
    assert found["battery"] is None
    assert found["alarms"] == {"count": 0, "worst": ""}
    assert found["used_at"] is found["seen_at"] is None


def test_a_connected_robot_shows_battery_and_alarms_and_comes_first(
    client: TestClient, robots: dict[str, FakeRobot]
) -> None:
    assert [*states(client)] == ["arm", "puppet", "rover"]
    with client.websocket_connect("ws://localhost:8080/ws?robot=puppet", headers=OURS) as line:
        assert line.receive_json()["t"] == "hello"
        assert client.portal is not None
        client.portal.call(robots["puppet"].set_reading, "battery", 77)
        found = states(client)
        assert [*found] == ["puppet", "arm", "rover"]
        assert found["puppet"]["connected"] is True
        assert found["puppet"]["state"] == "live"
        assert found["puppet"]["battery"] == {"value": 77.0, "unit": "%", "alarm": ""}
        client.portal.call(partial(robots["puppet"].set_reading, "battery", 7, alarm="lolo"))
        found = states(client)
        assert found["puppet"]["alarms"] == {"count": 1, "worst": "high"}
        assert found["puppet"]["battery"] == {"value": 7.0, "unit": "%", "alarm": "lolo"}


def test_a_stale_value_is_no_battery_but_its_alarm_stays(
    client: TestClient, robots: dict[str, FakeRobot]
) -> None:
    with client.websocket_connect("ws://localhost:8080/ws?robot=puppet", headers=OURS) as line:
        assert line.receive_json()["t"] == "hello"
        assert client.portal is not None
        old = partial(robots["puppet"].set_reading, "battery", 7, alarm="lolo", age_s=4.0)
        client.portal.call(old)
        found = states(client)["puppet"]
        assert found["battery"] is None
        assert found["alarms"] == {"count": 1, "worst": "high"}


def test_the_cause_of_a_lost_link_is_told(client: TestClient, robots: dict[str, FakeRobot]) -> None:
    with client.websocket_connect("ws://localhost:8080/ws?robot=puppet", headers=OURS) as line:
        assert line.receive_json()["t"] == "hello"
        assert client.portal is not None
        client.portal.call(robots["puppet"].link, "lost", "refused")
        found = states(client)["puppet"]
        assert (found["state"], found["detail"]) == ("lost", "refused")


def test_the_menu_contains_the_first_states_in_their_order(client: TestClient) -> None:
    page = client.get("/").text
    told = re.search(r'data-states="([^"]*)"', page)
    assert told is not None
    listed = json.loads(html.unescape(told[1]))
    assert [one["name"] for one in listed["robots"]] == [*states(client)]
    assert re.findall(r'data-robot-card="(\w+)"', page) == [*states(client)]


def test_only_the_emulated_robot_has_the_mark(client: TestClient) -> None:
    page = client.get("/").text
    cards = page.split("data-robot-card=")[1:]
    assert [">SIM</abbr>" in card for card in cards] == [False, False, True]
    assert ">SIM</abbr>" in client.get("/robots/rover/").text
    assert ">SIM</abbr>" not in client.get("/robots/puppet/").text


def test_one_mark_serves_all_cards_if_all_robots_are_emulated(
    robots: dict[str, FakeRobot], tmp_path: Path
) -> None:
    """A single card keeps its own mark."""
    for names, on_cards in ((NAMES, False), (NAMES[:1], True)):
        served = {
            name: Robot(robots[name].profile, {}, robots[name].open, is_emulated=True)
            for name in names
        }
        app = build_app(served, DashboardOptions(access=ACCESS, data=tmp_path))
        with TestClient(app, base_url="http://localhost:8080", cookies=HERE) as client:
            head, *cards = client.get("/").text.split("data-robot-card=")
        assert [">SIM</abbr>" in card for card in cards] == [on_cards] * len(names)
        assert (">SIM</abbr>" in head) is ("All robots are emulated" in head) is not on_cards


@pytest.mark.anyio
async def test_last_use_and_last_data_survive_a_restart(
    robots: dict[str, FakeRobot], tmp_path: Path
) -> None:
    service = RobotService(Robot(robots["arm"].profile, {}, robots["arm"].open))
    watch = ContactWatch(lambda: {"arm": service}, tmp_path, utc=lambda: 500.0)
    watch.look()
    assert watch.times("arm") == (None, None)
    with service.visit():
        await watch.close()
    assert watch.times("arm") == (500.0, None)
    again = ContactWatch(lambda: {"arm": service}, tmp_path)
    assert again.times("arm").used_at == 500.0
    assert again.times("unknown") == (None, None)


def test_the_file_is_written_when_the_server_ends(
    robots: dict[str, FakeRobot], tmp_path: Path
) -> None:
    served = {"arm": Robot(robots["arm"].profile, {}, robots["arm"].open)}
    with TestClient(
        build_app(served, DashboardOptions(access=ACCESS, data=tmp_path, linger_s=5.0)),
        base_url="http://localhost:8080",
        cookies=HERE,
    ) as started:
        started.app_state["flow"] = SocketFlow()
        client = started
        line = client.websocket_connect("ws://localhost:8080/ws?robot=arm", headers=OURS)
        with line as opened:
            assert opened.receive_json()["t"] == "hello"
        assert not (tmp_path / "contact-times.json").exists()
    # The session lingers, so the robot was heard at the end although the page has left.
    kept = ContactStore(tmp_path / "contact-times.json").of("arm")
    assert kept.seen_at is not None


def test_each_state_is_only_for_those_who_may_watch_the_robot(
    robots: dict[str, FakeRobot], tmp_path: Path
) -> None:
    served = {name: Robot(one.profile, {}, one.open) for name, one in robots.items()}
    app = build_app(served, DashboardOptions(access=ACCESS, data=tmp_path))
    ann = person("Ann who watches the arm", "watch@arm")
    client = TestClient(app, base_url="http://localhost:8080", cookies=ann)
    assert [*states(client)] == ["arm"]
    page = client.get("/").text
    assert "rover" not in page
    assert client.get("/robots/rover/card").status_code == 403


def summary(
    name: str, *, worst: str = "", on: bool = False, used: float | None = None
) -> RobotSummary:
    alarms = ActiveAlarms(1 if worst else 0, worst)  # type: ignore[arg-type]
    return RobotSummary(
        name, name, "", (), "idle", "", "", False, "watch", on, alarms=alarms, used_at=used
    )


def test_alarms_come_first_then_connected_robots_then_the_last_used() -> None:
    robots = [
        summary("never"),
        summary("long ago", used=10.0),
        summary("today", used=90.0),
        summary("on 1", on=True, used=99.0),
        summary("on 2", on=True, used=100.0),
        summary("warning", worst="low", used=5.0),
        summary("medium", worst="medium"),
        summary("alarm", worst="high"),
    ]
    order = [one.name for one in in_order(robots)]
    assert order == ["alarm", "medium", "warning", "on 1", "on 2", "today", "long ago", "never"]


SIGNALS = {
    "battery_voltage": Signal("battery_voltage", "number", unit="V"),
    "charge": Signal("charge", "number", unit="Ah"),
    "battery": Signal("battery", "number", unit="V"),
    "soc": Signal("soc", "integer", unit="%"),
}


def test_the_battery_is_the_level_of_a_battery_widget_or_a_usual_name() -> None:
    bound = dashboard_profile(signals=SIGNALS, uses=(WidgetUse("b", "battery", {"level": "soc"}),))
    assert battery_signal(bound) == "soc"
    plain = WidgetUse("n", "number", {"value": "soc"})
    assert battery_signal(dashboard_profile(signals=SIGNALS, uses=(plain,))) == "battery"
    driver = Driver({"wire": TransportSpec("wire", "tcp")}, {"charge": SIGNALS["charge"]})
    without = dashboard_profile(signals=SIGNALS, uses=(plain,))._replace(driver=driver)
    assert battery_signal(without) == ""
