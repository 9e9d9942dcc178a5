"""The audit log is searched and exported by people who may, each within their robots."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from tests.unit.runtime.desks import DRIVER
from urc.runtime.audit import AuditLog
from urc.runtime.audit_check import check_export
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_search import AuditQuery, search
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS, BEARER, HERE, KEY, person
from urc.web.app import DashboardOptions, build_app
from urc.web.fleet.robots import Robot

ADDRESS = "http://localhost:8080"


def robot() -> Robot:
    made = FakeRobot(dashboard_profile())
    return Robot(made.profile, {}, made.open)


def dashboard(data: Path | None) -> TestClient:
    robots = {"puppet": robot(), "rover": robot()}
    return TestClient(
        build_app(robots, DashboardOptions(access=ACCESS, data=data)), base_url=ADDRESS
    )


@pytest.fixture(scope="module")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    data = tmp_path_factory.mktemp("data")
    with AuditLog(data / "audit.sqlite") as log:
        for number in range(6):
            name = ("puppet", "rover", "")[number % 3]
            who = "Ann" if number < 3 else "Ben"
            log.add(AuditEntry(1000.0 + number, name, "moved", who, place="192.0.2.7"))
        assert log.settle()
    with dashboard(data) as made:
        yield made


@pytest.fixture(scope="module")
def cookies() -> dict[str, dict[str, str]]:
    return {
        "the local user": HERE,
        "maintainer": person("Auditor Mia", "maintain"),
        "maintainer of rover": person("Auditor Ron", "maintain@rover", "drive@puppet"),
        "driver": person("Auditor Dan", "drive"),
        "nobody": {},
    }


def found(client: TestClient, query: str, cookies: dict[str, str]) -> list[tuple[str, float]]:
    client.cookies = cookies  # type: ignore[assignment]
    answer = client.get(f"/api/v1/audit?{query}")
    assert answer.status_code == 200, answer.text
    assert answer.headers["cache-control"] == "no-store"
    entries = answer.json()["entries"]
    return [(one["robot"], one["at"]) for one in entries if one["what"] == "moved"]


@pytest.mark.parametrize(
    ("query", "wanted"),
    [
        ("", [1005, 1004, 1003, 1002, 1001, 1000]),
        ("robot=rover", [1004, 1001]),
        ("who=ann", [1002, 1001, 1000]),
        ("who=192.0.2", [1005, 1004, 1003, 1002, 1001, 1000]),
        ("what=moved,STOP&last=2", [1005, 1004]),
        ("what=STOP", []),
        ("text=BEN", [1005, 1004, 1003]),
        ("since=1001&until=1003", [1002, 1001]),
        ("before=3", [1001, 1000]),
    ],
)
def test_filters(
    client: TestClient, cookies: dict[str, dict[str, str]], query: str, wanted: list[float]
) -> None:
    assert [at for _, at in found(client, query, cookies["maintainer"])] == wanted


def test_pages_follow_each_other(client: TestClient, cookies: dict[str, dict[str, str]]) -> None:
    client.cookies = cookies["maintainer"]  # type: ignore[assignment]
    seen: list[int] = []
    before, has_more = "", True
    while has_more:
        answer = client.get(f"/api/v1/audit?what=moved&last=4{before}").json()
        seen += [one["id"] for one in answer["entries"]]
        before, has_more = f"&before={seen[-1]}", answer["hasMore"]
    assert seen == [6, 5, 4, 3, 2, 1]


@pytest.mark.parametrize(
    ("who", "robots"),
    [
        ("the local user", {"puppet", "rover", ""}),
        ("maintainer", {"puppet", "rover", ""}),
        ("maintainer of rover", {"rover"}),
    ],
)
def test_each_person_sees_the_entries_of_the_own_robots(
    client: TestClient, cookies: dict[str, dict[str, str]], who: str, robots: set[str]
) -> None:
    assert {name for name, _ in found(client, "", cookies[who])} == robots
    assert all(name in robots for name, _ in found(client, "robot=puppet", cookies[who]))
    lines = client.get("/api/v1/audit/export").text.splitlines()
    assert {json.loads(line)["robot"] for line in lines} == robots


@pytest.mark.parametrize("path", ["/audit", "/api/v1/audit", "/api/v1/audit/export"])
@pytest.mark.parametrize(("who", "status"), [("driver", 403), ("nobody", 401)])
def test_others_see_nothing(
    client: TestClient, cookies: dict[str, dict[str, str]], path: str, who: str, status: int
) -> None:
    client.cookies = cookies[who]  # type: ignore[assignment]
    answer = client.get(path)
    assert answer.status_code == status
    assert "192.0.2.7" not in answer.text


def test_timeline_needs_the_right_at_its_robot(
    client: TestClient, cookies: dict[str, dict[str, str]]
) -> None:
    client.cookies = cookies["maintainer of rover"]  # type: ignore[assignment]
    answer = client.get("/api/v1/robots/rover/timeline?robot=puppet")
    assert {one["robot"] for one in answer.json()["entries"]} == {"rover"}
    assert client.get("/api/v1/robots/puppet/timeline").status_code == 403


@pytest.mark.parametrize(
    ("query", "told"),
    [
        ("last=many", "expected a number from 1 to 1000 for 'last', found 'many'"),
        ("last=0", "expected a number from 1 to 1000 for 'last', found '0'"),
        ("last=1001", "expected a number from 1 to 1000 for 'last', found '1001'"),
        ("before=-1", "for 'before', found '-1'"),
        ("before=99999999999999999999999", "for 'before'"),
        ("since=nan", "expected seconds since 1970 for 'since', found 'nan'"),
        ("until=inf", "expected seconds since 1970 for 'until', found 'inf'"),
        ("since=-1", "expected seconds since 1970 for 'since'"),
        ("what=" + "a," * 21, "expected at most 20 kinds for 'what'"),
        ("text=" + "x" * 201, "expected at most 200 characters for 'text'"),
    ],
)
@pytest.mark.parametrize("path", ["/api/v1/audit", "/api/v1/robots/rover/timeline"])
def test_slip_in_a_query_is_told(client: TestClient, path: str, query: str, told: str) -> None:
    client.cookies = HERE  # type: ignore[assignment]
    answer = client.get(f"{path}?{query}")
    assert answer.status_code == 400
    assert told in answer.json()["error"]


def test_export_can_be_checked_and_is_recorded(
    client: TestClient, cookies: dict[str, dict[str, str]]
) -> None:
    client.cookies = cookies["maintainer"]  # type: ignore[assignment]
    answer = client.get("/api/v1/audit/export")
    assert re.fullmatch(
        r'attachment; filename="urc-audit-[0-9-]{10}\.jsonl"', answer.headers["content-disposition"]
    )
    lines = answer.text.splitlines(keepends=True)
    result = check_export(lines)
    assert (result.fault, result.gap) == ("", "")
    last = json.loads(lines[-1])
    assert (last["what"], last["command"], last["who"]) == ("audit", "exported", "Auditor Mia")
    assert (last["role"], last["way"]) == ("maintain", "passphrase")


def test_page_offers_only_what_the_visitor_may_see(
    client: TestClient, cookies: dict[str, dict[str, str]]
) -> None:
    client.cookies = cookies["maintainer of rover"]  # type: ignore[assignment]
    page = client.get("/audit").text
    assert "<option>rover</option>" in page
    assert "<option>puppet</option>" not in page
    assert "Sign-ins" not in page
    client.cookies = cookies["maintainer"]  # type: ignore[assignment]
    page = client.get("/audit").text
    assert "<option>puppet</option>" in page
    assert "Sign-ins" in page


@pytest.mark.parametrize(("who", "sees"), [("maintainer of rover", True), ("driver", False)])
def test_menu_links_to_the_page_for_people_who_may_open_it(
    client: TestClient, cookies: dict[str, dict[str, str]], who: str, sees: bool
) -> None:
    client.cookies = cookies[who]  # type: ignore[assignment]
    assert ('href="/audit"' in client.get("/").text) == sees


def test_server_without_a_folder_says_so() -> None:
    with dashboard(None) as asked:
        asked.cookies = HERE  # type: ignore[assignment]
        for path in ("/api/v1/audit", "/api/v1/audit/export", "/api/v1/robots/rover/timeline"):
            answer = asked.get(path)
            assert answer.status_code == 404
            assert "this server has no audit log" in answer.json()["error"]
        assert asked.get("/audit").status_code == 404
        assert 'href="/audit"' not in asked.get("/").text


def test_unknown_robot_has_no_timeline(client: TestClient) -> None:
    client.cookies = HERE  # type: ignore[assignment]
    answer = client.get("/api/v1/robots/nobody/timeline")
    assert (answer.status_code, answer.json()["message"]) == (
        404,
        "this server has no robot with that name",
    )


def test_file_that_is_no_log_is_told(tmp_path: Path) -> None:
    with dashboard(tmp_path) as asked:
        asked.cookies = HERE  # type: ignore[assignment]
        assert asked.get("/api/v1/audit").status_code == 200
        for one in tmp_path.glob("audit.sqlite*"):
            one.unlink()
        (tmp_path / "audit.sqlite").write_bytes(b"no database " * 200)
        answer = asked.get("/api/v1/audit")
    assert answer.status_code == 503
    assert answer.json()["error"].endswith("cannot be read: file is not a database")


def test_start_and_end_of_the_server_are_recorded(tmp_path: Path) -> None:
    with dashboard(tmp_path) as asked:
        asked.get("/", headers=BEARER)
    with dashboard(tmp_path) as asked:
        entries = asked.get("/api/v1/audit", headers=BEARER).json()["entries"]
    told = [(one["what"], one["command"]) for one in reversed(entries)]
    assert told == [("server", "started"), ("server", "ended"), ("server", "started")]
    data = b"".join(one.read_bytes() for one in tmp_path.iterdir() if one.is_file())
    assert KEY.encode() not in data


def test_foreign_host_learns_nothing(client: TestClient) -> None:
    client.cookies = HERE  # type: ignore[assignment]
    answer = client.get("/api/v1/audit", headers={"host": "evil.example"})
    assert answer.status_code in (400, 403, 421)
    assert "entries" not in answer.text


def moving_dashboard(data: Path) -> TestClient:
    """Return a dashboard with a robot that STOP can stop."""
    made = FakeRobot(dashboard_profile()._replace(driver=DRIVER))
    app = build_app(
        {"rover": Robot(made.profile, {}, made.open)}, DashboardOptions(access=ACCESS, data=data)
    )
    return TestClient(app, base_url=ADDRESS, headers={"origin": ADDRESS})


def test_stop_by_request_names_the_person_and_counts_unknown_visitors(tmp_path: Path) -> None:
    with moving_dashboard(tmp_path) as asked:
        asked.cookies = person("Auditor Sue", "drive")  # type: ignore[assignment]
        assert asked.post("/api/v1/robots/rover/stop").status_code == 200
        asked.cookies = {}  # type: ignore[assignment]
        for _ in range(20):
            assert asked.post("/api/v1/robots/rover/stop").status_code == 200
    found = [row.entry for row in reversed(search(tmp_path / "audit.sqlite", AuditQuery()))]
    stops = [one for one in found if one.what == "STOP"]
    assert (stops[0].who, stops[0].role, stops[0].way) == ("Auditor Sue", "drive", "passphrase")
    assert sum(one.times for one in stops[1:]) == 20
    assert len(stops) <= 4
    assert {(one.who, one.place) for one in stops[1:]} == {("", "testclient")}


@pytest.mark.parametrize(
    "name", ["robot", "who", "what", "text", "since", "until", "before", "last"]
)
@pytest.mark.parametrize(
    "value", ["%00", "%ED%A0%80", "%FF", "%25%5F!", "%D9%A3", "1e999", "'--", ""]
)
def test_odd_values_are_a_result_or_one_line(client: TestClient, name: str, value: str) -> None:
    client.cookies = HERE  # type: ignore[assignment]
    answer = client.get(f"/api/v1/audit?{name}={value}")
    assert answer.status_code in (200, 400)
    assert ("error" in answer.json()) == (answer.status_code == 400)
