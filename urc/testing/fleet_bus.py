"""A fake network of a fleet, in one process: it delivers, delays, loses and cuts as told."""

import asyncio
from collections.abc import Callable, Iterable

from urc.fleet.bus import MAX_MESSAGE_BYTES, Arrival, FleetBus, Lane

__all__ = ["FakeFleetBus", "FakeFleetNetwork"]


class FakeFleetNetwork:
    """The network between fake buses. Messages arrive in a later turn of the event loop."""

    def __init__(self) -> None:
        self._buses: dict[str, FakeFleetBus] = {}
        self._cut: set[frozenset[str]] = set()
        self.loses: Callable[[str, str, bytes], bool] = _loses_nothing
        """Function that decides whether a message is lost: sender, receiver and body."""
        self.sent: list[tuple[str, str, Lane, bytes]] = []
        """All messages: sender, receiver, lane and body."""

    def bus(self, site: str) -> "FakeFleetBus":
        """Return a new bus for a site; the bus joins the network with `open`."""
        return FakeFleetBus(self, site)

    def cut(self, one: str, other: str) -> None:
        """Cut the connection between two sites: they no longer see each other."""
        self._cut.add(frozenset((one, other)))
        self._changed()

    def heal(self) -> None:
        """Restore all connections."""
        self._cut.clear()
        self._changed()

    def joined(self, bus: "FakeFleetBus") -> None:
        """Add an opened bus."""
        self._buses[bus.site] = bus
        self._changed()

    def left(self, bus: "FakeFleetBus") -> None:
        """Remove a closed bus."""
        if self._buses.get(bus.site) is bus:
            del self._buses[bus.site]
        self._changed()

    def seen_from(self, site: str) -> frozenset[str]:
        """Return the names of the sites that `site` can reach."""
        if site not in self._buses:
            return frozenset()
        others = (name for name in self._buses if name != site)
        return frozenset(name for name in others if frozenset((site, name)) not in self._cut)

    def carry(self, sender: str, site: str, lane: Lane, body: bytes) -> bool:
        """Deliver a message later; return False if the receiver cannot be reached."""
        self.sent.append((sender, site, lane, body))
        if site not in self.seen_from(sender):
            return False
        if not self.loses(sender, site, body):
            asyncio.get_running_loop().call_soon(self._deliver, sender, site, lane, body)
        return True

    def _deliver(self, sender: str, site: str, lane: Lane, body: bytes) -> None:
        receiver = self._buses.get(site)
        if receiver is not None and site in self.seen_from(sender):
            receiver.on_arrival(Arrival(sender, lane, body))

    def _changed(self) -> None:
        _tell(self._buses.values())


class FakeFleetBus(FleetBus):
    """One site's bus of a `FakeFleetNetwork`."""

    def __init__(self, network: FakeFleetNetwork, site: str) -> None:
        self._network = network
        self._site = site
        self._seen: frozenset[str] = frozenset()
        self.on_arrival = _ignore
        self.on_sites = _rest

    @property
    def site(self) -> str:
        """Name of this site."""
        return self._site

    @property
    def sites(self) -> frozenset[str]:
        """Names of the sites that can be reached."""
        return self._seen

    async def open(self) -> None:
        """Join the network."""
        self._network.joined(self)

    def send(self, site: str, lane: Lane, body: bytes) -> bool:
        """Send a message; raise `ValueError` if it is too large."""
        if len(body) > MAX_MESSAGE_BYTES:
            raise ValueError(f"a message has {len(body)} bytes; at most {MAX_MESSAGE_BYTES}")
        return self._network.carry(self._site, site, lane, body)

    async def refresh(self) -> None:
        """Leave the network, and join it again."""
        await self.close()
        self.on_sites()
        await self.open()

    async def close(self) -> None:
        """Leave the network."""
        self._network.left(self)
        self._seen = frozenset()

    def look(self) -> None:
        """Compare the visible sites with the known ones, and report a change."""
        seen = self._network.seen_from(self._site)
        if seen != self._seen:
            self._seen = seen
            self.on_sites()


def _tell(buses: Iterable[FakeFleetBus]) -> None:
    for bus in tuple(buses):
        bus.look()


def _loses_nothing(sender: str, site: str, body: bytes) -> bool:
    return False


def _ignore(arrival: Arrival) -> None:
    """Ignore a message; the default callback."""


def _rest() -> None:
    """Ignore a change; the default callback."""
