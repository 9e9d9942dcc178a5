"""Making a fleet, and joining one.

Layer 4.
"""

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from urc.fleet.authority import FleetAuthority
from urc.fleet.certificates import FleetRoot, SiteCertificate, new_key
from urc.fleet.files import AUTHORITY_FOLDER
from urc.fleet.invitation import SiteInvitation
from urc.fleet.membership import Membership, NoMembership
from urc.fleet.names import FleetError, endpoint, fleet_name, site_name

__all__ = ["join", "make_fleet", "renew_own"]


def make_fleet(
    folder: Path, fleet: str, site: str, now: datetime, *, listen: Sequence[str] = ()
) -> Membership:
    """Make a fleet with its authority, and the membership of the authority's site.

    Args:
        folder: folder of the membership; it is created if it is missing.
        fleet: name of the fleet.
        site: name of the authority's site.
        now: time with a time zone.
        listen: addresses ``HOST:PORT`` on which the site accepts other sites.

    Raises:
        FleetError: a name or address is invalid, or the folder has an authority or a membership.
    """
    fleet, site, endpoints = fleet_name(fleet), site_name(site), tuple(map(endpoint, listen))
    existing = _existing(folder)
    if existing is not None:
        raise FleetError(
            f"{folder}: this site already is {existing.site} of fleet {existing.fleet}; select"
            " another data folder with --data-dir"
        )
    authority = _authority(folder / AUTHORITY_FOLDER, fleet, site, now)
    key = new_key()
    certificate = SiteCertificate.parse(authority.enrol(key.public_key(), now))
    made = Membership(folder, authority.root, site, endpoints, (), certificate, key)
    made.store()
    return made


def join(
    folder: Path,
    invitation: SiteInvitation,
    now: datetime,
    *,
    listen: Sequence[str] = (),
    replace: bool = False,
) -> Membership:
    """Make the membership of an invited site. The site renews its certificate at first contact.

    The code of an earlier invitation changes nothing: it would replace a newer certificate.

    Args:
        folder: folder of the membership; it is created if it is missing.
        invitation: the invitation.
        now: time with a time zone.
        listen: addresses ``HOST:PORT`` on which the site accepts other sites.
        replace: whether to replace the membership in another fleet, or of another site.

    Raises:
        CertificateRefused: the invitation has ended, is not valid yet, or is not from its fleet.
        FleetError: the folder has an authority, another membership or a damaged one.
    """
    endpoints = tuple(map(endpoint, listen))
    invitation.root.check(invitation.certificate, now)
    if FleetAuthority.is_in(folder / AUTHORITY_FOLDER):
        raise FleetError(
            f"{folder}: this folder has the authority of a fleet, which cannot join another one;"
            " select another data folder with --data-dir"
        )
    existing = None if replace else _existing(folder)
    if existing is not None:
        if (existing.root, existing.site) != (invitation.root, invitation.certificate.site):
            raise FleetError(
                f"{folder}: this site already is {existing.site} of fleet {existing.fleet}; use"
                " --replace to leave that fleet"
            )
        if existing.certificate.starts >= invitation.certificate.starts:
            return existing
    made = Membership(
        folder, invitation.root, invitation.authority, endpoints, invitation.connect,
        invitation.certificate, invitation.key,
    )  # fmt: skip
    made.store()
    return made


def renew_own(authority: FleetAuthority, membership: Membership, now: datetime) -> Membership:
    """Return the membership of the authority's site, with a renewed certificate if it is due.

    This works even if the old certificate has ended, for example after a long time without power.
    """
    if not membership.is_renewal_due(now):
        return membership
    return membership.renewed(authority.enrol(membership.renewal_key(), now), now)


def _authority(folder: Path, fleet: str, site: str, now: datetime) -> FleetAuthority:
    """Return a new authority, or the one that an interrupted `make_fleet` has left."""
    if not FleetAuthority.is_in(folder):
        key = new_key()
        return FleetAuthority.make(folder, FleetRoot.make(fleet, key, now), key, site)
    found = FleetAuthority.load(folder)
    if (found.root.fleet, found.site) != (fleet, site):
        raise FleetError(
            f"{folder}: this folder already has the authority of fleet {found.root.fleet} with site"
            f" {found.site}; select another data folder with --data-dir"
        )
    return found


def _existing(folder: Path) -> Membership | None:
    try:
        return Membership.load(folder)
    except NoMembership:
        return None
    except FleetError as error:
        raise FleetError(f"{error}, with --replace") from error
