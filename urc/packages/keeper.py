"""A repository's folder: packages to write in, and the files that any web server can give out.

DIR/drivers/puppet/package.yaml …     what the keeper writes, one folder for each package
DIR/archives/drivers/puppet/1.0.0.zip every version that was ever listed
DIR/archives/drivers/puppet/1.0.0.sig who signed it, if anybody did
DIR/index.json, DIR/index/…           what there is, and what changed, see `changes`
DIR/drivers/puppet/urcpm.json         the same in the thesis's form
"""

import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from urc.packages import disk
from urc.packages.archive import PACKAGE
from urc.packages.changes import write_index
from urc.packages.index import INDEX, INDEX_BYTES, Entry, Index, entry_of, read_index
from urc.packages.manifest import MANIFEST, Manifest
from urc.packages.names import FOLDERS, PackageError, parse_key
from urc.packages.package import Package, open_package, pack_folder, sha256
from urc.packages.signature import Signature, Signer

__all__ = ["Listing", "changing", "keep", "make_index", "read_signature", "urcpm"]

_THESIS: Final = ("driver", "interface", "widget")
_PACKAGES_MOST: Final = 20_000
_SIGNED: Final = ".sig"


class Listing(NamedTuple):
    """What came of looking through a repository's folder."""

    listed: Index
    faults: tuple[str, ...]
    """One line for each package that is not listed."""


def make_index(
    folder: Path, name: str, examine: Callable[[Path], list[str]], signer: Signer | None = None
) -> Listing:
    """Look at every package in a folder, list those that are sound, and write `index.json`.

    Args:
        folder: the repository.
        name: what it is called.
        examine: returns what is wrong with a package's document, one line each.
        signer: signs what is new in the keeper's folders.

    Raises:
        PackageError: there is no such folder, or it cannot be written to.
    """
    if not folder.is_dir():
        raise PackageError(f"{folder}: there is no such folder")
    try:
        with changing(folder) as work:
            faults: list[str] = []
            for home in _homes(folder):
                faults += _take(folder, home, work, examine, signer)
            entries = []
            known = _known(folder)
            for file in _archives(folder):
                try:
                    entries.append(_entry(folder, file, known))
                except PackageError as error:
                    faults.append(str(error))
            index = write_index(folder, name, entries, work)
    except OSError as error:
        raise PackageError(f"{error.filename or folder}: {error.strerror or error}") from None
    return Listing(index, tuple(faults))


@contextmanager
def changing(folder: Path) -> Iterator[Path]:
    """Keep other processes from changing a repository; yields a folder for what is not whole yet.

    Raises:
        PackageError: another one changes it for longer than ten seconds.
    """
    work = folder / ".work"
    with disk.exclusive(folder / ".changing"):
        shutil.rmtree(work, ignore_errors=True)
        try:
            yield work
        finally:
            shutil.rmtree(work, ignore_errors=True)


def keep(folder: Path, package: Package, signature: Signature | None, work: Path) -> Entry:
    """Put an archive into a repository; it is listed when the index is written next.

    The signature goes first: an archive that is there is whole in every way.
    """
    entry = entry_of(package, signature)
    archive = folder / entry.file
    if signature is not None:
        disk.put_file(archive.with_suffix(_SIGNED), msgspec.json.encode(signature) + b"\n", work)
    elif not archive.is_file():
        archive.with_suffix(_SIGNED).unlink(missing_ok=True)  # of another try, with other bytes
    if not archive.is_file():
        disk.put_file(archive, package.data, work)
    return entry


def _homes(folder: Path) -> list[Path]:
    """Return the folders of packages that the keeper writes in."""
    return sorted(
        home
        for kind in FOLDERS
        if (folder / kind).is_dir()
        for home in (folder / kind).iterdir()
        if (home / MANIFEST).is_file()
    )


def _take(
    folder: Path,
    home: Path,
    work: Path,
    examine: Callable[[Path], list[str]],
    signer: Signer | None,
) -> list[str]:
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
        signature = signer.sign(said.key, said.version, package.digest) if signer else None
        keep(folder, package, signature, work)
    if said.key.kind in _THESIS:
        disk.put_file(home / "urcpm.json", urcpm(said, package.files), work)
    return []


def _known(folder: Path) -> dict[str, Entry]:
    """Return what the last index says, by file: an archive of the same bytes is not read again."""
    try:
        with open(folder / INDEX, "rb") as file:
            index = read_index(file.read(INDEX_BYTES + 1), INDEX)
    except (OSError, PackageError):
        return {}
    return {entry.file: entry for entry in index.packages}


def _archives(folder: Path) -> list[Path]:
    found = sorted((folder / "archives").glob("*/*/*.zip"))
    if len(found) > _PACKAGES_MOST:
        raise PackageError(f"{folder}: more than {_PACKAGES_MOST} archives")
    return found


def _entry(folder: Path, file: Path, known: Mapping[str, Entry]) -> Entry:
    with open(file, "rb") as opened:
        data = opened.read(PACKAGE.archive_bytes + 1)
    signature = read_signature(file)
    entry = known.get(file.relative_to(folder).as_posix())
    is_known = entry is not None and entry.sha256 == sha256(data) and entry.signed == signature
    if entry is None or not is_known:
        package = open_package(data, str(file))
        entry = entry_of(package, signature)
        if signature is not None:
            signature.check(entry.key, entry.version, entry.sha256)
    if folder / entry.file != file:
        raise PackageError(f"{file}: this is {entry}, which belongs into {folder / entry.file}")
    return entry


def read_signature(archive: Path) -> Signature | None:
    """Return the signature that stands beside an archive, or None; raise `PackageError`."""
    file = archive.with_suffix(_SIGNED)
    try:
        with open(file, "rb") as opened:
            return msgspec.json.decode(opened.read(4096), type=Signature)
    except FileNotFoundError:
        return None
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise PackageError(f"{file}: this is no signature: {error}") from None


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
