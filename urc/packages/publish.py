"""Uploads packages to a repository."""

import base64
import ipaddress
from urllib.parse import urlsplit

import msgspec

from urc.packages.http_repository import put, repository_url
from urc.packages.index import entry_of
from urc.packages.names import PackageError
from urc.packages.package import Package
from urc.packages.signature import SIGNATURE, Signature
from urc.packages.version_notes import PROVENANCE, Provenance
from urc.problems import printable

__all__ = ["Published", "is_overheard", "publish"]


class Published(msgspec.Struct, frozen=True):
    """A repository's response to an upload."""

    listed: str
    """Package version that the repository lists, such as ``drivers/puppet 1.0.0``."""
    sha256: str
    is_new: bool = True
    """Whether the version is new; False if the repository already listed the version."""


class _ErrorBody(msgspec.Struct, frozen=True):
    error: str


def is_overheard(url: str) -> bool:
    """Return whether others on the network could read a token sent to this URL."""
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
    """Upload a package to a repository. The repository checks, tests and lists the package.

    Args:
        url: the repository's URL. Redirects are not followed, to protect the token.
        package: the package.
        signature: the package's signature; None for an unsigned package.
        token: upload token from the maintainer.
        provenance: the package's origin, shown before installation; None if unknown.

    Raises:
        PackageError: the repository rejects the upload or is unreachable.
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
            raise PackageError(
                f"{address}: the upload was accepted, but the server's response is invalid"
            ) from None
        if said.sha256 != package.digest:
            raise PackageError(
                f"{address}: the server listed an archive that differs from the uploaded archive"
            )
        return msgspec.structs.replace(said, is_new=answer.status == 201)
    raise PackageError(f"{address}: {_reason(answer.status, answer.body)}")


def _reason(status: int, body: bytes) -> str:
    if status in (404, 405, 501):
        return (
            f"this server does not accept uploads (status {status});"
            " start one with 'urc repo serve DIR --tokens FILE'"
        )
    try:
        return printable(msgspec.json.decode(body, type=_ErrorBody).error)[:2000]
    except (msgspec.DecodeError, UnicodeDecodeError):
        return f"the server replied with status {status}"
