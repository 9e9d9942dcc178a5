"""One command to robots of several sites: each site checks the rights and names its result."""

from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import pytest

from tests.e2e.dashboards import until
from tests.e2e.fleet.places import Place, keys_of, place
from tests.e2e.transports.certificates import Authority
from urc.runtime.open_profile import open_document
from urc.testing.dashboard import FakeRobot
from urc.testing.fleet_bus import FakeFleetNetwork

pytestmark = pytest.mark.anyio

CART = """\
urc: 1
kind: robot
name: cart
tags: [carts]
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 6789
    framing: { type: delimiter, tx: LF, rx: LF }
signals:
  speed: { type: number, unit: m/s }
messages:
  said: { regex: '^v (?P<speed>[0-9.]+)$' }
commands:
  lights:
    args: { level: { type: number, min: 0, max: MOST } }
    send: "lights {{ level }}"
"""
BODY = {"command": "lights", "tags": ["carts"], "arguments": {"level": 1}, "confirmed": True}


class Fleet:
    """The sites bern and zug with a cart each; the command is sent from zug."""

    def __init__(self, network: FakeFleetNetwork, zug: Place, carts: dict[str, FakeRobot]) -> None:
        self.network = network
        self.zug = zug
        self.carts = carts

    async def results(self) -> dict[str, str]:
        """Send the command; return the code of each robot, "" for success."""
        status, said, _ = await self.zug.ask("/api/v1/commands", BODY)
        assert status == 200, said
        return {one["name"]: one["code"] for one in said["robots"]}

    def sent(self) -> set[str]:
        """Return the sites whose cart has received the command."""
        return {site for site, one in self.carts.items() if one.commands}


@asynccontextmanager
async def open_fleet(
    folder: Path,
    most: str = "9",
    rules: str = "",
) -> AsyncIterator[Fleet]:
    """Run both sites with the rules; `most` is the highest level of bern's lights."""
    authority, network = Authority(folder), FakeFleetNetwork()
    carts, places = {}, {}
    async with AsyncExitStack() as stack:
        for site, level in (("bern", most), ("zug", "9")):
            file = folder / site / "cart.yaml"
            file.parent.mkdir()
            file.write_text(CART.replace("MOST", level), "utf-8")
            carts[site] = FakeRobot(open_document(file))
            keys = keys_of(authority, site, folder)
            places[site] = await stack.enter_async_context(
                place(network, keys, carts[site], rules=rules)
            )
        zug = places["zug"]
        await zug.ask("/api/v1/robots")
        await until(lambda: "bern" in zug.network.watch.sites)
        yield Fleet(network, zug, carts)


async def test_the_carts_of_both_sites_get_the_command(tmp_path: Path) -> None:
    async with open_fleet(tmp_path) as fleet:
        assert await fleet.results() == {"cart": "", "cart@bern": ""}
        for cart in fleet.carts.values():
            assert cart.commands == [("lights", {"level": 1})]


async def test_an_absent_site_is_named_and_the_others_run_it(tmp_path: Path) -> None:
    async with open_fleet(tmp_path) as fleet:
        fleet.network.cut("bern", "zug")
        assert await fleet.results() == {"cart": "", "cart@bern": "site-failed"}
        assert fleet.sent() == {"zug"}


async def test_the_site_of_a_robot_decides_on_the_right(tmp_path: Path) -> None:
    async with open_fleet(tmp_path, rules="otherwise: watch") as fleet:
        assert await fleet.results() == {"cart": "", "cart@bern": "forbidden"}
        assert fleet.sent() == {"zug"}


async def test_other_arguments_at_another_site_are_refused(tmp_path: Path) -> None:
    async with open_fleet(tmp_path, most="5") as fleet:
        assert await fleet.results() == {"cart": "", "cart@bern": "other-arguments"}
        assert fleet.sent() == {"zug"}
