"""Ed25519 signatures for packages; each signature covers a statement in readable text.

A signature is the key holder's statement that an archive's bytes are a particular version of a
package. URC does not verify the identity of the key's holder. The first installation of a package
pins its key. Later versions signed with another key are rejected. SSH handles host keys in the same
way.
"""

import base64
import binascii
import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import msgspec

from urc.packages.names import PackageError, PackageId

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

__all__ = [
    "PUBLISHER",
    "SIGNATURE",
    "Signature",
    "SignatureOf",
    "Signer",
    "fingerprint",
    "new_signer",
    "read_signer",
]

PUBLISHER: Final = "publisher.pem"
"""File with the user's private key, in the data folder."""
SIGNATURE: Final = "urc-signature"
"""Upload header that contains the signature as JSON, in base64."""
_STATEMENT: Final = "URC package signature 1\n{package}\n{version}\n{sha256}\n{by}\n"
_NAMED: Final = "Publisher: "
_KEY_BYTES: Final = 16384
_LONGEST: Final = 100


class Signature(msgspec.Struct, frozen=True):
    """A publisher's or maintainer's signature, with the name and the public key."""

    by: Annotated[str, msgspec.Meta(min_length=1, max_length=_LONGEST)]
    """Publisher's name, which URC does not verify; only the key identifies the publisher."""
    key: Annotated[str, msgspec.Meta(pattern=r"\A[A-Za-z0-9+/]{43}=\Z")]
    """Ed25519 public key, 32 bytes in base64."""
    value: Annotated[str, msgspec.Meta(pattern=r"\A[A-Za-z0-9+/]{86}==\Z")]
    """Signature, 64 bytes in base64."""

    def __post_init__(self) -> None:
        """Reject ambiguous base64 and names with hidden characters."""
        for text in (self.key, self.value):
            if base64.b64encode(base64.b64decode(text)).decode() != text:
                raise ValueError("expected base64 without extra bits")
        if not self.by.isprintable():
            raise ValueError("expected a name on one line")

    @property
    def fingerprint(self) -> str:
        """Readable fingerprint of the public key: ``SHA256:…``."""
        return fingerprint(self.key)

    def check(self, package: PackageId, version: str, sha256: str) -> None:
        """Raise `PackageError` unless the key's holder signed exactly these bytes."""
        if not self.verifies(_statement(package, version, sha256, self.by)):
            raise PackageError(
                f"{package} {version}: the signature does not match the archive: {self} did"
                " not sign the archive, or the archive was changed"
            )

    def verifies(self, statement: bytes) -> bool:
        """Return whether the key's holder signed exactly this statement."""
        from cryptography.exceptions import InvalidSignature
        from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

        try:
            key = Ed25519PublicKey.from_public_bytes(base64.b64decode(self.key))
            key.verify(base64.b64decode(self.value), statement)
        except (InvalidSignature, ValueError):
            return False
        return True

    def __str__(self) -> str:
        return f"{self.by} ({self.fingerprint})"


SignatureOf = Callable[[str], Signature | None]
"""Function that returns an archive's signature by its digest; None if there is no signature."""


class Signer:
    """A publisher or maintainer who signs with a private key."""

    def __init__(self, by: str, private: "Ed25519PrivateKey") -> None:
        self.by = by
        self._private = private
        self.key = base64.b64encode(private.public_key().public_bytes_raw()).decode()

    @property
    def fingerprint(self) -> str:
        """Fingerprint of the public key."""
        return fingerprint(self.key)

    def sign(self, package: PackageId, version: str, sha256: str) -> Signature:
        """Return a package's signature. The same package always has the same signature."""
        return self.signs(_statement(package, version, sha256, self.by))

    def signs(self, statement: bytes) -> Signature:
        """Sign a statement with the private key, and return the signature.

        The statement must contain the signer and the subject.
        """
        value = self._private.sign(statement)
        return Signature(self.by, self.key, base64.b64encode(value).decode())

    def __str__(self) -> str:
        return f"{self.by} ({self.fingerprint})"


def fingerprint(key: str) -> str:
    """Return a public key's fingerprint, in SSH's format."""
    digest = hashlib.sha256(base64.b64decode(key)).digest()
    return "SHA256:" + base64.b64encode(digest).decode().rstrip("=")


def new_signer(by: str, file: Path) -> Signer:
    """Generate a key in a new file that only its owner can read.

    Raises:
        PackageError: the name is invalid, or the file exists.
        OSError: the file cannot be written.
    """
    from cryptography.hazmat.primitives import serialization
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    if not by.strip() or len(by) > _LONGEST or not by.isprintable():
        raise PackageError(f"expected a publisher's name of 1 to {_LONGEST} characters on one line")
    private = Ed25519PrivateKey.generate()
    text = private.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    file.parent.mkdir(parents=True, exist_ok=True)
    try:
        number = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        raise PackageError(
            f"{file}: this key already exists; users recognise your packages by this key"
        ) from None
    with os.fdopen(number, "wb") as opened:
        opened.write(f"{_NAMED}{by}\n".encode() + text)
    return Signer(by, private)


def read_signer(file: Path) -> Signer | None:
    """Return the key in a file; None for a missing file. Raise `PackageError` on failure."""
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        with open(file, "rb") as opened:
            data = opened.read(_KEY_BYTES)
    except FileNotFoundError:
        return None
    except OSError as error:
        raise PackageError(f"{file}: {error.strerror or error}") from None
    named, _, text = data.partition(b"\n")
    try:
        by = named.decode()
        private = load_pem_private_key(text, None)
    except (ValueError, TypeError, binascii.Error):
        raise PackageError(_no_key(file)) from None
    is_named = by.startswith(_NAMED) and by.isprintable() and by != _NAMED
    if not is_named or not isinstance(private, Ed25519PrivateKey):
        raise PackageError(_no_key(file))
    return Signer(by.removeprefix(_NAMED)[:_LONGEST], private)


def _no_key(file: Path) -> str:
    return f"{file}: this is not a publisher's key; create one with 'urc repo key new NAME'"


def _statement(package: PackageId, version: str, sha256: str, by: str) -> bytes:
    """Return the statement that a publisher signs for a package version.

    The statement's parts contain no line ends, so different statements have different bytes.
    """
    return _STATEMENT.format(package=package, version=version, sha256=sha256, by=by).encode()
