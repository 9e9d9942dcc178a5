"""Accounts of identity providers: the people they stand for, and their roles at each sign-in."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from urc.access.directory import NOBODY, Principal
from urc.access.external_accounts import ExternalAccount, admit_account, admit_named
from urc.access.grants import AccessError, Grant, parse_grant
from urc.access.store import AccessStore

NOW = 1_000_000.0


@pytest.fixture
def store(tmp_path: Path) -> Iterator[AccessStore]:
    opened = AccessStore(tmp_path / "data")
    yield opened
    opened.close()


def account(*grants: str, subject: str = "17", name: str = "ann") -> ExternalAccount:
    given = tuple(parse_grant(each) for each in grants)
    return ExternalAccount("https://id.example/lab", subject, name, given, NOW + 60)


def grants_of(store: AccessStore, principal: str) -> list[str]:
    return [str(each) for each in store.directory().principals[principal].grants]


def test_the_first_sign_in_adds_a_person(store: AccessStore) -> None:
    person = admit_account(store, account("drive@#lab"), NOW)
    assert (person.kind, person.name, person.grants) == ("person", "ann", (Grant("drive", "#lab"),))
    again = admit_account(store, account("drive@#lab", name="ann smith"), NOW + 1)
    assert again.id == person.id, "the subject counts, not the name"
    assert len(store.directory().principals) == 1


def test_grants_follow_the_claims_at_each_sign_in(store: AccessStore) -> None:
    person = admit_account(store, account("drive", "watch@cart"), NOW)
    admit_account(store, account("watch@cart"), NOW)
    assert grants_of(store, person.id) == ["watch@cart"]


def test_a_person_without_a_grant_loses_all_and_is_refused(store: AccessStore) -> None:
    person = admit_account(store, account("drive"), NOW)
    sign_in, _ = store.open_sign_in(person.id, "oidc", now=NOW)
    with pytest.raises(AccessError, match="the account 'ann' has no role here"):
        admit_account(store, account(), NOW)
    assert grants_of(store, person.id) == []
    assert sign_in.id in store.directory().sign_ins, "it has no rights, but is in the list"
    with pytest.raises(AccessError, match="has no role here"):
        admit_account(store, account(), NOW)


def test_an_unknown_account_without_a_grant_adds_nobody(store: AccessStore) -> None:
    with pytest.raises(AccessError, match="has no role here"):
        admit_account(store, account(), NOW)
    assert store.directory().principals == {}


def test_grants_by_hand_stay(store: AccessStore) -> None:
    person = admit_account(store, account("watch"), NOW)
    store.set_grants(person.id, [Grant("watch"), Grant("drive", "cart")])
    assert admit_account(store, account(), NOW).id == person.id
    assert grants_of(store, person.id) == ["drive@cart"]
    admit_account(store, account("watch"), NOW)
    assert grants_of(store, person.id) == ["drive@cart", "watch"]


def test_an_account_never_takes_over_a_person_of_the_same_name(store: AccessStore) -> None:
    ann = store.add("person", "Ann", [Grant("administer")], now=NOW)
    first = admit_account(store, account("watch"), NOW)
    second = admit_account(store, account("watch", subject="18"), NOW)
    assert (first.name, second.name) == ("ann (id.example)", "ann (id.example 2)")
    assert ann.id not in (first.id, second.id)
    long = admit_account(store, account("watch", subject="19", name="n" * 64), NOW)
    other = admit_account(store, account("watch", subject="20", name="n" * 64), NOW)
    assert (len(long.name), len(other.name)) == (64, 64)


def test_issuers_are_kept_apart(store: AccessStore) -> None:
    first = admit_account(store, account("watch"), NOW)
    other = account("watch")._replace(issuer="https://other.example")
    assert admit_account(store, other, NOW).id != first.id


def test_a_removed_person_is_added_again_as_another(store: AccessStore) -> None:
    person = admit_account(store, account("watch"), NOW)
    store.remove(person.id)
    assert admit_account(store, account("watch"), NOW).id != person.id


def test_all_rights_end_with_the_sign_in_at_the_provider(store: AccessStore) -> None:
    """Else a passkey or a paired phone would outlive an account that the provider has blocked."""
    person = admit_account(store, account("drive"), NOW)
    assert person.ends_at == NOW + 60
    phone = store.add("device", "phone", now=NOW, owner=person.id)
    keys = [
        store.open_sign_in(person.id, "passkey", now=NOW)[1],
        store.open_sign_in(phone.id, "pairing", now=NOW)[1],
    ]
    directory = store.directory()
    assert [directory.identify(key, NOW + 59).person for key in keys] == [person.id] * 2
    assert [directory.identify(key, NOW + 60) for key in keys] == [NOBODY] * 2
    admit_account(store, account("drive")._replace(ends_at=NOW + 90), NOW + 50)
    admit_account(store, account("drive")._replace(ends_at=NOW + 70), NOW + 50)
    directory = store.directory()
    assert directory.identify(keys[0], NOW + 89).person == person.id
    assert directory.identify(keys[0], NOW + 90) == NOBODY


def test_a_proxy_names_a_person(store: AccessStore) -> None:
    ann = store.add("person", "Ann", now=NOW)
    store.add("device", "tablet", now=NOW)

    def named(name: str, *grants: Grant, ends_at: float = NOW + 60) -> Principal:
        return admit_named(store, name, grants, proxy="gate", now=NOW, ends_at=ends_at)

    assert named("ann").id == ann.id
    for name in ("tablet", "eve", ""):
        with pytest.raises(AccessError, match="no person has the name"):
            named(name)
    eve = named("eve", Grant("watch"))
    assert (eve.name, eve.grants, eve.ends_at) == ("eve", (Grant("watch"),), NOW + 60)
    store.set_grants(eve.id, [Grant("drive")])
    assert named("Eve", Grant("watch"), ends_at=NOW + 90).ends_at == NOW + 90
    assert grants_of(store, eve.id) == ["drive"], "the grants of a new person only"
    named("ann", Grant("watch"))
    people = store.directory().principals
    assert (people[ann.id].grants, people[ann.id].ends_at) == ((), None), "a person of this server"
    assert people[eve.id].ends_at == NOW + 90
