"""A repository's folder: packages to write in, and the files that any web server can give out.

DIR/drivers/puppet/package.yaml …     what the keeper writes, one folder for each package
DIR/archives/drivers/puppet/1.0.0.zip every version that was ever listed
DIR/index.json                        what there is
DIR/drivers/puppet/urcpm.json         the same in the thesis's form
"""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from urc.packages import disk
from urc.packages.archive import PACKAGE
from urc.packages.index import INDEX, Entry, Index, entry_of
from urc.packages.manifest import MANIFEST, Manifest
from urc.packages.names import FOLDERS, PackageError, parse_key
from urc.packages.package import open_package, pack_folder

__all__ = ["Listing", "make_index", "urcpm"]

_THESIS: Final = ("driver", "interface", "widget")
_PACKAGES_MOST: Final = 20_000


class Listing(NamedTuple):
    """What came of looking through a repository's folder."""

    listed: Index
    faults: tuple[str, ...]
    """One line for each package that is not listed."""


def make_index(folder: Path, name: str, examine: Callable[[Path], list[str]]) -> Listing:
    """Look at every package in a folder, list those that are sound, and write `index.json`.

    Args:
        folder: the repository.
        name: what it is called.
        examine: returns what is wrong with a package's document, one line each.

    Raises:
        PackageError: there is no such folder, or it cannot be written to.
    """
    if not folder.is_dir():
        raise PackageError(f"{folder}: there is no such folder")
    work = folder / ".work"
    faults: list[str] = []
    try:
        for home in _homes(folder):
            faults += _take(folder, home, work, examine)
        entries = []
        for file in _archives(folder):
            try:
                entries.append(_entry(folder, file))
            except PackageError as error:
                faults.append(str(error))
        entries.sort(key=lambda entry: (entry.key, entry.number))
        index = Index(1, name, tuple(entries))
        disk.put_file(folder / INDEX, index.to_bytes(), work)
        shutil.rmtree(work, ignore_errors=True)
    except OSError as error:
        raise PackageError(f"{error.filename or folder}: {error.strerror or error}") from None
    return Listing(index, tuple(faults))


def _homes(folder: Path) -> list[Path]:
    """Return the folders of packages that the keeper writes in."""
    return sorted(
        home
        for kind in FOLDERS
        if (folder / kind).is_dir()
        for home in (folder / kind).iterdir()
        if (home / MANIFEST).is_file()
    )


def _take(folder: Path, home: Path, work: Path, examine: Callable[[Path], list[str]]) -> list[str]:
    """Make the archive of a package that is new; return what is wrong with it."""
    try:
        package = pack_folder(home)
    except PackageError as error:
        return [str(error)]
    said = package.manifest
    wanted = folder / str(said.key)
    if home != wanted:
        return [f"{home}: {said.key} belongs into {wanted}"]
    entry = entry_of(package)
    archive = folder / entry.file
    if archive.is_file():
        if archive.read_bytes() != package.data:
            return [f"{home}: it has changed since {entry} was listed; give it a new version"]
    else:
        if faults := examine(home / said.main):
            return faults
        disk.put_file(archive, package.data, work)
    if said.key.kind in _THESIS:
        disk.put_file(home / "urcpm.json", urcpm(said, package.files), work)
    return []


def _archives(folder: Path) -> list[Path]:
    found = sorted((folder / "archives").glob("*/*/*.zip"))
    if len(found) > _PACKAGES_MOST:
        raise PackageError(f"{folder}: more than {_PACKAGES_MOST} archives")
    return found


def _entry(folder: Path, file: Path) -> Entry:
    with open(file, "rb") as opened:
        package = open_package(opened.read(PACKAGE.archive_bytes + 1), str(file))
    entry = entry_of(package)
    if folder / entry.file != file:
        raise PackageError(f"{file}: this is {entry}, which belongs into {folder / entry.file}")
    return entry


def urcpm(said: Manifest, files: Mapping[str, bytes]) -> bytes:
    """Return a package in the form of the thesis's figure B.2."""
    needed = [key for key in map(parse_key, said.needs) if key.kind in _THESIS]
    styles = sorted(path for path in files if path.endswith(".css"))
    found: dict[str, object] = {
        "name": said.key.name,
        "description": said.summary,
        "type": said.key.kind,
        "main": "widget.js" if said.key.kind == "widget" and "widget.js" in files else said.main,
        "dependencies": sorted(
            path for path in files if path.endswith(".js") and path != "widget.js"
        ),
    }
    if said.key.kind == "driver":
        found["css"] = {Path(path).stem: path for path in styles}
        found["widgets"] = [f"/{key}/" for key in needed if key.kind == "widget"]
        found["interfaces"] = [f"/{key}/" for key in needed if key.kind == "interface"]
    else:
        found["css"] = styles
    if said.key.kind == "widget":
        rest = set(files) - set(styles) - {MANIFEST}
        found["resources"] = {path: path for path in sorted(rest) if not path.endswith(".js")}
    return msgspec.json.format(msgspec.json.encode(found), indent=1) + b"\n"
