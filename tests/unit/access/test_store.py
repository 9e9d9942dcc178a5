"""The store of people, devices, programs, sign-ins and codes, and the rights that follow."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from urc.access.directory import NOBODY, Identity
from urc.access.grants import AccessError, Grant
from urc.access.store import (
    CHECKS,
    MOST_CODES_OF_ONE,
    MOST_DEVICES_OF_ONE,
    MOST_SIGN_INS_OF_ONE,
    AccessStore,
    Invitation,
)

NOW = 1_000_000.0
DRIVE = (Grant("drive"),)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[AccessStore]:
    opened = AccessStore(tmp_path / "data")
    yield opened
    opened.close()


def signed_in(store: AccessStore, name: str = "Ann") -> tuple[Identity, str]:
    """Add a person who may drive, and sign in; return the identity and the sign-in's secret."""
    person = store.add("person", name, DRIVE, now=NOW)
    _, secret = store.open_sign_in(person.id, "passphrase", now=NOW, idle_s=60.0)
    return store.directory().identify(secret, NOW), secret


def test_a_secret_names_its_owner_until_the_session_is_closed(store: AccessStore) -> None:
    who, secret = signed_in(store)
    assert (who.name, who.kind, who.way) == ("Ann", "person", "passphrase")
    before = store.directory()
    assert before.role(who, NOW) == "drive"
    store.close_sign_in(who.sign_in)
    after = store.directory()
    assert after.identify(secret, NOW) == NOBODY
    assert after.role(who, NOW) is None, "an old identity has no rights"
    assert after.identify("guess", NOW) == NOBODY


def test_a_removed_person_loses_sessions_and_devices(store: AccessStore) -> None:
    who, secret = signed_in(store)
    phone = store.add("device", "Ann's phone", now=NOW, owner=who.principal)
    _, key = store.open_sign_in(phone.id, "pairing", now=NOW)
    its = store.directory().identify(key, NOW)
    assert store.directory().role(its, NOW) == "drive", "the rights of its owner"
    code = store.invite(Invitation("device", "", (), who.principal, NOW + 60))
    store.remove(who.principal)
    left = store.directory()
    assert (left.identify(secret, NOW), left.identify(key, NOW)) == (NOBODY, NOBODY)
    assert (left.principals, left.sign_ins) == ({}, {})
    assert store.redeem(code, NOW) is None
    with pytest.raises(AccessError, match="this entry was already removed"):
        store.remove(who.principal)


def test_other_grants_act_on_identities_that_exist(store: AccessStore) -> None:
    who, _ = signed_in(store)
    store.set_grants(who.principal, [Grant("watch"), Grant("drive", "#lab")])
    now = store.directory()
    assert now.role(who, NOW, "cart") == "watch"
    assert now.role(who, NOW, "cart", ("lab",)) == "drive"


def test_a_session_ends_by_itself(store: AccessStore) -> None:
    who, secret = signed_in(store)
    directory = store.directory()
    assert directory.identify(secret, NOW + 59.9) == who
    assert directory.identify(secret, NOW + 60) == NOBODY
    assert directory.role(who, NOW + 60) is None
    store.touch_all({who.sign_in: NOW + 50})
    assert store.directory().identify(secret, NOW + 100) == who
    token, key = store.open_sign_in(who.principal, "token", now=NOW, ends_at=NOW + 10)
    assert store.directory().identify(key, NOW + 9.9).sign_in == token.id
    assert store.directory().identify(key, NOW + 10) == NOBODY


def test_a_guest_ends_with_the_link(store: AccessStore) -> None:
    guest = store.add("guest", "Visitor", [Grant("watch", "cart")], now=NOW, ends_at=NOW + 100)
    _, secret = store.open_sign_in(guest.id, "link", now=NOW)
    directory = store.directory()
    who = directory.identify(secret, NOW)
    assert (directory.role(who, NOW, "cart"), directory.role(who, NOW, "rover")) == ("watch", None)
    assert directory.identify(secret, NOW + 100) == NOBODY
    assert directory.role(who, NOW + 100, "cart") is None


def test_a_program_gives_only_the_commands_of_its_token(store: AccessStore) -> None:
    program = store.add("program", "Night patrol", DRIVE, now=NOW, commands=["goto", "dock"])
    _, secret = store.open_sign_in(program.id, "token", now=NOW)
    directory = store.directory()
    who = directory.identify(secret, NOW)
    assert [directory.may_give(who, one) for one in ("goto", "dock", "arm")] == [True, True, False]
    assert not directory.may_give(NOBODY, "goto")


def test_a_code_works_once_and_not_for_long(store: AccessStore) -> None:
    invitation = Invitation("device", "Tablet in the lab", (Grant("drive", "#lab"),), "", NOW + 120)
    code = store.invite(invitation)
    assert store.redeem("wrong", NOW) is None
    assert store.redeem(code, NOW + 119) == invitation
    assert store.redeem(code, NOW + 119) is None
    late = store.invite(invitation)
    assert store.redeem(late, NOW + 120) is None


def test_two_processes_see_each_others_changes(store: AccessStore, tmp_path: Path) -> None:
    """The server notices a removal by command line."""
    who, secret = signed_in(store)
    other = AccessStore(tmp_path / "data")
    assert other.directory().identify(secret, NOW) == who
    assert not store.changed(), "reading is no change"
    other.remove(who.principal)
    other.close()
    assert store.changed()
    assert not store.changed()
    assert store.directory().identify(secret, NOW) == NOBODY


def test_the_file_is_read_only_after_a_change(store: AccessStore, tmp_path: Path) -> None:
    """Also a few times later: a second change may have the same time."""
    os.utime(store.file, (0, 0))
    first = [store.may_have_changed() for _ in range(CHECKS + 2)]
    assert first == [True] * CHECKS + [False] * 2
    other = AccessStore(tmp_path / "data")
    other.add("person", "Ann", now=NOW)
    other.close()
    assert [store.may_have_changed() for _ in range(CHECKS + 1)] == [True] * CHECKS + [False]
    store.file.unlink()
    assert store.may_have_changed()


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("  ", "the name is empty"),
        ("x" * 65, "the name has 65 characters; expected at most 64"),
        ("a\x1b[31m", "the name contains unprintable characters"),
        (" ann ", "a person already has the name 'ann'"),
    ],
)
def test_a_wrong_name_is_refused(store: AccessStore, name: str, message: str) -> None:
    signed_in(store)
    with pytest.raises(AccessError) as caught:
        store.add("person", name, now=NOW)
    assert str(caught.value) == message
    assert len(store.directory().principals) == 1, "nothing is half done"


def test_a_name_is_free_again_and_may_change(store: AccessStore) -> None:
    who, _ = signed_in(store)
    ben = store.add("person", "Ben", now=NOW)
    with pytest.raises(AccessError, match="the name 'ANN' is in use"):
        store.rename(ben.id, "ANN")
    store.remove(who.principal)
    store.rename(ben.id, "Ann")
    assert store.directory().principals[ben.id].name == "Ann"
    assert store.add("device", "Ann", now=NOW).kind == "device", "names are unique for each kind"


def test_the_file_is_private_and_holds_no_secret(store: AccessStore, tmp_path: Path) -> None:
    _, secret = signed_in(store)
    code = store.invite(Invitation("device", "", DRIVE, "", NOW + 60))
    assert stat.S_IMODE(store.file.stat().st_mode) == 0o600
    assert stat.S_IMODE((tmp_path / "data").stat().st_mode) == 0o700
    written = store.file.read_bytes()
    assert secret.encode() not in written
    assert code.encode() not in written


def test_a_foreign_or_newer_file_is_refused_in_one_line(tmp_path: Path) -> None:
    store = AccessStore(tmp_path)
    store._base.execute("PRAGMA user_version = 99")
    store.close()
    with pytest.raises(AccessError, match="a newer version of URC wrote this file"):
        AccessStore(tmp_path)
    (tmp_path / "access.sqlite").write_bytes(b"no database at all, but long enough to be read" * 9)
    with pytest.raises(AccessError, match=r"cannot be used: file is not a database"):
        AccessStore(tmp_path)


def test_a_passphrase_belongs_to_one_person(store: AccessStore) -> None:
    who, _ = signed_in(store)
    assert store.passphrase_of("ann") == (who.principal, None)
    assert store.passphrase_of("nobody") == ("", None)
    store.set_passphrase(who.principal, "hash")
    store.set_passphrase(who.principal, "other")
    assert store.passphrase_of("ANN") == (who.principal, "other")
    store.remove(who.principal)
    assert store.passphrase_of("ann") == ("", None)


def test_one_person_ends_no_sign_ins_of_others(store: AccessStore) -> None:
    """The oldest sign-in of the same person gives way, long before the file is full."""
    who, key = signed_in(store, "Ben")
    mine, first = signed_in(store)
    newest = [
        store.open_sign_in(mine.principal, "passphrase", now=NOW + number / 10)[1]
        for number in range(1, MOST_SIGN_INS_OF_ONE + 1)
    ]
    left = store.directory()
    assert left.identify(first, NOW) == NOBODY
    assert all(left.identify(secret, NOW).principal == mine.principal for secret in newest)
    assert left.identify(key, NOW) == who


def test_one_person_takes_few_codes_and_devices(store: AccessStore) -> None:
    """Otherwise, a person who only watches could keep administrators from pairing."""
    who, _ = signed_in(store)
    codes = [
        store.invite(Invitation("device", "", (), who.principal, NOW + 60 + number), now=NOW)
        for number in range(MOST_CODES_OF_ONE + 1)
    ]
    free = [store.invite(Invitation("device", "", DRIVE, "", NOW + 60)) for _ in codes]
    assert [number for number, code in enumerate(codes) if not store.redeem(code, NOW)] == [0]
    assert all(store.redeem(code, NOW) for code in free)
    for number in range(MOST_DEVICES_OF_ONE):
        store.add("device", f"phone {number}", now=NOW, owner=who.principal)
    with pytest.raises(AccessError, match="50 devices"):
        store.add("device", "one more", now=NOW, owner=who.principal)
    store.add("device", "tablet", DRIVE, now=NOW)
