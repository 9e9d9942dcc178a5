"""The membership of a site in a fleet: its certificate, its key, and the addresses of the fleet.

Layer 4. A membership is a folder with `fleet.json`, `root.pem`, `site.pem` and `site.key`.
`next.key` is the key of a pending renewal, and `revoked.json` is the newest known revocation list.
"""

import os
import ssl
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Final, Self

import msgspec
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec

from urc._x509 import common_name, key_pem
from urc.fleet.certificates import (
    CertificateRefused,
    FleetRoot,
    SiteCertificate,
    key_from,
    new_key,
    public_key_of,
)
from urc.fleet.files import locked, read, write
from urc.fleet.names import FleetError, endpoint, site_name
from urc.fleet.revocations import MAX_BYTES, RevocationList
from urc.fleet.tls import site_client_context, site_server_context

__all__ = ["Membership", "NoMembership"]

_FACTS: Final = "fleet.json"
_ROOT: Final = "root.pem"
_CERTIFICATE: Final = "site.pem"
_KEY: Final = "site.key"
_NEXT_KEY: Final = "next.key"
_REVOKED: Final = "revoked.json"
_ATTEMPTS: Final = 3


class NoMembership(FleetError):
    """The folder has no membership; the message is one line."""


class _Facts(msgspec.Struct, forbid_unknown_fields=True):
    fleet: str
    site: str
    authority: str
    listen: list[str] = []
    connect: list[str] = []


@dataclass(frozen=True, slots=True)
class Membership:
    """A site's membership, as it was in its folder when it was loaded."""

    folder: Path
    root: FleetRoot
    authority: str
    """Site of the authority."""
    listen: tuple[str, ...]
    """Zenoh endpoints on which this site accepts other sites."""
    connect: tuple[str, ...]
    """Zenoh endpoints that this site connects to."""
    certificate: SiteCertificate
    key: ec.EllipticCurvePrivateKey = field(repr=False)

    @classmethod
    def load(cls, folder: Path) -> Self:
        """Return the membership in a folder. Times and revocations are not checked: see `check`.

        An interrupted renewal is completed.

        Raises:
            NoMembership: the folder has no membership.
            FleetError: a file is missing, damaged or unreadable, or the files do not match.
        """
        try:
            data = read(folder / _FACTS)
        except FileNotFoundError as error:
            raise NoMembership(
                f"{folder}: this site is in no fleet; join one with 'urc fleet join CODE'"
            ) from error
        try:
            facts = _facts(folder, data)
            root = FleetRoot.parse(read(folder / _ROOT))
            certificate, key = _pair(folder)
        except FileNotFoundError as error:
            name = os.path.basename(error.filename)
            raise FleetError(f"{folder}: {name} is missing; join the fleet again") from error
        except FleetError as error:
            text = str(error)
            where = "" if text.startswith(str(folder)) else f"{folder}: "
            raise FleetError(f"{where}{text}") from error
        if (facts.fleet, facts.site) != (root.fleet, certificate.site):
            raise FleetError(
                f"{folder}: {_FACTS} names fleet {facts.fleet} and site {facts.site}, but the"
                f" certificates are for {root.fleet} and {certificate.site}; join the fleet again"
            )
        listen, connect = tuple(facts.listen), tuple(facts.connect)
        return cls(folder, root, facts.authority, listen, connect, certificate, key)

    @property
    def fleet(self) -> str:
        """Name of the fleet."""
        return self.root.fleet

    @property
    def site(self) -> str:
        """Name of this site."""
        return self.certificate.site

    @property
    def root_file(self) -> Path:
        """File with the fleet's root certificate, in PEM."""
        return self.folder / _ROOT

    @property
    def certificate_file(self) -> Path:
        """File with this site's certificate, in PEM."""
        return self.folder / _CERTIFICATE

    @property
    def key_file(self) -> Path:
        """File with the key of this site's certificate, in PEM."""
        return self.folder / _KEY

    def store(self) -> None:
        """Write the membership to its folder, in place of any other; raise `FleetError`.

        A crash leaves the old membership, the new one, or none.
        """
        try:
            for name in (_FACTS, _NEXT_KEY):
                (self.folder / name).unlink(missing_ok=True)
            if not self._knows_revocations():
                (self.folder / _REVOKED).unlink(missing_ok=True)
        except OSError as error:
            raise FleetError(f"{self.folder}: cannot be written: {error.strerror}") from error
        facts = _Facts(self.fleet, self.site, self.authority, list(self.listen), list(self.connect))
        write(self.root_file, self.root.pem)
        write(self.key_file, key_pem(self.key))
        write(self.certificate_file, self.certificate.pem)
        # Last, because this file marks a complete membership.
        write(self.folder / _FACTS, msgspec.json.format(msgspec.json.encode(facts), indent=2))

    def check(self, now: datetime) -> None:
        """Check that this site's certificate is valid now; raise `CertificateRefused` if not."""
        self._check(self.certificate, now)

    def peer(
        self, certificate: bytes, now: datetime, *, is_renewal: bool = False
    ) -> SiteCertificate:
        """Return the certificate of another site, after a TLS handshake has proven its key.

        Args:
            certificate: the certificate in DER or PEM.
            now: time with a time zone.
            is_renewal: whether the site only renews its certificate, for which the certificate of
                an invitation is good enough.

        Raises:
            CertificateRefused: the certificate is from another fleet, not valid now, revoked, or
                from an invitation.
            FleetError: the data is not the certificate of a site.
        """
        found = SiteCertificate.parse(certificate)
        self._check(found, now)
        if found.is_invitation and not is_renewal:
            raise CertificateRefused(
                f"site {found.site} must first renew the certificate of its invitation"
            )
        return found

    def server_context(self) -> ssl.SSLContext:
        """Return a context for mutual TLS 1.3 that accepts the sites of this fleet.

        Revocations are not checked: pass the certificate of each peer to `peer`.
        """
        return site_server_context(self.root, self.certificate_file, self.key_file)

    def client_context(self, site: str) -> ssl.SSLContext:
        """Return a context for mutual TLS 1.3 that connects to this site of the fleet only."""
        return site_client_context(self.root, self.certificate_file, self.key_file, site_name(site))

    def is_renewal_due(self, now: datetime) -> bool:
        """Return whether the certificate is from an invitation, or half of its time is over."""
        return self.certificate.is_invitation or self.certificate.is_half_over(now)

    def renewal(self) -> bytes:
        """Return a certificate signing request with a fresh key, in PEM.

        The key is stored and used until `renewed`, so that a lost reply can be requested again.
        """
        key = self._pending_key()
        request = x509.CertificateSigningRequestBuilder().subject_name(common_name(self.site))
        signed = request.sign(key, hashes.SHA256())
        return signed.public_bytes(serialization.Encoding.PEM)

    def renewal_key(self) -> ec.EllipticCurvePublicKey:
        """Return the public key of `renewal`, for the authority in the same data folder."""
        return self._pending_key().public_key()

    def renewed(self, chain: bytes, now: datetime) -> Self:
        """Store the authority's reply to `renewal`; return the new membership.

        Args:
            chain: the new certificate in PEM, followed by the root certificate.
            now: time with a time zone.

        Raises:
            FleetError: the certificate is not for this site and the key of `renewal`.
        """
        new = SiteCertificate.parse(chain)
        self.root.check(new, now)
        if new.site != self.site or new.is_invitation:
            raise FleetError(f"expected a certificate for site {self.site}, found {new.site}")
        with locked(self.folder):
            key = self._next_key()
            if key is None or key.public_key() != public_key_of(new.certificate):
                raise FleetError("the new certificate does not match the key of this renewal")
            # After this write, `load` takes the next key if a crash prevents the second step.
            write(self.certificate_file, new.pem)
            _complete(self.folder, new)
        return replace(self, certificate=new, key=key)

    def revocations(self) -> RevocationList:
        """Return the newest known revocation list; raise `FleetError` if it is damaged."""
        try:
            data = read(self.folder / _REVOKED, MAX_BYTES)
        except FileNotFoundError:
            return RevocationList(self.fleet)
        try:
            return RevocationList.verified(data, self.root)
        except FleetError as error:
            file = self.folder / _REVOKED
            raise FleetError(
                f"{file}: {error}; delete the file, and connect to the fleet"
            ) from error

    def signed_revocations(self) -> bytes:
        """Return the newest known revocation list with its signature, or b""."""
        try:
            return read(self.folder / _REVOKED, MAX_BYTES)
        except FileNotFoundError:
            return b""

    def take_revocations(self, signed: bytes) -> bool:
        """Store a signed revocation list if it is newer than the known one; return whether it was.

        Raises:
            FleetError: the list is not from this fleet's authority, or cannot be written.
        """
        new = RevocationList.verified(signed, self.root)
        with locked(self.folder):
            try:
                known = self.revocations().number
            except FleetError:  # a damaged list is replaced
                known = -1
            if new.number <= known:
                return False
            write(self.folder / _REVOKED, signed)
        return True

    def _check(self, certificate: SiteCertificate, now: datetime) -> None:
        self.root.check(certificate, now)
        if self.revocations().revokes(certificate.serial):
            raise CertificateRefused(f"the certificate of site {certificate.site} is revoked")

    def _knows_revocations(self) -> bool:
        """Return whether the folder's revocation list is from this fleet."""
        try:
            self.revocations()
        except FleetError:
            return False
        return True

    def _pending_key(self) -> ec.EllipticCurvePrivateKey:
        with locked(self.folder):
            key = self._next_key()
            if key is None:
                key = new_key()
                write(self.folder / _NEXT_KEY, key_pem(key))
        return key

    def _next_key(self) -> ec.EllipticCurvePrivateKey | None:
        try:
            return key_from(read(self.folder / _NEXT_KEY))
        except FileNotFoundError:
            return None


def _facts(folder: Path, data: bytes) -> _Facts:
    try:
        facts = msgspec.json.decode(data, type=_Facts)
        site_name(facts.authority)
        facts.listen = [*map(endpoint, facts.listen)]
        facts.connect = [*map(endpoint, facts.connect)]
    except (msgspec.DecodeError, ValueError, FleetError) as error:
        raise FleetError(f"{folder / _FACTS}: {error}; correct the file") from error
    return facts


def _pair(folder: Path) -> tuple[SiteCertificate, ec.EllipticCurvePrivateKey]:
    """Return certificate and key, which match even while another process stores new ones."""
    for _ in range(_ATTEMPTS):
        certificate = SiteCertificate.parse(read(folder / _CERTIFICATE))
        key = key_from(read(folder / _KEY))
        if key.public_key() == public_key_of(certificate.certificate):
            return certificate, key
        _complete(folder, certificate)
    raise FleetError(
        f"{folder}: {_KEY} does not match {_CERTIFICATE}; restore a backup, or join the fleet again"
    )


def _complete(folder: Path, certificate: SiteCertificate) -> None:
    """Make the key of the renewal the site's key, if it is the key of this certificate."""
    with suppress(FileNotFoundError):  # another process was faster
        key = key_from(read(folder / _NEXT_KEY))
        if key.public_key() == public_key_of(certificate.certificate):
            os.replace(folder / _NEXT_KEY, folder / _KEY)
