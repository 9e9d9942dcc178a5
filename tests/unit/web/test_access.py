"""Identities of requests: the start key, cookies of browsers, tokens of programs."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from urc.access.control import LOCAL_SIGN_INS, AccessControl
from urc.access.grants import parse_grant
from urc.access.store import AccessStore
from urc.web.serve.access import Access
from urc.web.serve.rights import (
    ADMINISTER,
    DRIVE,
    FRESH_S,
    LOCAL,
    MAINTAIN_SERVER,
    SIGNED_IN,
    WATCH,
)
from urc.web.serve.visitor import Visitor

pytestmark = pytest.mark.anyio

URL = "http://127.0.0.1:8080/"


@pytest.fixture
def access(tmp_path: Path) -> Iterator[Access]:
    """Return the access to a server with a store of people."""
    store = AccessStore(tmp_path)
    yield Access(AccessControl(store))
    store.close()


def headers(name: str, secret: str) -> list[tuple[bytes, bytes]]:
    """Return the headers of a browser with that cookie."""
    return [(b"cookie", f"urc-language=de; {name}={secret}".encode())]


def word_of(address: str) -> str:
    """Return the key or code in an address."""
    assert address.startswith(f"{URL}?key=")
    return address.partition("=")[2]


def admitted(access: Access, address: str) -> Visitor:
    """Return the visitor whose browser opened an address."""
    secret = access.admit(word_of(address))
    assert secret is not None
    return access.visitor(headers(access.cookie, secret))


def person(access: Access, *grants: str, way: str = "passphrase") -> tuple[Visitor, str]:
    """Return a new person who has signed in, and the secret of the cookie."""
    store, now = access.control.store, access.control.now()
    assert store is not None
    count = len(access.control.directory.principals)
    added = store.add("person", f"Ann {count}", [parse_grant(one) for one in grants], now=now)
    _, secret = store.open_sign_in(added.id, way, now=now)  # type: ignore[arg-type]
    access.control.load()
    return access.visitor(headers(access.sign_in_cookie, secret)), secret


def test_the_printed_address_makes_a_browser_the_local_user() -> None:
    """Any number of browsers, each told apart from the others."""
    access = Access()
    first, second = (admitted(access, access.address(URL)) for _ in range(2))
    assert first.is_local
    assert first.may(LOCAL)
    assert first.client != second.client
    assert not first.is_program


def test_an_address_for_a_command_line_lets_in_one_browser() -> None:
    """A later reader finds it used, and the start key is not in it."""
    access = Access()
    address = access.address_once(URL)
    assert access.key not in address
    assert admitted(access, address).is_local
    assert access.admit(word_of(address)) is None


def test_a_program_sends_the_key_with_each_request() -> None:
    access = Access()
    program = access.visitor([(b"authorization", f"Bearer {access.key}".encode())])
    assert (program.is_program, program.is_local) == (True, True)
    for said in (b"Bearer guessed", f"Basic {access.key}".encode(), b"Bearer "):
        unknown = access.visitor([(b"authorization", said)])
        assert (unknown.is_known, unknown.may(SIGNED_IN)) == (False, False)
        assert unknown.is_program == said.startswith(b"Bearer")  # no page of another site


def test_a_cookie_is_no_token_and_a_token_no_cookie(access: Access) -> None:
    """A page of another site cannot send a token, so a token needs no check of the origin."""
    _, cookie = person(access, "drive")
    assert not access.visitor([(b"authorization", f"Bearer {cookie}".encode())]).is_known
    _, token = person(access, "drive", way="token")
    assert not access.visitor(headers(access.sign_in_cookie, token)).is_known
    assert access.visitor([(b"authorization", f"Bearer {token}".encode())]).is_program


def test_nothing_of_one_start_opens_the_next() -> None:
    """Neither key, nor cookie, nor code; the cookies of two servers have two names."""
    old, new = Access(), Access()
    secret = old.admit(old.key)
    assert secret is not None
    assert old.cookie != new.cookie
    assert not new.visitor(headers(old.cookie, secret)).is_known
    assert not new.visitor(headers(new.cookie, secret)).is_known
    assert new.admit(old.key) is None
    assert new.admit(word_of(old.address_once(URL))) is None
    assert new.admit("") is None


def test_people_stay_signed_in_after_a_restart(access: Access) -> None:
    """The name of their cookie is the store's, and two stores have two names."""
    _, secret = person(access, "drive")
    again = Access(AccessControl(access.control.store))
    assert again.cookie != access.cookie
    assert again.sign_in_cookie == access.sign_in_cookie
    assert again.visitor(headers(again.sign_in_cookie, secret)).may(DRIVE, "cart")
    assert Access().sign_in_cookie != access.sign_in_cookie


def test_a_cookie_is_out_of_reach_of_scripts_and_of_other_sites() -> None:
    """HttpOnly, SameSite=Strict, without an end of its own; over TLS it stays there."""
    access = Access(instance="1a2b3c4d")
    (plain,) = access.cookies("word", [], is_secure=False)
    assert plain == "urc-start-1a2b3c4d=word; Path=/; HttpOnly; SameSite=Strict"
    (secure,) = access.cookies("word", [], is_secure=True)
    assert secure == f"__Host-{plain}; Secure"
    assert access.visitor(
        headers(f"__Host-{access.cookie}", str(access.admit(access.key))), is_secure=True
    ).is_local


def test_the_cookie_of_a_person_replaces_the_one_of_the_local_user(access: Access) -> None:
    """Otherwise the person would stay the local user."""
    _, secret = person(access, "watch")
    before = headers(access.cookie, str(access.admit(access.key)))
    kept, deleted = access.cookies(secret, before, is_secure=False, is_kept=True)
    assert kept.startswith(f"{access.sign_in_cookie}={secret}; Max-Age=")
    assert deleted.startswith(f"{access.cookie}=; Max-Age=0")
    both = headers(access.sign_in_cookie, secret)
    assert [line.partition("=")[0] for line in access.forgotten(both)] == [access.sign_in_cookie]


def test_cookies_of_many_starts_are_taken_away() -> None:
    """A browser that stays open for months would send them all for ever."""
    access = Access()
    many = "; ".join(f"urc-start-{number}=x" for number in range(9))
    few = "; ".join(f"urc-start-{number}=x" for number in range(8))
    assert len(access.cookies("word", [(b"cookie", few.encode())], is_secure=False)) == 1
    kept = access.cookies("word", [(b"cookie", many.encode())], is_secure=False)
    assert sum("Max-Age=0" in line for line in kept) == 9


@pytest.mark.parametrize("said", ["{name}=forged; {name}={secret}", "{name}={secret}; {name}=no"])
def test_another_cookie_of_the_same_name_does_not_hide_ours(said: str) -> None:
    """Programs on other ports of a machine may set cookies for its name, too."""
    access = Access()
    text = said.format(name=access.cookie, secret=access.admit(access.key))
    assert access.visitor([(b"cookie", text.encode())]).is_local


def test_over_tls_a_cookie_of_another_server_signs_nobody_in(access: Access) -> None:
    """Another port of the host can set any cookie but one with the prefix ``__Host-``.

    Otherwise, a person would act in the name of the owner of that cookie.
    """
    _, secret = person(access, "drive")
    _, foreign = person(access, "watch")
    name = access.sign_in_cookie
    assert not access.visitor(headers(name, foreign), is_secure=True).is_known
    both = [(b"cookie", f"{name}={foreign}; __Host-{name}={secret}".encode())]
    assert access.visitor(both, is_secure=True).role("cart") == "drive"
    assert access.visitor(both).role("cart") == "watch"


def test_the_number_of_local_browsers_is_bounded() -> None:
    """The browser that came first is forgotten, and must open the address again."""
    access = Access()
    first, *_, last = (access.admit(access.key) for _ in range(LOCAL_SIGN_INS + 1))
    assert not access.visitor(headers(access.cookie, str(first))).is_known
    assert access.visitor(headers(access.cookie, str(last))).is_local


def test_letters_outside_ascii_are_no_fault() -> None:
    """A header may hold any byte."""
    assert not Access().visitor([(b"authorization", b"Bearer \xff\xfe")]).is_known
    assert Access().admit("schlüssel\udce4".encode("utf-8", "replace").decode()) is None


def test_rights_are_those_of_the_grants_at_each_robot(access: Access) -> None:
    """At one robot, at robots with a tag, and for the whole server."""
    access.tags_of = lambda robot: ("lab",) if robot == "arm" else ()
    ann, _ = person(access, "drive@cart", "watch@#lab")
    assert ann.may(DRIVE, "cart")
    assert (ann.may(WATCH, "arm"), ann.may(DRIVE, "arm")) == (True, False)
    assert not ann.may(WATCH, "rover")
    assert ann.may(SIGNED_IN)
    assert not ann.may(MAINTAIN_SERVER)
    boss, _ = person(access, "administer")
    assert boss.may(ADMINISTER)
    assert not boss.may(LOCAL), "paths of this machine are for its own user"


def test_rights_are_read_at_each_question(access: Access) -> None:
    """A visitor keeps an identity, and no right."""
    ann, _ = person(access, "drive")
    store = access.control.store
    assert store is not None
    store.set_grants(ann.identity.principal, [parse_grant("watch")])
    access.control.load()
    assert (ann.may(WATCH, "cart"), ann.may(DRIVE, "cart")) == (True, False)
    store.remove(ann.identity.principal)
    access.control.load()
    assert not ann.may(SIGNED_IN)


def test_a_sign_in_is_fresh_for_some_minutes(
    access: Access, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The local user and programs have no second sign-in."""
    ann, _ = person(access, "maintain")
    _, token = person(access, "maintain", way="token")
    program = access.visitor([(b"authorization", f"Bearer {token}".encode())])
    local = admitted(access, access.address(URL))
    assert ann.is_fresh
    later = access.control.now() + FRESH_S + 1
    monkeypatch.setattr(access.control, "now", lambda: later)
    assert (ann.is_fresh, program.is_fresh, local.is_fresh) == (False, True, True)


async def test_commands_of_an_open_page_count_as_use(access: Access) -> None:
    """A page that drives for a day must not lose its right while it drives."""
    ann, _ = person(access, "drive")
    store, later = access.control.store, access.control.now() + 3600
    assert store is not None
    access.control._utc = lambda: later
    assert ann.may_give("drive")
    await access.control._record_use()
    assert store.directory().sign_ins[ann.identity.sign_in].used_at == later


def test_sockets_look_at_their_rights_after_each_change(access: Access) -> None:
    looks: list[str] = []
    with access.followed(lambda: looks.append("looked")):
        access.control.load()
    access.control.load()
    assert looks == ["looked"]


def test_without_sign_in_an_unknown_visitor_has_one_role() -> None:
    unknown = Access(anonymous="drive").visitor([])
    assert unknown.may(DRIVE, "cart")
    assert not unknown.may(MAINTAIN_SERVER)
