"""The start addresses of a dashboard, including their keys."""

import os
from collections.abc import Iterator
from contextlib import AsyncExitStack, ExitStack
from ipaddress import ip_address
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import quote, urlsplit

from urc.cli.arguments import is_loopback
from urc.cli.output import complain

if TYPE_CHECKING:
    from urc.cli.tls_options import TlsOptions
    from urc.web.foxglove.port import FoxglovePort
    from urc.web.serve.access import Access
    from urc.web.serve.certificates import Certificates, LoadedCertificate

__all__ = ["ReadyDashboard", "access_for", "announce", "print_entrance", "ready_addresses"]


class ReadyDashboard(NamedTuple):
    """The addresses at which browsers and viewers reach a running dashboard."""

    url: str
    """Address for this machine, without a key."""
    access: "Access"
    others: str = ""
    """Address for other machines; "" if only this machine can reach the dashboard."""
    certificate: "LoadedCertificate | None" = None
    """HTTPS certificate; None for plain HTTP."""
    foxglove_port: int = 0
    """Port for Foxglove viewers; 0 if they use the dashboard's port."""

    @property
    def address(self) -> str:
        """Address that grants all rights, for the user who started the dashboard."""
        return self.access.address(self.url)

    @property
    def address_once(self) -> str:
        """One-time address for the browser that URC opens."""
        return self.access.address_once(self.url)

    def lines(self) -> Iterator[str]:
        """Yield the lines of the start message; the first line is the address with all rights."""
        yield f"dashboard {self.address}"
        if self.foxglove_port:
            yield f"foxglove {_viewer_address(self.url, self.foxglove_port, self.access.key)}"
        if self.others and self.access.anonymous:
            yield f"for others {self.others} (without a sign-in: {self.access.anonymous})"
        elif self.others:
            yield f"for others {self.others} (with a sign-in)"
        if self.certificate is not None:
            yield from _certificate_lines(self.certificate, self.others or self.url)


def _viewer_address(url: str, port: int, key: str) -> str:
    """Return the address for viewers on this machine, which grants all rights."""
    place = urlsplit(url)
    host = f"[{place.hostname}]" if ":" in (place.hostname or "") else place.hostname
    scheme = "wss" if place.scheme == "https" else "ws"
    return f"{scheme}://{host}:{port}/?token={quote(key, safe='')}"


def _certificate_lines(certificate: "LoadedCertificate", url: str) -> Iterator[str]:
    if not certificate.authority:
        yield f"certificate {certificate.fingerprint}"
        return
    # Use plain HTTP, because browsers show a warning until the device trusts the authority.
    plain = url.replace("https://", "http://", 1)
    yield f"new devices {plain}trust (once, before the first visit)"
    yield f"authority {certificate.fingerprint}"


def ready_addresses(
    url: str,
    host: str,
    access: "Access",
    certificates: "Certificates | None",
    tls: "TlsOptions",
    foxglove: "FoxglovePort | None" = None,
) -> ReadyDashboard:
    """Return the addresses of a dashboard that listens on `host`.

    Args:
        url: first address of the dashboard, without a key.
        host: value of `--host`.
        access: the start key, identities and rights of the dashboard.
        certificates: HTTPS certificates; None for plain HTTP.
        tls: public names of a web server in front of the dashboard.
        foxglove: port for Foxglove viewers; None if they use the dashboard's port.
    """
    others = "" if is_loopback(host) else url
    if tls.public_names:
        others = f"https://{tls.public_names[0]}/"
    current = certificates.current if certificates is not None else None
    foxglove_port = foxglove.port if foxglove is not None else 0
    return ReadyDashboard(_near(url, host), access, others, current, foxglove_port)


def print_entrance(ready_dashboard: ReadyDashboard) -> None:
    """Print the addresses."""
    print("\n".join(ready_dashboard.lines()), flush=True)


def access_for(data: Path | None = None, *, is_open: bool = False) -> "Access":
    """Return the identities and rights for a dashboard.

    Args:
        data: folder with the store of people, devices and programs; None means only the local user.
        is_open: whether visitors who have not signed in may watch and drive.

    Raises:
        AccessError: the store cannot be used.
    """
    from urc.access.control import AccessControl
    from urc.access.store import AccessStore
    from urc.web.serve.access import Access

    control = AccessControl(AccessStore(data) if data else None)
    return Access(control, anonymous="drive" if is_open else None)


def announce(
    stack: ExitStack | AsyncExitStack, data: Path, ready_dashboard: ReadyDashboard
) -> None:
    """Until `stack` closes, register the dashboard, so that `urc send` finds it."""
    from urc.runtime.running_servers import RunningServer, announced

    found = ready_dashboard.certificate
    if not ready_dashboard.url.startswith("https://"):
        found = None
    server = RunningServer(
        ready_dashboard.url,
        ready_dashboard.access.key,
        os.getpid(),
        ready_dashboard.others,
        str(found.file.absolute()) if found is not None else "",
        found.name if found is not None else "",
    )
    try:
        stack.enter_context(announced(data, ready_dashboard.access.instance, server))
    except OSError as error:
        reason = error.strerror or error
        complain(f"urc: cannot write into {data}: {reason}; 'urc send' will not find this server")


def _near(url: str, host: str) -> str:
    """Return the dashboard's address for this machine.

    A server that listens on all addresses accepts plain HTTP from this machine, even with a
    certificate. Browsers then show no warning and treat the address as secure.
    """
    port = urlsplit(url).port
    try:
        address = ip_address(host)
    except ValueError:
        return url
    if not address.is_unspecified:
        return url
    return f"http://127.0.0.1:{port}/" if address.version == 4 else f"http://[::1]:{port}/"
