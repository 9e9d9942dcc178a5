"""Requests of trusted proxies: the person of the header, and nothing without the secret."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from urc.access.control import AccessControl
from urc.access.grants import Grant
from urc.access.proxies import TrustedProxy
from urc.access.store import AccessStore
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.app import DashboardOptions, build_app
from urc.web.feed.client_socket import SocketFlow
from urc.web.fleet.robots import Robot
from urc.web.people.ways_in import SignInOptions
from urc.web.serve.access import Access

ADDRESS = "http://localhost:8080"
SECRET = "0123456789abcdef" * 2
SOCKET = "ws://localhost:8080/ws?robot=puppet"
STOP = "/api/v1/robots/puppet/stop"
PROOF = {"x-gate-secret": SECRET}
ANN = {**PROOF, "x-forwarded-user": "ann"}
EVE = {**PROOF, "x-forwarded-user": "eve"}
NOW = 1e9


class House:
    """A dashboard behind a proxy."""

    def __init__(self, folder: Path) -> None:
        self.store = AccessStore(folder)
        self.control = AccessControl(self.store, key="key", utc=lambda: NOW)
        self.access = Access(self.control, instance="test")
        self.ann = self.store.add("person", "Ann", [Grant("administer")], now=NOW)
        self.control.load()

    def browser(self, *new_people: Grant) -> TestClient:
        robot = FakeRobot(dashboard_profile())
        proxy = TrustedProxy(
            "gate", b"x-forwarded-user", b"x-gate-secret", SECRET.encode(), new_people
        )
        app = build_app(
            {"puppet": Robot(robot.profile, {}, robot.open)},
            DashboardOptions(access=self.access, sign_in=SignInOptions(proxies=(proxy,))),
        )
        browser = TestClient(app, base_url=ADDRESS)
        browser.app_state["flow"] = SocketFlow()
        return browser


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.store.close()


def test_the_person_of_the_header_is_signed_in(house: House) -> None:
    with house.browser() as browser:
        page = browser.get("/", headers=ANN)
        assert page.status_code == 200
        assert "set-cookie" not in page.headers, "the proxy proves each request"
        assert browser.get("/").status_code == 401
        for _ in range(3):
            browser.get("/", headers={**ANN, "x-forwarded-user": "ANN"})
    (sign_in,) = house.store.directory().sign_ins.values()
    assert (sign_in.way, sign_in.principal, sign_in.place) == ("proxy", house.ann.id, "testclient")
    assert sign_in.ends_at == NOW + 12 * 3600


@pytest.mark.parametrize(
    "headers",
    [
        {"x-forwarded-user": "ann"},
        {"x-forwarded-user": "ann", "x-gate-secret": "guess"},
        {"x-gate-secret": SECRET},
        {**PROOF, "x-forwarded-user": " "},
    ],
)
def test_without_proof_a_request_is_that_of_a_stranger(
    house: House, headers: dict[str, str]
) -> None:
    with house.browser() as browser:
        assert browser.get("/", headers=headers).status_code == 401
        socket = browser.websocket_connect(SOCKET, headers={"origin": ADDRESS, **headers})
        with socket as line:
            assert line.receive_json()["code"] == "refused"
        with browser.websocket_connect(SOCKET, headers={"origin": ADDRESS, **ANN}) as line:
            assert line.receive_json().get("code") != "refused"


def test_a_doubled_header_names_nobody(house: House) -> None:
    """A proxy that appends its header lets clients send another one."""
    with house.browser() as browser:
        both = [*PROOF.items(), ("x-forwarded-user", "eve"), ("x-forwarded-user", "ann")]
        assert browser.get("/", headers=both).status_code == 401


def test_an_unknown_person_is_told_and_may_stop(house: House) -> None:
    with house.browser() as browser:
        refused = browser.get("/", headers=EVE)
        assert refused.status_code == 403
        assert "proxy gate was refused: no person has the name 'eve'" in refused.text
        assert refused.headers["content-security-policy"].startswith("default-src 'none'")
        stopped = browser.post(STOP, headers={**EVE, "origin": ADDRESS})
        assert stopped.status_code in (200, 409), "a robot without motion has nothing to stop"


def test_a_new_person_gets_the_named_roles(house: House) -> None:
    with house.browser(Grant("watch")) as browser:
        assert browser.get("/", headers=EVE).status_code == 200
    names = {one.name: one.grants for one in house.store.directory().principals.values()}
    assert names["eve"] == (Grant("watch"),)


def test_the_header_counts_more_than_cookies_of_the_browser(house: House) -> None:
    """Else the person who was at this browser before would be the visitor."""
    house.store.add("person", "Eve", [Grant("watch")], now=NOW)
    _, secret = house.store.open_sign_in(house.ann.id, "passphrase", now=NOW)
    house.control.load()
    local = str(house.access.admit("key"))
    cookies = {
        "theme": "dark", house.access.sign_in_cookie: secret, house.access.cookie: local,
    }  # fmt: skip
    with house.browser() as browser:
        browser.cookies.update(cookies)
        own = browser.get("/account/passkeys", headers=EVE)
        assert own.status_code == 200
        assert own.json() == {"passkeys": []}
        timeline = "/api/v1/robots/puppet/timeline"
        assert browser.get(timeline, headers=EVE).status_code == 403
        browser.cookies.clear()
        # A name that other letters than spaces surround is another name, for all parts of URC.
        hidden = {"cookie": f"\x1f{house.access.cookie}={local}"}
        assert browser.get(timeline, headers={**EVE, **hidden}).status_code == 403


def test_a_revoked_sign_in_and_a_removed_person_lose_their_rights(house: House) -> None:
    with house.browser() as browser:
        assert browser.get("/", headers=ANN).status_code == 200
        house.store.rename(house.ann.id, "Ann Lee")
        house.control.load()
        assert browser.get("/", headers=ANN).status_code == 403, "another person may be named so"
        house.store.remove(house.ann.id)
        house.control.load()
        again = browser.get("/", headers={**ANN, "x-forwarded-user": "Ann Lee"})
        assert again.status_code == 403


def test_another_site_cannot_write_through_the_proxy(house: House) -> None:
    with house.browser() as browser:
        headers = {**ANN, "origin": "http://evil.example"}
        assert browser.post("/account/passkeys/options", headers=headers).status_code == 403
