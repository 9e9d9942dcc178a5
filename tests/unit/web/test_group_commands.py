"""One confirmed command to several robots over HTTP: rights, arguments and results of each."""

from collections.abc import Iterator, Mapping
from typing import Any

import pytest
from starlette.testclient import TestClient

from urc.model.driver import Argument, Command
from urc.model.exchange import Confirm, Hold
from urc.model.values import Reading, Value
from urc.runtime.command_failed import CommandFailed
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS, HERE, person
from urc.testing.profile import text
from urc.web.app import DashboardOptions, build_app
from urc.web.fleet.robots import Robot

ADDRESS = "http://localhost:8080"
SPEED = Argument("speed", "number", unit="m/s", min=0, max=1)
SURE = Confirm("Dock now?", "normal", is_two_person=False)


def robot(name: str, tag: str, speed: Argument = SPEED) -> FakeRobot:
    """Return a robot with a command, a command that asks, and a held command."""
    commands = {
        "dock": Command("dock", "wire", text("dock"), {"speed": speed}),
        "ask": Command("ask", "wire", text("ask"), confirm=SURE),
        "drive": Command("drive", "wire", text("drive"), hold=Hold(0.05, {}, 0.25)),
    }
    return FakeRobot(dashboard_profile(name=name, commands=commands)._replace(tags=(tag,)))


@pytest.fixture
def robots() -> dict[str, FakeRobot]:
    carts = [robot(f"cart-{number}", "carts") for number in (1, 2)]
    arm = robot("arm", "arms", SPEED._replace(unit="km/h"))
    still = FakeRobot(dashboard_profile(name="still")._replace(tags=("carts",)))
    return {one.profile.name: one for one in (*carts, arm, still)}


@pytest.fixture
def browser(robots: Mapping[str, FakeRobot]) -> Iterator[TestClient]:
    served = {name: Robot(one.profile, {}, one.open) for name, one in robots.items()}
    app = build_app(served, DashboardOptions(access=ACCESS, linger_s=0.01))
    with TestClient(app, base_url=ADDRESS, cookies=HERE, headers={"origin": ADDRESS}) as made:
        yield made


def asked(**more: Any) -> dict[str, Any]:
    """Return a confirmed request to all carts."""
    known = {"command": "dock", "tags": ["carts"], "arguments": {"speed": 0.5}, "confirmed": True}
    return known | more


def results(browser: TestClient, body: object) -> dict[str, str]:
    """Send a command; return the code of each robot, "" for success."""
    found = browser.post("/api/v1/commands", json=body)
    assert found.status_code == 200, found.text
    rows = found.json()["robots"]
    assert all(row["done"] is not bool(row["code"]) for row in rows)
    return {row["name"]: row["code"] for row in rows}


def sent(robots: Mapping[str, FakeRobot]) -> set[str]:
    """Return the robots that have received a command."""
    return {name for name, one in robots.items() if one.commands}


def test_all_robots_of_a_tag_with_the_command_run_it(
    browser: TestClient, robots: dict[str, FakeRobot]
) -> None:
    """A robot of the tag without the command is left out."""
    assert results(browser, asked()) == {"cart-1": "", "cart-2": ""}
    for name in ("cart-1", "cart-2"):
        assert robots[name].commands == [("dock", {"speed": 0.5})]


def test_one_failure_does_not_end_the_others(
    browser: TestClient, robots: dict[str, FakeRobot]
) -> None:
    def fail(name: str, arguments: Mapping[str, Reading]) -> Mapping[str, Value]:
        raise CommandFailed("refused", "the dock is occupied")

    robots["cart-1"].on_command = fail
    found = browser.post("/api/v1/commands", json=asked()).json()["robots"]
    assert [(one["name"], one["done"], one["message"]) for one in found] == [
        ("cart-1", False, "the dock is occupied"),
        ("cart-2", True, ""),
    ]


def test_nothing_is_sent_without_a_confirmation(
    browser: TestClient, robots: dict[str, FakeRobot]
) -> None:
    """The refusal contains the number of robots for the question."""
    found = browser.post("/api/v1/commands", json=asked(confirmed=False))
    assert (found.status_code, found.json()["code"]) == (428, "not-confirmed")
    assert found.json()["message"] == "dock for 2 robots needs a confirmation"
    assert sent(robots) == set()
    assert results(browser, asked(command="ask", arguments={})) == {"cart-1": "", "cart-2": ""}


def test_a_held_command_is_never_sent_to_several_robots(
    browser: TestClient, robots: dict[str, FakeRobot]
) -> None:
    found = browser.post("/api/v1/commands", json=asked(command="drive", arguments={}))
    assert (found.status_code, found.json()["code"]) == (409, "held")
    assert sent(robots) == set()


def test_a_robot_with_other_arguments_or_without_the_command_is_named(
    browser: TestClient, robots: dict[str, FakeRobot]
) -> None:
    """The arm's speed has another unit, so one value would mean two speeds."""
    body = asked(tags=[], robots=["cart-1", "arm", "still", "nobody"])
    assert results(browser, body) == {
        "cart-1": "",
        "arm": "other-arguments",
        "still": "unknown-command",
        "nobody": "unknown-robot",
    }
    assert sent(robots) == {"cart-1"}


def test_each_robot_requires_its_own_right(
    browser: TestClient, robots: dict[str, FakeRobot]
) -> None:
    """A robot that the visitor may not even watch is unknown."""
    browser.cookies = person("Group Gil", "drive@cart-1", "watch@cart-2")  # type: ignore[assignment]
    body = asked(robots=["arm"])
    assert results(browser, body) == {
        "arm": "unknown-robot",
        "cart-1": "",
        "cart-2": "forbidden",
    }
    assert sent(robots) == {"cart-1"}


@pytest.mark.parametrize(
    ("body", "status", "code"),
    [
        ({"command": "dock"}, 400, "no-robots"),
        ({"command": "fly", "tags": ["carts"]}, 404, "unknown-command"),
        ({"tags": ["carts"]}, 400, "bad-request"),
    ],
)
def test_a_wrong_request_says_why(
    browser: TestClient, body: object, status: int, code: str
) -> None:
    found = browser.post("/api/v1/commands", json=body)
    assert (found.status_code, found.json()["code"]) == (status, code)
