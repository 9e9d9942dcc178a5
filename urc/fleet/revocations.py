"""The revocation list of a fleet, signed by the fleet's root key.

Layer 4. Pure. Its number only grows, so sites can exchange lists in any order.
"""

import base64
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Final, Self

import msgspec
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec

from urc.fleet.certificates import FleetRoot, public_key_of
from urc.fleet.names import FleetError

__all__ = ["MAX_BYTES", "RevocationList"]

MAX_BYTES: Final = 1 << 22
"""Maximum size of a signed list, about 80 000 certificates."""
_PURPOSE: Final = b"urc fleet revocations 1\n"
"""Beginning of the signed bytes: a signature of this list cannot pass for another signature."""
_HASH: Final = ec.ECDSA(hashes.SHA256())


class _Content(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    fleet: str
    number: Annotated[int, msgspec.Meta(ge=0)]
    revoked: dict[str, list[Annotated[str, msgspec.Meta(pattern="^[0-9a-f]{1,40}$")]]]


class _Signed(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    content: str
    signature: str


@dataclass(frozen=True, slots=True)
class RevocationList:
    """Certificates that are no longer valid."""

    fleet: str
    number: int = 0
    """Number of changes so far."""
    serials: Mapping[str, frozenset[int]] = field(default_factory=dict)
    """Revoked serial numbers of each site."""

    @classmethod
    def verified(cls, data: bytes, root: FleetRoot) -> Self:
        """Return the list in `data`.

        Args:
            data: result of `signed`.
            root: root of the fleet.

        Raises:
            FleetError: the list is damaged, too large, or not signed by this root.
        """
        if len(data) > MAX_BYTES:
            raise FleetError(f"the revocation list has more than {MAX_BYTES} bytes")
        try:
            signed = msgspec.json.decode(data, type=_Signed)
            content = signed.content.encode()
            public_key_of(root.certificate).verify(
                base64.b64decode(signed.signature, validate=True), _PURPOSE + content, _HASH
            )
            found = msgspec.json.decode(content, type=_Content)
        except InvalidSignature as error:
            raise FleetError(
                f"the revocation list is not signed by the authority of fleet {root.fleet}"
            ) from error
        except (msgspec.DecodeError, ValueError) as error:
            raise FleetError("the revocation list is damaged") from error
        if found.fleet != root.fleet:
            raise FleetError(f"the revocation list is for fleet {found.fleet}, not {root.fleet}")
        serials = {
            site: frozenset(int(one, 16) for one in all_) for site, all_ in found.revoked.items()
        }
        return cls(found.fleet, found.number, serials)

    def signed(self, key: ec.EllipticCurvePrivateKey) -> bytes:
        """Return the list as JSON, signed with the root's key."""
        revoked = {
            site: sorted(f"{one:x}" for one in all_) for site, all_ in sorted(self.serials.items())
        }
        content = msgspec.json.encode(_Content(self.fleet, self.number, revoked))
        signature = base64.b64encode(key.sign(_PURPOSE + content, _HASH)).decode()
        return msgspec.json.encode(_Signed(content.decode(), signature))

    def revoking(self, site: str, serials: frozenset[int]) -> Self:
        """Return the next list, which also contains these certificates of a site.

        Without a certificate that is new to the list, return the list unchanged.
        """
        known = self.serials.get(site, frozenset())
        if serials <= known:
            return self
        return type(self)(self.fleet, self.number + 1, {**self.serials, site: known | serials})

    def merged(self, other: Self) -> Self:
        """Return a list with the certificates of both lists and a number above both.

        If the other list contains nothing new and has no higher number, return this list.
        """
        found = self
        for site, serials in other.serials.items():
            found = found.revoking(site, serials)
        if found is self and other.number <= self.number:
            return self
        return replace(found, number=max(self.number, other.number) + 1)

    def revokes(self, serial: int) -> bool:
        """Return whether the certificate with this serial number is revoked."""
        return any(serial in all_ for all_ in self.serials.values())

    @property
    def count(self) -> int:
        """Number of revoked certificates."""
        return sum(map(len, self.serials.values()))
