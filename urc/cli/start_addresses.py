"""The start addresses of a dashboard, including their keys."""

import os
import secrets
from collections.abc import Iterator
from contextlib import AsyncExitStack, ExitStack
from ipaddress import ip_address
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import urlsplit

from urc.cli.arguments import is_loopback
from urc.cli.error_report import Misuse
from urc.cli.output import complain
from urc.problems import UrcError

if TYPE_CHECKING:
    from urc.web.serve.access import Access

__all__ = ["ReadyDashboard", "access_for", "announce", "print_entrance", "token_in"]

_SHORTEST = 16
_LONGEST = 200


class ReadyDashboard(NamedTuple):
    """The addresses of a running dashboard."""

    url: str
    """Without a key."""
    access: "Access"

    @property
    def address(self) -> str:
        """Address with all rights, for the user who started the dashboard."""
        return self.access.address(self.url)

    @property
    def address_once(self) -> str:
        """One-time address for the browser that URC opens."""
        return self.access.address_once(self.url)

    def lines(self) -> Iterator[str]:
        """Yield the lines of the start message. The first line is the address with all rights."""
        yield f"dashboard {self.address}"
        if self.access.is_open:
            yield f"for others {self.url} (without a key: watch and drive)"
        if managers := self.access.address_of_managers(self.url):
            yield f"for managers {managers}"


def print_entrance(ready_dashboard: ReadyDashboard) -> None:
    """Print the addresses."""
    print("\n".join(ready_dashboard.lines()), flush=True)


def access_for(host: str, token: str = "") -> "Access":
    """Return the keys of a dashboard that listens on `host`."""
    from urc.web.serve.access import Access

    return Access(is_open=not is_loopback(host), token=token)


def token_in(file: Path) -> str:
    """Return the token in a file; create a missing file.

    Raises:
        UrcError: the file cannot be read or written, or contains no valid token.
    """
    from urc.private_files import put_private

    try:
        if not file.exists():
            put_private(file, secrets.token_urlsafe(24).encode() + b"\n")
        token = file.read_text("ascii").strip()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "the file is not plain text"
        raise UrcError(f"--token: cannot use {file}: {reason}") from error
    if not _SHORTEST <= len(token) <= _LONGEST or not token.isprintable() or " " in token:
        raise Misuse(
            f"--token: {file} must contain {_SHORTEST} to {_LONGEST} characters without spaces;"
            " remove the file to create a new token"
        )
    return token


def announce(
    stack: ExitStack | AsyncExitStack, data: Path, host: str, ready_dashboard: ReadyDashboard
) -> None:
    """Register the dashboard for other programs of this user until `stack` closes."""
    from urc.runtime.running_servers import RunningServer, announced

    server = RunningServer(
        _near(ready_dashboard.url, host),
        ready_dashboard.access.key,
        os.getpid(),
        "" if is_loopback(host) else ready_dashboard.url,
    )
    try:
        stack.enter_context(announced(data, ready_dashboard.access.instance, server))
    except OSError as error:
        reason = error.strerror or error
        complain(f"urc: cannot write into {data}: {reason}; 'urc send' will not find this server")


def _near(url: str, host: str) -> str:
    """Return the dashboard's address for programs on this machine."""
    port = urlsplit(url).port
    try:
        address = ip_address(host)
    except ValueError:
        return url
    if not address.is_unspecified:
        return url
    return f"http://127.0.0.1:{port}/" if address.version == 4 else f"http://[::1]:{port}/"
