"""The head of an index: its number, its digest, and who answers for it until when.

A keeper with a key signs the head, and through the digest all that the index says. It holds for
some days: who keeps a client from hearing of newer ones cannot do so for ever.
"""

import time
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Annotated, Final, NamedTuple

import msgspec

from urc.packages.names import PackageError
from urc.packages.signature import Signature, Signer

__all__ = ["HEAD", "HEAD_BYTES", "VALID_S", "Head", "Seal", "check_key", "next_head", "read_head"]

HEAD: Final = "index/head.json"
HEAD_BYTES: Final = 4096
VALID_S: Final = 14 * 86400.0
"""For how long a signed head holds, unless its keeper says otherwise."""
_STATEMENT: Final = "URC index signature 1\n{number}\n{sha256}\n{expires}\n{by}\n"
_TIME: Final = "%Y-%m-%dT%H:%M:%SZ"


class Seal(NamedTuple):
    """What a keeper signs an index with."""

    signer: Signer
    valid_s: float = VALID_S
    now: Callable[[], float] = time.time


class Head(msgspec.Struct, frozen=True, omit_defaults=True):
    """What is asked for first."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    number: Annotated[int, msgspec.Meta(ge=0, le=1 << 53)]
    sha256: Annotated[str, msgspec.Meta(pattern=r"\A[0-9a-f]{64}\Z")]
    """Of `index.json`."""
    expires: str = ""
    """``2026-12-05T20:00:00Z``, from when on it is not believed; "" where it is not signed."""
    signature: Signature | msgspec.UnsetType = msgspec.UNSET

    def __post_init__(self) -> None:
        """Refuse times that are none, and those that nobody answers for."""
        if self.expires:
            datetime.strptime(self.expires, _TIME)  # noqa: DTZ007 (its Z says it)
        if bool(self.expires) != isinstance(self.signature, Signature):
            raise ValueError("a time of expiry goes with a signature")

    @property
    def signed(self) -> Signature | None:
        """Who answers for it, or None."""
        return self.signature if isinstance(self.signature, Signature) else None

    def left_s(self, now_s: float) -> float:
        """Return for how many seconds it still holds."""
        end = datetime.strptime(self.expires, _TIME).replace(tzinfo=UTC)
        return end.timestamp() - now_s

    def is_sound(self) -> bool:
        """Return whether its signature is of exactly this, where it has one."""
        signature = self.signed
        return signature is None or signature.verifies(_statement(self, signature.by))

    def to_bytes(self) -> bytes:
        """Return the file."""
        return msgspec.json.encode(self) + b"\n"


def read_head(data: bytes, where: str) -> Head:
    """Return a head that came from outside; raise `PackageError`."""
    try:
        return msgspec.json.decode(data, type=Head)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise PackageError(f"{where}: this is no head of an index: {error}") from None


def check_key(old: Head | None, seal: Seal | None) -> None:
    """Raise `PackageError` when a head is signed by a key that is not at hand.

    Nobody who knows that key would believe the next one.
    """
    signed = old.signed if old is not None else None
    if signed is not None and (seal is None or seal.signer.key != signed.key):
        raise PackageError(
            f"the index is signed by {signed}: name that key with --key; if it is lost, remove"
            f" {HEAD}, and tell everybody who added the repository to remove and add it again"
        )


def next_head(old: Head | None, number: int, digest: str, seal: Seal | None) -> Head:
    """Return the head of an index; the old one where that still does.

    Args:
        old: what stands there, if anything sound.
        number: of the index.
        digest: of its bytes.
        seal: the keeper's; None: it is not signed.

    Raises:
        PackageError: the old one is signed by a key that is not at hand.
    """
    signed = old.signed if old is not None else None
    is_same = old is not None and (old.number, old.sha256) == (number, digest)
    if seal is None and is_same and old is not None:
        return old
    check_key(old, seal)
    if seal is None:
        return Head(1, number, digest)
    now_s = seal.now()
    if is_same and old is not None and signed and old.left_s(now_s) > seal.valid_s / 2:
        return old
    expires = datetime.fromtimestamp(now_s + seal.valid_s, UTC).strftime(_TIME)
    by = seal.signer.by
    statement = _STATEMENT.format(number=number, sha256=digest, expires=expires, by=by)
    return Head(1, number, digest, expires, seal.signer.signs(statement.encode()))


def _statement(head: Head, by: str) -> bytes:
    said = {"number": head.number, "sha256": head.sha256, "expires": head.expires, "by": by}
    return _STATEMENT.format(**said).encode()
