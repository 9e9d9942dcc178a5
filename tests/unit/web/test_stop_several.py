"""STOP of several robots over HTTP: all are stopped at once, and each has a result of its own."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from tests.unit.runtime.desks import DRIVER
from urc.model.profile import Setting
from urc.runtime.audit_search import AuditQuery, search
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS, HERE, person
from urc.testing.movers import FakeMotionBackend
from urc.web.app import DashboardOptions, build_app
from urc.web.fleet.robots import Robot

ADDRESS = "http://localhost:8080"


def mover(name: str, *tags: str) -> FakeRobot:
    """Return a robot that STOP can stop."""
    profile = dashboard_profile(name=name)
    return FakeRobot(profile._replace(driver=DRIVER, tags=tags))


@pytest.fixture
def robots() -> dict[str, FakeRobot]:
    made = (mover("cart-1", "carts"), mover("cart-2", "carts"), mover("arm", "arms"))
    still = FakeRobot(dashboard_profile(name="still")._replace(tags=("carts",)))
    host = {"host": Setting("host", "host", is_required=True)}
    unset = dashboard_profile(name="unset", settings=host)._replace(driver=DRIVER)
    return {one.profile.name: one for one in (*made, still, FakeRobot(unset))}


@contextmanager
def dashboard(robots: Mapping[str, FakeRobot], data: Path | None = None) -> Iterator[TestClient]:
    """Run a dashboard; the browser has the start key."""
    served = {name: Robot(one.profile, {}, one.open) for name, one in robots.items()}
    app = build_app(served, DashboardOptions(access=ACCESS, data=data, linger_s=0.01))
    with TestClient(app, base_url=ADDRESS, cookies=HERE, headers={"origin": ADDRESS}) as browser:
        yield browser


def results(browser: TestClient, asked: object) -> dict[str, str]:
    """Stop robots, and return the result of each robot."""
    answer = browser.post("/api/v1/stop", json=asked)
    assert answer.status_code == 200, answer.text
    return {one["name"]: one["result"] for one in answer.json()["robots"]}


def latched(browser: TestClient) -> set[str]:
    """Return the robots whose STOP is latched."""
    listed = browser.get("/api/v1/robots").json()["robots"]
    return {one["name"] for one in listed if one["latched"]}


@pytest.mark.parametrize(
    ("asked", "stopped"),
    [
        ({"all": True}, {"cart-1", "cart-2", "arm"}),
        ({"tags": ["carts"]}, {"cart-1", "cart-2"}),
        ({"robots": ["arm"], "tags": ["carts"]}, {"cart-1", "cart-2", "arm"}),
        ({"robots": ["cart-2", "cart-2"]}, {"cart-2"}),
    ],
)
def test_the_chosen_robots_stop_and_no_others(
    robots: dict[str, FakeRobot], asked: object, stopped: set[str]
) -> None:
    """A robot without motion or without its settings is not part of a choice."""
    with dashboard(robots) as browser:
        assert results(browser, asked) == dict.fromkeys(stopped, "confirmed")
        assert latched(browser) == stopped


def test_a_robot_without_a_link_is_named_and_the_others_are_confirmed(
    robots: dict[str, FakeRobot],
) -> None:
    backend = robots["cart-2"].backend
    assert isinstance(backend, FakeMotionBackend)
    backend.is_up = False
    with dashboard(robots) as browser:
        answer = browser.post("/api/v1/stop", json={"tags": ["carts"]})
        found = {one["name"]: one for one in answer.json()["robots"]}
        assert found["cart-1"]["result"] == "confirmed"
        assert found["cart-2"]["result"] == "no-link"
        assert found["cart-2"]["reason"]
        assert latched(browser) == {"cart-1", "cart-2"}
        assert answer.elapsed.total_seconds() < 1.0
        listed = browser.get("/api/v1/robots").json()["robots"]
        told = {one["name"]: (one["can_stop"], one["confirmed"]) for one in listed}
        assert told["cart-1"] == (True, True)
        assert told["cart-2"] == (True, False)
        assert told["still"] == (False, False)


def test_a_robot_that_cannot_be_stopped_is_refused_and_the_others_stop(
    robots: dict[str, FakeRobot],
) -> None:
    with dashboard(robots) as browser:
        asked = {"robots": ["nobody", "still", "arm"], "tags": ["boats"]}
        answer = browser.post("/api/v1/stop", json=asked).json()
        assert [(one["name"], one["result"], one["reason"]) for one in answer["robots"]] == [
            ("nobody", "refused", "this server has no robot with that name"),
            ("still", "refused", "this robot has no motion to stop"),
            ("arm", "confirmed", ""),
        ]
        assert answer["unknown_tags"] == ["boats"]


@pytest.mark.parametrize(
    ("asked", "status", "code"),
    [
        ({}, 400, "no-robots"),
        ({"tags": ["boats"]}, 404, "unknown-tag"),
        ({"robots": "arm"}, 400, "bad-request"),
        ({"everything": True}, 400, "bad-request"),
    ],
)
def test_a_wrong_request_says_why(
    robots: dict[str, FakeRobot], asked: object, status: int, code: str
) -> None:
    with dashboard(robots) as browser:
        answer = browser.post("/api/v1/stop", json=asked)
        assert (answer.status_code, answer.json()["code"]) == (status, code)
        assert latched(browser) == set()


def test_a_stranger_may_stop_all_robots(robots: dict[str, FakeRobot]) -> None:
    """As for one robot, STOP needs no right; another site's page gets nothing."""
    with dashboard(robots) as browser:
        browser.cookies = {}  # type: ignore[assignment]
        assert set(results(browser, {"all": True})) == {"cart-1", "cart-2", "arm"}
        other = browser.post(
            "/api/v1/stop", json={"all": True}, headers={"origin": "http://evil.example"}
        )
        assert other.status_code == 403


def test_the_audit_log_names_the_person_and_one_identifier(
    robots: dict[str, FakeRobot], tmp_path: Path
) -> None:
    with dashboard(robots, tmp_path) as browser:
        browser.cookies = person("Stopper Sue", "watch")  # type: ignore[assignment]
        answer = browser.post("/api/v1/stop", json={"all": True}).json()
    rows = [one.entry for one in search(tmp_path / "audit.sqlite", AuditQuery())]
    stops = [one for one in rows if one.what == "STOP"]
    assert {one.robot for one in stops} == {"cart-1", "cart-2", "arm"}
    assert {one.who for one in stops} == {"Stopper Sue"}
    assert {json.loads(one.arguments)["stop"] for one in stops} == {answer["id"]}
