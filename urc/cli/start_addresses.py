"""The start addresses of a dashboard, including their keys."""

import os
from collections.abc import Iterator
from contextlib import AsyncExitStack, ExitStack
from ipaddress import ip_address
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import urlsplit

from urc.cli.arguments import is_loopback
from urc.cli.output import complain

if TYPE_CHECKING:
    from urc.web.serve.access import Access

__all__ = ["ReadyDashboard", "access_for", "announce", "print_entrance"]


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
        if self.access.anonymous:
            yield f"for others {self.url} (without a sign-in: {self.access.anonymous})"
        elif not is_loopback(urlsplit(self.url).hostname or ""):
            yield f"for others {self.url} (with a sign-in)"


def print_entrance(ready_dashboard: ReadyDashboard) -> None:
    """Print the addresses."""
    print("\n".join(ready_dashboard.lines()), flush=True)


def access_for(data: Path | None = None, *, is_open: bool = False) -> "Access":
    """Return the identities and rights of a dashboard.

    Args:
        data: folder with the store of people, devices and programs; None for the local user alone.
        is_open: whether visitors without a sign-in may watch and drive.

    Raises:
        AccessError: the store cannot be used.
    """
    from urc.access.control import AccessControl
    from urc.access.store import AccessStore
    from urc.web.serve.access import Access

    control = AccessControl(AccessStore(data) if data else None)
    return Access(control, anonymous="drive" if is_open else None)


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
