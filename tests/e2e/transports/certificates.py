"""Certificates for counterparts that a test starts: an authority of its own, and what it signs."""

from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import NamedTuple

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

__all__ = ["Authority", "Pair"]

VALID = timedelta(days=7)


class Pair(NamedTuple):
    """Paths of a certificate and its key, PEM."""

    cert: str
    key: str


class Authority:
    """Signs certificates into a folder; `file` is the path of its own."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._key = ec.generate_private_key(ec.SECP256R1())
        self._serial = x509.random_serial_number()
        self._name = _named(f"authority {self._serial % 10**6}")
        file = folder / f"authority-{self._serial}.pem"
        ca = x509.BasicConstraints(ca=True, path_length=0)
        file.write_bytes(self._signed(self._name, self._key, (ca, True)))
        self.file = str(file)

    def sign(self, name: str, age_days: int = 0) -> Pair:
        """Return a certificate for a host or address, made `age_days` ago and good for a week."""
        key = ec.generate_private_key(ec.SECP256R1())
        names = x509.SubjectAlternativeName([_general(name)])
        stem = self._folder / f"{name}-{x509.random_serial_number()}"
        files = Pair(f"{stem}.crt", f"{stem}.key")
        Path(files.cert).write_bytes(self._signed(_named(name), key, (names, False), age_days))
        Path(files.key).write_bytes(
            key.private_bytes(
                serialization.Encoding.PEM,
                serialization.PrivateFormat.PKCS8,
                serialization.NoEncryption(),
            )
        )
        return files

    def _signed(
        self,
        name: x509.Name,
        key: ec.EllipticCurvePrivateKey,
        extension: tuple[x509.ExtensionType, bool],
        age_days: int = 0,
    ) -> bytes:
        begin = datetime.now(UTC) - timedelta(days=age_days, hours=1)
        identifier = x509.SubjectKeyIdentifier.from_public_key(key.public_key())
        issuer = x509.AuthorityKeyIdentifier.from_issuer_public_key(self._key.public_key())
        builder = (
            x509.CertificateBuilder()
            .subject_name(name)
            .issuer_name(self._name)
            .public_key(key.public_key())
            .serial_number(x509.random_serial_number())
            .not_valid_before(begin)
            .not_valid_after(begin + VALID)
            .add_extension(extension[0], critical=extension[1])
            .add_extension(identifier, critical=False)
            .add_extension(issuer, critical=False)
        )
        return builder.sign(self._key, hashes.SHA256()).public_bytes(serialization.Encoding.PEM)


def _named(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


def _general(name: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ip_address(name))
    except ValueError:
        return x509.DNSName(name)
