"""Creation of links for other devices: pairing codes, invitations and guest links.

Layer 5. Call the methods in a thread, because they read files. A link contains its code in the
fragment, which browsers never send to a server.
"""

import ipaddress
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

import segno
from starlette.requests import Request

from urc.access.authority import AUTHORITY_FOLDER, fingerprint
from urc.access.lifetimes import PAIRING_S
from urc.access.store import Invitation
from urc.runtime.running_servers import servers
from urc.web.people.browser_sign_ins import BrowserSignIns
from urc.web.people.messages import PairingCode, SecretLink
from urc.web.people.pairings import Pairings

__all__ = ["LinkMaker"]

_QUIET: Final = 4
"""Width of the QR code's quiet zone, in modules (ISO/IEC 18004, 6.3.8)."""
_SCALE: Final = 8


class LinkMaker:
    """Creates links with which other devices can reach one server."""

    def __init__(self, sign_ins: BrowserSignIns, pairings: Pairings, data: Path | None) -> None:
        """Create the maker.

        Args:
            sign_ins: the sign-ins of all browsers.
            pairings: the administrators' pending pairings.
            data: the data folder; None if the server has no data folder.
        """
        self._sign_ins = sign_ins
        self._pairings = pairings
        self._data = data

    def link(self, request: Request, page: str, secret: str, ends_at: float) -> SecretLink:
        """Return a link that contains a secret.

        Args:
            request: the administrator's request.
            page: page that the link opens, such as ``join``.
            secret: the secret, which only the fragment contains.
            ends_at: UTC time at which the link expires, in seconds since 1970.
        """
        address = _public_address(request, self._data, self._sign_ins.access.instance)
        text = f"{address}/{page}#{secret}"
        return SecretLink(text, _qr_image(text), ends_at, _is_reachable(address))

    def pairing(self, request: Request, invitation: Invitation) -> PairingCode:
        """Return a new code for pairing one device within two minutes.

        Args:
            request: the administrator's request.
            invitation: name, owner and rights of the device.

        Raises:
            AccessError: too many codes are currently valid.
        """
        now = self._sign_ins.control.now()
        ends_at = now + PAIRING_S
        code = self._sign_ins.store.invite(invitation._replace(ends_at=ends_at), now=now)
        made = self.link(request, "pair", code, ends_at)
        return PairingCode(
            id=self._pairings.add(code, ends_at),
            link=made.link,
            qr=made.qr,
            code=code,
            fingerprint=_authority_fingerprint(self._data),
            is_reachable=made.is_reachable,
            lasts_s=PAIRING_S,
        )


def _public_address(request: Request, data: Path | None, instance: str) -> str:
    """Return this server's address for other devices, without a trailing slash.

    A request from another device already contains an address that other devices can use. For a
    request from the server's own computer, the function returns the address announced by the
    server. Call the function in a thread, because it reads files.

    Args:
        request: the administrator's request; the page policy has checked its host.
        data: data folder with the addresses of running servers; None if there is no data folder.
        instance: identifier of this server among the running servers.
    """
    own = f"{request.url.scheme}://{request.headers['host']}"
    if _is_reachable(own) or data is None:
        return own
    running = {file.stem: server for file, server in servers(data).items()}.get(instance)
    return running.public.rstrip("/") if running and running.public else own


def _is_reachable(address: str) -> bool:
    """Return whether other devices can reach the server at an address."""
    host = urlsplit(address).hostname or ""
    if host == "localhost" or host.endswith(".localhost"):
        return False
    try:
        return not ipaddress.ip_address(host.partition("%")[0]).is_loopback
    except ValueError:
        return True


def _qr_image(text: str) -> str:
    """Return a QR code as the ``data:`` URL of an SVG image, dark on white in every theme."""
    code = segno.make(text, error="m", micro=False)
    return code.svg_data_uri(
        border=_QUIET, scale=_SCALE, dark="#000", light="#fff", svgclass=None, lineclass=None
    )


def _authority_fingerprint(data: Path | None) -> str:
    """Return the local certificate authority's fingerprint; "" if there is no authority."""
    if data is None:
        return ""
    try:
        pem = (data / AUTHORITY_FOLDER / "authority.pem").read_bytes()
    except OSError:
        return ""
    from cryptography import x509  # slow to import, and needed only with an authority

    try:
        return fingerprint(x509.load_pem_x509_certificate(pem))
    except ValueError:
        return ""
