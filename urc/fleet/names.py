"""Names of fleets and sites, and addresses of sites.

Layer 4. Pure.
"""

import ipaddress
import re
from typing import Final, Literal

from urc.problems import UrcError

__all__ = ["FleetError", "address_of", "endpoint", "fleet_name", "site_name"]

_NAME: Final = re.compile(r"[a-z0-9](?:[a-z0-9-]{0,30}[a-z0-9])?")
_HOST: Final = re.compile(r"(?!-)[A-Za-z0-9-]{1,63}(?:\.[A-Za-z0-9-]{1,63})*")
_SCHEME: Final = "tls/"
_LAST_PORT: Final = 65534
"""Highest port. The network also uses the next port."""
_SHOWN: Final = 80


class FleetError(UrcError):
    """A certificate, file or name of a fleet cannot be used; the message is one line."""


def fleet_name(text: object) -> str:
    """Return the name of a fleet: 1 to 32 characters of ``a-z``, ``0-9`` and ``-``.

    Raises:
        FleetError: the text is not such a name, or begins or ends with ``-``.
    """
    return _name(text, "fleet")


def site_name(text: object) -> str:
    """Return the name of a site; the rules and errors are those of `fleet_name`."""
    return _name(text, "site")


def endpoint(address: str) -> str:
    """Return the Zenoh endpoint of an address: ``192.168.1.20:7447`` → ``tls/192.168.1.20:7447``.

    Args:
        address: ``HOST:PORT`` or ``tls/HOST:PORT``. IPv6 addresses are in brackets. The port is in
            the range 1 to 65534.

    Raises:
        FleetError: the text is not such an address.
    """
    host, _, port = address.removeprefix(_SCHEME).rpartition(":")
    is_port = port.isascii() and port.isdecimal() and 1 <= int(port[:6]) <= _LAST_PORT
    if not is_port or not _is_host(host):
        raise FleetError(
            f"expected an address such as 192.168.1.20:7447, with a port from 1 to {_LAST_PORT},"
            f" found {address[:_SHOWN]!r}"
        )
    return f"{_SCHEME}{host}:{int(port)}"


def address_of(zenoh_endpoint: str) -> str:
    """Return the address ``HOST:PORT`` of an endpoint."""
    return zenoh_endpoint.removeprefix(_SCHEME)


def _name(text: object, kind: Literal["fleet", "site"]) -> str:
    if isinstance(text, str) and _NAME.fullmatch(text):
        return text
    shown = text[:_SHOWN] if isinstance(text, str) else text
    raise FleetError(
        f"expected the name of a {kind}, 1 to 32 characters of a-z, 0-9 and '-', such as"
        f" 'north-hall', found {shown!r}"
    )


def _is_host(host: str) -> bool:
    try:
        if host.startswith("["):
            ipaddress.IPv6Address(host.removeprefix("[").removesuffix("]"))
            return host.endswith("]")
    except ValueError:
        return False
    return bool(_HOST.fullmatch(host))
