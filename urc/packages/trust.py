"""A repository's pinned key: the first key that signed its index."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, NamedTuple

import msgspec

from urc.packages import atomic_files
from urc.packages.index_head import IndexHead
from urc.packages.names import PackageError
from urc.packages.signature import fingerprint

__all__ = ["PinnedKey", "PinnedSigner"]


class PinnedSigner(NamedTuple):
    """The name and the public key of the signer of a repository's index."""

    by: str
    """Name of the signer, which URC does not verify; only the key identifies the signer."""
    key: str
    """Public key, 32 bytes in base64."""


class _Pin(msgspec.Struct, frozen=True):
    key: Annotated[str, msgspec.Meta(pattern=r"\A[A-Za-z0-9+/]{43}=\Z")]
    by: str
    number: int
    """Highest index number signed with the pinned key."""


class PinnedKey:
    """The pinned key of one repository, stored in a file."""

    def __init__(self, url: str, file: Path, now: Callable[[], float] = time.time) -> None:
        """Initialize without reading the file.

        Args:
            url: the repository's URL, for messages.
            file: file that stores the pinned key.
            now: function that returns the current time in seconds since the epoch.
        """
        self._url = url
        self._file = file
        self._now = now

    @property
    def keeper(self) -> str:
        """Name and fingerprint of the index's signer; "" if no key is pinned."""
        pin = self._pin()
        return f"{pin.by} ({fingerprint(pin.key)})" if pin is not None else ""

    @property
    def signer(self) -> PinnedSigner | None:
        """Signer of the index; None if no key is pinned."""
        pin = self._pin()
        return PinnedSigner(pin.by, pin.key) if pin is not None else None

    @property
    def number(self) -> int:
        """Highest signed index number; an index with a lower number is rejected."""
        pin = self._pin()
        return pin.number if pin is not None else 0

    def check(self, head: IndexHead | None) -> None:
        """Raise `PackageError` if the head is invalid, outdated or not signed with the pinned key.

        While no key is pinned, a missing head and an unsigned head are accepted.

        Args:
            head: the repository's head; None for a missing or damaged head.
        """
        signature = head.signed if head is not None else None
        if head is not None and not head.is_sound():
            raise PackageError(
                f"{self._url}: the index does not match the signature by {signature}"
            )
        pin = self._pin()
        if pin is not None and (signature is None or signature.key != pin.key):
            found = f"signed by another key, {signature}" if signature else "not signed"
            raise PackageError(
                f"{self._url}: the index is {found}, but the key {fingerprint(pin.key)} is pinned."
                f" If the maintainer confirms this, run 'urc repo remove {self._url}' and add the"
                " repository again"
            )
        if head is None or signature is None:
            return
        if pin is not None and head.number < pin.number:
            raise PackageError(
                f"{self._url}: the index number decreased from {pin.number} to {head.number}; if"
                f" the maintainer confirms the change, run 'urc repo remove {self._url}' and add"
                " the repository again"
            )
        if head.left_s(self._now()) <= 0:
            raise PackageError(
                f"{self._url}: the index expired at {head.expires}; ask its maintainer to"
                " renew the index, and check this machine's clock; installed packages still work"
            )

    def pin(self, head: IndexHead, work: Path) -> None:
        """Pin the key that signed a verified head, and store the head's index number."""
        signature = head.signed
        if signature is None:
            return
        new = _Pin(signature.key, signature.by, head.number)
        if new != self._pin():
            atomic_files.put_file(self._file, msgspec.json.encode(new) + b"\n", work)

    def forget(self) -> None:
        """Delete the pinned key, so that the next key is accepted."""
        self._file.unlink(missing_ok=True)

    def _pin(self) -> _Pin | None:
        try:
            with open(self._file, "rb") as opened:
                return msgspec.json.decode(opened.read(4096), type=_Pin)
        except FileNotFoundError:
            return None
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise PackageError(
                f"{self._file}: this file is damaged: {error}; run 'urc repo remove {self._url}'"
                " and add the repository again"
            ) from None
