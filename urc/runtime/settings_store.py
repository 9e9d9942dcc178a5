"""The stored settings of robots, in one small file per robot.

A settings file may contain secrets, so only its owner can read the file.
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

__all__ = ["DRIVEN", "StoredSettings", "SettingsStore", "in_use", "names_kept", "pin"]

DRIVEN: Final = ("robot", "driver")
"""Kinds of packages with settings, in order of precedence if several have the same name: a robot
takes precedence over a driver."""

_MOST_BYTES: Final = 1 << 20
_Name = Annotated[str, msgspec.Meta(max_length=200)]
_Text = Annotated[str, msgspec.Meta(max_length=4096)]


class StoredSettings(msgspec.Struct, frozen=True):
    """The stored settings and choices for one robot."""

    format: Annotated[int, msgspec.Meta(ge=1, le=1)] = 1
    version: _Name = ""
    """Package version that the operator has chosen; "" for the newest installed version."""
    interface: _Name = ""
    """Interface to show first; "" for the first interface in the document."""
    settings: dict[_Name, _Text] = {}
    """The operator's text for each setting, by name; missing settings use their defaults."""
    destination: _Name = ""
    """Destination for which the secrets were entered, from `urc.runtime.destination`. "" means an
    unknown destination; the secrets must then be entered again."""
    package: _Name = ""
    """Package to which the settings belong, such as ``drivers/puppet``; "" for a document given by
    path."""
    monitors_alarms: bool | None = None
    """Whether the robot stays connected for its alarms; None leaves the choice to the server."""


class SettingsStore:
    """The settings file of one robot."""

    def __init__(self, folder: Path, name: str) -> None:
        """Set the path of the file, without reading or writing the file."""
        self.file = folder / f"{quote(name, safe='')}.json"

    def load(self) -> StoredSettings:
        """Return the stored settings; if there is no file, return an empty `StoredSettings`.

        Raises:
            UrcError: the file cannot be read or is damaged.
        """
        try:
            with open(self.file, "rb") as opened:
                data = opened.read(_MOST_BYTES + 1)
            return msgspec.json.decode(data, type=StoredSettings)
        except FileNotFoundError:
            return StoredSettings()
        except OSError as error:
            raise UrcError(f"{self.file}: {error.strerror or error}") from None
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            raise UrcError(f"{self.file}: this file is damaged: {error}") from None

    def save(self, kept: StoredSettings) -> None:
        """Write the settings atomically: a power failure leaves either the old or the new file.

        Raises:
            UrcError: the file cannot be written and stays unchanged.
        """
        data = msgspec.json.format(msgspec.json.encode(kept, order="sorted"), indent=1) + b"\n"
        try:
            put_private(self.file, data)
        except OSError as error:
            raise UrcError(f"{self.file}: {error.strerror or error}") from None

    def is_of(self, package: str) -> bool:
        """Return whether the file exists and may belong to `package`."""
        try:
            kept = self.load()
        except UrcError:
            return True  # damaged, so its content is lost anyway
        if kept == StoredSettings():
            return False
        # An earlier version stored neither the destination nor the package.
        return kept.package == package or not (kept.package or kept.destination)

    def forget(self) -> None:
        """Delete the settings file, if it exists."""
        with suppress(OSError):
            self.file.unlink(missing_ok=True)


def names_kept(folder: Path, removed: Iterable[Lock], left: Iterable[Lock]) -> list[str]:
    """Return the robots whose settings no package uses once packages are removed.

    Args:
        folder: folder with the settings files.
        removed: packages to remove.
        left: packages that remain installed; a robot with such a package keeps its settings.
    """
    stay = {lock.key.name for lock in left if lock.key.kind in DRIVEN}
    roots = {lock.key.name: lock.root for lock in removed if lock.key.kind in DRIVEN}
    return [
        name
        for name, package in sorted(roots.items())
        if name not in stay and SettingsStore(folder, name).is_of(package)
    ]


def in_use(folder: Path, name: str, installed: Iterable[Lock]) -> Lock | None:
    """Return the installed package for the robot `name`, or None.

    The result is the version chosen by the operator, or else the newest version. A robot takes
    precedence over a driver with the same name.

    Args:
        folder: folder with the settings files.
        name: robot name.
        installed: all installed packages.
    """
    locks = [lock for lock in installed if lock.key.kind in DRIVEN and lock.key.name == name]
    try:
        kept = SettingsStore(folder, name).load()
    except UrcError:
        kept = StoredSettings()
    if any(lock.root == kept.package for lock in locks):
        locks = [lock for lock in locks if lock.root == kept.package]
    chosen = [lock for lock in locks if lock.version == kept.version]
    return max(
        chosen or locks,
        key=lambda lock: (-DRIVEN.index(lock.key.kind), lock.number),
        default=None,
    )


def pin(folder: Path, lock: Lock) -> None:
    """Store the robot's current package version as its chosen version, before an installation.

    Args:
        folder: folder with the settings files.
        lock: result of `in_use`.
    """
    file = SettingsStore(folder, lock.key.name)
    kept = file.load()
    chosen = msgspec.structs.replace(kept, version=lock.version, package=lock.root)
    if chosen != kept:
        file.save(chosen)
