"""Another site at the end of a connection, as proven by its certificate.

Layer 5. Pure.
"""

from typing import Final, NamedTuple

from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

from urc.fleet.certificates import SiteCertificate, public_key_of

__all__ = ["CERTIFICATE", "SitePeer", "site_of"]

CERTIFICATE: Final = "/fleet/certificate"
"""Path at which a site renews its certificate."""


class SitePeer(NamedTuple):
    """Another site, whose certificate has been checked."""

    name: str
    serial: int
    """Serial number of the certificate."""
    key_pem: bytes
    """Public key of the certificate, in PEM format."""
    certificate_der: bytes
    is_invitation: bool = False
    """Whether the certificate is from an invitation: good for its renewal only."""

    def refusal(self, path: str = "") -> str:
        """Return why the site may not send a request to a path; "" if it may. "" is any path."""
        if self.is_invitation and path != CERTIFICATE:
            return f"site {self.name} must first renew the certificate of its invitation"
        return ""


def site_of(certificate_der: bytes) -> SitePeer:
    """Return the site that a checked certificate names.

    Raises:
        FleetError: the certificate is not the certificate of a site.
    """
    found = SiteCertificate.parse(certificate_der)
    key = public_key_of(found.certificate)
    pem = key.public_bytes(Encoding.PEM, PublicFormat.SubjectPublicKeyInfo)
    return SitePeer(found.site, found.serial, pem, certificate_der, found.is_invitation)
