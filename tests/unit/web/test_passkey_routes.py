"""Routes of passkeys: sign-in and one's own passkeys, with the software authenticator."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from tests.authenticator import Authenticator
from urc.access.control import AccessControl
from urc.access.external_accounts import ExternalAccount, admit_account
from urc.access.grants import Grant, parse_grant
from urc.access.store import AccessStore
from urc.runtime.audit_search import AuditQuery, search
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.app import DashboardOptions, build_app
from urc.web.feed.client_socket import SocketFlow
from urc.web.fleet.robots import Robot
from urc.web.serve.access import Access
from urc.web.serve.rights import FRESH_S

ADDRESS = "http://localhost:8080"
OURS = {"origin": ADDRESS}
SIGN_IN, OWN = "/sign-in/passkey", "/account/passkeys"
STOP = "/api/v1/robots/puppet/stop"


class House:
    """A dashboard with its people, and a clock that tests set."""

    def __init__(self, folder: Path) -> None:
        self.ahead_s = 0.0
        self.folder = folder
        self.store = AccessStore(folder)
        self.control = AccessControl(self.store, key="key", utc=lambda: 1e9 + self.ahead_s)
        self.access = Access(self.control, instance="test")
        self.phone = Authenticator(ADDRESS)

    def person(self, name: str, *grants: str, way: Any = "passphrase") -> dict[str, str]:
        """Return the cookies of a new person who has signed in."""
        now = self.control.now()
        added = self.store.add("person", name, [parse_grant(one) for one in grants], now=now)
        _, secret = self.store.open_sign_in(added.id, way, now=now)
        self.control.load()
        return {self.access.sign_in_cookie: secret}

    @contextmanager
    def browser(
        self,
        cookies: Mapping[str, str] = {},
        url: str = ADDRESS,
        host: str = "127.0.0.1",
    ) -> Iterator[TestClient]:
        robot = FakeRobot(dashboard_profile())
        app = build_app(
            {"puppet": Robot(robot.profile, {}, robot.open)},
            DashboardOptions(access=self.access, data=self.folder),
        )
        with TestClient(
            app, base_url=url, cookies=dict(cookies), client=(host, 50_000),
            headers={"origin": url},
        ) as browser:  # fmt: skip
            browser.app_state["flow"] = SocketFlow()
            yield browser

    def add(self, browser: TestClient, name: str = "phone") -> Any:
        options = browser.post(f"{OWN}/options")
        assert options.status_code == 200, options.text
        made = self.phone.create(options.json())
        return browser.post(f"{OWN}/add", json={"response": made, "name": name})

    def sign_in(self, browser: TestClient) -> Any:
        options = browser.post(f"{SIGN_IN}/options")
        assert options.status_code == 200, options.text
        return browser.post(SIGN_IN, json={"response": self.phone.get(options.json())})


@pytest.fixture
def house(tmp_path: Path) -> Iterator[House]:
    made = House(tmp_path)
    yield made
    made.store.close()


def test_a_person_adds_a_passkey_and_signs_in_with_it(house: House) -> None:
    with house.browser(house.person("Ann", "watch")) as browser:
        added = house.add(browser)
        assert (added.status_code, added.json()["name"]) == (200, "phone")
        assert added.json()["used_at"] is None
    with house.browser() as browser:
        assert browser.get("/").status_code == 401
        done = house.sign_in(browser)
        assert (done.status_code, done.json()) == (200, {"name": "Ann"})
        line = done.headers["set-cookie"]
        assert "HttpOnly; SameSite=Strict" in line
        assert browser.get("/").status_code == 200
        house.ahead_s = 60
        (shown,) = browser.get(OWN).json()["passkeys"]
        assert (shown["name"], shown["host"]) == ("phone", "localhost")
    (sign_in,) = [one for one in house.control.directory.sign_ins.values() if one.way == "passkey"]
    assert sign_in.idle_s == 12 * 3600
    assert sign_in.ends_at == pytest.approx(1e9 + 7 * 24 * 3600, abs=1)


def test_sign_ins_are_in_the_audit_log_with_their_way(house: House) -> None:
    with house.browser(house.person("Ann", "drive")) as browser:
        house.add(browser)
        house.sign_in(browser)
        house.phone.credentials[0].count = 0
        assert house.sign_in(browser).status_code == 403
    rows = search(house.folder / "audit.sqlite", AuditQuery())
    texts = [(row.entry.what, row.entry.who, row.entry.way, row.entry.place) for row in rows]
    assert ("access", "Ann", "passphrase", "127.0.0.1") in texts
    assert ("signed in", "Ann", "passkey", "127.0.0.1") in texts
    assert ("sign-in failed", "", "passkey", "127.0.0.1") in texts


def test_a_new_sign_in_replaces_that_of_the_browser(house: House) -> None:
    cookies = house.person("Ann", "watch")
    with house.browser(cookies) as browser:
        house.add(browser)
        house.sign_in(browser)
    assert [one.way for one in house.store.directory().sign_ins.values()] == ["passkey"]


def test_only_fresh_people_add_passkeys(house: House) -> None:
    with house.browser(house.person("Ann", "watch")) as browser:
        house.ahead_s = FRESH_S + 1
        refused = browser.post(f"{OWN}/options")
        assert refused.status_code == 403
        assert "this needs a sign-in within the last 5 minutes" in refused.text
        assert browser.post(f"{OWN}/add", json={"response": {}}).status_code == 403
        assert browser.get(OWN).status_code == 200


def test_devices_programs_and_the_local_user_have_no_passkeys(house: House) -> None:
    now = house.control.now()
    ann = house.store.add("person", "Ann", [parse_grant("administer")], now=now)
    tablet = house.store.add("device", "Tablet", now=now, owner=ann.id)
    _, key = house.store.open_sign_in(tablet.id, "pairing", now=now)
    _, token = house.store.open_sign_in(ann.id, "token", now=now)
    house.control.load()
    local = {house.access.cookie: str(house.access.admit("key"))}
    bearer = {"authorization": f"Bearer {token}"}
    for cookies, headers in (({house.access.sign_in_cookie: key}, {}), (local, {}), ({}, bearer)):
        with house.browser(cookies) as browser:
            for path in (OWN, f"{OWN}/options"):
                verb = "GET" if path == OWN else "POST"
                refused = browser.request(verb, path, headers=headers)
                assert (refused.status_code, path) == (403, path)
                assert "only people have passkeys" in refused.text


def test_strangers_reach_no_passkeys(house: House) -> None:
    with house.browser() as browser:
        for path in ("options", "add", "rename", "remove"):
            assert browser.post(f"{OWN}/{path}", json={}).status_code == 401
        assert browser.get(OWN).status_code == 401


def test_passkeys_are_renamed_and_removed_by_their_owner(house: House) -> None:
    ann, eve = house.person("Ann", "watch"), house.person("Eve", "administer")
    with house.browser(ann) as browser:
        passkey = house.add(browser).json()["id"]
    with house.browser(eve) as browser:
        for path, body in (
            ("rename", {"id": passkey, "name": "mine"}),
            ("remove", {"id": passkey}),
        ):
            assert browser.post(f"{OWN}/{path}", json=body).status_code == 403
    with house.browser(ann) as browser:
        renamed = browser.post(f"{OWN}/rename", json={"id": passkey, "name": "work"})
        assert [one["name"] for one in renamed.json()["passkeys"]] == ["work"]
        assert browser.post(f"{OWN}/remove", json={"id": passkey}).json() == {"passkeys": []}
    with house.browser() as browser:
        assert house.sign_in(browser).status_code == 403


def test_a_person_without_a_role_is_not_signed_in(house: House) -> None:
    with house.browser(house.person("Ann", "watch")) as browser:
        house.add(browser)
    (ann,) = house.store.directory().principals.values()
    house.store.set_grants(ann.id, [])
    house.control.load()
    with house.browser() as browser:
        refused = house.sign_in(browser)
    assert refused.status_code == 403
    assert "Ann has no role here" in refused.text
    assert "set-cookie" not in refused.headers


def test_the_passkey_of_an_account_ends_with_the_account(house: House) -> None:
    """A blocked account has no way in past its provider."""
    now = house.control.now()
    account = ExternalAccount("https://id.example", "17", "ann", (Grant("watch"),), now + 300)
    person = admit_account(house.store, account, now)
    _, secret = house.store.open_sign_in(person.id, "oidc", now=now)
    house.control.load()
    with house.browser({house.access.sign_in_cookie: secret}) as browser:
        assert house.add(browser).status_code == 200
        assert house.sign_in(browser).status_code == 200
        house.ahead_s = 300
        assert browser.get(OWN).status_code == 401
        refused = house.sign_in(browser)
    assert refused.status_code == 403
    assert "the rights of 'ann' have ended" in refused.text


def test_failures_make_an_address_wait_and_never_stop(house: House) -> None:
    with house.browser(host="192.0.2.1") as browser:
        for _ in range(5):
            assert browser.post(SIGN_IN, json={"response": {}}).status_code == 403
        waiting = browser.post(SIGN_IN, json={"response": {}})
        assert waiting.status_code == 429
        assert "wait 1 s" in waiting.text
        assert browser.post(f"{SIGN_IN}/options").status_code == 429
        assert browser.post(STOP).status_code != 429
    with house.browser(house.person("Ann", "watch")) as browser:
        house.add(browser)
        assert house.sign_in(browser).status_code == 200, "another address"


def test_an_address_has_no_passkeys(house: House) -> None:
    with house.browser(house.person("Ann", "watch"), "http://127.0.0.1:8080") as browser:
        for path in (f"{SIGN_IN}/options", f"{OWN}/options"):
            refused = browser.post(path)
            assert refused.status_code == 403
            assert "open this page by its host name" in refused.text


def test_another_site_cannot_ask(house: House) -> None:
    with house.browser(house.person("Ann", "watch")) as browser:
        refused = browser.post(f"{OWN}/options", headers={"origin": "http://evil.example"})
        assert refused.status_code == 403
        refused = browser.post(SIGN_IN, content="{}", headers={"content-type": "text/plain"})
        assert refused.status_code == 415
        assert browser.post(SIGN_IN, json={"reponse": {}}).status_code == 400


def test_a_server_without_a_store_has_no_passkeys() -> None:
    robot = FakeRobot(dashboard_profile())
    app = build_app({"puppet": Robot(robot.profile, {}, robot.open)})
    with TestClient(app, base_url=ADDRESS, headers=OURS) as browser:
        refused = browser.post(f"{SIGN_IN}/options")
    assert refused.status_code == 404
    assert "no list of people" in refused.text
