"""The seam between URC and the network of a fleet.

Layer 4. A `FleetBus` carries small messages between sites, and reports which sites are present. It
promises little, so that any network can stand behind it. Messages can be lost. Messages from one
site on one lane arrive in the order in which they were sent. The sender of a message is a claim:
`urc.fleet.lines` adds flow control, and TLS above it proves who the peer is.

Two implementations pass the same contract tests: `urc.fleet.zenoh_bus` and the public fake
`urc.testing.fleet_bus`.
"""

from collections.abc import Callable
from typing import Final, Literal, NamedTuple, Protocol

from urc.problems import UrcError

__all__ = ["LANES", "MAX_MESSAGE_BYTES", "Arrival", "BusFailed", "FleetBus", "Lane"]

Lane = Literal["control", "data"]
"""A separate connection of the network. Ticks, leases, stops and commands use ``control``. Images,
files and recordings use ``data``, so that they never delay a stop."""
LANES: Final[tuple[Lane, ...]] = ("control", "data")
MAX_MESSAGE_BYTES: Final = 16 * 1024
"""Maximum size of a message. Larger messages would keep others waiting on a slow line."""


class BusFailed(UrcError):
    """The network of a fleet cannot be used; the message is one line."""


class Arrival(NamedTuple):
    """A message from another site."""

    sender: str
    """Name of the site that claims to be the sender."""
    lane: Lane
    body: bytes


class FleetBus(Protocol):
    """The network of a fleet, as one site sees it. It belongs to one event loop."""

    on_arrival: Callable[[Arrival], None]
    """Callback for each message; it runs on the event loop."""
    on_sites: Callable[[], None]
    """Callback for each change of `sites`; it runs on the event loop."""

    @property
    def site(self) -> str:
        """Name of this site."""

    @property
    def sites(self) -> frozenset[str]:
        """Names of the other sites that are present. A name is a claim, as in `Arrival`."""

    async def open(self) -> None:
        """Join the network, and announce this site; raise `BusFailed` if this is impossible.

        An unreachable network is no failure: the bus joins it as soon as it can be reached.
        """

    def send(self, site: str, lane: Lane, body: bytes) -> bool:
        """Send a message without waiting; return False if it is certainly lost.

        Args:
            site: name of the receiver.
            lane: the connection to use.
            body: at most `MAX_MESSAGE_BYTES`.
        """

    async def refresh(self) -> None:
        """Use this site's current certificate for new connections; raise `BusFailed` on a fault.

        The other sites may be absent for a moment, and lines to them may end.
        """

    async def close(self) -> None:
        """Leave the network; the other sites learn this soon. The method never raises."""
