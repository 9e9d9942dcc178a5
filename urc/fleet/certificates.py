"""Certificates of a fleet: its root, and the certificates that the root issues to sites.

Layer 4. Pure, except for random numbers. The common name of the root is the fleet's name. The
common name and the only DNS name of a site's certificate are the site's name. All keys are P-256.
"""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Final, Self

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from urc._x509 import common_name, is_signed_by, key_usage
from urc.fleet.names import FleetError, fleet_name, site_name

__all__ = [
    "CLOCKS_DIFFER", "INVITATION_LASTS", "ROOT_LASTS", "SITE_LASTS", "CertificateRefused",
    "FleetRoot", "SiteCertificate", "certificate_pem", "duration", "key_from", "new_key",
    "public_key_of",
]  # fmt: skip

ROOT_LASTS: Final = timedelta(days=3650)
SITE_LASTS: Final = timedelta(days=7)
INVITATION_LASTS: Final = timedelta(hours=24)
CLOCKS_DIFFER: Final = timedelta(minutes=10)
"""Accepted delay of a site's clock: each certificate begins this much earlier."""
_INVITATION: Final = "invitation"
"""Organizational unit in the subject of an invitation's certificate."""
_DAY: Final = timedelta(days=1)


class CertificateRefused(FleetError):
    """A certificate is not valid in this fleet at this time; the message is one line."""


@dataclass(frozen=True, slots=True)
class SiteCertificate:
    """The certificate of a site."""

    certificate: x509.Certificate
    site: str
    is_invitation: bool
    """Whether the certificate is part of an invitation: valid only for the first renewal."""

    @classmethod
    def parse(cls, data: bytes) -> Self:
        """Return the first certificate in `data`, which is in PEM or DER.

        Raises:
            FleetError: the data is not the certificate of a site.
        """
        found = _loaded(data)
        site = site_name(_text(found.subject, NameOID.COMMON_NAME))
        unit = _text(found.subject, NameOID.ORGANIZATIONAL_UNIT_NAME)
        try:
            names = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        except (x509.ExtensionNotFound, x509.DuplicateExtension, ValueError) as error:
            raise FleetError("expected the certificate of a site, with one DNS name") from error
        if [*names] != [x509.DNSName(site)]:
            raise FleetError(f"expected a certificate with the one DNS name {site}")
        public_key_of(found)
        return cls(found, site, unit == _INVITATION)

    @property
    def serial(self) -> int:
        """Serial number."""
        return self.certificate.serial_number

    @property
    def starts(self) -> datetime:
        """First valid time."""
        return self.certificate.not_valid_before_utc

    @property
    def ends(self) -> datetime:
        """Last valid time."""
        return self.certificate.not_valid_after_utc

    @property
    def pem(self) -> bytes:
        """The certificate in PEM, without the root."""
        return certificate_pem(self.certificate)

    def is_half_over(self, now: datetime) -> bool:
        """Return whether half of the certificate's time is over, so that a renewal is due."""
        return now >= self.starts + (self.ends - self.starts) / 2


@dataclass(frozen=True, slots=True)
class FleetRoot:
    """The root certificate of a fleet."""

    certificate: x509.Certificate
    fleet: str

    @classmethod
    def parse(cls, data: bytes) -> Self:
        """Return a root certificate from PEM or DER.

        Raises:
            FleetError: the data is not the root certificate of a fleet.
        """
        found = _loaded(data)
        if not is_signed_by(found, found):
            raise FleetError("expected a root certificate, signed by its own key")
        public_key_of(found)
        return cls(found, fleet_name(_text(found.subject, NameOID.COMMON_NAME)))

    @classmethod
    def make(cls, fleet: str, key: ec.EllipticCurvePrivateKey, now: datetime) -> Self:
        """Return a new root certificate, valid for 10 years."""
        made = (
            _builder(common_name(fleet), key.public_key(), now, ROOT_LASTS)
            .issuer_name(common_name(fleet))
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(key_usage(is_authority=True), critical=True)
            .sign(key, hashes.SHA256())
        )
        return cls(made, fleet)

    @property
    def ends(self) -> datetime:
        """Last valid time of the root certificate, and of all certificates that it issues."""
        return self.certificate.not_valid_after_utc

    @property
    def pem(self) -> bytes:
        """The root certificate in PEM."""
        return certificate_pem(self.certificate)

    def issue(
        self,
        site: str,
        public_key: ec.EllipticCurvePublicKey,
        key: ec.EllipticCurvePrivateKey,
        now: datetime,
        *,
        is_invitation: bool = False,
    ) -> SiteCertificate:
        """Return a new certificate of a site, signed with the root's `key`.

        The certificate is valid for `SITE_LASTS`, or for `INVITATION_LASTS` in an invitation.

        Raises:
            FleetError: the clock shows a time before the root certificate, or after its end.
        """
        starts = self.certificate.not_valid_before_utc
        if not starts <= now < self.ends:
            raise FleetError(
                f"the clock of this computer shows {now:%Y-%m-%d %H:%M} UTC, but fleet {self.fleet}"
                f" lasts from {starts:%Y-%m-%d} to {self.ends:%Y-%m-%d}; set the clock, or make a"
                " new fleet"
            )
        subject = common_name(site)
        if is_invitation:
            unit = x509.NameAttribute(NameOID.ORGANIZATIONAL_UNIT_NAME, _INVITATION)
            subject = x509.Name([*subject, unit])
        uses = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
        lasts = INVITATION_LASTS if is_invitation else SITE_LASTS
        made = (
            _builder(subject, public_key, now, min(lasts, self.ends - now))
            .issuer_name(self.certificate.subject)
            .add_extension(x509.SubjectAlternativeName([x509.DNSName(site)]), critical=False)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(key_usage(is_authority=False), critical=True)
            .add_extension(x509.ExtendedKeyUsage(uses), critical=False)
            .add_extension(
                x509.AuthorityKeyIdentifier.from_issuer_public_key(key.public_key()),
                critical=False,
            )
            .sign(key, hashes.SHA256())
        )
        return SiteCertificate(made, site, is_invitation)

    def check(self, certificate: SiteCertificate, now: datetime) -> None:
        """Check that this root has issued the certificate, and that it is valid at `now`.

        Raises:
            CertificateRefused: it is from another fleet, has ended, or is not valid yet.
        """
        if not is_signed_by(certificate.certificate, self.certificate):
            raise CertificateRefused(
                f"the certificate of site {certificate.site} is not from fleet {self.fleet}"
            )
        what = "invitation" if certificate.is_invitation else "certificate"
        if now < certificate.starts:
            raise CertificateRefused(
                f"the {what} of site {certificate.site} is not valid yet: the clock of this"
                f" computer is at least {duration(certificate.starts - now)} behind; set the clock"
            )
        if now > self.ends:
            raise CertificateRefused(
                f"the root certificate of fleet {self.fleet} ended {duration(now - self.ends)} ago,"
                " or the clock of this computer is ahead; make a new fleet"
            )
        if now > certificate.ends:
            raise CertificateRefused(
                f"the {what} of site {certificate.site} ended {duration(now - certificate.ends)}"
                " ago, or the clock of this computer is ahead"
            )


def new_key() -> ec.EllipticCurvePrivateKey:
    """Return a new P-256 key."""
    return ec.generate_private_key(ec.SECP256R1())


def key_from(pem: bytes) -> ec.EllipticCurvePrivateKey:
    """Return the private key in a PEM file.

    Raises:
        FleetError: the data is not a P-256 key without a passphrase.
    """
    try:
        key = serialization.load_pem_private_key(pem, password=None)
    except (ValueError, TypeError) as error:
        raise FleetError("expected a private key in PEM, without a passphrase") from error
    if not isinstance(key, ec.EllipticCurvePrivateKey) or not _is_p256(key):
        raise FleetError("expected a P-256 key")
    return key


def public_key_of(
    signed: x509.Certificate | x509.CertificateSigningRequest,
) -> ec.EllipticCurvePublicKey:
    """Return the public key of a certificate or request; raise `FleetError` if it is not P-256."""
    try:
        key = signed.public_key()
    except Exception as error:  # `cryptography` raises several classes for damaged keys
        raise FleetError("expected a P-256 key") from error
    if not isinstance(key, ec.EllipticCurvePublicKey) or not _is_p256(key):
        raise FleetError("expected a P-256 key")
    return key


def certificate_pem(certificate: x509.Certificate) -> bytes:
    """Return a certificate in PEM."""
    return certificate.public_bytes(serialization.Encoding.PEM)


def duration(span: timedelta) -> str:
    """Return a duration in words, such as ``3 days``, ``5 hours`` or ``1 minute``."""
    for unit, length in (("day", _DAY), ("hour", _DAY / 24)):
        if span >= 2 * length:
            return f"{span // length} {unit}s"
    minutes = max(1, round(span / timedelta(minutes=1)))
    return f"{minutes} minute{'s' if minutes > 1 else ''}"


def _loaded(data: bytes) -> x509.Certificate:
    load: Callable[[bytes], x509.Certificate] = x509.load_der_x509_certificate
    if data.lstrip().startswith(b"-----"):
        load = x509.load_pem_x509_certificate
    try:
        return load(data)
    except ValueError as error:
        raise FleetError("expected a certificate in PEM or DER") from error


def _text(subject: x509.Name, kind: x509.ObjectIdentifier) -> str:
    found = subject.get_attributes_for_oid(kind)
    value = found[0].value if len(found) == 1 else ""
    return value if isinstance(value, str) else ""


def _is_p256(key: ec.EllipticCurvePrivateKey | ec.EllipticCurvePublicKey) -> bool:
    return isinstance(key.curve, ec.SECP256R1)


def _builder(
    subject: x509.Name, key: ec.EllipticCurvePublicKey, now: datetime, lasts: timedelta
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - CLOCKS_DIFFER)
        .not_valid_after(now + lasts)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key), critical=False)
    )
