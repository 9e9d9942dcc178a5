"""Site invitations: a one-time code with all that a new site needs to join a fleet.

Layer 4. Pure. The code is ``urc-fleet-1.`` and base64url text of compressed JSON. The code contains
a private key, so it is as secret as a password until a site has used it, or for 24 hours.
"""

import base64
import binascii
import zlib
from dataclasses import dataclass, field
from typing import Final, Self

import msgspec
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec

from urc.fleet.certificates import FleetRoot, SiteCertificate, public_key_of
from urc.fleet.names import FleetError, endpoint, site_name

__all__ = ["MAX_ADDRESSES", "SiteInvitation"]

_PREFIX: Final = "urc-fleet-1."
_MAX_CODE: Final = 8192
_MAX_CONTENT: Final = 16384
MAX_ADDRESSES: Final = 8
_AGAIN: Final = "copy the complete code again"


class _InvitationContent(msgspec.Struct, forbid_unknown_fields=True, array_like=True):
    root: bytes
    """DER."""
    authority: str
    connect: list[str]
    certificate: bytes
    """DER."""
    key: bytes
    """The private number of the P-256 key, 32 bytes, big-endian."""


@dataclass(frozen=True, slots=True)
class SiteInvitation:
    """An invitation of one site to a fleet, valid for 24 hours and for one key."""

    root: FleetRoot
    authority: str
    """Site of the authority."""
    connect: tuple[str, ...]
    """Endpoints of the authority's site, such as ``tls/192.168.1.20:7447``."""
    certificate: SiteCertificate
    key: ec.EllipticCurvePrivateKey = field(repr=False)

    def code(self) -> str:
        """Return the invitation as one line of text."""
        content = _InvitationContent(
            self.root.certificate.public_bytes(serialization.Encoding.DER),
            self.authority,
            list(self.connect),
            self.certificate.certificate.public_bytes(serialization.Encoding.DER),
            self.key.private_numbers().private_value.to_bytes(32, "big"),
        )
        packed = zlib.compress(msgspec.msgpack.encode(content), 9)
        return _PREFIX + base64.urlsafe_b64encode(packed).decode().rstrip("=")

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the invitation in a code. Its time is not checked.

        Raises:
            FleetError: the code is incomplete, damaged, or from another version.
        """
        content = _unpacked("".join(text.split()))
        root = FleetRoot.parse(content.root)
        certificate = SiteCertificate.parse(content.certificate)
        try:
            key = ec.derive_private_key(int.from_bytes(content.key, "big"), ec.SECP256R1())
        except ValueError as error:
            raise FleetError(f"the code contains a damaged key; {_AGAIN}") from error
        is_match = key.public_key() == public_key_of(certificate.certificate)
        if not is_match or not certificate.is_invitation:
            raise FleetError("the code contains a certificate that is not an invitation")
        if len(content.connect) > MAX_ADDRESSES:
            raise FleetError(f"expected at most {MAX_ADDRESSES} addresses in the code")
        connect = tuple(map(endpoint, content.connect))
        return cls(root, site_name(content.authority), connect, certificate, key)


def _unpacked(code: str) -> _InvitationContent:
    if not code.startswith(_PREFIX):
        raise FleetError(
            f"expected a code that begins with {_PREFIX!r}, or a file with one, found {code[:20]!r}"
        )
    if len(code) > _MAX_CODE:
        raise FleetError(f"expected a code of at most {_MAX_CODE} characters, found {len(code)}")
    body = code.removeprefix(_PREFIX)
    try:
        packed = base64.b64decode(body + "=" * (-len(body) % 4), b"-_", validate=True)
        reader = zlib.decompressobj()
        data = reader.decompress(packed, _MAX_CONTENT)
        if not reader.eof:
            raise FleetError(f"the code of {len(code)} characters is incomplete; {_AGAIN}")
        return msgspec.msgpack.decode(data, type=_InvitationContent)
    except (binascii.Error, zlib.error, msgspec.DecodeError, ValueError) as error:
        raise FleetError(f"the code of {len(code)} characters is damaged; {_AGAIN}") from error
