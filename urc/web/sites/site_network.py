"""This server as a site of a fleet: its network, its way in, and its requests to other sites.

Layer 5. The module combines the other modules of the package.
"""

import asyncio
import ssl
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, cast

from starlette.types import ASGIApp

from urc.access.directory import Kind
from urc.access.visits import Visit
from urc.fleet.assertion import Assertion, sign_assertion, verified_assertion
from urc.fleet.bus import FleetBus
from urc.fleet.lines import Lines
from urc.model.role import ROLES, Role
from urc.problems import UrcError
from urc.web.serve.access import Access
from urc.web.serve.rights import ProtectedRoute
from urc.web.serve.site_peer import SitePeer
from urc.web.sites.door import SiteDoor
from urc.web.sites.gateway import Gateway
from urc.web.sites.member import Member
from urc.web.sites.member_routes import MemberRoutes
from urc.web.sites.site_client import SiteClient
from urc.web.sites.site_watch import SiteWatch

__all__ = ["SiteKeys", "SiteNetwork", "SitePolicy"]


class SiteKeys(Protocol):
    """The certificates of this site; see `urc.fleet.membership.Membership`."""

    @property
    def site(self) -> str:
        """Name of this site."""

    @property
    def folder(self) -> Path:
        """Folder of the membership."""

    def server_context(self) -> ssl.SSLContext:
        """Return mutual TLS for lines from other sites."""

    def client_context(self, site: str) -> ssl.SSLContext:
        """Return mutual TLS for lines to a site."""

    def key_pem(self) -> bytes:
        """Return the private key of the certificate."""

    def peer(self, certificate_der: bytes) -> SitePeer:
        """Return the site of a certificate that TLS has proven; raise `UrcError` if revoked."""


@dataclass(frozen=True, slots=True)
class SitePolicy:
    """The rights of visitors from other sites at this site."""

    role: Role | None = "drive"
    """Highest role; None refuses all visitors."""
    sites: frozenset[str] | None = None
    """Sites whose visitors are admitted; None admits all sites of the fleet."""

    def granted(self, site: str, proposed: Role) -> Role | None:
        """Return the role for a visitor of a site; None refuses the visitor."""
        if self.role is None or (self.sites is not None and site not in self.sites):
            return None
        return min(self.role, proposed, key=ROLES.index)


class SiteNetwork:
    """The fleet, as this server sees it."""

    def __init__(
        self,
        keys: SiteKeys,
        bus: FleetBus,
        *,
        policy: SitePolicy = SitePolicy(),
        member: Member | None = None,
        utc: Callable[[], float] = time.time,
    ) -> None:
        """Prepare the network.

        Args:
            keys: the membership of this site.
            bus: the network of the fleet.
            policy: rights of visitors from other sites.
            member: the membership, for renewals and revocations; None for fixed certificates.
            utc: UTC time in seconds since 1970.
        """
        self._keys = keys
        self._bus = bus
        self._policy = policy
        self._utc = utc
        self.member = member
        self.door = SiteDoor(keys.server_context, keys.peer)
        self._lines = Lines(bus, self.door.accept)
        self.client = SiteClient(self._lines, keys.client_context, keys.peer)
        self.watch = SiteWatch(self.client, keys.folder)
        self._lines.on_sites = self._sites_changed
        self._present: frozenset[str] = frozenset()
        self._tasks: set[asyncio.Task[None]] = set()
        self._access: Access | None = None
        if member is not None:
            member.on_revoked = self._revoked

    @property
    def site(self) -> str:
        """Name of this site."""
        return self._keys.site

    def asserted(self, assertion: Assertion, site: str) -> str:
        """Return an assertion for another site, signed by this site."""
        return sign_assertion(
            assertion,
            issuer=self.site,
            audience=site,
            key_pem=self._keys.key_pem(),
            now=self._utc(),
        )

    def visit(self, peer: SitePeer, text: str) -> Visit:
        """Return the visit in an assertion of another site, with the role that this site grants.

        Raises:
            BadAssertion: the assertion does not count.
            UrcError: this site admits no visitors from the other site.
        """
        said = verified_assertion(
            text, issuer=peer.name, audience=self.site, key_pem=peer.key_pem, now=self._utc()
        )
        role = self._policy.granted(peer.name, said.role)
        if role is None:
            raise UrcError(f"the site {self.site} admits no visitors from the site {peer.name}")
        kind = cast("Kind", said.kind)
        return Visit(
            peer.name, said.principal, said.name, kind, said.sign_in, said.robot, role, said.place
        )

    def around(self, app: ASGIApp, access: Access) -> ASGIApp:
        """Return the application with robots of other sites."""
        self._access = access
        return Gateway(app, self.client, self, access.followed)

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes about certificates for other sites."""
        return MemberRoutes(self.member).routes() if self.member is not None else []

    def _sites_changed(self, sites: frozenset[str]) -> None:
        self.watch.changed()
        new, self._present = sites - self._present, sites
        if self.member is None:
            return
        self.member.sites_changed()
        for site in new:
            task = asyncio.create_task(self.member.exchange(self.client, site))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    def _revoked(self, sites: frozenset[str]) -> None:
        """End all that sites with revoked certificates have open; valid ones connect again."""
        for site in sites:
            self._lines.end_with(site)
            if self._access is not None:
                self._access.control.end_visits(site)

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Take part in the fleet while the context is open; raise `BusFailed` if impossible."""
        await self._bus.open()
        tasks = [asyncio.create_task(self.watch.run())]
        if self.member is not None:
            tasks.append(asyncio.create_task(self.member.keep(self.client)))
        try:
            yield
        finally:
            for task in (*tasks, *self._tasks):
                task.cancel()
            self._lines.close()
            await self._bus.close()
