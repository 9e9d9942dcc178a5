"""The door: the printed address lets a browser in, strangers are told how, and STOP is for all."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import pytest
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from urc.model.driver import Command
from urc.model.exchange import Hold
from urc.model.payload import WriteSpec
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.entry import ACCESS, BEARER, HERE, KEY, OPEN
from urc.web.access_page import SAID
from urc.web.app import DashboardOptions, build_app
from urc.web.feed.client_socket import SocketFlow
from urc.web.fleet.robots import Robot
from urc.web.serve.access import Access

ADDRESS = "http://localhost:8080"
OURS = {"origin": ADDRESS}
SOCKET = "ws://localhost:8080/ws"
STOP = "/api/v1/robots/puppet/stop"


def robots() -> dict[str, Robot]:
    """Return one robot that moves, and one that does not."""
    drive = Command("drive", "wire", WriteSpec("text", {}), hold=Hold(0.05, {}, 0.25))
    puppet = FakeRobot(dashboard_profile(commands={"drive": drive}))
    still = FakeRobot(dashboard_profile(name="still"))
    both = {"puppet": puppet, "still": still}
    return {name: Robot(one.profile, {}, one.open) for name, one in both.items()}


@contextmanager
def at(
    access: Access, cookies: Mapping[str, str] | None = None, host: str = "127.0.0.1"
) -> Iterator[TestClient]:
    """Give a browser in front of a dashboard."""
    app = build_app(robots(), DashboardOptions(access=access))
    with TestClient(
        app, base_url=ADDRESS, cookies=dict(cookies or {}), client=(host, 50_000)
    ) as browser:
        browser.app_state["flow"] = SocketFlow()
        yield browser


@pytest.mark.parametrize(
    "path", ["/", "/robots/puppet/", "/robots/nobody/", "/widgets", "/robots/puppet/dev", "/docs"]
)
def test_a_stranger_on_this_machine_is_told_how_to_come_in(path: str) -> None:
    """Whatever is asked for: being on loopback is no right."""
    with at(ACCESS) as browser:
        page = browser.get(path)
    assert page.status_code == 401
    assert "Open the address that URC printed in its terminal" in page.text
    assert page.headers["cache-control"] == "no-store"
    assert "battery" not in page.text.lower()


@pytest.mark.parametrize("path", ["/api/v1/packages", "/api/v1/robots/puppet/timeline"])
def test_a_program_without_the_key_gets_one_line(path: str) -> None:
    """And the name of the header that it needs."""
    with at(ACCESS) as browser:
        answer = browser.get(path)
        assert answer.status_code == 401
        assert answer.json() == {"code": "unauthorized", "message": SAID, "error": SAID}
        assert answer.headers["www-authenticate"].startswith("Bearer")
        assert browser.get(path, headers=BEARER).status_code in (200, 404)


def test_a_socket_of_a_stranger_is_closed_with_the_reason() -> None:
    """A page that outlived a restart has to know why: a refused handshake says nothing."""
    with (
        at(ACCESS) as browser,
        browser.websocket_connect(SOCKET, headers=OURS) as line,
    ):
        assert line.receive_json() == {"t": "error", "code": "refused", "message": SAID}
        with pytest.raises(WebSocketDisconnect) as closed:
            line.receive_json()
    assert closed.value.code == 4401
    assert closed.value.reason == SAID


def test_stop_is_open_to_everyone() -> None:
    """The page at the door has it for each robot that moves, and for the one that was asked for."""
    with at(ACCESS) as browser:
        assert re.findall(r'data-stop="([^"]+)"', browser.get("/").text) == [STOP]
        assert STOP in browser.get("/robots/puppet/").text
        answer = browser.post(STOP, headers=OURS)
    assert answer.status_code == 200
    assert answer.json()["latched"]


def test_a_page_of_another_site_cannot_even_stop() -> None:
    with at(ACCESS) as browser:
        assert browser.post(STOP, headers={"origin": "http://evil.example"}).status_code == 403


def test_what_the_page_at_the_door_loads_is_open() -> None:
    """None of it says anything of a robot."""
    with at(ACCESS) as browser:
        page = browser.get("/").text
        files = re.findall(r'(?:src|href)="(/(?:static|words)/[^"]+|/app\.webmanifest)"', page)
        assert "/static/control/early_stop.js" in files
        assert {browser.get(file).status_code for file in files} == {200}
        assert browser.get("/healthz").json()["status"] == "ok"


@pytest.mark.parametrize("path", ["/", "/robots/puppet/?tab=one&watch="])
def test_the_printed_address_lets_a_browser_in(path: str) -> None:
    """It leads on to the same page without the key, and hides it from what comes after."""
    with at(ACCESS) as browser:
        joint = "&" if "?" in path else "?"
        page = browser.get(f"{path}{joint}key={KEY}")
        assert page.status_code == 200
        (cookie,) = page.headers.get_list("set-cookie")
        assert cookie.startswith("urc-start-test=")
        assert cookie.endswith("; Path=/; HttpOnly; SameSite=Strict")
        assert KEY not in page.text + str(page.headers)
        assert page.headers["referrer-policy"] == "no-referrer"
        where = re.search(r'http-equiv="refresh" content="0; url=([^"]+)"', page.text)
        assert where is not None
        assert where[1].replace("&amp;", "&") == path
        assert browser.get(path).status_code == 200


def test_an_old_address_says_that_it_is_old() -> None:
    """No cookie is set; a browser that is in already simply goes on."""
    with at(ACCESS) as browser:
        page = browser.get("/?key=of-yesterday")
        assert page.status_code == 401
        assert "The key in this address has expired or was already used." in page.text
        assert "set-cookie" not in page.headers
    with at(OPEN) as browser:
        page = browser.get("/?key=of-yesterday")
        assert "has expired or was already used" in page.text
        assert "Continue without a key" in page.text
    with at(ACCESS, HERE) as browser:
        page = browser.get("/?key=of-yesterday")
        assert page.status_code == 200
        assert 'content="0; url=/"' in page.text


def test_an_address_that_works_once_works_once() -> None:
    """It is for the command line of a browser, which others can read."""
    with at(ACCESS) as first, at(ACCESS) as second:
        path = ACCESS.address_once("/")
        assert first.get(path).status_code == 200
        assert second.get(path).status_code == 401


def test_no_address_leads_to_another_host() -> None:
    with at(ACCESS) as browser:
        page = browser.get(f"{ADDRESS}//evil.example/?key={KEY}")
    assert 'url=/evil.example/"' in page.text


def test_beyond_loopback_strangers_watch_and_drive_and_are_never_here() -> None:
    """Whatever address they come from, this machine's own included."""
    for host in ("192.168.1.9", "127.0.0.1", "::1"):
        with at(OPEN, host=host) as browser:
            assert browser.get("/robots/puppet/").status_code == 200
            assert browser.get("/robots/puppet/dev").status_code in (403, 404)
            timeline = browser.get("/api/v1/robots/puppet/timeline")
            assert (timeline.status_code, "maintain" in timeline.json()["error"]) == (403, True)


FORWARDED = [
    {"x-forwarded-for": "203.0.113.9"},
    {"forwarded": "for=203.0.113.9;proto=http"},
    {"x-real-ip": "127.0.0.1"},
    {"via": "1.1 proxy"},
]


@pytest.mark.parametrize("forwarded", FORWARDED)
def test_behind_a_proxy_of_this_machine_nobody_is_here_without_the_key(
    forwarded: dict[str, str],
) -> None:
    """The proxy comes from loopback, its clients from anywhere."""
    with at(ACCESS) as browser:
        assert browser.get("/robots/puppet/", headers=forwarded).status_code == 401
    with at(OPEN) as browser:
        timeline = browser.get("/api/v1/robots/puppet/timeline", headers=forwarded)
        assert timeline.status_code == 403
    with at(ACCESS, HERE) as browser:
        assert browser.get("/robots/puppet/", headers=forwarded).status_code == 200


@pytest.mark.parametrize(
    ("access", "cookies", "forces"), [(ACCESS, HERE, True), (OPEN, HERE, True), (OPEN, {}, False)]
)
def test_only_the_holder_of_the_key_may_force(
    access: Access, cookies: dict[str, str], forces: bool
) -> None:
    """The role comes from the cookie, not from the address."""
    with (
        at(access, cookies) as browser,
        browser.websocket_connect(f"{SOCKET}?robot=puppet", headers=OURS) as line,
    ):
        said = next(said for _ in range(20) if (said := line.receive_json())["t"] == "lease")
    assert said["forces"] is forces


@pytest.mark.parametrize(
    ("access", "host", "warnings"),
    [
        (OPEN, "192.168.1.9", ["Sign-in is off", "This connection is not encrypted"]),
        (OPEN, "127.0.0.1", ["Sign-in is off"]),
        (ACCESS, "192.168.1.9", ["This connection is not encrypted"]),
        (ACCESS, "127.0.0.1", []),
    ],
)
def test_each_page_warns_of_missing_protection(
    access: Access, host: str, warnings: list[str]
) -> None:
    """On the menu, and on the page of the door."""
    with at(access, host=host) as browser:
        text = browser.get("/").text
    shown = re.findall(r'urc-server-warning" role="alert">.*?</span> ([^:]+):', text)
    assert shown == warnings


def test_each_page_shows_a_wrong_clock() -> None:
    access = Access(key=KEY)
    access.clock_check = lambda: "the clock is behind"
    app = build_app(robots(), DashboardOptions(access=access))
    with TestClient(app, base_url=ADDRESS) as browser:
        while "the clock is behind" not in browser.get("/").text:
            pass
