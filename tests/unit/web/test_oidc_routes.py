"""Routes of the sign-in with an identity provider; the provider is the one of the flow's tests."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from tests.unit.access import test_oidc as flow
from urc.access.control import AccessControl
from urc.access.oidc_options import OidcOptions
from urc.access.store import AccessStore
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.app import DashboardOptions, build_app
from urc.web.feed.client_socket import SocketFlow
from urc.web.fleet.robots import Robot
from urc.web.people.oidc_routes import CALLBACK
from urc.web.people.ways_in import SignInOptions
from urc.web.serve.access import Access

ADDRESS = "https://localhost:8443"
BEGIN = "/sign-in/oidc"


class House:
    """A dashboard with its provider."""

    def __init__(self, folder: Path) -> None:
        self.provider = flow.FakeProvider()
        self.store = AccessStore(folder)
        self.control = AccessControl(self.store, utc=lambda: flow.NOW)
        self.access = Access(self.control, instance="test")
        self.options = OidcOptions(
            self.provider.url, "urc", self.provider.secret, "Lab account", rules=flow.RULES
        )

    def browser(self, options: OidcOptions | None = None) -> TestClient:
        robot = FakeRobot(dashboard_profile())
        app = build_app(
            {"puppet": Robot(robot.profile, {}, robot.open)},
            DashboardOptions(
                access=self.access, sign_in=SignInOptions(oidc=options or self.options)
            ),
        )
        browser = TestClient(app, base_url=ADDRESS, follow_redirects=False)
        browser.app_state["flow"] = SocketFlow()
        return browser

    def go(self, browser: TestClient) -> dict[str, str]:
        """Begin, and sign in at the provider; return the query of the way back."""
        begun = browser.post(BEGIN, headers={"origin": ADDRESS})
        assert begun.status_code == 200, begun.text
        return self.provider.visit(begun.json()["url"])


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.provider.close()
    made.store.close()


def test_an_account_signs_in(house: House) -> None:
    with house.browser() as browser:
        assert browser.get("/").status_code == 401
        back = browser.get(CALLBACK, params=house.go(browser))
        assert back.status_code == 200
        assert '<meta http-equiv="refresh" content="0; url=/">' in back.text
        assert back.headers["cache-control"] == "no-store"
        lines = back.headers.get_list("set-cookie")
        assert re.match(r"__Host-urc-sign-in-\w+=.*; HttpOnly; SameSite=Strict; Secure", lines[0])
        assert lines[1].startswith("__Host-urc-provider-test=; Max-Age=0; ")
        assert browser.get("/").status_code == 200
    (person,) = house.store.directory().principals.values()
    assert (person.kind, person.name, [str(one) for one in person.grants]) == (
        "person", "ann", ["drive"],
    )  # fmt: skip
    (sign_in,) = house.store.directory().sign_ins.values()
    assert (sign_in.way, sign_in.ends_at) == ("oidc", flow.NOW + 43200)


def test_the_redirect_address_is_ours(house: House) -> None:
    with house.browser() as browser:
        url = browser.post(BEGIN, headers={"origin": ADDRESS}).json()["url"]
        assert "redirect_uri=https%3A%2F%2Flocalhost%3A8443%2Fsign-in%2Foidc%2Fcallback" in url
    named = OidcOptions(
        house.provider.url, "urc", house.provider.secret, address="https://robots.example",
        rules=flow.RULES,
    )  # fmt: skip
    with house.browser(named) as browser:
        url = browser.post(BEGIN, headers={"origin": ADDRESS}).json()["url"]
        assert "redirect_uri=https%3A%2F%2Frobots.example%2Fsign-in%2Foidc%2Fcallback" in url


def test_another_browser_cannot_come_back(house: House) -> None:
    with house.browser() as browser:
        query = house.go(browser)
    with house.browser() as other:
        back = other.get(CALLBACK, params=query)
    assert back.status_code == 403
    assert "began in another browser" in back.text
    assert house.store.directory().principals == {}


def test_the_binding_is_in_a_cookie_that_scripts_cannot_read(house: House) -> None:
    with house.browser() as browser:
        begun = browser.post(BEGIN, headers={"origin": ADDRESS})
        line = begun.headers["set-cookie"]
        assert line.startswith("__Host-urc-provider-test=")
        assert line.endswith("; Max-Age=600; Path=/; HttpOnly; SameSite=Lax; Secure")
        assert line.partition("=")[2].partition(";")[0] not in begun.text


def test_an_account_without_a_role_loses_its_roles_at_once(house: House) -> None:
    with house.browser() as browser:
        browser.get(CALLBACK, params=house.go(browser))
        assert browser.get("/").status_code == 200
        house.provider.claims["groups"] = []
        back = browser.get(CALLBACK, params=house.go(browser))
        assert back.status_code == 403
        assert "has no role here" in back.text
        assert browser.get("/").status_code == 401, "the sign-in of before has no rights"


def test_texts_of_the_provider_are_no_markup(house: House) -> None:
    house.provider.claims |= {"preferred_username": "<b>ann</b>", "groups": []}
    with house.browser() as browser:
        back = browser.get(CALLBACK, params=house.go(browser))
        assert "<b>" not in back.text
        assert "&lt;b&gt;" in back.text
        begun = house.go(browser)
        back = browser.get(CALLBACK, params=begun | {"error": "<script>alert(1)</script>"})
        assert "<script>alert" not in back.text


def test_failures_make_an_address_wait(house: House) -> None:
    with house.browser() as browser:
        for _ in range(5):
            assert browser.get(CALLBACK, params={"state": "guess"}).status_code == 403
        assert browser.get(CALLBACK, params={"state": "guess"}).status_code == 429
        assert browser.post(BEGIN, headers={"origin": ADDRESS}).status_code == 429


def test_another_site_cannot_begin(house: House) -> None:
    with house.browser() as browser:
        assert browser.post(BEGIN, headers={"origin": "https://evil.example"}).status_code == 403
        assert browser.get(BEGIN).status_code in (401, 405)


def test_an_unreachable_provider_is_told(house: House) -> None:
    house.provider.answers["/.well-known/openid-configuration"] = lambda request: flow.send(
        request, {}, 503
    )
    with house.browser() as browser:
        refused = browser.post(BEGIN, headers={"origin": ADDRESS})
    assert refused.status_code == 502
    assert "status 503" in refused.text


def test_without_a_provider_both_routes_refuse(house: House) -> None:
    robot = FakeRobot(dashboard_profile())
    app = build_app(
        {"puppet": Robot(robot.profile, {}, robot.open)}, DashboardOptions(access=house.access)
    )
    with TestClient(app, base_url=ADDRESS) as browser:
        assert browser.post(BEGIN, headers={"origin": ADDRESS}).status_code == 404
        back = browser.get(CALLBACK, params={"state": "x"})
        assert (back.status_code, "no identity provider" in back.text) == (404, True)
