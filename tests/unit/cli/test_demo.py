"""The demo for a phone: who may enter, by which code, and for how long."""

import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from urc.access.pairing import NewSignIn, pair
from urc.access.store import AccessStore
from urc.cli import demo_phone
from urc.cli.demo_phone import NAME, paired_until_end
from urc.cli.main import main

ADDRESS = "https://192.0.2.7:8080/"


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[AccessStore]:
    """Return the store of the demo's data folder."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path))
    with closing(AccessStore(tmp_path)) as opened:
        yield opened


def paired(store: AccessStore, output: str) -> NewSignIn:
    """Pair a phone with the code in the demo's output."""
    _, _, code = output.strip().partition("#")
    return pair(store, code, "Phone", now=time.time())


def role_of(store: AccessStore, phone: NewSignIn, now: float) -> str | None:
    """Return what the phone may do."""
    directory = store.directory()
    return directory.role(directory.identify(phone.secret, now), now)


def test_phone_gets_a_link_with_a_code(
    store: AccessStore, capsys: pytest.CaptureFixture[str]
) -> None:
    """The code pairs one device, which may drive; a pipe gets no QR code."""
    with paired_until_end(ADDRESS):
        link, errors = capsys.readouterr()
        assert link.startswith("https://192.0.2.7:8080/pair#")
        assert link.count("\n") == 1
        assert "pairs one device (roles of urc demo): works once, valid for 2 minutes" in errors
        assert "the pairing ends with this demo" in errors
        phone = paired(store, link)
        assert role_of(store, phone, time.time()) == "drive"


def test_the_pairing_ends_with_the_demo(
    store: AccessStore, capsys: pytest.CaptureFixture[str]
) -> None:
    """Neither the phone nor an unused code can enter a later server with the same data folder."""
    with paired_until_end(ADDRESS):
        phone = paired(store, capsys.readouterr().out)
    with paired_until_end(ADDRESS):
        unused = capsys.readouterr().out
    assert role_of(store, phone, time.time()) is None
    assert store.directory().principals == {}
    assert store.invitation(unused.strip().partition("#")[2], time.time()) is None


def test_the_pairing_ends_soon_after_a_demo_that_was_killed(
    store: AccessStore, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The demo renews the rights; the next demo removes what a killed demo has left."""
    monkeypatch.setattr(demo_phone, "_remove", lambda *_: None)
    with paired_until_end(ADDRESS):
        phone = paired(store, capsys.readouterr().out)
    now = time.time()
    assert role_of(store, phone, now) == "drive"
    assert role_of(store, phone, now + 130) is None
    monkeypatch.undo()
    (owner,) = [one for one in store.directory().principals.values() if one.name == NAME]
    store.set_end(owner.id, now - 1)
    monkeypatch.setenv("URC_DATA_DIR", str(store.file.parent))
    with paired_until_end(ADDRESS) as fresh:
        assert list(store.directory().principals) == [fresh.id]
        assert fresh.name == NAME


def test_a_running_demo_renews_the_pairing(
    store: AccessStore, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(demo_phone, "_VALID_S", 0.5)
    monkeypatch.setattr(demo_phone, "_RENEWAL_S", 0.05)
    with paired_until_end(ADDRESS):
        phone = paired(store, capsys.readouterr().out)
        began = time.time()
        while time.time() < began + 1:
            time.sleep(0.05)
        assert role_of(store, phone, began + 1) == "drive"


def test_two_demos_end_their_own_pairings(
    store: AccessStore, capsys: pytest.CaptureFixture[str]
) -> None:
    with paired_until_end(ADDRESS) as first:
        phone = paired(store, capsys.readouterr().out)
        with paired_until_end(ADDRESS) as second:
            assert (first.name, second.name) == (NAME, f"{NAME} 2")
        assert role_of(store, phone, time.time()) == "drive"


def test_phone_and_developer_pages_exclude_each_other(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--phone", "--dev"]) == 2
    assert "allowed only on this machine; found --phone" in capsys.readouterr().err
