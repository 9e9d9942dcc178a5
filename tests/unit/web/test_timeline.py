"""A robot's timeline is asked for by query, and every slip of it has one line for an answer."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route
from starlette.testclient import TestClient

from urc.runtime.audit import AuditLog
from urc.runtime.audit_entry import AuditEntry
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import HERE, OPEN
from urc.web.app import build_app
from urc.web.dev.timeline import timeline
from urc.web.fleet.robots import Robot


@pytest.fixture
def client(tmp_path: Path) -> Iterator[TestClient]:
    with AuditLog(tmp_path / "audit.sqlite") as log:
        for number in range(5):
            log.add(
                AuditEntry(1000.0 + number, "rover" if number % 2 else "puppet", "moved", "Ann")
            )
        yield asking(log)


def asking(log: AuditLog) -> TestClient:
    async def answer(request: Request) -> Response:
        return await timeline(request, log, "rover")

    return TestClient(Starlette(routes=[Route("/", answer)]))


def test_entries_of_one_robot_come_newest_first(client: TestClient) -> None:
    found = client.get("/").json()["entries"]
    assert [(one["at"], one["robot"], one["who"]) for one in found] == [
        (1003.0, "rover", "Ann"),
        (1001.0, "rover", "Ann"),
    ]


def test_query_says_how_many_and_since_when(client: TestClient) -> None:
    assert [one["at"] for one in client.get("/?last=1").json()["entries"]] == [1003.0]
    assert [one["at"] for one in client.get("/?since=1002").json()["entries"]] == [1003.0]


@pytest.mark.parametrize(
    ("query", "text"),
    [
        ("last=many", "expected numbers for 'last' and 'since'"),
        ("last=0", "expected 'last' from 1 to 1000, and 'since' in seconds since 1970"),
        ("last=1001", "expected 'last' from 1 to 1000, and 'since' in seconds since 1970"),
        ("since=nan", "expected 'last' from 1 to 1000, and 'since' in seconds since 1970"),
    ],
)
def test_slip_in_the_query_is_told(client: TestClient, query: str, text: str) -> None:
    answer = client.get(f"/?{query}")
    assert (answer.status_code, answer.json()) == (400, {"error": text})


def test_broken_file_is_told(tmp_path: Path) -> None:
    file = tmp_path / "audit.sqlite"
    file.write_bytes(b"no database " * 200)
    with AuditLog(file) as log:
        found = asking(log).get("/")
    assert found.status_code == 503
    assert found.json()["error"].endswith("cannot be read: file is not a database")


def dashboard(data: Path | None, *, has_key: bool = True) -> TestClient:
    robot = FakeRobot(dashboard_profile())
    app = build_app({"puppet": Robot(robot.profile, {}, robot.open)}, access=OPEN, data=data)
    cookies = HERE if has_key else None
    return TestClient(app, base_url="http://localhost:8080", cookies=cookies)


@pytest.mark.parametrize(
    ("has_data", "has_key", "path", "status", "told"),
    [
        (True, True, "nobody", 404, "no robot of that name is served here"),
        (True, False, "puppet", 403, "This needs the role maintain."),
        (False, True, "puppet", 404, "there is no audit log: this server has no folder"),
    ],
)
def test_where_there_is_no_timeline_a_line_says_why(
    has_data: bool, has_key: bool, path: str, status: int, told: str, tmp_path: Path
) -> None:
    with dashboard(tmp_path if has_data else None, has_key=has_key) as asked:
        answer = asked.get(f"/api/v1/robots/{path}/timeline")
    assert answer.status_code == status
    assert told in answer.json()["error"]
    assert answer.headers["cache-control"] == "no-store"


def test_a_foreign_host_learns_nothing(tmp_path: Path) -> None:
    with dashboard(tmp_path) as asked:
        answer = asked.get("/api/v1/robots/puppet/timeline", headers={"host": "evil.example"})
    assert answer.status_code in (400, 403, 421)
    assert "entries" not in answer.text


def test_a_robot_to_which_nothing_happened_has_an_empty_one(tmp_path: Path) -> None:
    with dashboard(tmp_path) as asked:
        answer = asked.get("/api/v1/robots/puppet/timeline")
    assert answer.json() == {"entries": [], "fault": ""}
