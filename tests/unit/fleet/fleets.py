"""What the tests of fleets share: a fleet of two sites, each with a data folder of its own."""

from datetime import UTC, datetime
from pathlib import Path

from urc.fleet.authority import FleetAuthority
from urc.fleet.certificates import SiteCertificate
from urc.fleet.files import AUTHORITY_FOLDER
from urc.fleet.invitation import SiteInvitation
from urc.fleet.joining import join, make_fleet
from urc.fleet.membership import Membership

NOW = datetime(2026, 12, 1, 12, tzinfo=UTC)
ADDRESS = "192.168.1.20:7447"


class Place:
    """The authority of a fleet, and the sites that join it."""

    def __init__(self, folder: Path, fleet: str = "mill", now: datetime = NOW) -> None:
        self.folder = folder
        self.office = make_fleet(folder / "office", fleet, "office", now, listen=[ADDRESS])
        self.authority = FleetAuthority.load(folder / "office" / AUTHORITY_FOLDER)

    def invite(self, site: str = "hall", now: datetime = NOW) -> SiteInvitation:
        return self.authority.invite(site, [ADDRESS], now)

    def joined(self, site: str = "hall", now: datetime = NOW) -> Membership:
        """Return a site that has joined, but has not been in contact yet."""
        return join(self.folder / site, self.invite(site, now), now)

    def member(self, site: str = "hall", now: datetime = NOW) -> Membership:
        """Return a site that has joined and used its invitation."""
        return self.renewed(self.joined(site, now), now)

    def renewed(self, site: Membership, now: datetime = NOW) -> Membership:
        return site.renewed(self.authority.renew(site.renewal(), site.certificate, now), now)


def serials(*all_: SiteCertificate) -> frozenset[int]:
    return frozenset(one.serial for one in all_)
