"""Metrics: what a request returns, for whom, and that it wakes no robot."""

import math
from collections.abc import Callable, Iterator, Mapping
from functools import partial

import pytest
from prometheus_client.openmetrics.parser import text_string_to_metric_families
from starlette.testclient import TestClient

from urc.problems import UrcError
from urc.runtime.clock import LoopClock
from urc.runtime.open_profile import open_document
from urc.shipped import shipped
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS, HERE
from urc.web.app import DashboardOptions, build_app
from urc.web.feed.client_socket import SocketFlow
from urc.web.fleet.robots import Robot
from urc.web.metrics import robot_metrics, routes
from urc.web.metrics.loop_delay import ASKED_S, EVERY_S, LoopDelay
from urc.web.metrics.metric_names import metric_name, reading_choice, unit_name

OURS = {"origin": "http://localhost:8080"}
OPENMETRICS = {"accept": "application/openmetrics-text; version=1.0.0"}
Labels = Mapping[str, str]


@pytest.fixture
def robots() -> dict[str, FakeRobot]:
    moving = open_document(shipped("robots") / "turtlebot4.yaml")
    return {
        "puppet": FakeRobot(dashboard_profile(name="puppet")),
        "rover": FakeRobot(moving._replace(name="rover")),
    }


@pytest.fixture
def client(robots: dict[str, FakeRobot]) -> Iterator[TestClient]:
    served = {name: Robot(one.profile, {}, one.open) for name, one in robots.items()}
    choices = [reading_choice("*.battery")]
    app = build_app(served, DashboardOptions(access=ACCESS, linger_s=0.01, metrics=choices))
    with TestClient(app, base_url="http://localhost:8080", cookies=HERE) as started:
        started.app_state["flow"] = SocketFlow()
        yield started


def samples(text: str) -> dict[str, list[tuple[Labels, float]]]:
    """Return the samples by name; the parser of the library refuses invalid text."""
    found: dict[str, list[tuple[Labels, float]]] = {}
    for family in text_string_to_metric_families(text):
        for one in family.samples:
            found.setdefault(one.name, []).append((one.labels, one.value))
    return found


def asked(client: TestClient) -> dict[str, list[tuple[Labels, float]]]:
    reply = client.get("/metrics", headers=OPENMETRICS)
    assert reply.status_code == 200, reply.text
    assert reply.headers["content-type"].startswith("application/openmetrics-text")
    return samples(reply.text)


def value(found: dict[str, list[tuple[Labels, float]]], name: str, **labels: str) -> float:
    (one,) = (sample for own, sample in found[name] if labels.items() <= own.items())
    return one


def test_a_request_wakes_no_robot(client: TestClient, robots: dict[str, FakeRobot]) -> None:
    for _ in range(3):
        found = asked(client)
    assert not any(one.opened for one in robots.values())
    assert value(found, "urc_robot_session_open", robot="puppet", site="") == 0
    assert value(found, "urc_robot_pages", robot="puppet") == 0
    assert value(found, "urc_robot_alarms", robot="rover", priority="high") == 0
    assert "urc_reading_battery_percent" not in found
    assert "urc_link_state" not in found


def test_an_open_session_has_links_alarms_and_chosen_readings(
    client: TestClient, robots: dict[str, FakeRobot]
) -> None:
    with client.websocket_connect("ws://localhost:8080/ws?robot=puppet", headers=OURS) as line:
        assert line.receive_json()["t"] == "hello"
        assert client.portal is not None
        client.portal.call(partial(robots["puppet"].set_reading, "battery", 7, alarm="lolo"))
        found = asked(client)
        assert value(found, "urc_robot_session_open", robot="puppet") == 1
        assert value(found, "urc_robot_pages", robot="puppet") == 1
        assert value(found, "urc_reading_battery_percent", robot="puppet", signal="battery") == 7
        assert value(found, "urc_robot_alarms", robot="puppet", priority="high") == 1
        assert value(found, "urc_link_state", robot="puppet", urc_link_state="live") == 1
        assert value(found, "urc_link_state", robot="puppet", urc_link_state="lost") == 0
        assert value(found, "urc_robot_images_total", robot="puppet") == 0
        assert value(found, "urc_robot_reading_age_seconds", robot="puppet") < 60
        assert not [own for own, _ in found["urc_link_state"] if own["robot"] == "rover"]
        assert [own for own, _ in found["urc_reading_battery_percent"]] == [
            {"robot": "puppet", "site": "", "signal": "battery"}
        ]


def test_a_latched_stop_is_a_metric(client: TestClient) -> None:
    assert value(asked(client), "urc_robot_stop_latched", robot="rover") == 0
    assert client.post("/api/v1/robots/rover/stop", headers=OURS).status_code == 200
    assert value(asked(client), "urc_robot_stop_latched", robot="rover") == 1
    assert value(asked(client), "urc_robot_stop_latched", robot="puppet") == 0


def test_the_process_and_the_event_loop_are_metrics(client: TestClient) -> None:
    found = asked(client)
    assert value(found, "urc_event_loop_delay_seconds_count") >= 0
    assert value(found, "process_resident_memory_bytes") > 1e6
    assert value(found, "process_open_fds") > 0
    assert value(found, "process_cpu_seconds_total") > 0


def test_an_old_client_gets_the_text_format(client: TestClient) -> None:
    reply = client.get("/metrics")
    assert reply.headers["content-type"].startswith("text/plain")
    assert "# TYPE urc_robot_pages gauge" in reply.text


def test_without_a_sign_in_nothing_is_told(client: TestClient) -> None:
    client.cookies.clear()
    reply = client.get("/metrics")
    assert reply.status_code in (401, 403)
    assert "urc_robot" not in reply.text


def test_a_missing_package_is_one_line(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(routes, "find_spec", lambda _: None)
    reply = client.get("/metrics")
    assert reply.status_code == 501
    assert reply.text.startswith("metrics need the package prometheus-client: ")
    assert reply.text.count("\n") == 1


def test_too_many_readings_are_cut_and_counted(
    client: TestClient, robots: dict[str, FakeRobot], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robot_metrics, "MOST_READINGS", 0)
    with client.websocket_connect("ws://localhost:8080/ws?robot=puppet", headers=OURS) as line:
        assert line.receive_json()["t"] == "hello"
        assert client.portal is not None
        client.portal.call(robots["puppet"].set_reading, "battery", 7)
        found = asked(client)
    assert "urc_reading_battery_percent" not in found
    assert value(found, "urc_metrics_cut_readings") == 1


@pytest.mark.parametrize(
    ("unit", "name"),
    [
        ("", ""), ("%", "percent"), ("m/s", "meters_per_second"), ("°C", "celsius"),
        ("rad/s", "radians_per_second"), ("km/h", "kilometers_per_hour"), ("1/s", "1_s"),
        ("m/s2", "meters_per_second_squared"), ("widgets", "widgets"), ("°", "degrees"),
        ("Ω", "ohms"), ("--", ""), ("日", ""),
    ],
)  # fmt: skip
def test_units_are_words(unit: str, name: str) -> None:
    assert unit_name(unit) == name


def test_names_of_metrics_have_only_permitted_characters() -> None:
    assert metric_name("Motor.left-Speed") == "urc_reading_motor_left_speed"


@pytest.mark.parametrize("text", ["battery", ".battery", "cart.", "c*t.battery", "Cart.x", "a.b c"])
def test_a_wrong_choice_is_one_line(text: str) -> None:
    with pytest.raises(UrcError, match=r"expected ROBOT\.SIGNAL"):
        reading_choice(text)


def test_the_delay_of_a_busy_loop_is_measured_only_while_somebody_asks() -> None:
    clock = BusyClock()
    delay = LoopDelay(clock)
    delay.asked()
    clock.go(0.0)
    clock.go(0.2)
    (family,) = delay.asked()
    found = {(one.name, one.labels.get("le", "")): one.value for one in family.samples}
    assert found["urc_event_loop_delay_seconds_count", ""] == 2
    assert found["urc_event_loop_delay_seconds_bucket", "0.25"] == 2
    assert found["urc_event_loop_delay_seconds_bucket", "0.1"] == 1
    assert math.isclose(found["urc_event_loop_delay_seconds_sum", ""], 0.2)
    for _ in range(round(ASKED_S / EVERY_S) + 1):
        clock.go(0.0)
    assert clock.due is None
    delay.asked()
    assert clock.due is not None
    delay.close()
    assert clock.due is None


class BusyClock(LoopClock):
    """A clock whose timers are late."""

    def __init__(self) -> None:
        self.time_s = 0.0
        self.due: tuple[float, Callable[[], None]] | None = None

    def now(self) -> float:
        return self.time_s

    def call_at(self, when: float, call: Callable[[], None]) -> "BusyClock":
        self.due = (when, call)
        return self

    def cancel(self) -> None:
        self.due = None

    def go(self, late_s: float) -> None:
        assert self.due is not None
        (when, call), self.due = self.due, None
        self.time_s = when + late_s
        call()
