"""A repository's folder: source packages and files that any web server can serve.

    DIR/drivers/puppet/package.yaml …     source of a package, edited by the maintainer
    DIR/archives/drivers/puppet/1.0.0.zip every version that was ever listed
    DIR/archives/drivers/puppet/1.0.0.sig signature of the archive, if any
    DIR/archives/drivers/puppet/1.0.0.json origin and withdrawal of the version
    DIR/index.json                        all versions, with a number that grows with each change
    DIR/blocks.json                       blocked packages, a part of the next index
    DIR/index/head.json                   number and digest of the index, signed by the maintainer
    DIR/drivers/puppet/urcpm.json         the package's description in the form of the URC thesis

A repository's server sends only the files that the index lists.
"""

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from urc.packages import atomic_files
from urc.packages.archive import PACKAGE
from urc.packages.blocks import BLOCK_FILE_BYTES, BlockList
from urc.packages.index import INDEX, INDEX_BYTES, Index, IndexEntry, entry_of, in_order, read_index
from urc.packages.index_head import (
    HEAD,
    HEAD_BYTES,
    IndexHead,
    IndexSigner,
    check_key,
    next_head,
    read_head,
)
from urc.packages.manifest import MANIFEST, Manifest
from urc.packages.names import FOLDERS, PackageError, PackageId, parse_key
from urc.packages.package import Package, open_package, pack_folder, sha256
from urc.packages.signature import Signature, Signer
from urc.packages.version_notes import Notes, Provenance, read_notes, write_notes

__all__ = [
    "BLOCKS",
    "IndexListing",
    "changing",
    "head_in",
    "keep",
    "make_index",
    "notes_of",
    "read_signature",
    "renew",
    "urcpm",
    "withdraw",
    "write_index",
]

BLOCKS: Final = "blocks.json"
"""File with the repository's block list."""
_THESIS: Final = ("driver", "interface", "widget")
_PACKAGES_MOST: Final = 20_000
_SIGNED: Final = ".sig"


class IndexListing(NamedTuple):
    """Result of `make_index`: the new index, and the errors in rejected packages."""

    listed: Index
    faults: tuple[str, ...]
    """Error messages about the rejected packages."""


def make_index(
    folder: Path,
    name: str,
    examine: Callable[[Path], list[str]],
    index_signer: IndexSigner | None = None,
) -> IndexListing:
    """Check every package in a folder, list the valid packages, and write `index.json`.

    Args:
        folder: the repository's folder.
        name: the repository's name.
        examine: function that returns the errors in a package's document, one per line.
        index_signer: maintainer's signer for the index and for new source packages.

    Raises:
        PackageError: the folder is missing or not writable.
    """
    if not folder.is_dir():
        raise PackageError(f"{folder}: the folder does not exist")
    try:
        with changing(folder) as work:
            faults: list[str] = []
            signer = index_signer.signer if index_signer is not None else None
            for home in _homes(folder):
                faults += _take(folder, home, work, examine, signer)
            entries = []
            known = _known(folder)
            for file in _archives(folder):
                try:
                    entries.append(_entry(folder, file, known))
                except PackageError as error:
                    faults.append(str(error))
            index = write_index(folder, name, entries, work, index_signer)
    except OSError as error:
        raise PackageError(f"{error.filename or folder}: {error.strerror or error}") from None
    return IndexListing(index, tuple(faults))


@contextmanager
def changing(folder: Path) -> Iterator[Path]:
    """Lock a repository against other processes and yield a folder for incomplete files.

    Raises:
        PackageError: another process has held the lock for more than ten seconds.
    """
    work = folder / ".work"
    with atomic_files.exclusive(folder / ".changing"):
        shutil.rmtree(work, ignore_errors=True)
        try:
            yield work
        finally:
            shutil.rmtree(work, ignore_errors=True)


def keep(
    folder: Path,
    package: Package,
    signature: Signature | None,
    work: Path,
    notes: Notes | None = None,
) -> IndexEntry:
    """Add an archive to a repository, to be listed in the next index.

    The signature and the notes are written before the archive, so an existing archive is always
    complete.
    """
    entry = entry_of(package, signature, notes)
    archive = folder / entry.file
    write_notes(archive, notes or Notes(), work)
    if signature is not None:
        atomic_files.put_file(
            archive.with_suffix(_SIGNED), msgspec.json.encode(signature) + b"\n", work
        )
    elif not archive.is_file():
        archive.with_suffix(_SIGNED).unlink(missing_ok=True)  # from an interrupted attempt
    if not archive.is_file():
        atomic_files.put_file(archive, package.data, work)
    return entry


def notes_of(entry: IndexEntry) -> Notes:
    """Return the notes in an index entry; raise `PackageError` for invalid notes."""
    provenance = entry.provenance if isinstance(entry.provenance, Provenance) else None
    try:
        return Notes(entry.why_withdrawn, provenance)
    except ValueError as error:
        raise PackageError(f"{entry}: {error}") from None


def withdraw(
    folder: Path, key: PackageId, version: str, why: str, index_signer: IndexSigner | None
) -> IndexEntry:
    """Withdraw a version or make it available again; return the version's index entry.

    Args:
        folder: the repository's folder.
        key: the package.
        version: its version.
        why: reason shown to users of the version; "" to make the version available again.
        index_signer: maintainer's signer, for a signed index.

    Raises:
        PackageError: the version is not listed, or the repository is not writable.
    """
    try:
        with changing(folder) as work:
            with open(folder / INDEX, "rb") as file:
                index = read_index(file.read(INDEX_BYTES + 1), INDEX)
            head = head_in(folder)
            check_key(head, index_signer)  # before any write
            before = _listed(index, key, version)
            after = msgspec.structs.replace(before, withdrawn=why or msgspec.UNSET)
            notes = _checked(notes_of(after))
            entries = [after if one is before else one for one in index.packages]
            # Write the note first, so that an index written in the meantime agrees with it.
            write_notes(folder / before.file, notes, work)
            is_signed = head is not None and head.signed is not None
            write_index(folder, index.name, entries, work, index_signer if is_signed else None)
    except OSError as error:
        raise PackageError(f"{error.filename or folder}: {error.strerror or error}") from None
    return after


def _listed(index: Index, key: PackageId, version: str) -> IndexEntry:
    for one in index.packages:
        if (one.key, one.version) == (key, version):
            return one
    there = ", ".join(one.version for one in index.packages if one.key == key)
    raise PackageError(f"{key} {version} is not listed; listed versions: {there or 'none'}")


def _checked(notes: Notes) -> Notes:
    """Return the notes if they can be encoded and decoded again; otherwise raise `PackageError`."""
    try:
        return msgspec.json.decode(msgspec.json.encode(notes), type=Notes)
    except msgspec.DecodeError as error:
        raise PackageError(f"--why: {error}") from None


def renew(folder: Path, index_signer: IndexSigner) -> None:
    """Renew an index's signature if necessary; raise `PackageError` or `OSError` on failure."""
    with changing(folder) as work:
        with open(folder / INDEX, "rb") as file:
            index = read_index(file.read(INDEX_BYTES + 1), INDEX)
        write_index(folder, index.name, index.packages, work, index_signer)


def write_index(
    folder: Path,
    name: str,
    entries: Sequence[IndexEntry],
    work: Path,
    index_signer: IndexSigner | None = None,
) -> Index:
    """Write a repository's index, then its head.

    Every served file is complete, even after an interruption. The next call repairs missing files.

    Args:
        folder: the repository's folder, locked against other processes.
        name: the repository's name.
        entries: all versions.
        work: folder for incomplete files.
        index_signer: maintainer's signer, which signs the head.

    Raises:
        PackageError: the index is signed with another key; no file has been changed.
        OSError: writing failed, for example because the disk is full.
    """
    before, number = _before(folder)
    index = Index(1, name, in_order(entries), number, _blocks(folder))
    if is_new := before != index:
        number += 1
        index = msgspec.structs.replace(index, number=number)
    data = index.to_bytes()
    head = next_head(head_in(folder), number, sha256(data), index_signer).to_bytes()
    if is_new:
        atomic_files.put_file(folder / INDEX, data, work)
    if _content(folder / HEAD, HEAD_BYTES) != head:
        atomic_files.put_file(folder / HEAD, head, work)
    return index


def _blocks(folder: Path) -> BlockList | msgspec.UnsetType:
    """Return the block list of a repository's folder; raise `PackageError` for a damaged file."""
    data = _content(folder / BLOCKS, BLOCK_FILE_BYTES)
    try:
        return msgspec.UNSET if data is None else msgspec.json.decode(data, type=BlockList)
    except (ValueError, PackageError) as error:
        raise PackageError(f"{folder / BLOCKS}: this file is damaged: {error}") from None


def _before(folder: Path) -> tuple[Index | None, int]:
    """Return the current index, or None if it is damaged, and the number of the index."""
    data = _content(folder / INDEX, INDEX_BYTES + 1)
    with suppress(PackageError):
        if data is not None:
            index = read_index(data, INDEX)
            # A number identifies the exact bytes of an index, so different bytes need a new number.
            return (index if data == index.to_bytes() else None), index.number
    head = head_in(folder)
    return None, head.number if head is not None else 0


def head_in(folder: Path) -> IndexHead | None:
    """Return the head in a repository's folder; None if there is no valid head."""
    with suppress(PackageError):
        return read_head(_content(folder / HEAD, HEAD_BYTES) or b"", HEAD)
    return None


def _content(file: Path, most: int) -> bytes | None:
    try:
        with open(file, "rb") as opened:
            return opened.read(most)
    except FileNotFoundError:
        return None


def _homes(folder: Path) -> list[Path]:
    """Return the folders of the maintainer's source packages."""
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
    """Write the archive of a source package's new version; return the errors that prevent this."""
    try:
        package = pack_folder(home)
    except PackageError as error:
        return [str(error)]
    said = package.manifest
    wanted = folder / str(said.key)
    if home != wanted:
        return [f"{home}: expected {said.key} in {wanted}"]
    entry = entry_of(package)
    archive = folder / entry.file
    if archive.is_file():
        if archive.read_bytes() != package.data:
            return [
                f"{home}: the package has changed since {entry} was listed; increase its version"
            ]
    else:
        if faults := examine(home / said.main):
            return faults
        signature = signer.sign(said.key, said.version, package.digest) if signer else None
        keep(folder, package, signature, work)
    if said.key.kind in _THESIS:
        atomic_files.put_file(home / "urcpm.json", urcpm(said, package.files), work)
    return []


def _known(folder: Path) -> dict[str, IndexEntry]:
    """Return the last index's entries by file, so that known archives need no parsing."""
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


def _entry(folder: Path, file: Path, known: Mapping[str, IndexEntry]) -> IndexEntry:
    with open(file, "rb") as opened:
        data = opened.read(PACKAGE.archive_bytes + 1)
    signature, notes = read_signature(file), read_notes(file)
    entry = known.get(file.relative_to(folder).as_posix())
    is_known = entry is not None and entry.sha256 == sha256(data) and entry.signed == signature
    if entry is None or not is_known or notes_of(entry) != notes:
        package = open_package(data, str(file))
        entry = entry_of(package, signature, notes)
        if signature is not None:
            signature.check(entry.key, entry.version, entry.sha256)
    if folder / entry.file != file:
        raise PackageError(f"{file}: expected {entry} in {folder / entry.file}")
    return entry


def read_signature(archive: Path) -> Signature | None:
    """Return an archive's signature; None if unsigned; raise `PackageError` if it is damaged."""
    file = archive.with_suffix(_SIGNED)
    try:
        with open(file, "rb") as opened:
            return msgspec.json.decode(opened.read(4096), type=Signature)
    except FileNotFoundError:
        return None
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise PackageError(f"{file}: this is not a signature: {error}") from None


def urcpm(said: Manifest, files: Mapping[str, bytes]) -> bytes:
    """Return a package's description in the format of figure B.2 of the URC thesis."""
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
