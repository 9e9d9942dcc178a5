"""A page of another site learns how old its ticks arrive, with the heartbeats."""

import json
from typing import Any

import pytest

from tests.unit.web.test_controls import Scene, scene
from urc.access.directory import Identity
from urc.motion.link_age import LinkState
from urc.runtime.motion_screen import SLOW_LINK
from urc.web.drive.control_service import BEAT_S, OperatorSession
from urc.web.feed.client_socket import FixedRights, SocketPeer
from urc.web.wire import drive as wire

pytestmark = pytest.mark.anyio


def far_page(it: Scene) -> OperatorSession:
    """Add a page of a visitor from the site zug."""
    who = Identity("zug/ann", "zug/1", "Ann (zug)", "person", "site", "zug/ann")
    peer = SocketPeer("", is_known=True, identity=who, rights=FixedRights("drive"))
    operator = it.controls.add_page(peer, lambda: None)
    it.told[operator.client.id] = []
    it.read(operator)
    return operator


async def beat(it: Scene, operator: OperatorSession) -> dict[str, Any]:
    """Return the next heartbeat of the page in control."""
    await it.clock.advance(BEAT_S)
    messages = [json.loads(text) for text in it.controls.changes(operator)]
    return next(one for one in messages if one["t"] == "beat")


async def test_the_heartbeat_has_the_age_and_the_permitted_speed() -> None:
    async with scene() as it:
        page = far_page(it)
        it.say(page, "take")
        it.tick(page, 0.0)
        first = await beat(it, page)
        assert first["input"] == {"age": 0, "percent": 100}
        it.beats[page.client.id] = first["n"]
        await it.clock.advance(0.325)
        it.controls.changes(page)  # lost on the way: the page echoes the older one
        said = wire.Tick("drive", it.controls.controller.lease.state.epoch, 99, first["n"])
        it.controls.handle(page, said)
        assert (await beat(it, page))["input"] == {"age": 325, "percent": 50}


async def test_a_page_of_this_site_gets_the_number_alone() -> None:
    async with scene() as it:
        page = it.add_page()
        it.say(page, "take")
        it.tick(page, 0.5)
        assert set(await beat(it, page)) == {"t", "n"}


async def test_the_redundant_socket_carries_it_too() -> None:
    heard: list[tuple[int, LinkState | None]] = []

    class Spare:
        def heartbeat(self, number: int, link: LinkState | None) -> None:
            heard.append((number, link))

        def end(self) -> None:
            pass

    async with scene() as it:
        page = far_page(it)
        page.spare = Spare()
        it.say(page, "take")
        it.tick(page, 0.5)
        await it.clock.advance(BEAT_S)
        assert heard[-1][1] == LinkState(0.0, 1.0)


async def test_the_end_of_a_shortened_lease_is_told_as_a_slow_link() -> None:
    """The page shows it at the stick, and the audit log contains it."""
    async with scene() as it:
        page = far_page(it)
        it.say(page, "take")
        it.tick(page, 0.5)
        number = (await beat(it, page))["n"]
        epoch = it.controls.controller.lease.state.epoch
        for tick in (98, 99):
            await it.clock.advance(0.15)
            it.controls.handle(page, wire.Tick("drive", epoch, tick, number, {"speed": 0.5}))
        it.controls._stopped("drive", "expired")
        told = [one for one in it.read(page) if one["t"] == "refused"]
        assert [(one["command"], one["message"]) for one in told] == [("drive", SLOW_LINK)]
        assert [one for one in it.audit if SLOW_LINK in str(one)]
