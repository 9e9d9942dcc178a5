"""What the operator filled in for a robot, kept over a restart: one small file for each.

The file may hold secrets, so nobody but its owner can read it.
"""

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Final
from urllib.parse import quote

import msgspec

from urc.packages.lock import Lock
from urc.private_files import put_private
from urc.problems import UrcError

__all__ = ["DRIVEN", "Kept", "KeptFile", "in_use", "names_kept", "pin"]

DRIVEN: Final = ("robot", "driver")
"""Kinds of packages that settings are filled in for; of one name, the robot goes first."""

_MOST_BYTES: Final = 1 << 20
_Name = Annotated[str, msgspec.Meta(max_length=200)]
_Text = Annotated[str, msgspec.Meta(max_length=4096)]


class Kept(msgspec.Struct, frozen=True):
    """What was chosen for one robot."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)] = 1
    version: _Name = ""
    """Of the installed package; "": the newest."""
    interface: _Name = ""
    """Shown first; "": the document's first."""
    settings: dict[_Name, _Text] = {}
    """Setting → as typed; those that are missing take their defaults."""
    destination: _Name = ""
    """What the secrets among them were entered for, as `urc.runtime.destination` tells it; "": that
    was not noted, so they are asked for again."""
    package: _Name = ""
    """For which they were filled in, as ``drivers/puppet``; "": for a document that was named."""


class KeptFile:
    """The file of one robot."""

    def __init__(self, folder: Path, name: str) -> None:
        """Choose the file; nothing is read or written yet."""
        self.file = folder / f"{quote(name, safe='')}.json"

    def load(self) -> Kept:
        """Return what is kept; nothing yet is an empty `Kept`.

        Raises:
            UrcError: the file cannot be read, or is damaged.
        """
        try:
            with open(self.file, "rb") as opened:
                data = opened.read(_MOST_BYTES + 1)
            return msgspec.json.decode(data, type=Kept)
        except FileNotFoundError:
            return Kept()
        except OSError as error:
            raise UrcError(f"{self.file}: {error.strerror or error}") from None
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            raise UrcError(f"{self.file}: this file is damaged: {error}") from None

    def save(self, kept: Kept) -> None:
        """Write it: after this the file holds `kept`, even if the power goes; before, what it held.

        Raises:
            UrcError: it cannot be written; then nothing has changed.
        """
        data = msgspec.json.format(msgspec.json.encode(kept, order="sorted"), indent=1) + b"\n"
        try:
            put_private(self.file, data)
        except OSError as error:
            raise UrcError(f"{self.file}: {error.strerror or error}") from None

    def is_of(self, package: str) -> bool:
        """Return whether it is there, and was not filled in for something else than a package."""
        try:
            kept = self.load()
        except UrcError:
            return True  # damaged: what it held is of no use any more
        if kept == Kept():
            return False
        # An earlier version noted no destination, and no package with it.
        return kept.package == package or not (kept.package or kept.destination)

    def forget(self) -> None:
        """Take the file away, if it is there."""
        with suppress(OSError):
            self.file.unlink(missing_ok=True)


def names_kept(folder: Path, removed: Iterable[Lock], left: Iterable[Lock]) -> list[str]:
    """Return the robots for which something is kept that goes with packages that are removed.

    Args:
        folder: of the files.
        removed: the packages.
        left: what stays installed; a robot that still has a package keeps its settings.
    """
    stay = {lock.key.name for lock in left if lock.key.kind in DRIVEN}
    roots = {lock.key.name: lock.root for lock in removed if lock.key.kind in DRIVEN}
    return [
        name
        for name, package in sorted(roots.items())
        if name not in stay and KeptFile(folder, name).is_of(package)
    ]


def in_use(folder: Path, name: str, installed: Iterable[Lock]) -> Lock | None:
    """Return the installed package that is driven under a name, or None.

    That is the version that was chosen. Without a choice it is the newest, and of a robot and a
    driver of one name the robot.

    Args:
        folder: of the files.
        name: of the robot.
        installed: all that is installed.
    """
    locks = [lock for lock in installed if lock.key.kind in DRIVEN and lock.key.name == name]
    try:
        kept = KeptFile(folder, name).load()
    except UrcError:
        kept = Kept()
    if any(lock.root == kept.package for lock in locks):
        locks = [lock for lock in locks if lock.root == kept.package]
    chosen = [lock for lock in locks if lock.version == kept.version]
    return max(
        chosen or locks,
        key=lambda lock: (-DRIVEN.index(lock.key.kind), lock.number),
        default=None,
    )


def pin(folder: Path, lock: Lock) -> None:
    """Let a robot go on with a version, whatever else is installed; raise `UrcError`.

    Args:
        folder: of the files.
        lock: what `in_use` returned.
    """
    file = KeptFile(folder, lock.key.name)
    kept = file.load()
    chosen = msgspec.structs.replace(kept, version=lock.version, package=lock.root)
    if chosen != kept:
        file.save(chosen)
