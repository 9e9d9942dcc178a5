"""Sends a package to a repository that takes packages."""

import base64
import ipaddress
from urllib.parse import urlsplit

import msgspec

from urc.packages.index import entry_of
from urc.packages.names import PackageError
from urc.packages.notes import PROVENANCE, Provenance
from urc.packages.package import Package
from urc.packages.remote import put, repository_url
from urc.packages.signature import SIGNATURE, Signature
from urc.problems import printable

__all__ = ["Published", "is_overheard", "publish"]


class Published(msgspec.Struct, frozen=True):
    """What a repository answered."""

    listed: str
    """``drivers/puppet 1.0.0``."""
    sha256: str
    is_new: bool = True
    """False: exactly this was listed already."""


class _Fault(msgspec.Struct, frozen=True):
    error: str


def is_overheard(url: str) -> bool:
    """Return whether a token sent to an address can be read by others on the way."""
    parts = urlsplit(url)
    if parts.scheme == "https":
        return False
    try:
        return not ipaddress.ip_address(parts.hostname or "").is_loopback
    except ValueError:
        return parts.hostname != "localhost"


def publish(
    url: str,
    package: Package,
    signature: Signature | None,
    token: str,
    provenance: Provenance | None = None,
) -> Published:
    """Send a package to the repository at an address, where it is checked, tested and listed.

    Args:
        url: of the repository. Redirects are not followed: a token goes nowhere else.
        package: what is published.
        signature: who made it, if it is signed.
        token: the keeper's.
        provenance: where it was made, to be told who installs it.

    Raises:
        PackageError: what the repository has against it, or that it cannot be reached.
    """
    address = repository_url(url) + entry_of(package).file
    headers = {
        "authorization": f"Bearer {token}",
        "content-type": "application/zip",
        "urc-sha256": package.digest,
    }
    if signature is not None:
        headers[SIGNATURE] = base64.b64encode(msgspec.json.encode(signature)).decode()
    if provenance is not None:
        headers[PROVENANCE] = base64.b64encode(msgspec.json.encode(provenance)).decode()
    answer = put(address, package.data, headers)
    if answer.status in (200, 201):
        try:
            said = msgspec.json.decode(answer.body, type=Published)
        except (msgspec.DecodeError, UnicodeDecodeError):
            raise PackageError(f"{address}: it is taken, says the server, but not what") from None
        if said.sha256 != package.digest:
            raise PackageError(f"{address}: the server listed other bytes than were sent")
        return msgspec.structs.replace(said, is_new=answer.status == 201)
    raise PackageError(f"{address}: {_reason(answer.status, answer.body)}")


def _reason(status: int, body: bytes) -> str:
    if status in (404, 405, 501):
        return (
            f"this server takes no packages (it answers {status});"
            " 'urc repo serve DIR --tokens FILE' does"
        )
    try:
        return printable(msgspec.json.decode(body, type=_Fault).error)[:2000]
    except (msgspec.DecodeError, UnicodeDecodeError):
        return f"the server answers {status}"
