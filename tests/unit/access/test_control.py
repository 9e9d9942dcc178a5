"""The access control of one server: the local user, and changes by others."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import pytest

from urc.access.control import LOCAL_SIGN_INS, AccessControl
from urc.access.directory import NOBODY
from urc.access.grants import AccessError, Grant
from urc.access.store import AccessStore

pytestmark = pytest.mark.anyio

KEY = "k" * 32


class Clock:
    """UTC time as a test sets it."""

    def __init__(self) -> None:
        self.now = 1_000_000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def store(tmp_path: Path) -> Iterator[AccessStore]:
    opened = AccessStore(tmp_path)
    yield opened
    opened.close()


def test_the_start_key_is_a_token_of_the_local_user() -> None:
    access = AccessControl(key=KEY)
    program = access.identify(KEY)
    assert (program.name, program.kind, program.way) == ("this computer", "person", "token")
    assert access.role(program, "any robot") == "administer"
    assert access.identify("k" * 31) == NOBODY
    assert access.role(NOBODY) is None
    assert AccessControl().key != AccessControl().key


def test_a_browser_hands_the_start_key_in_for_a_session() -> None:
    access = AccessControl(key=KEY)
    secret = access.admit(KEY)
    assert secret is not None
    assert secret != KEY
    assert access.role(access.identify(secret)) == "administer"
    assert access.admit("another") is None
    code = access.code()
    assert access.admit(code) is not None
    assert access.admit(code) is None, "a code works once"


async def test_local_sessions_are_closed_one_by_one_and_the_oldest_first() -> None:
    access = AccessControl(key=KEY)
    first, second = (access.admit(KEY) or "" for _ in range(2))
    await access.end_sign_in(access.identify(second).sign_in)
    assert access.identify(second) == NOBODY
    assert access.identify(first) != NOBODY
    for _ in range(LOCAL_SIGN_INS):
        access.admit(KEY)
    assert access.identify(first) == NOBODY
    assert access.identify(KEY) != NOBODY


async def test_people_and_the_local_user_stand_side_by_side(store: AccessStore) -> None:
    access = AccessControl(store, key=KEY)
    changes: list[str] = []
    access.on_change.append(lambda: changes.append("changed"))
    ann = store.add("person", "Ann", [Grant("drive")], now=access.now())
    sign_in, secret = store.open_sign_in(ann.id, "passkey", now=access.now())
    await access.reload()
    who = access.identify(secret)
    assert access.role(who) == "drive"
    assert access.role(access.identify(KEY)) == "administer"
    await access.end_sign_in(sign_in.id)
    assert access.role(who) is None
    assert changes == ["changed"] * 2
    with pytest.raises(AccessError, match="this entry was already removed"):
        await access.end_sign_in(sign_in.id)


async def test_a_change_by_another_process_is_noticed(store: AccessStore, tmp_path: Path) -> None:
    access = AccessControl(store)
    ann = store.add("person", "Ann", [Grant("drive")], now=access.now())
    _, secret = store.open_sign_in(ann.id, "passkey", now=access.now())
    await access.reload()
    who = access.identify(secret)
    heard = asyncio.Event()
    access.on_change.append(heard.set)
    other = AccessStore(tmp_path)
    watching = asyncio.create_task(access.watch())
    try:
        other.set_grants(ann.id, [Grant("watch")])
        await heard.wait()
        assert access.role(who) == "watch"
        heard.clear()
        other.remove(ann.id)
        await heard.wait()
        assert access.role(who) is None
    finally:
        watching.cancel()
        other.close()


async def test_the_use_of_sign_ins_is_recorded_now_and_then(
    store: AccessStore, clock: Clock
) -> None:
    access = AccessControl(store, utc=clock)
    ann = store.add("person", "Ann", [Grant("drive")], now=clock())
    sign_in, _ = store.open_sign_in(ann.id, "passkey", now=clock(), idle_s=100)
    heard = asyncio.Event()
    access.on_change.append(heard.set)
    watching = asyncio.create_task(access.watch())
    await asyncio.sleep(0)
    clock.now += 61
    access.used(sign_in.id)
    await heard.wait()
    watching.cancel()
    assert store.directory().sign_ins[sign_in.id].used_at == clock.now


async def test_a_server_without_people_has_nothing_to_watch() -> None:
    await AccessControl().watch()


async def test_a_clock_set_back_revives_no_sign_in(store: AccessStore, clock: Clock) -> None:
    access = AccessControl(store, utc=clock)
    ann = store.add("person", "Ann", [Grant("drive")], now=clock())
    _, secret = store.open_sign_in(ann.id, "passkey", now=clock(), ends_at=clock() + 60)
    await access.reload()
    assert access.identify(secret) != NOBODY
    clock.now += 61
    assert access.identify(secret) == NOBODY
    clock.now -= 3600
    assert access.identify(secret) == NOBODY


async def test_the_end_of_a_sign_in_is_reported_and_survives_a_restart(
    store: AccessStore, clock: Clock
) -> None:
    """Sockets hear of the end, and a clock set back before the next start changes nothing."""
    access = AccessControl(store, utc=clock)
    began = clock.now
    ann = store.add("person", "Ann", [Grant("drive")], now=began)
    guest = store.add("guest", "Visitor", [Grant("watch")], now=began, ends_at=began + 20)
    phone = store.add("device", "Phone", now=began, owner=guest.id)
    for owner, ends in ((ann, began + 10), (guest, None), (phone, None), (ann, None)):
        store.open_sign_in(owner.id, "link", now=began, ends_at=ends)
    heard = asyncio.Event()
    access.on_change.append(heard.set)
    await access.reload()
    heard.clear()
    watching = asyncio.create_task(access.watch())
    try:
        for later, left in ((10, 3), (20, 1)):
            assert not heard.is_set()
            clock.now = began + later
            await asyncio.wait_for(heard.wait(), 30)
            assert len(store.directory().sign_ins) == left
            heard.clear()
    finally:
        watching.cancel()
    clock.now = began
    assert len(AccessControl(store, utc=clock).directory.sign_ins) == 2, "Ann and the start key"


async def test_a_sign_in_in_use_does_not_end(store: AccessStore, clock: Clock) -> None:
    """The use of the last minute counts, although the store does not have it yet."""
    access = AccessControl(store, utc=clock)
    ann = store.add("person", "Ann", [Grant("drive")], now=clock())
    used, _ = store.open_sign_in(ann.id, "passkey", now=clock(), idle_s=30)
    store.open_sign_in(ann.id, "passkey", now=clock(), idle_s=30)
    await access.reload()
    clock.now += 20
    access.used(used.id)
    heard = asyncio.Event()
    access.on_change.append(heard.set)
    watching = asyncio.create_task(access.watch())
    try:
        clock.now += 10
        await asyncio.wait_for(heard.wait(), 30)
        while len(store.directory().sign_ins) > 1:
            heard.clear()
            await asyncio.wait_for(heard.wait(), 30)
    finally:
        watching.cancel()
    assert list(store.directory().sign_ins) == [used.id]
