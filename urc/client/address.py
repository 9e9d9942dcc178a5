"""A server's address and secrets, and the encryption of its connections.

Layer 5. Certificates are always checked, against the system's trust store or the authority in a
file. A token never crosses a network unencrypted, unless the program explicitly allows it.
"""

import ssl
from ipaddress import ip_address
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote, urlsplit

from urc.problems import UrcError

__all__ = ["ServerAddress", "read_token", "trust", "server_address"]

_MOST_BYTES = 4096


class ServerAddress(NamedTuple):
    """A server's address, checked and split into its scheme and host."""

    scheme: str
    """``http`` or ``https``."""
    netloc: str
    """Host of the server, followed by the port if the address contains a port."""
    is_loopback: bool

    @property
    def url(self) -> str:
        """Address of the server without a path, such as ``https://robots.lab:8080``."""
        return f"{self.scheme}://{self.netloc}"

    @property
    def origin(self) -> str:
        """Value of the ``Origin`` header that the server's own pages send."""
        return self.url

    def socket(self, robot: str) -> str:
        """Return the address of a robot's WebSocket; "" means the server's only robot."""
        scheme = "wss" if self.scheme == "https" else "ws"
        query = f"?robot={quote(robot, safe='')}" if robot else ""
        return f"{scheme}://{self.netloc}/ws{query}"

    def stop(self, robot: str) -> str:
        """Return the HTTP address to which a request stops a robot and latches STOP."""
        return f"{self.url}/api/v1/robots/{quote(robot, safe='')}/stop"

    @property
    def stop_several(self) -> str:
        """HTTP address to which a request stops several robots."""
        return f"{self.url}/api/v1/stop"

    def alarms(self, robot: str, verb: str) -> str:
        """Return the address of an action on a robot's alarms, such as ``acknowledge``."""
        return f"{self.url}/api/v1/robots/{quote(robot, safe='')}/alarms/{verb}"


def server_address(server: str, *, allow_unencrypted: bool = False) -> ServerAddress:
    """Parse and check a server's address.

    Args:
        server: address such as ``https://robots.lab:8080``, without a path.
        allow_unencrypted: whether ``http`` is allowed even to another computer.

    Raises:
        UrcError: the address is not a server's address, or must use ``https``.
    """
    try:
        parts = urlsplit(server)
        host, _ = parts.hostname or "", parts.port
    except ValueError as error:
        raise UrcError(f"server: {server!r} is not an address: {error}") from None
    if parts.scheme not in ("http", "https") or not host:
        example = "https://robots.lab:8080"
        raise UrcError(f"server: expected an address like {example}, found {server!r}")
    if parts.username is not None or parts.query or parts.fragment:
        # Programs often log addresses, so an address must not contain a secret.
        raise UrcError("server: expected an address without a key; pass the key as the token")
    if parts.path not in ("", "/"):
        raise UrcError(f"server: expected an address without a path, found {parts.path!r}")
    is_loopback = _is_loopback(host)
    if parts.scheme == "http" and not is_loopback and not allow_unencrypted:
        raise UrcError(
            f"server: http://{parts.netloc} would send the token without encryption; use https"
        )
    return ServerAddress(parts.scheme, parts.netloc, is_loopback)


def trust(authority: Path | None) -> ssl.SSLContext:
    """Return a TLS context that trusts the system's trust store, or only the authority in a file.

    Raises:
        UrcError: the file cannot be read, or contains no certificate.
    """
    try:
        context = ssl.create_default_context(cafile=authority)
    except (OSError, ssl.SSLError) as error:
        reason = getattr(error, "strerror", None) or error
        raise UrcError(f"authority: cannot use {authority}: {reason}") from error
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    return context


def read_token(token: str, file: Path | None) -> str:
    """Return a program's token, from the argument or from a file.

    Raises:
        UrcError: the file cannot be read, or the token is not one word of printable ASCII.
    """
    if token and file is not None:
        raise UrcError("token: pass the token or its file, not both")
    if file is not None:
        try:
            with file.open("rb") as opened:
                token = opened.read(_MOST_BYTES).decode("ascii").strip()
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "the file is not plain text"
            raise UrcError(f"token: cannot use {file}: {reason}") from error
    if file is not None and not token:
        raise UrcError(f"token: {file} is empty")
    if not (token.isascii() and token.isprintable()) or " " in token:
        raise UrcError("token: expected one word of printable ASCII characters")
    return token


def _is_loopback(host: str) -> bool:
    try:
        return ip_address(host.partition("%")[0]).is_loopback
    except ValueError:
        return host == "localhost" or host.endswith(".localhost")
