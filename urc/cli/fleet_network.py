"""The network of the fleet for `urc serve --fleet`, from the membership in the data folder.

Layer 6.
"""

from datetime import UTC, datetime
from pathlib import Path

from urc.cli.output import complain
from urc.fleet.certificates import CertificateRefused
from urc.fleet.files import FLEET_FOLDER
from urc.fleet.membership import Membership
from urc.fleet.zenoh_bus import BusOptions, ZenohBus
from urc.web.sites.member import Member
from urc.web.sites.site_network import SiteNetwork

__all__ = ["network_of"]


def network_of(data: Path) -> SiteNetwork:
    """Return the network of the fleet that the server with this data folder belongs to.

    A certificate that is not valid now is reported; the robots of this site are served all the
    same.

    Raises:
        FleetError: the data folder has no membership, or its files are damaged.
    """
    membership = Membership.load(data / FLEET_FOLDER)
    try:
        membership.check(datetime.now(UTC))
    except CertificateRefused as fault:
        complain(f"urc serve: other sites will refuse this site: {fault}")
    bus = ZenohBus(
        BusOptions(
            membership.fleet,
            membership.site,
            membership.listen,
            membership.connect,
            membership.root_file,
            membership.certificate_file,
            membership.key_file,
        )
    )
    member = Member(membership)
    return SiteNetwork(member, bus, member=member)
