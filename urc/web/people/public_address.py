"""The address of a server for other devices, as a link and as a QR code.

Layer 5. The code of a link is in the fragment, which browsers never send to a server.
"""

import ipaddress
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

import segno
from starlette.requests import Request

from urc.access.authority import AUTHORITY_FOLDER, fingerprint
from urc.runtime.running_servers import servers

__all__ = ["authority_fingerprint", "is_reachable", "public_address", "qr_image"]

_QUIET: Final = 4
"""Width of the quiet zone in modules (ISO/IEC 18004, 6.3.8)."""
_SCALE: Final = 8


def public_address(request: Request, data: Path | None, instance: str) -> str:
    """Return the address of this server for other devices, without a slash at its end.

    An administrator on another device uses such an address already. On the server's own computer,
    the address is the one that the server has announced. The call reads files.

    Args:
        request: the administrator's request, with a host that the page policy has checked.
        data: data folder with the addresses of running servers; None without one.
        instance: identifier of this server among them.
    """
    own = f"{request.url.scheme}://{request.headers['host']}"
    if is_reachable(own) or data is None:
        return own
    running = {file.stem: server for file, server in servers(data).items()}.get(instance)
    return running.public.rstrip("/") if running and running.public else own


def is_reachable(address: str) -> bool:
    """Return whether an address is valid on other devices, too."""
    host = urlsplit(address).hostname or ""
    if host == "localhost" or host.endswith(".localhost"):
        return False
    try:
        return not ipaddress.ip_address(host.partition("%")[0]).is_loopback
    except ValueError:
        return True


def qr_image(text: str) -> str:
    """Return a QR code as the ``data:`` address of an SVG image: dark on white in every theme."""
    code = segno.make(text, error="m", micro=False)
    return code.svg_data_uri(
        border=_QUIET, scale=_SCALE, dark="#000", light="#fff", svgclass=None, lineclass=None
    )


def authority_fingerprint(data: Path | None) -> str:
    """Return the fingerprint of the local certificate authority, or "" without one."""
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
