"""Sign-in by name and passphrase over HTTP, its limits, and the sign-out."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from tests.unit.web.people import OURS, PASSPHRASE, Door
from urc.access.throttle import FREE
from urc.runtime.audit_search import AuditQuery, search
from urc.web.people.sign_in_page import own_path


@pytest.fixture
def door(tmp_path: Path) -> Iterator[Door]:
    with closing(Door(tmp_path)) as opened:
        yield opened


def sign_in(browser: TestClient, name: str, passphrase: str = PASSPHRASE) -> int:
    """Sign in; return the status."""
    said = {"name": name, "passphrase": passphrase}
    return browser.post("/api/v1/sign-in", json=said, headers=OURS).status_code


def test_a_server_without_people_shows_the_simple_page(door: Door) -> None:
    with door.browser() as browser:
        page = browser.get("/").text
    assert "data-sign-in" not in page
    assert "Open the address that URC printed in its terminal" in page


def test_name_and_passphrase_open_the_requested_page(door: Door) -> None:
    door.add("Ann", "drive", passphrase=PASSPHRASE)
    with door.browser() as browser:
        page = browser.get("/robots/puppet/?tab=one")
        assert page.status_code == 401
        assert 'data-to="/robots/puppet/?tab=one"' in page.text
        assert sign_in(browser, "  ann ") == 200
        assert browser.get("/robots/puppet/").status_code == 200
        assert len(door.access.control.directory.sign_ins) == 2  # with the start key
    (cookie,) = [line for line in browser.cookies.jar if line.name.startswith("urc-sign-in-")]
    assert cookie.has_nonstandard_attr("HttpOnly")


@pytest.mark.parametrize("name", ["Ann", "Unknown", ""])
def test_a_wrong_sign_in_does_not_tell_what_is_wrong(door: Door, name: str) -> None:
    door.add("Ann", "drive", passphrase=PASSPHRASE)
    with door.browser() as browser:
        said = {"name": name, "passphrase": "not this one"}
        answer = browser.post("/api/v1/sign-in", json=said, headers=OURS)
        assert answer.status_code == 403
        assert answer.json()["error"] == "The name or the passphrase is wrong."
        assert "set-cookie" not in answer.headers


def test_failures_make_the_address_wait_and_no_other_address(door: Door) -> None:
    door.add("Ann", "drive", passphrase=PASSPHRASE)
    door.add("Ben", "drive", passphrase=PASSPHRASE)
    with door.browser() as browser:
        assert {sign_in(browser, "Ann", "wrong one") for _ in range(FREE)} == {403}
        assert sign_in(browser, "Ben") == 429
        other = door.other(browser)
        assert sign_in(other, "Ann") == 429  # the name was tried too often
        assert sign_in(other, "Ben") == 200


def test_only_own_pages_sign_in(door: Door) -> None:
    door.add("Ann", "drive", passphrase=PASSPHRASE)
    with door.browser() as browser:
        said = {"name": "Ann", "passphrase": PASSPHRASE}
        foreign = {"origin": "http://evil.example"}
        assert browser.post("/api/v1/sign-in", json=said, headers=foreign).status_code == 403
        assert browser.post("/api/v1/sign-in", json=said).status_code == 403


def test_a_person_without_a_role_is_told(door: Door) -> None:
    door.add("Ann", passphrase=PASSPHRASE)
    with door.browser() as browser:
        said = {"name": "Ann", "passphrase": PASSPHRASE}
        answer = browser.post("/api/v1/sign-in", json=said, headers=OURS)
    assert answer.status_code == 403
    assert answer.json()["error"] == "Ann has no role here: ask an administrator."


def test_signing_out_ends_the_sign_in_on_the_server(door: Door) -> None:
    door.add("Ann", "drive", passphrase=PASSPHRASE)
    with door.browser() as browser:
        assert sign_in(browser, "Ann") == 200
        kept = {one.name: str(one.value) for one in browser.cookies.jar}
        assert browser.post("/api/v1/sign-out", headers=OURS).status_code == 200
        assert not [one for one in browser.cookies.jar if one.name.startswith("urc-sign-in-")]
        assert door.other(browser, cookies=kept).get("/").status_code == 401


def test_sign_ins_are_in_the_audit_log_without_secrets(door: Door) -> None:
    ann = door.add("Ann", "drive", passphrase=PASSPHRASE)
    with door.browser() as browser:
        sign_in(browser, "Ann", "mistyped word")
        sign_in(browser, "hunter2 is my passphrase", "x")
        sign_in(browser, "Ann")
        browser.post("/api/v1/sign-out", headers=OURS)
    found = [one.entry for one in search(door.folder / "audit.sqlite", AuditQuery())]
    events = [(one.what, one.who, one.principal, one.place) for one in found]
    assert ("sign-in failed", "Ann", ann, "192.0.2.7") in events
    assert ("signed in", "Ann", ann, "192.0.2.7") in events
    assert ("signed out", "Ann", ann, "192.0.2.7") in events
    text = str(found)
    assert "hunter2" not in text
    assert "mistyped" not in text


def test_the_page_to_sign_in_leads_to_pages_of_this_server_only(door: Door) -> None:
    door.add("Ann", "drive", passphrase=PASSPHRASE)
    with door.browser() as browser:
        page = browser.get("/sign-in", params={"to": "//evil.example/"})
        assert page.status_code == 200
        assert 'data-to="/"' in page.text


@pytest.mark.parametrize(
    ("text", "path"),
    [
        ("/robots/cart/?tab=2", "/robots/cart/?tab=2"),
        ("//evil.example", "/"),
        ("/\\evil.example", "/"),
        ("https://evil.example", "/"),
        ("javascript:alert(1)", "/"),
        ("/\tevil", "/"),
        ("", "/"),
    ],
)
def test_a_path_of_another_server_is_the_menu(text: str, path: str) -> None:
    assert own_path(text) == path
