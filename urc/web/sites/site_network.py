"""This server as a site of a fleet: its network, its way in, and its requests to other sites.

Layer 5. The module combines the other modules of the package.
"""

import asyncio
import logging
import ssl
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Final, Protocol, cast

from starlette.types import ASGIApp

from urc import __version__
from urc.access.directory import Kind
from urc.access.visits import Visit
from urc.fleet.assertion import Assertion, BadAssertion, sign_assertion, verified_assertion
from urc.fleet.bus import BusFailed, FleetBus
from urc.fleet.lines import Lines
from urc.fleet.rules import Applicant
from urc.fleet.rules_file import RULES_FILE, RulesFile
from urc.fleet.versions import version_refusal
from urc.problems import UrcError
from urc.runtime.server_recorder import ServerRecorder
from urc.web.serve.access import Access
from urc.web.serve.rights import ProtectedRoute
from urc.web.serve.site_peer import SitePeer
from urc.web.sites.door import SiteDoor
from urc.web.sites.gateway import Gateway
from urc.web.sites.member import Member
from urc.web.sites.member_routes import MemberRoutes
from urc.web.sites.refusal_log import RefusalLog
from urc.web.sites.site_client import SiteClient
from urc.web.sites.site_stops import SiteStops
from urc.web.sites.site_watch import SiteWatch
from urc.web.sites.visit_log import VisitLog
from urc.web.sites.visitor_proof import VisitorProofs

__all__ = ["SiteKeys", "SiteNetwork"]


RULES_S: Final = 0.2
"""Interval between two looks at the file of rules, in seconds."""
REFRESH_S: Final = 1.0
"""Interval between checks whether the network uses the current certificate, in seconds."""
LAST_S: Final = 12 * 3600.0
"""Time before the end of a replaced certificate from which open lines delay no refresh, in
seconds."""

log = logging.getLogger(__name__)


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


class SiteNetwork:
    """The fleet, as this server sees it."""

    def __init__(
        self,
        keys: SiteKeys,
        bus: FleetBus,
        *,
        member: Member | None = None,
        utc: Callable[[], float] = time.time,
        version: str = __version__,
    ) -> None:
        """Prepare the network.

        Args:
            keys: the membership of this site.
            bus: the network of the fleet.
            member: the membership, for renewals and revocations; None for fixed certificates.
            utc: UTC time in seconds since 1970.
            version: version of URC at this site.
        """
        self._keys = keys
        self._bus = bus
        self.rules = RulesFile(keys.folder / RULES_FILE)
        """The rules for visitors from other sites."""
        self._visits = VisitLog(utc)
        self._utc = utc
        self.version = version
        self.member = member
        self._refusals = RefusalLog()
        self.door = SiteDoor(keys.server_context, keys.peer, self._refusals)
        self._lines = Lines(bus, self.door.accept)
        self.client = SiteClient(self._lines, keys.client_context, keys.peer)
        self.watch = SiteWatch(self.client, keys.folder, own=(keys.site, version), utc=utc)
        self.stops = SiteStops(self.client)
        self.proofs = VisitorProofs(self, self._visits)
        """Headers that tell other sites who acts."""
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
            replace(assertion, version=self.version),
            issuer=self.site,
            audience=site,
            key_pem=self._keys.key_pem(),
            now=self._utc(),
        )

    def visit(self, peer: SitePeer, text: str) -> Visit:
        """Return the visit in an assertion of another site, with the role that this site grants.

        Raises:
            BadAssertion: the assertion does not count.
            UrcError: the versions of the two sites are too far apart.
        """
        try:
            said = verified_assertion(
                text, issuer=peer.name, audience=self.site, key_pem=peer.key_pem, now=self._utc()
            )
        except BadAssertion as fault:
            self._refusals.tell("a visitor", peer.name, str(fault))
            raise
        if text := version_refusal(peer.name, said.version, self.site, self.version):
            raise UrcError(text)
        kind = cast("Kind", said.kind)
        visit = self._judged(
            Visit(
                *(peer.name, said.principal, said.name, kind, said.sign_in, said.robot),
                role=None,
                place=said.place,
                proposed=said.role,
                id=said.visit,
            )
        )
        self._visits.received(visit)
        return visit

    def _judged(self, visit: Visit) -> Visit:
        """Return a visit with the role that the rules of this site grant now."""
        tags = self._access.tags_of(visit.robot) if self._access is not None else ()
        is_guest = visit.kind == "guest"
        who = Applicant(visit.site, visit.name, is_guest, visit.place, visit.robot, tags)
        found = self.rules.rules.decided(who, visit.proposed, self._utc(), self.site)
        return visit._replace(role=found.role, limit=found.reason)

    def attach(self, access: Access, recorder: ServerRecorder) -> None:
        """Admit visitors to a server.

        Args:
            access: identities and rights of the server.
            recorder: the server's audit log.
        """
        self._access = access
        self._visits.recorder = recorder
        access.site_visitor = self.visit

    def around(self, app: ASGIApp, access: Access) -> ASGIApp:
        """Return the application with robots of other sites."""
        return Gateway(app, self.client, self.proofs, access.followed, self.watch.refusal)

    def routes(self) -> list[ProtectedRoute]:
        """Return the routes about certificates for other sites."""
        return MemberRoutes(self.member).routes() if self.member is not None else []

    async def _follow_rules(self) -> None:
        """Judge all visits again after each change of the rules, and each minute.

        Rules begin and end at full minutes.
        """
        minute = self._utc() // 60
        while True:
            await asyncio.sleep(RULES_S)
            has_changed, before = self.rules.has_changed(), minute
            if has_changed:
                await asyncio.to_thread(self.rules.reread)
            minute = self._utc() // 60
            if has_changed or minute != before:
                self.judge_visits()

    def judge_visits(self) -> None:
        """Grant all visitors the roles of the current rules; robots of refused drivers stop."""
        if self._access is not None:
            for visit in self._access.control.judge_visits(self._judged):
                self._visits.received(visit)

    async def _follow_certificate(self, member: Member) -> None:
        """Let the network use each renewed certificate.

        A refresh ends lines, so it waits for a moment without lines. Before the old certificate
        ends, it no longer waits: other sites could not connect afterwards.
        """
        used = member.certificate
        while True:
            await asyncio.sleep(REFRESH_S)
            current = member.certificate
            is_last = self._utc() > used.ends.timestamp() - LAST_S
            if current.serial == used.serial or (self._lines.count and not is_last):
                continue
            try:
                await self._bus.refresh()
            except BusFailed as fault:
                log.warning("%s", fault)
            else:
                used = current

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
        tasks = [asyncio.create_task(self.watch.run()), asyncio.create_task(self._follow_rules())]
        if self.member is not None:
            tasks.append(asyncio.create_task(self.member.keep(self.client)))
            tasks.append(asyncio.create_task(self._follow_certificate(self.member)))
        try:
            yield
        finally:
            for task in (*tasks, *self._tasks):
                task.cancel()
            await self.stops.close()
            self._lines.close()
            await self._bus.close()
