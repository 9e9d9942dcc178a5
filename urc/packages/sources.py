"""Package sources that share one interface: repositories, bundles, archives and folders."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Final, Protocol

from urc.packages.archive import BUNDLE, read_archive, write_archive
from urc.packages.index import INDEX, Index, IndexEntry, entry_of, in_order, read_index
from urc.packages.manifest import MANIFEST
from urc.packages.names import PackageError, PackageId, parse_key
from urc.packages.package import Package, open_package, pack_folder, sha256
from urc.packages.signature import Signature

__all__ = ["FileSource", "Source", "make_bundle", "merged", "offered", "open_source"]

_ENDINGS: Final = (".urcof", ".zip")


class Source(Protocol):
    """A source of packages, such as a repository, a bundle, an archive or a folder."""

    @property
    def name(self) -> str:
        """Name shown in messages."""

    def entries(self) -> tuple[IndexEntry, ...]:
        """Return every version of every package; raise `PackageError` on failure."""

    def fetch(self, entry: IndexEntry) -> bytes:
        """Return the archive with the digest of the entry; raise `PackageError` on failure."""


class FileSource:
    """A bundle, an archive or a folder as a source of packages."""

    def __init__(
        self,
        name: str,
        packages: Iterable[Package],
        roots: Iterable[PackageId],
        signatures: Mapping[str, Signature] | None = None,
        *,
        is_folder: bool = False,
    ) -> None:
        self.name = name
        self.is_folder = is_folder
        """Whether the source is a folder of packages in development."""
        self.signatures = dict(signatures or {})
        """Signatures of the signed archives, by digest of the archive."""
        self.roots = tuple(roots)
        """Packages to install if the user requests the whole source."""
        self._packages = {package.digest: package for package in packages}

    def entries(self) -> tuple[IndexEntry, ...]:
        """Return the index entries of all packages."""
        return tuple(
            entry_of(package, self.signatures.get(digest))
            for digest, package in self._packages.items()
        )

    @property
    def packages(self) -> tuple[Package, ...]:
        """All packages in the source. For a folder, the requested package comes first."""
        return tuple(self._packages.values())

    def fetch(self, entry: IndexEntry) -> bytes:
        """Return the archive of an index entry from this source."""
        return self._packages[entry.sha256].data


def open_source(path: Path) -> FileSource:
    """Return the source (folder, archive or bundle) at a path; raise `PackageError` on failure."""
    if path.is_dir():
        packages = _pack_with_needs(path)
        return FileSource(str(path), packages, [packages[0].manifest.key], is_folder=True)
    if path.suffix not in _ENDINGS:
        raise PackageError(f"{path}: expected a folder, or a file that ends in .urcof or .zip")
    try:
        if not path.is_file():
            raise PackageError(f"{path}: the file does not exist")
        with open(path, "rb") as file:
            data = file.read(BUNDLE.archive_bytes + 1)
    except OSError as error:
        raise PackageError(f"{path}: {error.strerror or error}") from None
    if path.suffix == ".urcof":
        return _open_bundle(data, str(path))
    package = open_package(data, str(path))
    return FileSource(str(path), [package], [package.manifest.key])


def _pack_with_needs(folder: Path) -> list[Package]:
    """Return the package in a folder and its dependencies in the same repository."""
    packages = [pack_folder(folder)]
    top = folder.resolve().parent.parent
    known = {packages[0].manifest.key}
    for package in packages:  # grows during the loop
        for key in map(parse_key, package.manifest.needs):
            home = top / str(key)
            if key not in known and (home / MANIFEST).is_file() and len(known) < BUNDLE.entries:
                known.add(key)
                packages.append(pack_folder(home))
    return packages


def make_bundle(
    root: PackageId, archives: Mapping[str, bytes], signatures: Mapping[str, Signature], name: str
) -> bytes:
    """Return the bytes of a bundle, which is a small repository in one file.

    Args:
        root: package to install.
        archives: archives of `root` and all its dependencies, by digest.
        signatures: signatures of signed archives, by digest.
        name: bundle name in error messages.
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
        raise PackageError(f"{name}: this is not a bundle: it has no {INDEX}")
    index = read_index(files.pop(INDEX), f"{name}/{INDEX}")
    packages = []
    signatures: dict[str, Signature] = {}
    for entry in index.packages:
        found = files.pop(entry.file, b"")
        if sha256(found) != entry.sha256:
            raise PackageError(
                f"{name}: {entry}: the archive is missing, or does not match its digest"
            )
        package = open_package(found, f"{name}/{entry.file}")
        if entry.signed is not None:
            signatures[package.digest] = entry.signed
        if entry_of(package, signatures.get(package.digest)) != entry:
            raise PackageError(f"{name}: {entry}: the index and the package disagree")
        packages.append(package)
    if files:
        raise PackageError(f"{name}: {min(files)!r} is not in the index of this bundle")
    roots = [
        package.manifest.key for package in packages if str(package.manifest.key) == index.name
    ]
    if len(roots) != 1:
        raise PackageError(
            f"{name}: the bundle is for {index.name!r}, but does not contain it exactly once"
        )
    return FileSource(name, packages, roots, signatures)


def offered(
    found: Mapping[PackageId, list[tuple[IndexEntry, Source]]],
) -> dict[PackageId, list[tuple[IndexEntry, Source]]]:
    """Return the available packages without their withdrawn versions."""
    kept = {key: [one for one in some if not one[0].why_withdrawn] for key, some in found.items()}
    return {key: some for key, some in kept.items() if some}


def merged(
    sources: Iterable[Source], complain: Callable[[str], None]
) -> dict[PackageId, list[tuple[IndexEntry, Source]]]:
    """Return every version of every package with its source, including withdrawn versions.

    For each package, all versions come from the first source that contains the package. A later
    source therefore cannot provide a newer version of a package from an earlier source.

    Args:
        sources: package sources, in the order in which they are queried.
        complain: callback that receives an error message about each unreachable source.
    """
    found: dict[PackageId, list[tuple[IndexEntry, Source]]] = {}
    for source in sources:
        try:
            entries = source.entries()
        except PackageError as error:
            complain(str(error))
            continue
        fresh: dict[PackageId, list[tuple[IndexEntry, Source]]] = {}
        for entry in entries:
            fresh.setdefault(entry.key, []).append((entry, source))
        found = fresh | found
    return found
