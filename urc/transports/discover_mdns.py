"""Discovers announced services with multicast DNS.

The library zeroconf (extra ``mdns``) is imported only when a search begins.
"""

import asyncio
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any, NamedTuple

from urc._extras import missing
from urc.transports.base import TransportError

__all__ = ["ServiceAnnouncement", "announced"]

RESOLVE_S = 1.0
"""Timeout for resolving one service, in seconds."""
MAX_SERVICES = 256


class ServiceAnnouncement(NamedTuple):
    """One announced service."""

    type: str
    """Requested service type, such as ``_rosbridge._tcp``."""
    name: str
    host: str
    """Address."""
    port: int


async def announced(
    types: Sequence[str], seconds: float, interfaces: Sequence[str] = ()
) -> list[ServiceAnnouncement]:
    """Return the services found within `seconds`, sorted by type and name.

    Args:
        types: service types, such as ``_rosbridge._tcp``; at least one.
        seconds: duration of the search.
        interfaces: addresses of this machine on which to listen; () for all interfaces.

    Raises:
        TransportError: the library is missing, or no network is available.
    """
    if find_spec("zeroconf") is None:
        raise TransportError(missing("mDNS needs", "zeroconf", "mdns"))
    from zeroconf import InterfaceChoice, ServiceStateChange
    from zeroconf.asyncio import AsyncServiceBrowser, AsyncZeroconf

    found: dict[tuple[str, str], None] = {}

    def changed(
        zeroconf: Any, service_type: str, name: str, state_change: ServiceStateChange
    ) -> None:
        if state_change is ServiceStateChange.Removed:
            found.pop((service_type, name), None)
        elif len(found) < MAX_SERVICES:
            found[service_type, name] = None

    try:
        zeroconf = AsyncZeroconf(interfaces=list(interfaces) or InterfaceChoice.All)
    except OSError as fault:
        raise TransportError(f"mDNS is not available ({fault.strerror or fault})") from fault
    try:
        wanted = [f"{one}.local." for one in types]
        browser = AsyncServiceBrowser(zeroconf.zeroconf, wanted, handlers=[changed])
        await asyncio.sleep(seconds)
        await browser.async_cancel()
        places = await asyncio.gather(*(_resolve(zeroconf, *service) for service in found))
    finally:
        await zeroconf.async_close()
    return sorted(one for several in places for one in several)


async def _resolve(zeroconf: Any, kind: str, name: str) -> list[ServiceAnnouncement]:
    """Return a service's addresses; an empty list if the announcement has no address."""
    from zeroconf import IPVersion
    from zeroconf.asyncio import AsyncServiceInfo

    info = AsyncServiceInfo(kind, name)
    if not await info.async_request(zeroconf.zeroconf, RESOLVE_S * 1000) or not info.port:
        return []
    addresses = info.parsed_addresses(IPVersion.V4Only) or info.parsed_addresses()
    short = kind.removesuffix(".local.")
    label = name.removesuffix(f".{kind}")
    return [ServiceAnnouncement(short, label, address, info.port) for address in addresses[:1]]
