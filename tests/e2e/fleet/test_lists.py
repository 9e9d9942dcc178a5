"""The lists of robots of other sites follow each change, and no site delays another's list."""

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

import urc.client
from tests.e2e.dashboards import until
from tests.e2e.fleet.places import Place, keys_of, place
from tests.e2e.transports.certificates import Authority
from urc.fleet import lines
from urc.runtime.open_profile import open_document
from urc.shipped import shipped
from urc.testing.dashboard import FakeRobot
from urc.testing.fleet_bus import FakeFleetNetwork
from urc.web.sites import site_client, site_watch

pytestmark = pytest.mark.anyio
ROBOT = "turtlebot4"


class Sites:
    """The sites bern and genf, which have a robot each, and zug, which has a menu."""

    def __init__(self, network: FakeFleetNetwork, bern: Place, genf: Place, zug: Place) -> None:
        self.network = network
        self.bern = bern
        self.genf = genf
        self.zug = zug

    async def state(self) -> str:
        """Return the state of bern's robot in zug's menu."""
        _, found, _ = await self.zug.ask("/api/v1/robots")
        states = {one["name"]: one["state"] for one in found["robots"]}
        return str(states.get(f"{ROBOT}@bern", ""))

    async def until_state(self, state: str) -> None:
        """Look at zug's menu until bern's robot has a state."""
        async with asyncio.timeout(20):
            while True:
                if await self.state() == state:
                    return
                await asyncio.sleep(0.05)

    async def asked(self, after: str) -> dict[str, Any]:
        """Return bern's list, as zug gets it for a mark."""
        target = f"/fleet/robots?after={after}"
        async with self.zug.network.client.request("bern", "GET", target) as response:
            found: dict[str, Any] = json.loads(await response.whole())
            return found


@asynccontextmanager
async def running(folder: Path, hangs: str = "") -> AsyncIterator[Sites]:
    """Run the sites; the network loses all messages from and to the site `hangs`."""
    authority, network = Authority(folder), FakeFleetNetwork()
    network.loses = lambda sender, receiver, body: hangs in (sender, receiver)
    profile = open_document(shipped("robots") / f"{ROBOT}.yaml")
    async with AsyncExitStack() as stack:
        made = [
            await stack.enter_async_context(
                place(network, keys_of(authority, name, folder), *robots)
            )
            for name, robots in (
                ("bern", [FakeRobot(profile)]),
                ("genf", [FakeRobot(profile)]),
                ("zug", []),
            )
        ]
        yield Sites(network, *made)


@pytest.fixture
async def sites(tmp_path: Path) -> AsyncIterator[Sites]:
    """Run the sites."""
    async with running(tmp_path) as made:
        yield made


async def test_a_site_answers_a_known_list_when_it_changes(sites: Sites) -> None:
    """An unchanged list is answered late and with the same mark."""
    await until(lambda: "bern" in sites.zug.network.client.sites)
    first = await sites.asked("")
    assert (await sites.asked(first["mark"]))["mark"] == first["mark"]
    waiting = asyncio.create_task(sites.asked(first["mark"]))
    async with urc.client.open(sites.bern.url, ROBOT, token=sites.bern.access.key):
        second = await waiting
    assert second["mark"] != first["mark"]
    assert second["robots"][0]["summary"]["connected"]


async def test_the_menu_follows_each_change(sites: Sites) -> None:
    """The robot gets a session, and loses it."""
    await sites.until_state("idle")
    async with urc.client.open(sites.bern.url, ROBOT, token=sites.bern.access.key):
        await sites.until_state("live")
    await sites.until_state("idle")


async def test_a_site_that_hangs_delays_the_list_of_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Genf is present, but does not answer; bern's list follows its robot all the same."""
    monkeypatch.setattr(site_client, "CONNECT_S", 60.0)
    monkeypatch.setattr(lines, "STALL_S", 60.0)
    async with running(tmp_path, hangs="genf") as sites:
        await sites.until_state("idle")
        async with urc.client.open(sites.bern.url, ROBOT, token=sites.bern.access.key):
            await sites.until_state("live")
        assert "genf" in sites.zug.network.client.sites
        assert "genf" not in sites.zug.network.watch.sites, "the request to genf is over"


async def test_a_failed_request_is_repeated_soon(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One lost message ends a request; the menu does not wait for the longest pause."""
    monkeypatch.setattr(site_watch, "LOOK_S", 60.0)
    async with running(tmp_path) as sites:
        await sites.until_state("idle")
        left = ["one message"]
        sites.network.loses = lambda sender, receiver, body: (
            (sender, receiver) == ("bern", "zug") and bool(left) and left.pop() != ""
        )
        await until(lambda: not left)
        sites.network.loses = lambda sender, receiver, body: False
        async with urc.client.open(sites.bern.url, ROBOT, token=sites.bern.access.key):
            await sites.until_state("live")
