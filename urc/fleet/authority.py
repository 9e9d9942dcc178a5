"""The authority of a fleet: issues, renews and revokes the certificates of sites.

Layer 4. `FleetAuthority` is a folder with the root key. A running server and commands may use the
folder at the same time: each change reads and writes the files under a lock.
"""

import hashlib
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Final, Self

from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec

from urc._x509 import key_pem
from urc.fleet.certificates import (
    CertificateRefused,
    FleetRoot,
    SiteCertificate,
    key_from,
    new_key,
    public_key_of,
)
from urc.fleet.files import locked, read, write
from urc.fleet.invitation import MAX_ADDRESSES, SiteInvitation
from urc.fleet.ledger import Ledger, LedgerEntry
from urc.fleet.names import FleetError, endpoint, site_name
from urc.fleet.revocations import MAX_BYTES, RevocationList

__all__ = ["FleetAuthority"]

_ROOT: Final = "root.pem"
_KEY: Final = "root.key"
_LEDGER: Final = "issued.json"
_REVOKED: Final = "revoked.json"
_LEDGER_BYTES: Final = 1 << 24


@dataclass(frozen=True, slots=True)
class FleetAuthority:
    """The authority of one fleet, in one folder that only its owner can read."""

    folder: Path
    root: FleetRoot
    site: str
    """Site of the authority."""
    _key: ec.EllipticCurvePrivateKey = field(repr=False)

    @classmethod
    def make(
        cls, folder: Path, root: FleetRoot, key: ec.EllipticCurvePrivateKey, site: str
    ) -> Self:
        """Store a new authority.

        Args:
            folder: folder without an authority; it is created if it is missing.
            root: root certificate.
            key: key of the root certificate.
            site: name of the authority's site.

        Raises:
            FleetError: the folder already has an authority, or cannot be written.
        """
        if cls.is_in(folder):
            raise FleetError(f"{folder}: this folder already has the authority of a fleet")
        write(folder / _ROOT, root.pem)
        write(folder / _LEDGER, Ledger(site_name(site)).to_bytes())
        write(folder / _REVOKED, RevocationList(root.fleet).signed(key))
        write(folder / _KEY, key_pem(key))  # last, because its existence marks a complete folder
        return cls(folder, root, site, key)

    @staticmethod
    def is_in(folder: Path) -> bool:
        """Return whether the folder has a complete authority."""
        return os.path.exists(folder / _KEY)  # also False without the right to look

    @classmethod
    def load(cls, folder: Path) -> Self:
        """Return the authority in a folder.

        Raises:
            FleetError: the folder has no authority, or a damaged one.
        """
        try:
            key = key_from(read(folder / _KEY))
            root = FleetRoot.parse(read(folder / _ROOT))
            site = site_name(Ledger.parse(read(folder / _LEDGER, _LEDGER_BYTES)).authority)
        except FileNotFoundError as error:
            raise FleetError(
                f"{folder}: this folder has no authority; run the command on the authority's"
                " computer, or make a fleet with 'urc fleet init'"
            ) from error
        except FleetError as error:
            raise FleetError(f"{folder}: {error}") from error
        if key.public_key() != public_key_of(root.certificate):
            raise FleetError(f"{folder}: {_KEY} does not match {_ROOT}; restore a backup")
        return cls(folder, root, site, key)

    def invite(self, site: str, addresses: Iterable[str], now: datetime) -> SiteInvitation:
        """Return an invitation for a site; earlier unused invitations of the site become invalid.

        Args:
            site: name of the new site.
            addresses: addresses ``HOST:PORT`` of the authority's site.
            now: time with a time zone.

        Raises:
            FleetError: a name or address is invalid, or the site already is a member.
        """
        endpoints = tuple(dict.fromkeys(map(endpoint, addresses)))
        if len(endpoints) > MAX_ADDRESSES:
            raise FleetError(f"expected at most {MAX_ADDRESSES} addresses, found {len(endpoints)}")
        site = site_name(site)
        with locked(self.folder):
            ledger, revoked = self._ledger(), self.revocations()
            member = next(
                (one for one in ledger.of_site(site) if _is_member(one, revoked, now)), None
            )
            if site == self.site or member is not None:
                raise FleetError(
                    f"site {site} already is a member of fleet {self.root.fleet}; choose another"
                    f" name, or run 'urc fleet revoke {site}' first"
                )
            key = new_key()
            certificate = self.root.issue(
                site, key.public_key(), self._key, now, is_invitation=True
            )
            ledger.withdraw_invitations(site)
            ledger.add(certificate, now)
            write(self.folder / _LEDGER, ledger.to_bytes())
        return SiteInvitation(self.root, self.site, endpoints, certificate, key)

    def enrol(self, public_key: ec.EllipticCurvePublicKey, now: datetime) -> bytes:
        """Return the first certificate of the authority's own site, in PEM with the root."""
        with locked(self.folder):
            return self._issued(self._ledger(), self.site, public_key, now)

    def renew(self, csr_pem: bytes, old: SiteCertificate, now: datetime) -> bytes:
        """Return a new certificate of a site, in PEM, followed by the root certificate.

        The caller has checked that the sender has the key of `old`: by mutual TLS. An invitation is
        accepted for one key only, so a lost reply can be repeated, but a copied code fails.

        Args:
            csr_pem: certificate signing request (PKCS #10) in PEM, with a fresh key.
            old: the sender's certificate.
            now: time with a time zone.

        Raises:
            CertificateRefused: `old` is from another fleet, has ended, is revoked, or is an
                invitation that was used before.
            FleetError: the request is damaged, or is for another name.
        """
        csr = _request(csr_pem, old)
        self.root.check(old, now)
        key = public_key_of(csr)
        with locked(self.folder):
            if self.revocations().revokes(old.serial):
                raise CertificateRefused(f"the certificate of site {old.site} is revoked")
            ledger = self._ledger()
            ledger.add(old, now)  # after the restore of a backup, `old` may be unknown
            if old.is_invitation:
                _use(ledger.entry(old), old.site, _hash_of(key))
            return self._issued(ledger, old.site, key, now)

    def revoke(self, site: str, now: datetime) -> RevocationList:
        """Revoke all certificates and invitations of a site; return the new list.

        Raises:
            FleetError: the site is unknown, or is the authority itself.
        """
        site = site_name(site)
        if site == self.site:
            raise FleetError(f"site {site} is the authority itself, which cannot be revoked")
        with locked(self.folder):
            ledger, old = self._ledger(), self.revocations()
            serials = frozenset(int(one.serial, 16) for one in ledger.of_site(site))
            if not serials and site not in old.serials:
                known = sorted({one.site for one in ledger.entries} - {self.site})
                raise FleetError(
                    f"fleet {self.root.fleet} has no site {site};"
                    f" known sites: {', '.join(known) or 'none'}"
                )
            new = old.revoking(site, serials)
            if new is not old:
                write(self.folder / _REVOKED, new.signed(self._key))
        return new

    def merge_revocations(self, signed: bytes) -> bool:
        """Add the revocations of a list that a site knows; return whether any was new.

        After the restore of a backup, the sites know more than their authority.

        Raises:
            FleetError: the list is damaged, or not signed by this authority.
        """
        theirs = RevocationList.verified(signed, self.root)
        with locked(self.folder):
            own = self.revocations()
            merged = own.merged(theirs)
            if merged is own:
                return False
            write(self.folder / _REVOKED, merged.signed(self._key))
        return True

    def revocations(self) -> RevocationList:
        """Return the current revocation list; raise `FleetError` if it is missing or damaged."""
        return RevocationList.verified(self.signed_revocations(), self.root)

    @property
    def revocations_file(self) -> Path:
        """File of the current revocation list, which `revoke` replaces."""
        return self.folder / _REVOKED

    def signed_revocations(self) -> bytes:
        """Return the current revocation list with its signature, for other sites."""
        return self._file(_REVOKED, MAX_BYTES)

    def _issued(
        self, ledger: Ledger, site: str, key: ec.EllipticCurvePublicKey, now: datetime
    ) -> bytes:
        certificate = self.root.issue(site, key, self._key, now)
        ledger.add(certificate, now)
        # Written before the certificate is handed over: each certificate can be revoked.
        write(self.folder / _LEDGER, ledger.to_bytes())
        return certificate.pem + self.root.pem

    def _ledger(self) -> Ledger:
        try:
            return Ledger.parse(self._file(_LEDGER, _LEDGER_BYTES))
        except FleetError as error:
            raise FleetError(f"{self.folder / _LEDGER}: {error}") from error

    def _file(self, name: str, at_most: int) -> bytes:
        try:
            return read(self.folder / name, at_most)
        except FileNotFoundError as error:
            raise FleetError(f"{self.folder / name}: missing; restore it from a backup") from error


def _is_member(entry: LedgerEntry, revoked: RevocationList, now: datetime) -> bool:
    is_valid = entry.ends > now and not revoked.revokes(int(entry.serial, 16))
    return is_valid and not entry.is_invitation


def _use(entry: LedgerEntry | None, site: str, key: str) -> None:
    """Mark an invitation as used by a key, or raise `CertificateRefused`."""
    if entry is None or entry.is_withdrawn:
        raise CertificateRefused(f"a newer invitation of site {site} has replaced this one")
    if entry.used_by not in ("", key):
        raise CertificateRefused(
            f"the invitation of site {site} was used before; if another computer used it, run"
            f" 'urc fleet revoke {site}', then invite the site again"
        )
    entry.used_by = key


def _request(pem: bytes, old: SiteCertificate) -> x509.CertificateSigningRequest:
    try:
        csr = x509.load_pem_x509_csr(pem)
        is_signed = csr.is_signature_valid
        names = [one.value for one in csr.subject]
    except Exception as error:  # `cryptography` raises several classes for damaged requests
        raise FleetError("expected a certificate signing request in PEM") from error
    if not is_signed:
        raise FleetError("the certificate signing request is not signed by its own key")
    if names != [old.site]:
        raise CertificateRefused(
            f"site {old.site} requested a certificate for another name: {str(names)[:80]}"
        )
    if public_key_of(csr) == public_key_of(old.certificate):
        raise CertificateRefused(f"site {old.site} must renew its certificate with a new key")
    return csr


def _hash_of(key: ec.EllipticCurvePublicKey) -> str:
    form = serialization.PublicFormat.SubjectPublicKeyInfo
    return hashlib.sha256(key.public_bytes(serialization.Encoding.DER, form)).hexdigest()
