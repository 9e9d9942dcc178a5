"""Where packages come from: repositories, bundles, archives and folders, all alike."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Final, Protocol

from urc.packages.archive import BUNDLE, read_archive, write_archive
from urc.packages.index import INDEX, Entry, Index, entry_of, in_order, read_index
from urc.packages.manifest import MANIFEST
from urc.packages.names import Key, PackageError, parse_key
from urc.packages.package import Package, open_package, pack_folder, sha256
from urc.packages.signature import Signature

__all__ = ["FileSource", "Source", "make_bundle", "merged", "offered", "open_source"]

_ENDINGS: Final = (".urcof", ".zip")


class Source(Protocol):
    """Has packages."""

    @property
    def name(self) -> str:
        """What it is called in lines for people."""

    def entries(self) -> tuple[Entry, ...]:
        """Return every version of every package; raise `PackageError`."""

    def fetch(self, entry: Entry) -> bytes:
        """Return an archive with exactly the digest of the entry; raise `PackageError`."""


class FileSource:
    """A bundle, a package's archive, or a package's folder."""

    def __init__(
        self,
        name: str,
        packages: Iterable[Package],
        roots: Iterable[Key],
        signatures: Mapping[str, Signature] | None = None,
        *,
        is_folder: bool = False,
    ) -> None:
        self.name = name
        self.is_folder = is_folder
        """Whether it is somebody's own folder, in which packages are still being written."""
        self.signatures = dict(signatures or {})
        """Digest → who signed it, of what is signed."""
        self.roots = tuple(roots)
        """What is installed when the whole source is asked for."""
        self._packages = {package.digest: package for package in packages}

    def entries(self) -> tuple[Entry, ...]:
        """Return what is in it."""
        return tuple(
            entry_of(package, self.signatures.get(digest))
            for digest, package in self._packages.items()
        )

    @property
    def packages(self) -> tuple[Package, ...]:
        """What is in it, what is installed first of all at the front."""
        return tuple(self._packages.values())

    def fetch(self, entry: Entry) -> bytes:
        """Return an archive that is in it."""
        return self._packages[entry.sha256].data


def open_source(path: Path) -> FileSource:
    """Return what a path holds: a folder, an archive, or a bundle; raise `PackageError`."""
    if path.is_dir():
        packages = _pack_with_needs(path)
        return FileSource(str(path), packages, [packages[0].manifest.key], is_folder=True)
    if path.suffix not in _ENDINGS:
        raise PackageError(f"{path}: a folder, or a file that ends in .urcof or .zip, is expected")
    try:
        if not path.is_file():
            raise PackageError(f"{path}: there is no such file")
        with open(path, "rb") as file:
            data = file.read(BUNDLE.archive_bytes + 1)
    except OSError as error:
        raise PackageError(f"{path}: {error.strerror or error}") from None
    if path.suffix == ".urcof":
        return _open_bundle(data, str(path))
    package = open_package(data, str(path))
    return FileSource(str(path), [package], [package.manifest.key])


def _pack_with_needs(folder: Path) -> list[Package]:
    """Return the package in a folder, and those it needs that stand in the same repository."""
    packages = [pack_folder(folder)]
    top = folder.resolve().parent.parent
    known = {packages[0].manifest.key}
    for package in packages:  # grows while it is walked
        for key in map(parse_key, package.manifest.needs):
            home = top / str(key)
            if key not in known and (home / MANIFEST).is_file() and len(known) < BUNDLE.entries:
                known.add(key)
                packages.append(pack_folder(home))
    return packages


def make_bundle(
    root: Key, archives: Mapping[str, bytes], signatures: Mapping[str, Signature], name: str
) -> bytes:
    """Return the bytes of a bundle: a small repository in one file.

    Args:
        root: what somebody wants who installs it.
        archives: digest → bytes of `root` and of all that it needs.
        signatures: digest → who signed it, of what is signed.
        name: what it is called in errors.
    """
    entries = in_order(
        entry_of(open_package(data, digest), signatures.get(digest))
        for digest, data in archives.items()
    )
    files = {INDEX: Index(1, str(root), entries).to_bytes()}
    for entry in entries:
        files[entry.file] = archives[entry.sha256]
    return write_archive(files, BUNDLE, name)


def _open_bundle(data: bytes, name: str) -> FileSource:
    files = read_archive(data, BUNDLE, name)
    if INDEX not in files:
        raise PackageError(f"{name}: this is no bundle: there is no {INDEX} in it")
    index = read_index(files.pop(INDEX), f"{name}/{INDEX}")
    packages = []
    signatures: dict[str, Signature] = {}
    for entry in index.packages:
        found = files.pop(entry.file, b"")
        if sha256(found) != entry.sha256:
            raise PackageError(f"{name}: {entry}: the archive is missing, or has other bytes")
        package = open_package(found, f"{name}/{entry.file}")
        if entry.signed is not None:
            signatures[package.digest] = entry.signed
        if entry_of(package, signatures.get(package.digest)) != entry:
            raise PackageError(f"{name}: {entry}: the index says something else than the package")
        packages.append(package)
    if files:
        raise PackageError(f"{name}: {min(files)!r} is not in the index of this bundle")
    roots = [
        package.manifest.key for package in packages if str(package.manifest.key) == index.name
    ]
    if len(roots) != 1:
        raise PackageError(f"{name}: the bundle is for {index.name!r}, which is not in it once")
    return FileSource(name, packages, roots, signatures)


def offered(
    found: Mapping[Key, list[tuple[Entry, Source]]],
) -> dict[Key, list[tuple[Entry, Source]]]:
    """Return what was not withdrawn."""
    kept = {key: [one for one in some if not one[0].why_withdrawn] for key, some in found.items()}
    return {key: some for key, some in kept.items() if some}


def merged(
    sources: Iterable[Source], complain: Callable[[str], None]
) -> dict[Key, list[tuple[Entry, Source]]]:
    """Return every version of every package, the withdrawn ones too, and where it is from.

    The first source that has a package gives all its versions: another one, added later, cannot
    slip in a newer version under a name that is known.

    Args:
        sources: in the order in which they are asked.
        complain: takes one line for each that does not answer.
    """
    found: dict[Key, list[tuple[Entry, Source]]] = {}
    for source in sources:
        try:
            entries = source.entries()
        except PackageError as error:
            complain(str(error))
            continue
        fresh: dict[Key, list[tuple[Entry, Source]]] = {}
        for entry in entries:
            fresh.setdefault(entry.key, []).append((entry, source))
        found = fresh | found
    return found
