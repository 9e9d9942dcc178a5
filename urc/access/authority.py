"""A local certificate authority, which enables HTTPS on machines without a public name.

Layer 4. `CertificateAuthority` keeps one root certificate for years and uses it to issue the
server's certificate. Users trust the root certificate once on each device. The root is limited to
local network names (RFC 5280, 4.2.1.10), so a stolen key cannot impersonate public websites.

Every certificate is valid from one day before the release day of this version. If the machine's
clock shows an earlier time than the release day, URC uses the release day as the current time.
"""

import ipaddress
import re
from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final, NamedTuple

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID

from urc._x509 import common_name, is_signed_by, key_pem, key_usage
from urc.access.grants import AccessError
from urc.access.wrong_clock import RELEASED
from urc.packages.atomic_files import exclusive
from urc.packages.names import PackageError
from urc.private_files import make_private, put_private

__all__ = [
    "AUTHORITY_FOLDER",
    "CertificateAuthority",
    "ServerCertificate",
    "fingerprint",
    "issued_at",
]

AUTHORITY_FOLDER: Final = "tls"
"""Subfolder in the data folder for certificates and keys."""
AUTHORITY_LASTS: Final = timedelta(days=3650)
LEAF_LASTS: Final = timedelta(days=397)
"""Longest time from the issue of a server certificate to its expiry."""
RENEW_BEFORE: Final = timedelta(days=30)
OLDEST: Final = RELEASED
"""Earliest plausible time of the machine's clock."""
_BACK: Final = timedelta(days=1)
"""Extra validity before the start date, for devices whose clock is behind."""
_LOCAL_NAMES: Final = ("localhost", "local", "lan", "internal", "home.arpa")
_LOCAL_NETWORKS: Final = (
    "127.0.0.0/8", "10.0.0.0/8", "172.16.0.0/12", "192.168.0.0/16", "169.254.0.0/16",
    "100.64.0.0/10", "::1/128", "fc00::/7", "fe80::/10",
)  # fmt: skip
_DNS: Final = re.compile(r"(?!-)[a-z0-9-]{1,63}(?:\.[a-z0-9-]{1,63})*\.?")
_Address = ipaddress.IPv4Address | ipaddress.IPv6Address


class ServerCertificate(NamedTuple):
    """The certificate and key files of a TLS server."""

    chain: Path
    key: Path
    ends: datetime
    """Time after which browsers reject the certificate."""
    is_new: bool
    """Whether the certificate is newly issued, not read from a file."""


class CertificateAuthority:
    """A certificate authority in one folder; only the folder's owner can read its two keys."""

    def __init__(
        self, folder: Path, names: Sequence[str], now: datetime, *, optional: Sequence[str] = ()
    ) -> None:
        """Load the authority, or create one.

        Args:
            folder: folder for certificates and keys.
            names: host names and addresses that the server's certificate must contain. A name
                outside the limits of the existing authority requires a new authority, which every
                device must then trust.
            now: time on this machine's clock, with a time zone.
            optional: names and addresses to add if the authority permits them. Names that the
                existing authority does not permit are omitted and listed in `left_out`.

        Raises:
            AccessError: a file cannot be read or written, or a name is invalid.
        """
        self._folder = folder
        self._now = max(now, OLDEST)
        self._names = _parsed(names)
        more = [one for one in _parsed(optional) if one not in self._names]
        self.left_out: tuple[str, ...] = ()
        """Optional names that were omitted from the certificate."""
        self.file = folder / "authority.pem"
        """Root certificate for devices to trust; not secret."""
        self.is_new = False
        """Whether devices must trust a new root certificate."""
        try:
            make_private(folder)
            with exclusive(folder / "lock"):
                self._open(more)
        except PackageError:
            raise AccessError(f"{folder}: another URC process is using the authority") from None
        except OSError as error:
            raise AccessError(f"{folder}: cannot be used: {error.strerror}") from None

    def _open(self, more: list[x509.GeneralName]) -> None:
        try:
            self._load()
        except FileNotFoundError:
            self._make(more)
        except (OSError, ValueError) as error:
            raise AccessError(f"{self.file}: cannot be read: {error}") from None
        if not self._is_usable():
            self._make(more)
        allowed = self._allowed()
        self._names += (one for one in more if _is_allowed(one, allowed))
        self.left_out = tuple(str(one.value) for one in more if not _is_allowed(one, allowed))

    @property
    def fingerprint(self) -> str:
        """SHA-256 of the root certificate, in readable groups."""
        return fingerprint(self._root)

    @property
    def pem(self) -> bytes:
        """The root certificate in PEM format."""
        return self._root.public_bytes(serialization.Encoding.PEM)

    def issue(self) -> ServerCertificate:
        """Return the server's certificate; issue a new one if it expires soon or a name is missing.

        Raises:
            AccessError: the files cannot be written.
        """
        try:
            with exclusive(self._folder / "lock"):
                return self._issued()
        except PackageError:
            text = f"{self._folder}: another URC process is using the authority"
            raise AccessError(text) from None

    def _issued(self) -> ServerCertificate:
        chain, key = self._folder / "server.pem", self._folder / "server.key"
        kept = _certificate(chain)
        if kept is not None and key.exists() and self._is_good(kept):
            return ServerCertificate(chain, key, kept.not_valid_after_utc, is_new=False)
        leaf_key = ec.generate_private_key(ec.SECP256R1())
        ends = min(self._now + LEAF_LASTS, self._root.not_valid_after_utc)
        leaf = (
            self._builder("URC", leaf_key, ends)
            .issuer_name(self._root.subject)
            .add_extension(x509.SubjectAlternativeName(self._names), critical=False)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(key_usage(is_authority=False), critical=True)
            .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
            .add_extension(
                x509.AuthorityKeyIdentifier.from_issuer_public_key(self._key.public_key()),
                critical=False,
            )
            .sign(self._key, hashes.SHA256())
        )
        self._write(key, key_pem(leaf_key))
        self._write(chain, leaf.public_bytes(serialization.Encoding.PEM) + self.pem)
        return ServerCertificate(chain, key, ends, is_new=True)

    def _load(self) -> None:
        self._root = x509.load_pem_x509_certificate(self.file.read_bytes())
        key = serialization.load_pem_private_key(
            self.file.with_suffix(".key").read_bytes(), password=None
        )
        if not isinstance(key, ec.EllipticCurvePrivateKey):
            raise ValueError("expected an elliptic-curve key")
        if key.public_key() != self._root.public_key():
            raise ValueError("the key does not match the certificate")
        self._key = key

    def _make(self, more: Sequence[x509.GeneralName]) -> None:
        self.is_new = True
        names = [*self._names, *more]
        self._key = ec.generate_private_key(ec.SECP256R1())
        own_name = next((one for one in _dns_of(names) if one != "localhost"), "this machine")
        name = f"URC on {own_name}"
        networks = [x509.IPAddress(ipaddress.ip_network(one)) for one in _LOCAL_NETWORKS]
        own = [
            x509.IPAddress(ipaddress.ip_network(one.value))
            for one in names
            if isinstance(one, x509.IPAddress)
        ]
        domains = [x509.DNSName(one) for one in (*_LOCAL_NAMES, *_dns_of(names))]
        self._root = (
            self._builder(name, self._key, self._now + AUTHORITY_LASTS)
            .issuer_name(common_name(name))
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(key_usage(is_authority=True), critical=True)
            .add_extension(
                x509.NameConstraints(list(dict.fromkeys([*domains, *networks, *own])), None),
                critical=True,
            )
            .sign(self._key, hashes.SHA256())
        )
        self._write(self.file.with_suffix(".key"), key_pem(self._key))
        self._write(self.file, self.pem)

    def _builder(
        self, name: str, key: ec.EllipticCurvePrivateKey, ends: datetime
    ) -> x509.CertificateBuilder:
        return (
            x509.CertificateBuilder()
            .subject_name(common_name(name))
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(min(self._now, OLDEST) - _BACK)
            .not_valid_after(ends)
            .add_extension(
                x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False
            )
        )

    def _is_usable(self) -> bool:
        """Return whether the root is valid for at least 30 more days and permits the names."""
        if self._root.not_valid_after_utc - self._now < RENEW_BEFORE:
            return False
        allowed = self._allowed()
        return all(_is_allowed(name, allowed) for name in self._names)

    def _allowed(self) -> list[x509.GeneralName]:
        found = self._root.extensions.get_extension_for_class(x509.NameConstraints).value
        return found.permitted_subtrees or []

    def _is_good(self, leaf: x509.Certificate) -> bool:
        if leaf.not_valid_after_utc - self._now < RENEW_BEFORE:
            return False
        if leaf.issuer != self._root.subject or not is_signed_by(leaf, self._root):
            return False
        found = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        return set(self._names) <= set(found)

    def _write(self, file: Path, data: bytes) -> None:
        try:
            put_private(file, data)
        except OSError as error:
            raise AccessError(f"{file}: cannot be written: {error.strerror}") from None


def fingerprint(certificate: x509.Certificate) -> str:
    """Return the SHA-256 hash of a certificate as 16 groups of four hexadecimal digits."""
    text = certificate.fingerprint(hashes.SHA256()).hex().upper()
    return " ".join(text[at : at + 4] for at in range(0, len(text), 4))


def issued_at(file: Path) -> datetime | None:
    """Return the earliest time at which this module could have issued a certificate.

    The start of the certificate's validity does not show the issue time, because the start is never
    later than `OLDEST`. Return None for a missing or damaged file.
    """
    found = _certificate(file)
    if found is None:
        return None
    is_authority = found.issuer == found.subject
    return found.not_valid_after_utc - (AUTHORITY_LASTS if is_authority else LEAF_LASTS)


def _parsed(names: Iterable[str]) -> list[x509.GeneralName]:
    found: dict[x509.GeneralName, None] = {}
    for name in names:
        plain = name.strip().strip("[]").partition("%")[0].lower()
        try:
            found[x509.IPAddress(ipaddress.ip_address(plain))] = None
        except ValueError:
            if not _DNS.fullmatch(plain):
                raise AccessError(f"expected a host name or an address, found {name!r}") from None
            found[x509.DNSName(plain.rstrip("."))] = None
    return list(found)


def _dns_of(names: Iterable[x509.GeneralName]) -> Iterator[str]:
    return (one.value for one in names if isinstance(one, x509.DNSName))


def _is_allowed(name: x509.GeneralName, allowed: Iterable[x509.GeneralName]) -> bool:
    if isinstance(name, x509.IPAddress):
        address = name.value
        return isinstance(address, _Address) and any(
            address in one.value
            for one in allowed
            if isinstance(one, x509.IPAddress)
            and isinstance(one.value, ipaddress.IPv4Network | ipaddress.IPv6Network)
        )
    return any(name.value == one or str(name.value).endswith(f".{one}") for one in _dns_of(allowed))


def _certificate(file: Path) -> x509.Certificate | None:
    try:
        return x509.load_pem_x509_certificate(file.read_bytes())
    except (OSError, ValueError):
        return None  # a new certificate replaces it
