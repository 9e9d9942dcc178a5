"""An index's head: number, digest, signature and expiry time.

A maintainer with a key signs the head, and therefore the digest of the whole index. A head's
signature expires after a number of days that the maintainer chooses. An attacker can then no longer
hide newer versions from clients.
"""

import time
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Annotated, Final, NamedTuple

import msgspec

from urc.packages.names import PackageError
from urc.packages.signature import Signature, Signer

__all__ = [
    "HEAD",
    "HEAD_BYTES",
    "VALID_S",
    "IndexHead",
    "IndexSigner",
    "check_key",
    "next_head",
    "read_head",
]

HEAD: Final = "index/head.json"
HEAD_BYTES: Final = 4096
VALID_S: Final = 14 * 86400.0
"""Default validity of a signed head, in seconds."""
_STATEMENT: Final = "URC index signature 1\n{number}\n{sha256}\n{expires}\n{by}\n"
_TIME: Final = "%Y-%m-%dT%H:%M:%SZ"


class IndexSigner(NamedTuple):
    """The signer of an index, with the maintainer's key."""

    signer: Signer
    valid_s: float = VALID_S
    now: Callable[[], float] = time.time


class IndexHead(msgspec.Struct, frozen=True, omit_defaults=True):
    """The summary of an index, which clients request before the index itself."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    number: Annotated[int, msgspec.Meta(ge=0, le=1 << 53)]
    sha256: Annotated[str, msgspec.Meta(pattern=r"\A[0-9a-f]{64}\Z")]
    """Digest of `index.json`."""
    expires: str = ""
    """Expiry time, such as ``2026-12-05T20:00:00Z``; "" if the head is unsigned."""
    signature: Signature | msgspec.UnsetType = msgspec.UNSET

    def __post_init__(self) -> None:
        """Reject an invalid expiry time, and a signature or an expiry time without the other."""
        if self.expires:
            datetime.strptime(self.expires, _TIME)  # noqa: DTZ007 (the format has a Z)
        if bool(self.expires) != isinstance(self.signature, Signature):
            raise ValueError(
                "an expiry time requires a signature, and a signature requires an expiry time"
            )

    @property
    def signed(self) -> Signature | None:
        """Signature, or None."""
        return self.signature if isinstance(self.signature, Signature) else None

    def left_s(self, now_s: float) -> float:
        """Return the time until the head expires, in seconds; negative after the expiry."""
        end = datetime.strptime(self.expires, _TIME).replace(tzinfo=UTC)
        return end.timestamp() - now_s

    def is_sound(self) -> bool:
        """Return whether the signature is valid; an unsigned head is valid."""
        signature = self.signed
        return signature is None or signature.verifies(_statement(self, signature.by))

    def to_bytes(self) -> bytes:
        """Return the content of the head's file."""
        return msgspec.json.encode(self) + b"\n"


def read_head(data: bytes, where: str) -> IndexHead:
    """Return a head from an untrusted source; raise `PackageError` if it is invalid."""
    try:
        return msgspec.json.decode(data, type=IndexHead)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise PackageError(f"{where}: this is not the head of an index: {error}") from None


def check_key(old: IndexHead | None, index_signer: IndexSigner | None) -> None:
    """Raise `PackageError` if the key that signed the current head is not available.

    Clients have pinned the key, so they would reject a head signed with another key.
    """
    signed = old.signed if old is not None else None
    if signed is not None and (index_signer is None or index_signer.signer.key != signed.key):
        raise PackageError(
            f"the index is signed by {signed}: select that key with --key; if it is lost, remove"
            f" {HEAD}, and ask all users to remove the repository and to add it again"
        )


def next_head(
    old: IndexHead | None, number: int, digest: str, index_signer: IndexSigner | None
) -> IndexHead:
    """Return an index's head; reuse a current head while more than half of its validity remains.

    Args:
        old: current head; None if there is no valid head.
        number: number of the index.
        digest: the index file's digest.
        index_signer: maintainer's signer; None for an unsigned head.

    Raises:
        PackageError: the key that signed the old head is not available.
    """
    signed = old.signed if old is not None else None
    is_same = old is not None and (old.number, old.sha256) == (number, digest)
    if index_signer is None and is_same and old is not None:
        return old
    check_key(old, index_signer)
    if index_signer is None:
        return IndexHead(1, number, digest)
    now_s = index_signer.now()
    if is_same and old is not None and signed and old.left_s(now_s) > index_signer.valid_s / 2:
        return old
    expires = datetime.fromtimestamp(now_s + index_signer.valid_s, UTC).strftime(_TIME)
    by = index_signer.signer.by
    statement = _STATEMENT.format(number=number, sha256=digest, expires=expires, by=by)
    return IndexHead(1, number, digest, expires, index_signer.signer.signs(statement.encode()))


def _statement(head: IndexHead, by: str) -> bytes:
    said = {"number": head.number, "sha256": head.sha256, "expires": head.expires, "by": by}
    return _STATEMENT.format(**said).encode()
