"""The membership of this server while it runs: its certificates, their renewal, and revocations.

Layer 5. The site of the authority renews the certificates of all sites. Every site checks the
certificate of its peer against the newest known revocation list.
"""

import asyncio
import logging
import ssl
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from urc._x509 import key_pem
from urc.fleet.authority import FleetAuthority
from urc.fleet.certificates import SiteCertificate
from urc.fleet.files import AUTHORITY_FOLDER
from urc.fleet.joining import renew_own
from urc.fleet.membership import Membership
from urc.fleet.names import FleetError
from urc.fleet.reach import reach_faults
from urc.fleet.revocations import RevocationList
from urc.web.serve.site_peer import CERTIFICATE, SitePeer, site_of
from urc.web.sites.site_client import SiteClient, SiteFailed

__all__ = ["REVOCATIONS", "Member"]

REVOCATIONS: Final = "/fleet/revocations"
_LOOK_S: Final = 0.1
"""Interval between checks of the authority's revocation list, in seconds."""
_RENEW_S: Final = 10.0
"""Interval between attempts to renew the certificate, in seconds."""
_WRONG_CLOCK_S: Final = 3600.0
"""The same if the new certificate is old already, in seconds."""
_AHEAD: Final = (
    "the new certificate of this site is half over already: this clock is days ahead of the"
    " authority's clock; set the wrong clock"
)
_ALONE_S: Final = 5.0
"""Interval between checks whether this site has reached its fleet, in seconds."""

log = logging.getLogger(__name__)


class Member:
    """This server as a member of its fleet."""

    def __init__(
        self, membership: Membership, utc: Callable[[], datetime] = lambda: datetime.now(UTC)
    ) -> None:
        """Load the authority too, if this is its site.

        Raises:
            FleetError: the authority's files are damaged.
        """
        self._membership = membership
        self._utc = utc
        folder = membership.folder / AUTHORITY_FOLDER
        self._authority = FleetAuthority.load(folder) if FleetAuthority.is_in(folder) else None
        self._server: tuple[int, ssl.SSLContext] | None = None
        self._clients: dict[tuple[str, int], ssl.SSLContext] = {}
        self._revoked = membership.revocations()
        self._news = asyncio.Event()
        self.on_revoked: Callable[[frozenset[str]], None] = _ignore
        """Callback with the sites of a new revocation list."""

    @property
    def site(self) -> str:
        """Name of this site."""
        return self._membership.site

    @property
    def folder(self) -> Path:
        """Folder of the membership."""
        return self._membership.folder

    @property
    def certificate(self) -> SiteCertificate:
        """The current certificate of this site."""
        return self._membership.certificate

    @property
    def number(self) -> int:
        """Number of the newest known revocation list."""
        return self._revoked.number

    def server_context(self) -> ssl.SSLContext:
        """Return mutual TLS for lines from other sites, with the current certificate."""
        serial = self._membership.certificate.serial
        if self._server is None or self._server[0] != serial:
            self._server = (serial, self._membership.server_context())
        return self._server[1]

    def client_context(self, site: str) -> ssl.SSLContext:
        """Return mutual TLS for lines to a site, with the current certificate."""
        key = (site, self._membership.certificate.serial)
        context = self._clients.get(key)
        if context is None:
            self._clients = {one: kept for one, kept in self._clients.items() if one[1] == key[1]}
            context = self._clients[key] = self._membership.client_context(site)
        return context

    def key_pem(self) -> bytes:
        """Return the private key of the current certificate."""
        return key_pem(self._membership.key)

    def peer(self, certificate_der: bytes) -> SitePeer:
        """Return the site of a certificate that TLS has proven.

        Raises:
            FleetError: the certificate is not valid now, or is revoked.
        """
        found = SiteCertificate.parse(certificate_der)
        self._membership.root.check(found, self._utc())
        if self._revoked.revokes(found.serial):
            raise FleetError(f"the certificate of site {found.site} is revoked")
        return site_of(certificate_der)

    def renewed_for(self, csr_pem: bytes, peer: SitePeer) -> bytes:
        """Return a new certificate for another site, in PEM, with its chain.

        Raises:
            FleetError: this is not the authority's site, or the request is refused.
        """
        if self._authority is None:
            text = f"the authority of the fleet is at the site {self._membership.authority}"
            raise FleetError(f"{text}, not at {self.site}")
        old = SiteCertificate.parse(peer.certificate_der)
        return self._authority.renew(csr_pem, old, self._utc())

    def signed_revocations(self) -> bytes:
        """Return the newest known list as signed by the authority, or b""."""
        if self._authority is not None:
            return self._authority.signed_revocations()
        return self._membership.signed_revocations()

    def take_revocations(self, signed: bytes) -> bool:
        """Store a newer list, and report its sites; return whether it was newer.

        Raises:
            FleetError: the list is not from this fleet's authority.
        """
        newest = RevocationList.verified(signed, self._membership.root)
        try:
            if self._authority is not None:  # after the restore of a backup, sites know more
                self._authority.merge_revocations(signed)
            self._membership.take_revocations(signed)
            newest = self._membership.revocations()  # another process may have stored a newer list
        except FleetError as fault:  # such as a full disk: the list counts all the same
            log.warning("the revocation list is lost when this server ends: %s", fault)
        if newest.number <= self._revoked.number:
            return False
        self._revoked = newest
        self.on_revoked(frozenset(self._revoked.serials))
        return True

    async def keep(self, client: SiteClient) -> None:
        """Renew the certificate when it is due, and spread revocations, until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._keep_certificate(client))
            group.create_task(self._explain(client))
            if self._authority is not None:
                group.create_task(self._spread(client, self._authority))

    def sites_changed(self) -> None:
        """Try a due renewal again, because the authority's site may have appeared."""
        self._news.set()

    async def exchange(self, client: SiteClient, site: str) -> None:
        """Compare revocation lists with a site that has appeared; the newer list wins at both."""
        try:
            async with client.request(site, "GET", REVOCATIONS, lane="control") as response:
                theirs = await response.whole()
            if response.status == 200 and theirs:
                await asyncio.to_thread(self.take_revocations, theirs)
            await self._send(client, site, self.signed_revocations())
        except (SiteFailed, FleetError) as fault:
            log.info("%s", fault)

    async def _send(self, client: SiteClient, site: str, signed: bytes) -> None:
        if not signed:
            return
        asking = client.request(site, "POST", REVOCATIONS, _BYTES, signed, lane="control")
        try:
            async with asking as response:
                await response.whole()
        except SiteFailed as fault:
            log.info("%s", fault)

    async def _spread(self, client: SiteClient, authority: FleetAuthority) -> None:
        """Send each new list to all present sites; another process writes the list."""
        seen = (0, 0)
        while True:
            stamp = _stamp(authority.revocations_file)
            if stamp != seen:
                seen = stamp
                try:
                    signed = await asyncio.to_thread(authority.signed_revocations)
                    is_newer = self.take_revocations(signed)
                except FleetError as fault:
                    log.warning("%s", fault)
                    continue
                if is_newer:
                    await asyncio.gather(
                        *(self._send(client, site, signed) for site in client.sites)
                    )
            await asyncio.sleep(_LOOK_S)

    async def _explain(self, client: SiteClient) -> None:
        """Log why this site reaches no other site, and log each new reason."""
        told: list[str] = []
        while True:
            await asyncio.sleep(_ALONE_S)
            if client.sites:
                told = []
                continue
            found = await asyncio.to_thread(list, reach_faults(self._membership, self._utc()))
            if found != told and not client.sites:
                for fault in found:
                    log.warning("the fleet cannot be reached at %s", fault)
                told = found

    async def _keep_certificate(self, client: SiteClient) -> None:
        while True:
            pause_s = _RENEW_S
            if self._membership.is_renewal_due(self._utc()):
                try:
                    await self._renew(client)
                except (SiteFailed, FleetError) as fault:
                    # An absent authority is ordinary; a refusal needs the maintainer.
                    is_refused = self._membership.authority in client.sites
                    level = logging.WARNING if is_refused else logging.INFO
                    log.log(level, "the certificate of this site was not renewed: %s", fault)
                else:
                    if self._membership.is_renewal_due(self._utc()):
                        pause_s = _WRONG_CLOCK_S
                        log.warning("%s", _AHEAD)
            self._news.clear()
            with suppress(TimeoutError):
                async with asyncio.timeout(pause_s):
                    await self._news.wait()

    async def _renew(self, client: SiteClient) -> None:
        now = self._utc()
        if self._authority is not None:
            self._membership = await asyncio.to_thread(
                renew_own, self._authority, self._membership, now
            )
            return
        site = self._membership.authority
        csr = await asyncio.to_thread(self._membership.renewal)
        asking = client.request(site, "POST", CERTIFICATE, _BYTES, csr, lane="control")
        async with asking as response:
            body = await response.whole()
        if response.status != 200:
            said = body.decode("utf-8", "replace")[:300]
            raise SiteFailed(f"the site {site} refuses the renewal: {said}")
        self._membership = await asyncio.to_thread(self._membership.renewed, body, now)
        log.info("the certificate of this site was renewed")


_BYTES: Final = ((b"content-type", b"application/octet-stream"),)


def _stamp(file: Path) -> tuple[int, int]:
    try:
        found = file.stat()
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_ino


def _ignore(sites: frozenset[str]) -> None:
    """Ignore a list; the default callback."""
