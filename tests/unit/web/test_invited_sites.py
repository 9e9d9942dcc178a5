"""A site whose certificate is from an invitation may only renew it: nobody acts from there."""

from pathlib import Path

from cryptography.hazmat.primitives.serialization import Encoding

from tests.unit.fleet.fleets import Place
from urc.access.visits import Visit
from urc.fleet.assertion import SCHEME
from urc.fleet.membership import Membership
from urc.web.serve.access import Access
from urc.web.serve.site_peer import CERTIFICATE, SitePeer, site_of

HEADERS = [(b"authorization", f"{SCHEME} text".encode())]


def peer_of(site: Membership) -> SitePeer:
    return site_of(site.certificate.certificate.public_bytes(Encoding.DER))


def test_nobody_acts_from_a_site_that_has_not_used_its_invitation(tmp_path: Path) -> None:
    """A copied code would otherwise drive robots for a day."""
    place = Place(tmp_path)
    invited = place.joined()
    access = Access()
    access.site_visitor = lambda peer, _: Visit(
        peer.name, "p1", "Ann", "person", "s1", "cart", "drive"
    )
    visitor, refused = access.visitor_from(peer_of(invited), HEADERS, "/api/v1/robots")
    assert refused == "site hall must first renew the certificate of its invitation"
    assert visitor.role("cart") is None
    visitor, refused = access.visitor_from(peer_of(invited), HEADERS, CERTIFICATE)
    assert refused == ""
    assert visitor.role("cart") is None
    visitor, refused = access.visitor_from(
        peer_of(place.renewed(invited)), HEADERS, "/api/v1/robots"
    )
    assert refused == ""
    assert visitor.role("cart") == "drive"
