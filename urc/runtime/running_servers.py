"""The running dashboards of the current user on this machine: addresses and start keys.

Layer 4. Each running server has one small file, readable only by its owner::

    servers/1a2b3c4d.json    {"address": "http://127.0.0.1:8080/", "key": "…", "pid": 4711, …}

Programs send the key with each request, as ``Authorization: Bearer …``. For an HTTPS address, the
file also contains the path of the certificate that verifies the server.
"""

import json
import os
import ssl
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.client import HTTPConnection, HTTPSConnection
from pathlib import Path
from typing import NamedTuple
from urllib.parse import urlsplit

from urc.private_files import put_private

__all__ = ["RunningServer", "announced", "headers", "open_connection", "servers"]

_FOLDER = "servers"
_MOST_BYTES = 4096


class RunningServer(NamedTuple):
    """A dashboard as described by its file; it may have ended without removing the file."""

    address: str
    """Base address, such as ``http://127.0.0.1:8080/``."""
    key: str
    """Start key."""
    pid: int
    """Process ID."""
    public: str = ""
    """Base address for other devices; "" if the server accepts clients on this machine only."""
    certificate: str = ""
    """PEM file with the certificate to trust for an ``https`` address; "" for plain HTTP."""
    name: str = ""
    """Name in the server's certificate, which may differ from the host of the address."""


def headers(server: RunningServer) -> dict[str, str]:
    """Return the HTTP headers for a program's requests to `server`."""
    return {"authorization": f"Bearer {server.key}"}


def open_connection(server: RunningServer, timeout_s: float) -> HTTPConnection:
    """Return a connection to `server` that connects and verifies on its first request.

    Args:
        server: the server.
        timeout_s: time limit for each step, in seconds.

    Raises:
        OSError: the certificate file cannot be read.
        ValueError: the address is invalid.
    """
    place = urlsplit(server.address)
    if place.scheme != "https":
        return HTTPConnection(place.hostname or "", place.port, timeout=timeout_s)
    return _Verified(server, place.hostname or "", place.port, timeout_s)


class _Verified(HTTPSConnection):
    """A connection that trusts one certificate and expects one name in the server's certificate.

    The name is separate, because an operator's own certificate may not include the server's
    address.
    """

    def __init__(
        self, server: RunningServer, host: str, port: int | None, timeout_s: float
    ) -> None:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.load_verify_locations(server.certificate)
        # An operator's file begins with the server's own certificate, not with a root certificate.
        context.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
        super().__init__(host, port, timeout=timeout_s, context=context)
        self._verifier = context
        self._name = server.name or host

    def connect(self) -> None:
        """Connect and verify the certificate."""
        HTTPConnection.connect(self)
        self.sock = self._verifier.wrap_socket(self.sock, server_hostname=self._name)


@contextmanager
def announced(data: Path, name: str, server: RunningServer) -> Iterator[None]:
    """Announce `server` to the user's other programs while the context is open.

    Args:
        data: URC's data folder.
        name: unique name of the server, used as the file name.
        server: the server.

    Raises:
        OSError: the file cannot be written.
    """
    servers(data)  # also removes the files of killed servers
    file = data / _FOLDER / f"{name}.json"
    put_private(file, json.dumps(server._asdict()).encode())
    try:
        yield
    finally:
        with suppress(OSError):
            file.unlink()


def servers(data: Path) -> dict[Path, RunningServer]:
    """Return the servers announced in the data folder, newest first.

    Files of killed servers are removed. If the system cannot determine whether a server's process
    is running, the server stays in the list, although its address may not respond.
    """
    found: dict[Path, RunningServer] = {}
    for file in _files(data):
        server = _read(file)
        if server is not None and _may_run(server.pid):
            found[file] = server
        else:
            with suppress(OSError):
                file.unlink()
    return found


def _files(data: Path) -> list[Path]:
    dated: list[tuple[float, Path]] = []
    for file in (data / _FOLDER).glob("*.json"):
        with suppress(OSError):
            dated.append((file.stat().st_mtime, file))
    return [file for _, file in sorted(dated, reverse=True)]


def _read(file: Path) -> RunningServer | None:
    try:
        with file.open("rb") as opened:
            said = json.loads(opened.read(_MOST_BYTES))
        return RunningServer(
            str(said["address"]),
            str(said["key"]),
            int(said["pid"]),
            *(str(said.get(name, "")) for name in ("public", "certificate", "name")),
        )
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None


def _may_run(pid: int) -> bool:
    """Return whether the process exists or may exist."""
    if os.name != "posix":
        return True  # on Windows, signal 0 is Ctrl-C
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True
