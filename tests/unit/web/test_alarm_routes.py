"""Alarms over HTTP: list, history, acknowledge and shelve, with names in log and history."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from urc.runtime.alarm_store import AlarmStore
from urc.runtime.audit_search import AuditQuery, search
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS, BEARER, person
from urc.web.app import DashboardOptions, build_app
from urc.web.fleet.robots import Robot

ADDRESS = "http://127.0.0.1:8080"
BASE = "/api/v1/robots/puppet/alarms"


class Served:
    """A server with one monitored robot, in a folder that outlives it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.robot = FakeRobot(dashboard_profile())
        robot = Robot(self.robot.profile, {}, self.robot.open, is_monitored=True)
        self.app = build_app({"puppet": robot}, DashboardOptions(access=ACCESS, data=folder))

    def client(self) -> TestClient:
        return TestClient(self.app, base_url=ADDRESS, headers=BEARER)


def wait_for_session(client: TestClient, served: Served) -> None:
    """Return when the monitored robot is connected."""
    for _ in range(200):
        if served.robot.is_open:
            return
        client.get("/healthz")
    raise AssertionError("the robot is not connected")


@pytest.fixture
def served(tmp_path: Path) -> Served:
    return Served(tmp_path)


@pytest.fixture
def api(served: Served) -> Iterator[TestClient]:
    with served.client() as client:
        wait_for_session(client, served)
        yield client


def battery(client: TestClient, served: Served, value: float, alarm: str = "") -> None:
    """Publish a reading on the loop of the server."""
    assert client.portal is not None

    async def publish() -> None:
        served.robot.set_reading("battery", value, alarm=alarm)  # type: ignore[arg-type]

    client.portal.call(publish)


def listed(client: TestClient) -> dict[str, Any]:
    found: dict[str, Any] = client.get(BASE).json()
    return found


def act(client: TestClient, verb: str, **body: Any) -> dict[str, Any]:
    answer = client.post(f"{BASE}/{verb}", json=body)
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def test_an_alarm_is_listed_acknowledged_and_over(api: TestClient, served: Served) -> None:
    assert listed(api)["alarms"] == []
    battery(api, served, 15, "low")
    found = listed(api)
    (alarm,) = found["alarms"]
    assert (alarm["signal"], alarm["condition"], alarm["state"]) == (
        "battery", "low", "unacknowledged",
    )  # fmt: skip
    assert (alarm["title"], alarm["value"], alarm["unit"]) == ("Battery", "15", "%")
    count = found["count"]
    assert (count["active"], count["unacknowledged"], count["worst"]) == (1, 1, "medium")
    assert count["monitored"]
    assert act(api, "acknowledge", alarms={"battery": alarm["raised"] - 1})["signals"] == []
    done = act(api, "acknowledge", alarms={"battery": alarm["raised"]})
    assert done == {"signals": ["battery"], "stored": True}
    assert listed(api)["alarms"][0]["state"] == "acknowledged"
    battery(api, served, 50)
    assert listed(api)["alarms"] == []
    (overview,) = api.get("/api/v1/alarms").json()["robots"]
    assert (overview["robot"], overview["active"]) == ("puppet", 0)


def test_a_shelf_has_an_end_and_can_be_ended(api: TestClient, served: Served) -> None:
    battery(api, served, 15, "low")
    assert act(api, "shelve", signals=["battery", "unknown"], for_s=600)["signals"] == ["battery"]
    (alarm,) = listed(api)["alarms"]
    assert alarm["state"] == "shelved"
    assert 590 < alarm["shelved_until"] - listed(api)["time"] <= 600
    assert listed(api)["count"]["active"] == 0
    assert act(api, "unshelve", signals=["battery"])["signals"] == ["battery"]
    assert listed(api)["alarms"][0]["state"] == "unacknowledged"


@pytest.mark.parametrize(
    ("verb", "body", "status"),
    [
        ("acknowledge", {"alarms": {}}, 400),
        ("acknowledge", {"alarms": {"battery": "7"}}, 400),
        ("shelve", {"signals": ["battery"]}, 400),
        ("shelve", {"signals": ["battery"], "for_s": 90_000}, 400),
        ("shelve", {"signals": [], "for_s": 60}, 400),
        ("unshelve", {"signals": ["a"] * 2001}, 400),
    ],
)
def test_a_bad_request_changes_nothing(
    api: TestClient, served: Served, verb: str, body: dict[str, Any], status: int
) -> None:
    battery(api, served, 15, "low")
    assert api.post(f"{BASE}/{verb}", json=body).status_code == status
    assert listed(api)["alarms"][0]["state"] == "unacknowledged"


def test_the_history_has_names_and_pages(api: TestClient, served: Served) -> None:
    for value in (15, 50, 16, 60):
        battery(api, served, value, "low" if value < 20 else "")
    raised = listed(api)["alarms"][0]["raised"]
    act(api, "acknowledge", alarms={"battery": raised})
    found = api.get(f"{BASE}/history").json()
    assert [one["kind"] for one in found["events"]] == [
        "acknowledged", "returned", "raised", "returned", "raised",
    ]  # fmt: skip
    assert found["events"][0]["who"]
    assert (found["has_more"], found["fault"], found["lost"]) == (False, "", 0)
    page = api.get(f"{BASE}/history", params={"last": 2}).json()
    assert page["has_more"]
    older = api.get(
        f"{BASE}/history", params={"last": 2, "before": page["events"][-1]["id"]}
    ).json()
    assert [one["kind"] for one in older["events"]] == ["raised", "returned"]
    only = api.get(f"{BASE}/history", params={"kinds": "raised", "text": "BATT"}).json()
    assert len(only["events"]) == 2
    for bad in ({"kinds": "lost"}, {"last": "0"}, {"since": "x"}):
        answer = api.get(f"{BASE}/history", params=bad)
        assert (answer.status_code, "Traceback" in answer.text) == (400, False)


def test_an_acknowledgement_survives_a_restart(tmp_path: Path) -> None:
    """The second server reads what the first one has answered for, which was never closed."""
    first = Served(tmp_path)
    with first.client() as client:
        wait_for_session(client, first)
        battery(client, first, 15, "low")
        raised = listed(client)["alarms"][0]["raised"]
        assert act(client, "acknowledge", alarms={"battery": raised})["stored"]
        second = Served(tmp_path)
        with second.client() as later:
            (alarm,) = listed(later)["alarms"]
            assert (alarm["state"], alarm["raised"]) == ("acknowledged", raised)
            assert not alarm["known"]
            wait_for_session(later, second)
            battery(later, second, 14, "low")
            (alarm,) = listed(later)["alarms"]
            assert (alarm["state"], alarm["known"]) == ("acknowledged", True)
            assert len(later.get(f"{BASE}/history").json()["events"]) == 2


ORIGIN = {"origin": ADDRESS}


def test_watching_reads_and_driving_acts(served: Served) -> None:
    """Each role has its right; the log and the list name the person."""
    watcher, driver = person("Wim of the alarms", "watch"), person("Dora of the alarms", "drive")
    nobody: dict[str, str] = {}
    with TestClient(served.app, base_url=ADDRESS, headers=ORIGIN) as client:
        wait_for_session(client, served)
        battery(client, served, 15, "low")

        def status(cookies: dict[str, str], verb: str, path: str, **more: Any) -> int:
            client.cookies = cookies  # type: ignore[assignment]
            return client.request(verb, path, **more).status_code

        for path in (BASE, f"{BASE}/history", "/api/v1/alarms"):
            assert status(watcher, "GET", path) == 200
            assert status(nobody, "GET", path) in (401, 403)
        client.cookies = watcher  # type: ignore[assignment]
        raised = listed(client)["alarms"][0]["raised"]
        bodies = {
            "acknowledge": {"alarms": {"battery": raised}},
            "shelve": {"signals": ["battery"], "for_s": 60},
            "unshelve": {"signals": ["battery"]},
        }
        for verb, body in bodies.items():
            assert status(watcher, "POST", f"{BASE}/{verb}", json=body) == 403
            assert status(nobody, "POST", f"{BASE}/{verb}", json=body) in (401, 403)
        client.cookies = watcher  # type: ignore[assignment]
        assert listed(client)["alarms"][0]["state"] == "unacknowledged"
        for verb, body in bodies.items():
            assert status(driver, "POST", f"{BASE}/{verb}", json=body) == 200
        history = client.get(f"{BASE}/history").json()["events"]
        assert {one["who"] for one in history if one["kind"] in (*_DONE,)} == {"Dora of the alarms"}
    rows = search(served.folder / "audit.sqlite", AuditQuery(what=("alarm",)))
    assert [row.entry.command for row in rows] == [*reversed(_DONE)]
    assert {(row.entry.who, row.entry.role, row.entry.kind) for row in rows} == {
        ("Dora of the alarms", "drive", "person")
    }


_DONE = ("acknowledged", "shelved", "unshelved")


def test_the_audit_log_names_an_action(api: TestClient, served: Served) -> None:
    battery(api, served, 15, "low")
    act(api, "shelve", signals=["battery"], for_s=60)
    rows: list[Any] = []
    while not rows:  # a thread writes the entry; the time limit of the test ends the wait
        rows = search(served.folder / "audit.sqlite", AuditQuery(what=("alarm",)))
    (row,) = rows
    assert (row.entry.robot, row.entry.command, row.entry.role) == (
        "puppet", "shelved", "administer",
    )  # fmt: skip
    assert row.entry.arguments == '{"signals": ["battery"], "for_s": 60.0}'
    assert row.entry.who


def test_a_server_without_a_folder_keeps_alarms_until_its_end() -> None:
    robot = FakeRobot(dashboard_profile())
    monitored = Robot(robot.profile, {}, robot.open, is_monitored=True)
    app = build_app({"puppet": monitored}, DashboardOptions(access=ACCESS))
    with TestClient(app, base_url=ADDRESS, headers=BEARER) as client:
        assert client.get(f"{BASE}/history").json()["events"] == []
        assert act(client, "unshelve", signals=["battery"]) == {"signals": [], "stored": False}
        assert client.get("/api/v1/robots/nobody/alarms").status_code == 404


def test_emulated_robots_share_no_alarms_with_real_ones(tmp_path: Path) -> None:
    real = Served(tmp_path)
    with real.client() as client:
        wait_for_session(client, real)
        battery(client, real, 15, "low")
        client.get(f"{BASE}/history")
    robot = FakeRobot(dashboard_profile())
    emulated = Robot(robot.profile, {}, robot.open, is_emulated=True)
    app = build_app({"puppet": emulated}, DashboardOptions(access=ACCESS, data=tmp_path))
    with TestClient(app, base_url=ADDRESS, headers=BEARER) as client:
        assert listed(client)["alarms"] == []
        assert client.get(f"{BASE}/history").json()["events"] == []
    assert len(AlarmStore(tmp_path / "alarms.sqlite").load("puppet")) == 1
