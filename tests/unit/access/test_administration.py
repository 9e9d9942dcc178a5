"""The work of administrators: overview, roles, invitations, and the end of many sign-ins."""

import multiprocessing
from collections.abc import Iterator
from pathlib import Path

import pytest

from urc.access.administration import (
    change_grants,
    end_after_restore,
    end_sign_ins,
    invite_person,
    newest_time,
    overview,
    principal_named,
)
from urc.access.grants import AccessError, Grant
from urc.access.store import MOST_INVITATIONS, AccessStore, Invitation

NOW = 1_000_000.0
DRIVE = (Grant("drive"),)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[AccessStore]:
    opened = AccessStore(tmp_path)
    yield opened
    opened.close()


def test_an_overview_has_the_state_of_all_credentials(store: AccessStore) -> None:
    ann = store.add("person", "Ann", DRIVE, now=NOW)
    store.set_passphrase(ann.id, "hash")
    store.open_sign_in(ann.id, "passphrase", now=NOW + 5)
    store.open_sign_in(ann.id, "passkey", now=NOW + 1, ends_at=NOW + 10)
    ben, _ = invite_person(store, "Ben", DRIVE, now=NOW, ends_at=NOW + 60)
    with store.transaction() as base:
        base.execute(
            "INSERT INTO passkeys VALUES ('id', ?, 'Phone', 'lab.local', x'00', 0, 1.0, 1.0)",
            (ann.id,),
        )
    phone = store.add("device", "Ann's phone", now=NOW, owner=ann.id)
    first, second, third = overview(store, NOW + 20)
    assert (first.principal.id, first.owner, first.sign_ins) == (phone.id, "Ann", 0)
    assert first.used_at is None
    assert (second.principal, second.has_passphrase, second.sign_ins) == (ann, True, 1)
    assert (second.used_at, second.invited_until, second.passkeys) == (NOW + 5, None, 1)
    assert (third.principal, third.has_passphrase) == (ben, False)
    assert third.invited_until == NOW + 60
    assert [one.principal for one in overview(store, NOW, "device")] == [phone]
    assert overview(store, NOW + 60, "person")[1].invited_until is None


def test_a_name_is_found_regardless_of_case_and_spaces(store: AccessStore) -> None:
    ann = store.add("person", "Ann Lee", now=NOW)
    directory = store.directory()
    assert principal_named(directory, "person", " ann  LEE ") == ann
    assert principal_named(directory, "device", "Ann Lee") is None


def test_an_invited_person_exists_and_a_newer_code_replaces_the_older(store: AccessStore) -> None:
    ann, old = invite_person(store, "Ann", DRIVE, now=NOW, ends_at=NOW + 60)
    same, new = invite_person(store, "ANN", (), now=NOW, ends_at=NOW + 90)
    assert same == ann
    assert store.redeem(old, NOW) is None
    assert store.redeem(new, NOW) == Invitation("person", "Ann", DRIVE, ann.id, NOW + 90)
    with pytest.raises(AccessError, match="'Ann' already exists"):
        invite_person(store, "ann", DRIVE, now=NOW, ends_at=NOW + 60)
    with pytest.raises(AccessError, match="a new person needs a role"):
        invite_person(store, "Ben", (), now=NOW, ends_at=NOW + 60)


def test_the_number_of_codes_is_bounded_and_ended_ones_make_room(store: AccessStore) -> None:
    invitation = Invitation("device", "", DRIVE, "", NOW + 60)
    with store.transaction():
        for _ in range(MOST_INVITATIONS):
            store.invite(invitation, now=NOW)
    with pytest.raises(AccessError, match="1000 codes are valid; wait until some have expired"):
        store.invite(invitation, now=NOW)
    store.invite(invitation._replace(ends_at=NOW + 90), now=NOW + 60)


def test_a_passphrase_of_a_removed_person_is_refused(store: AccessStore) -> None:
    with pytest.raises(AccessError, match="that person was removed"):
        store.set_passphrase("unknown", "hash")


def test_chosen_sign_ins_end_together(store: AccessStore) -> None:
    ann, ben = (store.add("person", name, DRIVE, now=NOW) for name in ("Ann", "Ben"))
    for one in (ann, ann, ben):
        store.open_sign_in(one.id, "passphrase", now=NOW)
    assert end_sign_ins(store, lambda _, one: one.name == "Ann") == 2
    assert [one.principal for one in store.directory().sign_ins.values()] == [ben.id]


def filled(store: AccessStore) -> None:
    """Add a person, a device, a program and a guest with a sign-in each, and two codes."""
    ann = store.add("person", "Ann", DRIVE, now=NOW)
    store.set_passphrase(ann.id, "hash")
    ways = {"device": "pairing", "program": "token", "guest": "link"}
    others = {kind: store.add(kind, kind, DRIVE, now=NOW) for kind in ways}  # type: ignore[arg-type]
    store.open_sign_in(ann.id, "passphrase", now=NOW)
    for kind, way in ways.items():
        store.open_sign_in(others[kind].id, way, now=NOW)  # type: ignore[arg-type]
    store.invite(Invitation("device", "", DRIVE, "", NOW + 1e9), now=NOW)


def test_a_restored_store_revives_neither_codes_nor_browsers(store: AccessStore) -> None:
    filled(store)
    assert end_after_restore(store, ends_keys=False) == 2
    directory = store.directory()
    assert sorted(one.way for one in directory.sign_ins.values()) == ["pairing", "token"]
    assert len(directory.principals) == 4
    assert store.passphrase_of("Ann")[1] == "hash"
    with store.transaction() as base:
        assert base.execute("SELECT count(*) FROM invitations").fetchone() == (0,)


def test_a_restored_store_can_keep_people_alone(store: AccessStore) -> None:
    filled(store)
    assert end_after_restore(store, ends_keys=True) == 4
    directory = store.directory()
    assert [one.name for one in directory.principals.values()] == ["Ann"]
    assert not directory.sign_ins


def test_the_newest_time_is_of_any_event(store: AccessStore) -> None:
    assert newest_time(store) == 0.0
    ann = store.add("person", "Ann", now=NOW)
    assert newest_time(store) == NOW
    store.open_sign_in(ann.id, "passphrase", now=NOW + 7)
    assert newest_time(store) == NOW + 7


def add_many(folder: Path, first: int, roles: list[str]) -> None:
    """Add people, and one grant each to Ann; run by several processes at once."""
    store = AccessStore(folder)
    for number in range(first, first + 20):
        store.add("person", f"Student {number}", now=NOW)
        role = roles[number % len(roles)]
        ann = principal_named(store.directory(), "person", "Ann")
        assert ann is not None
        grant = Grant(role, f"robot-{number}")  # type: ignore[arg-type]
        change_grants(store, ann.id, lambda own, more=grant: (*own, more))  # type: ignore[misc]
    store.close()


def test_processes_at_once_lose_no_change(tmp_path: Path) -> None:
    store = AccessStore(tmp_path)
    store.add("person", "Ann", now=NOW)
    context = multiprocessing.get_context("spawn")
    workers = [
        context.Process(target=add_many, args=(tmp_path, first, ["watch", "drive"]))
        for first in (0, 100, 200)
    ]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(60)
    assert [worker.exitcode for worker in workers] == [0, 0, 0]
    directory = store.directory()
    assert len(directory.principals) == 61
    ann = principal_named(directory, "person", "Ann")
    assert ann is not None
    assert len(ann.grants) == 60, "no grant is lost"
    assert store.changed()
    store.close()


def create(folder: Path, name: str) -> None:
    AccessStore(folder).add("person", name, now=NOW)


def test_processes_create_the_file_at_once(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    workers = [
        context.Process(target=create, args=(tmp_path / "new", name)) for name in ("Ann", "Ben")
    ]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join(60)
    assert [worker.exitcode for worker in workers] == [0, 0]
    store = AccessStore(tmp_path / "new")
    assert len(store.directory().principals) == 2
    store.close()


def test_an_error_undoes_the_whole_transaction(store: AccessStore) -> None:
    def fail() -> None:
        with store.transaction():
            store.add("person", "Ann", now=NOW)
            raise AccessError("refused")

    with pytest.raises(AccessError, match="refused"):
        fail()
    assert not store.directory().principals
    with pytest.raises(AccessError, match="this entry was already removed"):
        change_grants(store, "unknown", lambda own: own)
