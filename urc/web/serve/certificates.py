"""The server's certificate, from the local authority or from the operator's files.

Layer 5. `Certificates` loads a certificate in a thread and replaces it while the server runs. New
connections use the new certificate, while open connections keep the old one.
"""

import asyncio
import ipaddress
import logging
import ssl
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, NamedTuple, Protocol

from cryptography import x509

from urc._addresses import local_addresses
from urc.access.authority import RENEW_BEFORE, CertificateAuthority, fingerprint
from urc.problems import UrcError
from urc.web.serve.policy import own_names

__all__ = ["Certificates", "GivenCertificate", "LoadedCertificate", "LocalCertificate", "names_of"]

LOOK_S: Final = 60.0
"""Interval between checks of addresses, certificate files and expiry dates, in seconds."""
_ALWAYS: Final = ("localhost", "127.0.0.1", "::1")
log = logging.getLogger(__name__)


class LoadedCertificate(NamedTuple):
    """A certificate that is ready for new connections."""

    context: ssl.SSLContext
    fingerprint: str
    """SHA-256 of the certificate to trust: the authority's certificate or the given certificate."""
    file: Path
    """PEM file that local programs use to verify the server."""
    name: str
    """One host name or address for which the certificate is valid."""
    authority: bytes
    """The local authority's certificate in PEM format; b"" for a given certificate."""
    notes: tuple[str, ...] = ()
    """Notes for the operator, for example about a new authority."""


class CertificateSource(Protocol):
    """The authority or the operator's files, as the source of certificates. Both methods block."""

    def load(self) -> LoadedCertificate:
        """Return the current certificate, or raise `UrcError`."""

    def has_changed(self) -> bool:
        """Return whether `load` would now return a different certificate."""


class LocalCertificate:
    """A certificate from the local authority, for this machine's names and addresses."""

    def __init__(self, folder: Path, host: str, allowed_hosts: Iterable[str] = ()) -> None:
        """Create the source; only `load` reads the files.

        Args:
            folder: the authority's folder.
            host: address on which the server listens.
            allowed_hosts: additional names of this machine.
        """
        self._folder = folder
        self._host = host
        self._allowed_hosts = tuple(allowed_hosts)
        self._names: tuple[Sequence[str], Sequence[str]] = ((), ())
        self._renew_at = datetime.max.replace(tzinfo=UTC)

    def load(self) -> LoadedCertificate:
        """Return the certificate; issue a new certificate if the old one no longer suffices.

        Raises:
            AccessError: the files cannot be read or written.
        """
        had_one = (self._folder / "authority.pem").exists()
        self._names = required, optional = names_of(self._host, self._allowed_hosts)
        authority = CertificateAuthority(
            self._folder, required, datetime.now(UTC), optional=optional
        )
        issued = authority.issue()
        self._renew_at = issued.ends - RENEW_BEFORE
        notes = []
        if authority.is_new and had_one:
            notes.append(
                "a new certificate authority replaces the old one: all devices must trust it"
            )
        if authority.left_out:
            left_out = ", ".join(authority.left_out)
            notes.append(
                f"the certificate authority cannot certify {left_out}; to create a new authority,"
                " use --allow-host with this name"
            )
        return LoadedCertificate(
            _context(issued.chain, issued.key),
            authority.fingerprint,
            authority.file,
            _ALWAYS[0],
            authority.pem,
            tuple(notes),
        )

    def has_changed(self) -> bool:
        """Return whether the certificate expires soon, or this machine's addresses have changed."""
        is_late = datetime.now(UTC) >= self._renew_at
        return is_late or names_of(self._host, self._allowed_hosts) != self._names


class GivenCertificate:
    """A certificate and a key from the operator's files."""

    def __init__(self, chain: Path, key: Path) -> None:
        """Create the source; only `load` reads the files.

        Args:
            chain: PEM file with the server's certificate, followed by intermediate certificates.
            key: PEM file without a passphrase.
        """
        self._chain = chain
        self._key = key
        self._seen: tuple[int, ...] = ()

    def load(self) -> LoadedCertificate:
        """Read both files.

        Raises:
            UrcError: a file cannot be read, or the certificate and key do not match.
        """
        self._seen = self._stamps()
        try:
            leaf = x509.load_pem_x509_certificate(self._chain.read_bytes())
            self._key.read_bytes()  # its error names the file
            context = _context(self._chain, self._key)
        except _PassphraseError:
            text = f"--tls-key: {self._key} has a passphrase; remove the passphrase"
            raise UrcError(text) from None
        except ssl.SSLError as error:
            reason = error.reason or "the certificate and the key do not match"
            text = f"--tls-cert: cannot use {self._chain} with {self._key}: {reason}"
            raise UrcError(text) from error
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "expected a certificate in PEM"
            file = getattr(error, "filename", None) or self._chain
            raise UrcError(f"--tls-cert: cannot use {file}: {reason}") from error
        ends = leaf.not_valid_after_utc
        late = ends <= datetime.now(UTC)
        notes = (f"{self._chain}: the certificate expired on {ends:%Y-%m-%d}",) if late else ()
        return LoadedCertificate(
            context, fingerprint(leaf), self._chain.absolute(), _name_in(leaf), b"", notes
        )

    def has_changed(self) -> bool:
        """Return whether the certificate file or the key file has been replaced."""
        return self._stamps() != self._seen

    def _stamps(self) -> tuple[int, ...]:
        try:
            return tuple(one.stat().st_mtime_ns for one in (self._chain, self._key))
        except OSError:
            return ()


class Certificates:
    """The current certificate of a running server."""

    def __init__(self, source: CertificateSource, first: LoadedCertificate) -> None:
        """Start with a certificate loaded from `source`."""
        self._source = source
        self.current = first

    @classmethod
    async def of(cls, source: CertificateSource) -> "Certificates":
        """Load the first certificate in a thread, or raise `UrcError`."""
        return cls(source, await asyncio.to_thread(source.load))

    def context(self) -> ssl.SSLContext:
        """Return the certificate and the options for a new connection."""
        return self.current.context

    async def keep(self, look_s: float = LOOK_S) -> None:
        """Renew the certificate until cancelled; after a fault, keep the old certificate."""
        while True:
            await asyncio.sleep(look_s)
            await self.renew()

    async def renew(self) -> bool:
        """Load the certificate again if it has changed; return whether it was replaced."""
        try:
            if not await asyncio.to_thread(self._source.has_changed):
                return False
            new = await asyncio.to_thread(self._source.load)
        except UrcError as error:
            log.warning("the old certificate stays in use: %s", error)
            return False
        for note in new.notes:
            if note not in self.current.notes:
                log.warning("%s", note)
        self.current = new
        return True


def names_of(host: str, allowed_hosts: Iterable[str]) -> tuple[Sequence[str], Sequence[str]]:
    """Return the required and the optional names and addresses for a certificate.

    The page policy accepts the same names. Public IPv6 addresses are omitted if the machine has
    other addresses, because providers change them often and the authority must list each address.
    """
    try:
        address = ipaddress.ip_address(host.partition("%")[0])
    except ValueError:
        given = [host]
    else:
        given = [] if address.is_unspecified else [str(address)]
    required = dict.fromkeys((*_ALWAYS, *given, *allowed_hosts))
    addresses = local_addresses()
    local = [str(one) for one in addresses if one.version == 4 or not one.is_global]
    optional = (*sorted(own_names()), *(local or map(str, addresses)))
    return tuple(required), tuple(one for one in optional if one not in required)


def _context(chain: Path, key: Path) -> ssl.SSLContext:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.options |= ssl.OP_NO_RENEGOTIATION
    context.set_alpn_protocols(["http/1.1"])
    context.load_cert_chain(chain, key, password=_refused)
    return context


class _PassphraseError(Exception):
    """The private key has a passphrase."""


def _refused() -> str:
    """Refuse a key with a passphrase; OpenSSL would otherwise prompt on the terminal."""
    raise _PassphraseError


def _name_in(leaf: x509.Certificate) -> str:
    try:
        found = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        return ""
    return next((str(one.value).replace("*", "urc", 1) for one in found), "")
