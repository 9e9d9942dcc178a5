"""What a fleet's network promises: the public fake and Zenoh pass the same dialogues."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest
import zenoh

from tests.e2e.dashboards import until
from tests.e2e.ports import free_pair
from urc.fleet.bus import MAX_MESSAGE_BYTES, Arrival, BusFailed, FleetBus
from urc.fleet.zenoh_bus import BusOptions, ZenohBus, endpoint_of
from urc.testing.fleet_bus import FakeFleetNetwork

pytestmark = pytest.mark.anyio


class Network:
    """Sites on one network; bern is the site that the others connect to."""

    def __init__(self, make: Callable[[str], FleetBus]) -> None:
        self._make = make
        self.buses: dict[str, FleetBus] = {}
        self.arrived: dict[str, list[Arrival]] = {}

    async def open(self, *sites: str) -> None:
        """Open the buses of new sites."""
        for site in sites:
            bus = self.buses[site] = self._make(site)
            bus.on_arrival = self.arrived.setdefault(site, []).append
            await bus.open()

    async def see_each_other(self, *sites: str) -> None:
        """Wait until each of the sites sees exactly the others."""
        for site in sites:
            others = frozenset(sites) - {site}
            await until(lambda site=site, others=others: self.buses[site].sites == others)

    async def close(self) -> None:
        """Close all buses."""
        for bus in self.buses.values():
            await bus.close()


def zenoh_bus(port: int) -> Callable[[str], FleetBus]:
    """Return a function that makes the bus of a site; bern listens on `port`."""
    place = (f"tcp/127.0.0.1:{port}",)

    def make(site: str) -> FleetBus:
        if site == "bern":
            return ZenohBus(BusOptions("lab", site, listen=place))
        return ZenohBus(BusOptions("lab", site, connect=place))

    return make


@pytest.fixture(params=["fake", "zenoh"])
async def network(request: pytest.FixtureRequest) -> AsyncIterator[Network]:
    """Return a network without sites."""
    made = Network(FakeFleetNetwork().bus if request.param == "fake" else zenoh_bus(free_pair()))
    try:
        yield made
    finally:
        await made.close()


async def test_sites_see_the_others_and_not_themselves(network: Network) -> None:
    """Presence needs no message."""
    await network.open("bern", "genf", "zug")
    await network.see_each_other("bern", "genf", "zug")


async def test_a_message_reaches_its_receiver_alone(network: Network) -> None:
    """The receiver learns the sender and the lane; one router connects all sites."""
    await network.open("bern", "genf", "zug")
    await network.see_each_other("bern", "genf", "zug")
    assert network.buses["genf"].send("zug", "control", b"stop")
    assert network.buses["bern"].send("zug", "data", b"picture")
    await until(lambda: len(network.arrived["zug"]) == 2)
    assert set(network.arrived["zug"]) == {
        Arrival("genf", "control", b"stop"),
        Arrival("bern", "data", b"picture"),
    }
    assert network.arrived["bern"] == network.arrived["genf"] == []


async def test_messages_of_one_lane_arrive_in_order(network: Network) -> None:
    """Some may be lost, but none overtakes another."""
    await network.open("bern", "genf")
    await network.see_each_other("bern", "genf")
    for number in range(500):
        network.buses["genf"].send("bern", "control", number.to_bytes(4, "big"))
    network.buses["genf"].send("bern", "control", b"last")
    got = network.arrived["bern"]
    await until(lambda: bool(got) and got[-1].body == b"last")
    numbers = [int.from_bytes(one.body, "big") for one in got[:-1]]
    assert numbers == sorted(set(numbers))
    assert len(numbers) > 250


async def test_the_largest_message_arrives_and_a_larger_one_is_refused(network: Network) -> None:
    """The limit is the same for every network."""
    await network.open("bern", "genf")
    await network.see_each_other("bern", "genf")
    body = bytes(range(256)) * (MAX_MESSAGE_BYTES // 256)
    assert network.buses["bern"].send("genf", "data", body)
    await until(lambda: bool(network.arrived["genf"]))
    assert network.arrived["genf"][0].body == body
    with pytest.raises(ValueError, match=f"at most {MAX_MESSAGE_BYTES}"):
        network.buses["bern"].send("genf", "data", body + b"x")


async def test_a_site_that_leaves_is_absent(network: Network) -> None:
    """The others learn it, and messages to it are known to be lost."""
    await network.open("bern", "genf")
    await network.see_each_other("bern", "genf")
    told: list[frozenset[str]] = []
    bern = network.buses["bern"]
    bern.on_sites = lambda: told.append(bern.sites)
    await network.buses["genf"].close()
    await until(lambda: told == [frozenset()])
    assert not bern.send("genf", "control", b"stop")


async def test_a_site_that_returns_is_present_again(network: Network) -> None:
    """A restarted server is the same site."""
    await network.open("bern", "genf")
    await network.see_each_other("bern", "genf")
    await network.buses["genf"].close()
    await until(lambda: not network.buses["bern"].sites)
    await network.open("genf")
    await network.see_each_other("bern", "genf")
    assert network.buses["bern"].send("genf", "control", b"welcome")
    await until(lambda: [one.body for one in network.arrived["genf"]] == [b"welcome"])


async def test_sites_see_each_other_again_after_a_refresh(network: Network) -> None:
    """It is a short absence; afterwards messages pass in both directions."""
    await network.open("bern", "genf")
    await network.see_each_other("bern", "genf")
    for site in ("bern", "genf"):
        await network.buses[site].refresh()
        await network.see_each_other("bern", "genf")
    assert network.buses["bern"].send("genf", "control", b"one")
    assert network.buses["genf"].send("bern", "data", b"two")
    await until(lambda: [one.body for one in network.arrived["genf"]] == [b"one"])
    await until(lambda: [one.body for one in network.arrived["bern"]] == [b"two"])


async def test_a_site_works_before_the_others_are_there(network: Network) -> None:
    """An unreachable network is no failure; the site joins as soon as it can."""
    await network.open("genf")
    assert network.buses["genf"].sites == frozenset()
    assert not network.buses["genf"].send("bern", "control", b"hello")
    await network.open("bern")
    await network.see_each_other("bern", "genf")


async def test_other_fleets_on_the_same_router_are_not_seen() -> None:
    """The fleet's name belongs to each address."""
    port = free_pair()
    place = (f"tcp/127.0.0.1:{port}",)
    lab = ZenohBus(BusOptions("lab", "bern", listen=place))
    mill = ZenohBus(BusOptions("mill", "genf", connect=place))
    yard = ZenohBus(BusOptions("lab", "zug", connect=place))
    try:
        for bus in (lab, mill, yard):
            await bus.open()
        await until(lambda: lab.sites == {"zug"})
        assert mill.sites == frozenset()
    finally:
        for bus in (lab, mill, yard):
            await bus.close()


def router(port: int) -> Any:
    """Return a router without a site, as another program may run it."""
    settings = {
        "mode": "router",
        "listen": {"endpoints": [f"tcp/127.0.0.1:{port}"]},
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"shared_memory": {"enabled": False}},
    }
    return zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))


async def test_a_site_appears_only_when_both_of_its_lanes_are_connected() -> None:
    """A request on the other lane would be lost; a present site stays, so it can be driven."""
    port = free_pair()
    place = (f"tcp/127.0.0.1:{port}",)
    control, data = router(port), router(port + 1)
    genf, zug = (ZenohBus(BusOptions("lab", name, connect=place)) for name in ("genf", "zug"))
    try:
        await genf.open()
        await zug.open()
        await until(lambda: genf.sites == {"zug"})
        await asyncio.to_thread(data.close)
        await until(lambda: not genf.send("zug", "data", b"list"))
        assert genf.sites == {"zug"}
        assert genf.send("zug", "control", b"stop")
        await asyncio.to_thread(control.close)
        await until(lambda: not genf.sites)
        control = await asyncio.to_thread(router, port)
        got: list[Arrival] = []
        zug.on_arrival = got.append
        root = "urc/fleet/1/lab/control/zug/genf"
        probe = control.declare_publisher(root)

        def arrives() -> bool:
            probe.put(b"tick")
            return bool(got)

        await until(arrives)  # zug is connected again, on the control lane alone
        assert genf.sites == frozenset()
        data = await asyncio.to_thread(router, port + 1)
        await until(lambda: genf.sites == {"zug"})
        assert genf.send("zug", "data", b"list")
    finally:
        for bus in (genf, zug):
            await bus.close()
        for session in (control, data):
            await asyncio.to_thread(session.close)


async def test_an_endpoint_without_a_port_is_named() -> None:
    """The data lane uses the next port, so there must be one."""
    assert endpoint_of("tls/10.0.0.2:7447", "data") == "tls/10.0.0.2:7448"
    with pytest.raises(BusFailed, match=r"tls/10\.0\.0\.2: a port is missing"):
        endpoint_of("tls/10.0.0.2", "data")


async def test_a_taken_port_is_told_in_one_line() -> None:
    """The maintainer learns the reason, not a stack of the library."""
    port = free_pair()
    options = BusOptions("lab", "bern", listen=(f"tcp/127.0.0.1:{port}",))
    first, second = ZenohBus(options), ZenohBus(options)
    try:
        await first.open()
        with pytest.raises(BusFailed, match="the network of the fleet cannot be opened") as caught:
            await second.open()
        assert "\n" not in str(caught.value)
    finally:
        await first.close()
        await second.close()
