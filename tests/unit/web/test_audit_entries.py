"""What people change on pages has their name in the audit log, and no secret of theirs."""

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from tests.unit.packages.made import install, package
from tests.unit.web.test_manage_routes import served, stock
from urc.packages.store import Store
from urc.runtime.audit_check import check, exported
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_search import AuditQuery, search
from urc.runtime.secret_forms import forms
from urc.testing.entry import ACCESS, BEARER, HERE, KEY, person


@pytest.fixture
def ann() -> dict[str, str]:
    return person("Ann of the audit", "maintain")


@pytest.fixture(autouse=True)
def no_leftovers() -> Iterator[None]:
    """People of other tests have other names."""
    yield
    store = ACCESS.control.store
    assert store is not None
    for one in store.directory().principals.values():
        if one.name.endswith("of the audit"):
            store.remove(one.id)
    ACCESS.control.load()


def entries_of(data: Path) -> list[AuditEntry]:
    found = search(data / "audit.sqlite", AuditQuery(last=1000))
    return [row.entry for row in reversed(found) if row.entry.what != "server"]


def test_changed_settings_have_a_name_and_no_secret(tmp_path: Path, ann: dict[str, str]) -> None:
    stock(tmp_path)
    address = "/api/v1/robots/rover/settings"
    with served(tmp_path, cookies=ann) as client:
        wrong = {"settings": {"host": "http://x"}, "test": False}
        assert not client.post(address, json=wrong).json()["isSaved"]
        good = {"settings": {"host": "10.0.0.7", "key": "open sesame"}, "test": False}
        for _ in range(2):  # the second one changes nothing
            assert client.post(address, json=good).json()["isSaved"]
    (found,) = entries_of(tmp_path)
    assert (found.what, found.robot, found.outcome) == ("settings", "rover", "saved")
    assert json.loads(found.arguments) == {"host": "10.0.0.7", "key": "•••"}
    assert (found.who, found.role, found.way) == ("Ann of the audit", "maintain", "passphrase")
    assert (found.kind, found.place) == ("person", "testclient")


def test_changed_packages_have_a_name(tmp_path: Path, ann: dict[str, str]) -> None:
    install(Store(tmp_path / "packages"), package("driver", "rover"))
    with served(tmp_path, cookies=ann) as client:
        asked = client.post("/api/v1/packages/remove", json={"package": "drivers/rover"})
        assert asked.status_code == 200  # only lists what would go
        wished = {"package": "drivers/rover", "yes": True}
        assert client.post("/api/v1/packages/remove", json=wished).status_code == 200
        gone = client.post("/api/v1/packages/remove", json=wished)
        assert gone.status_code == 422
    (found,) = entries_of(tmp_path)
    assert (found.what, found.command, found.who) == ("package", "remove", "Ann of the audit")
    assert "drivers/rover 1.0.0" in found.arguments


def canaries(client: TestClient, secret: str, passphrase: str) -> None:
    """Hand in secrets wherever a visitor or a mistaken person can type them."""
    settings = {"host": "10.0.0.7", "key": passphrase}
    client.post("/api/v1/robots/rover/settings", json={"settings": settings, "test": False})
    client.get(f"/?key={secret}")
    client.get("/api/v1/audit", params={"text": passphrase, "who": secret})
    client.get("/api/v1/audit", headers={"authorization": f"Bearer {secret}"})
    client.get("/api/v1/audit/export", headers={"authorization": f"Bearer {secret}"})
    client.get("/api/v1/audit/export", headers={"user-agent": secret})
    client.post("/api/v1/repositories/remove", json={"url": f"http://ann:{passphrase}@10.0.0.5/"})


def test_no_secret_of_a_sign_in_reaches_the_log(tmp_path: Path, ann: dict[str, str]) -> None:
    """Start key, cookies, tokens and passphrases: in no column, no file and no export."""
    stock(tmp_path)
    store = ACCESS.control.store
    assert store is not None
    now = ACCESS.control.now()
    robot = store.add("program", "Robot of the audit", now=now)
    _, token = store.open_sign_in(robot.id, "token", now=now)
    ACCESS.control.load()
    passphrase = "canary horse battery staple"  # noqa: S105 - a canary
    with served(tmp_path, cookies={**HERE, **ann}) as client:
        for secret in (KEY, token, *ann.values(), *HERE.values()):
            canaries(client, secret, passphrase)
            canaries(client, secret, f"{passphrase} {secret}")
    assert check(tmp_path / "audit.sqlite") == ""
    whats = {one.what for one in entries_of(tmp_path)}
    assert {"settings", "audit"} <= whats
    with closing(sqlite3.connect(tmp_path / "audit.sqlite")) as base:
        base.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    files = b"".join(one.read_bytes() for one in tmp_path.glob("audit.sqlite*"))
    text = "".join(exported(tmp_path / "audit.sqlite"))
    for secret in (KEY, token, passphrase, *ann.values(), *HERE.values()):
        for form in forms(secret):
            assert form.encode() not in files, secret
            assert form not in text, secret


def test_start_key_signs_in_with_a_name_and_wrong_keys_are_counted(tmp_path: Path) -> None:
    with served(tmp_path, cookies={}) as client:
        assert client.get(f"/?key={KEY}").status_code == 200
        for _ in range(30):
            client.get("/?key=a-key-of-an-earlier-start")
    found = entries_of(tmp_path)
    (one,) = [each for each in found if each.what == "signed in"]
    assert (one.who, one.way, one.role, one.place) == (
        "this computer", "key", "administer", "testclient",
    )  # fmt: skip
    failed = [each for each in found if each.what == "sign-in failed"]
    assert sum(each.times for each in failed) == 30
    assert len(failed) <= 4
    assert "a-key-of" not in str(found)


def test_requests_with_a_bad_token_are_counted(tmp_path: Path) -> None:
    bad = "canary-token-that-was-revoked"
    with served(tmp_path, cookies={}) as client:
        for _ in range(40):
            client.get("/api/v1/audit", headers={"authorization": f"Bearer {bad}"})
        client.get("/api/v1/audit", headers={"authorization": "Basic abc"})
        client.get("/api/v1/audit")
    failed = entries_of(tmp_path)
    assert {(one.what, one.way, one.place) for one in failed} == {
        ("sign-in failed", "token", "testclient")
    }
    assert sum(one.times for one in failed) == 40
    assert len(failed) <= 4
    assert bad not in str(failed)


def test_programs_are_named_by_their_way(tmp_path: Path) -> None:
    with served(tmp_path, cookies={}) as client:
        assert client.get("/api/v1/audit/export", headers=BEARER).status_code == 200
    (found,) = entries_of(tmp_path)
    assert (found.who, found.role, found.way) == ("this computer", "administer", "key")
