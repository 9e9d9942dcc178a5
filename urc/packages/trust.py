"""Whose index a repository's is: the key that signed it first is kept, as keys of packages are."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import msgspec

from urc.packages import disk
from urc.packages.head import Head
from urc.packages.names import PackageError
from urc.packages.signature import fingerprint

__all__ = ["Trust"]


class _Pin(msgspec.Struct, frozen=True):
    key: Annotated[str, msgspec.Meta(pattern=r"\A[A-Za-z0-9+/]{43}=\Z")]
    by: str
    number: int
    """The highest that was seen under this key."""


class Trust:
    """What is known of the key of one repository."""

    def __init__(self, url: str, file: Path, now: Callable[[], float] = time.time) -> None:
        """Read nothing yet.

        Args:
            url: of the repository, for people.
            file: where the key is kept.
            now: seconds since the epoch.
        """
        self._url = url
        self._file = file
        self._now = now

    @property
    def keeper(self) -> str:
        """Who signs the index, with the fingerprint; "" for nobody."""
        pin = self._pin()
        return f"{pin.by} ({fingerprint(pin.key)})" if pin is not None else ""

    @property
    def number(self) -> int:
        """The highest number that was signed; an index never goes back behind it."""
        pin = self._pin()
        return pin.number if pin is not None else 0

    def check(self, head: Head | None) -> None:
        """Raise `PackageError` unless a head is the known key's, of now, and not an older one.

        Args:
            head: what the repository said; None: there is none, or it cannot be read.
        """
        signature = head.signed if head is not None else None
        if head is not None and not head.is_sound():
            raise PackageError(f"{self._url}: {signature} never signed this index")
        pin = self._pin()
        if pin is not None and (signature is None or signature.key != pin.key):
            found = f"signed by another key, {signature}," if signature else "not signed, other"
            raise PackageError(
                f"{self._url}: the index is {found} than {fingerprint(pin.key)} that was kept; if"
                f" its keeper says that this is right, 'urc repo remove {self._url}' and add it"
                " again"
            )
        if head is None or signature is None:
            return
        if pin is not None and head.number < pin.number:
            raise PackageError(
                f"{self._url}: it went back from number {pin.number} to {head.number}; if its"
                f" keeper says that this is right, 'urc repo remove {self._url}' and add it again"
            )
        if head.left_s(self._now()) <= 0:
            raise PackageError(
                f"{self._url}: the index was to be renewed before {head.expires}: nothing is"
                " installed from it until its keeper does, or the clock of this machine is wrong;"
                " what is installed stays"
            )

    def keep(self, head: Head, work: Path) -> None:
        """Remember who signed a head that was checked."""
        signature = head.signed
        if signature is None:
            return
        new = _Pin(signature.key, signature.by, head.number)
        if new != self._pin():
            disk.put_file(self._file, msgspec.json.encode(new) + b"\n", work)

    def forget(self) -> None:
        """Take any key the next time."""
        self._file.unlink(missing_ok=True)

    def _pin(self) -> _Pin | None:
        try:
            with open(self._file, "rb") as opened:
                return msgspec.json.decode(opened.read(4096), type=_Pin)
        except FileNotFoundError:
            return None
        except (msgspec.DecodeError, UnicodeDecodeError) as error:
            raise PackageError(
                f"{self._file}: this file is damaged: {error}; 'urc repo remove {self._url}' and"
                " add it again"
            ) from None
