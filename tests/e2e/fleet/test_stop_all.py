"""STOP of robots of several sites: one request for each site, and an absent site delays none."""

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.dashboards import until
from tests.e2e.fleet.places import Place, keys_of, place
from tests.e2e.transports.certificates import Authority
from tests.unit.runtime.desks import DRIVER
from urc.access.grants import Grant
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.fleet_bus import FakeFleetNetwork
from urc.web.sites.site_stops import STOP, SiteStops

pytestmark = pytest.mark.anyio

PLACES = ("bern", "genf", "zug")
LONGEST_S = 1.0
"""Longest time until the reply, whichever sites are absent."""


class Fleet:
    """Three sites with two carts each."""

    def __init__(self, network: FakeFleetNetwork, places: dict[str, Place]) -> None:
        self.network = network
        self.places = places
        self.zug = places["zug"]

    async def listed(self) -> None:
        """Wait until zug knows all robots."""
        watch = self.zug.network.watch
        await self.zug.ask("/api/v1/robots")
        await until(lambda: all(watch.sites.get(one) for one in ("bern", "genf")))

    async def stop(self, asked: object, **how: Any) -> tuple[dict[str, str], dict[str, Any], float]:
        """Press STOP at zug; return the result of each robot, the whole reply and its time."""
        began_s = time.monotonic()
        status, said, _ = await self.zug.ask("/api/v1/stop", asked, **how)
        took_s = time.monotonic() - began_s
        assert status == 200, said
        return {one["name"]: one["result"] for one in said["robots"]}, said, took_s

    async def latched(self, site: str) -> list[str]:
        """Return who has stopped each robot of a site."""
        _, found, _ = await self.places[site].ask("/api/v1/robots")
        own = {one["name"]: one["latched"] for one in found["robots"] if "@" not in one["name"]}
        return [own[name] for name in sorted(own)]


@pytest.fixture
async def fleet(tmp_path: Path) -> AsyncIterator[Fleet]:
    """Run the sites."""
    authority, network = Authority(tmp_path), FakeFleetNetwork()
    async with AsyncExitStack() as stack:
        places = {}
        for site in PLACES:
            carts = [
                FakeRobot(dashboard_profile(name=name)._replace(driver=DRIVER, tags=("carts",)))
                for name in ("cart-1", "cart-2")
            ]
            keys = keys_of(authority, site, tmp_path)
            places[site] = await stack.enter_async_context(place(network, keys, *carts))
        yield Fleet(network, places)


def names(*sites: str) -> set[str]:
    """Return the names of the carts at zug."""
    return {f"cart-{n}" + (f"@{one}" if one != "zug" else "") for one in sites for n in (1, 2)}


async def test_all_robots_of_all_sites_stop(fleet: Fleet, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each site gets one request, on the control lane."""
    await fleet.listed()
    asked: list[tuple[str, str]] = []
    client = fleet.zug.network.client
    request = client.request

    def counted(site: str, method: str, target: str, *args: Any, **named: Any) -> Any:
        if target == STOP:
            asked.append((site, named["lane"]))
        return request(site, method, target, *args, **named)

    monkeypatch.setattr(client, "request", counted)
    found, _, took_s = await fleet.stop({"all": True})
    assert found == dict.fromkeys(names(*PLACES), "confirmed")
    assert took_s < LONGEST_S
    assert sorted(asked) == [("bern", "control"), ("genf", "control")]
    for site in ("bern", "genf"):
        assert await fleet.latched(site) == ["this computer (zug)"] * 2


async def test_a_tag_reaches_over_sites_and_a_site_is_a_tag(fleet: Fleet) -> None:
    await fleet.listed()
    found, _, _ = await fleet.stop({"tags": ["bern"]})
    assert found == dict.fromkeys(names("bern"), "confirmed")
    assert await fleet.latched("genf") == ["", ""]
    found, _, _ = await fleet.stop({"tags": ["carts"]})
    assert set(found) == names(*PLACES)


@pytest.mark.parametrize("asked", [{"all": True}, {"tags": ["carts"]}, {"tags": ["bern"]}])
async def test_a_robot_that_is_new_at_its_site_stops_too(fleet: Fleet, asked: object) -> None:
    """The list that zug has of bern may be old, so bern applies the choice itself."""
    await fleet.listed()
    fleet.zug.network.watch.sites["bern"].robots.clear()
    found, said, _ = await fleet.stop(asked)
    assert {name for name in found if name.endswith("@bern")} == names("bern")
    assert set(found.values()) == {"confirmed"}
    assert said["unknown_tags"] == []
    assert await fleet.latched("bern") == ["this computer (zug)"] * 2


async def test_an_absent_site_delays_no_other_and_is_stopped_later(fleet: Fleet) -> None:
    """Its robots have no link; after the network returns, URC repeats the STOP."""
    await fleet.listed()
    fleet.network.cut("bern", "zug")
    found, said, took_s = await fleet.stop({"all": True})
    assert took_s < LONGEST_S
    assert {name for name, one in found.items() if one == "no-link"} == names("bern")
    assert {name for name, one in found.items() if one == "confirmed"} == names("genf", "zug")
    reasons = {one["reason"] for one in said["robots"] if one["name"].endswith("@bern")}
    assert reasons == {
        "the site bern cannot be reached; use the robot's own stop switch; URC repeats STOP"
    }
    fleet.network.heal()
    for _ in range(400):
        if await fleet.latched("bern") == ["this computer (zug)"] * 2:
            break
        await asyncio.sleep(0.05)
    assert await fleet.latched("bern") == ["this computer (zug)"] * 2


async def test_a_repetition_does_not_undo_a_reset(fleet: Fleet) -> None:
    """The site knows the identifier, so the robot stays free."""
    await fleet.listed()
    stops = fleet.zug.network.stops
    sent: list[Any] = []
    ask = SiteStops._ask

    async def noted(self: SiteStops, site: str, asked: Any, within_s: float) -> Any:
        sent.append(asked)
        return await ask(self, site, asked, within_s)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SiteStops, "_ask", noted)
        await fleet.stop({"robots": ["cart-1@bern"]})
    _, lease, _ = await fleet.places["bern"].ask("/api/v1/robots/cart-1/lease", {"verb": "reset"})
    assert lease["latched"] == ""
    await stops.stop("bern", sent[0], lambda *_: None)
    assert await fleet.latched("bern") == ["", ""]


async def test_a_stranger_stops_a_named_robot_and_no_other_site_by_choice(fleet: Fleet) -> None:
    """STOP needs no right, but a choice does not name the robots of other sites to strangers."""
    await fleet.listed()
    origin = {"origin": fleet.zug.url.rstrip("/")}
    found, _, _ = await fleet.stop({"all": True}, key="", more=origin)
    assert set(found) == names("zug")
    found, _, _ = await fleet.stop({"robots": ["cart-1@bern"]}, key="", more=origin)
    assert found == {"cart-1@bern": "confirmed"}
    assert (await fleet.latched("bern"))[0].endswith("(zug)")


async def test_a_choice_contains_only_robots_that_the_visitor_may_watch(fleet: Fleet) -> None:
    await fleet.listed()
    store = fleet.zug.access.control.store
    assert store is not None
    now = fleet.zug.access.control.now()
    program = store.add("program", "Patrol", [Grant("watch", "cart-2@bern")], now=now)
    _, token = store.open_sign_in(program.id, "token", now=now)
    fleet.zug.access.control.load()
    found, _, _ = await fleet.stop({"all": True}, key=token)
    assert set(found) == names("zug") | {"cart-2@bern"}
    assert await fleet.latched("bern") == ["", "Patrol (zug)"]
