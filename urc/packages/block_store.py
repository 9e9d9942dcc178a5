"""The block lists on this machine, stored in ``blocks.json`` in the packages folder.

A stored list remains in effect even if its repository is unreachable or removed, or has an expired
index. An entry therefore applies until a newer list from the same maintainer omits the entry.
"""

from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Annotated, Final, Protocol

import msgspec

from urc.packages import atomic_files
from urc.packages.blocks import BlockList
from urc.packages.lock import Lock
from urc.packages.names import PackageError
from urc.packages.signature import SignatureOf, fingerprint

__all__ = ["BlockStore", "KeyHolder", "KnownBlocks"]

_FILE_BYTES: Final = 64 << 20
_LISTS_MOST: Final = 64


class KeyHolder(Protocol):
    """A signer's name and public key."""

    @property
    def by(self) -> str:
        """Name of the signer."""

    @property
    def key(self) -> str:
        """Public key, 32 bytes in base64."""


class KnownBlocks(msgspec.Struct, frozen=True):
    """A stored block list, with its maintainer's key and its origin."""

    by: str
    """The maintainer's name, which URC does not verify; only the key identifies the maintainer."""
    key: str
    """The maintainer's public key, 32 bytes in base64."""
    number: int
    """Number of the index that contains the list."""
    listed: BlockList
    place: str
    """The repository's URL, or the imported file's path."""

    @property
    def maintainer(self) -> str:
        """Name and fingerprint of the maintainer."""
        return f"{self.by} ({fingerprint(self.key)})"


class _BlocksFile(msgspec.Struct, frozen=True):
    format: Annotated[int, msgspec.Meta(ge=1, le=1)]
    known: tuple[KnownBlocks, ...] = ()


class BlockStore:
    """The block lists of all maintainers whose keys the user trusts."""

    def __init__(self, folder: Path) -> None:
        """Initialize without reading the file; `folder` is the packages folder."""
        self._folder = folder
        self._file = folder / "blocks.json"
        self._read: tuple[object, tuple[KnownBlocks, ...]] = (None, ())

    def stamp(self) -> object:
        """Return a value that changes whenever the file changes; None for a missing file."""
        try:
            found = self._file.stat()
        except OSError:
            return None
        return found.st_mtime_ns, found.st_size, found.st_ino

    def all(self) -> tuple[KnownBlocks, ...]:
        """Return all stored block lists; raise `PackageError` for a damaged file."""
        stamp = self.stamp()
        if stamp is None:
            return ()
        if self._read[0] != stamp:
            self._read = stamp, self._decoded()
        return self._read[1]

    def keep(self, by: KeyHolder, number: int, listed: BlockList, place: str) -> None:
        """Store a verified list, which replaces an older list with the same key and id.

        Args:
            by: holder of the trusted key that signed the list.
            number: number of the index that contains the list.
            listed: the list.
            place: the repository's URL, or the file's path.

        Raises:
            PackageError: a newer list is stored, or too many lists are stored.
        """
        new = KnownBlocks(by.by, by.key, number, listed, place)
        with self._changing():
            others = []
            for one in self.all():
                if (one.key, one.listed.id) != (new.key, listed.id):
                    others.append(one)
                elif one.number > number or (one.number == number and one.listed != listed):
                    raise PackageError(
                        f"{place}: this block list has number {number}, but number {one.number} by"
                        f" {one.maintainer} is already stored"
                    )
                elif one.listed == listed and one.number == number:
                    return
            if len(others) >= _LISTS_MOST:
                raise PackageError(f"{place}: at most {_LISTS_MOST} block lists can be stored")
            self._write([*others, new])

    def forget(self, key: str) -> None:
        """Delete all lists signed with `key`; raise `PackageError` if there is no such list."""
        with self._changing():
            left = [one for one in self.all() if fingerprint(one.key) != key]
            if len(left) == len(self.all()):
                known = ", ".join(one.maintainer for one in left) or "none"
                raise PackageError(f"no block list is signed by {key}; stored lists: {known}")
            self._write(left)

    def lines(self, lock: Lock, signature_of: SignatureOf) -> list[str]:
        """Return one line for each blocked package in a lock, with the maintainer and the reason.

        Args:
            lock: the lock of an installed or planned package.
            signature_of: function that returns an archive's signature by its digest.

        Raises:
            PackageError: the file with the block lists is damaged.
        """
        known = self.all()
        if not known:
            return []
        lines = []
        for name, pin in lock.packages.items():
            signature = signature_of(pin.sha256)
            lines += [
                f"{name} {pin.version} is blocked by {one.by}: {block.why}"
                for one in known
                for block in one.listed.blocks
                if block.is_about(name, pin.version, pin.sha256, signature)
            ]
        return list(dict.fromkeys(lines))

    def _decoded(self) -> tuple[KnownBlocks, ...]:
        try:
            with open(self._file, "rb") as opened:
                data = opened.read(_FILE_BYTES)
        except FileNotFoundError:
            return ()
        try:
            return msgspec.json.decode(data, type=_BlocksFile).known
        except (ValueError, PackageError) as error:
            raise PackageError(f"{self._file}: this file is damaged: {error}") from None

    def _changing(self) -> AbstractContextManager[None]:
        return atomic_files.exclusive(self._folder / "blocking")

    def _write(self, known: Iterable[KnownBlocks]) -> None:
        data = (
            msgspec.json.format(msgspec.json.encode(_BlocksFile(1, tuple(known))), indent=1) + b"\n"
        )
        atomic_files.put_file(self._file, data, self._folder / "blocking-work")
