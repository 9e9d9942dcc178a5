"""What a repository does with a package that somebody sends: looks at it, then lists it, or not."""

from collections.abc import Callable
from pathlib import Path
from secrets import token_hex
from typing import NamedTuple

import msgspec

from urc.packages import disk
from urc.packages.archive import PACKAGE, read_archive
from urc.packages.head import Seal, check_key
from urc.packages.index import INDEX, INDEX_BYTES, Entry, entry_of, read_index
from urc.packages.install import check_names
from urc.packages.keeper import changing, head_in, keep, read_signature, write_index
from urc.packages.names import Key, PackageError
from urc.packages.notes import Notes, Provenance, read_notes
from urc.packages.package import Package, open_package
from urc.packages.resolver import resolve
from urc.packages.signature import Signature

__all__ = ["Refused", "Taken", "take"]


class Refused(PackageError):
    """A package that is not taken, with the status of HTTP that says so."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


class Taken(NamedTuple):
    """What came of it."""

    entry: Entry
    is_new: bool
    """False: exactly this was listed already."""


def take(
    folder: Path,
    entry_file: str,
    data: bytes,
    signature: Signature | None,
    examine: Callable[[Path], list[str]],
    provenance: Provenance | None = None,
    seal: Seal | None = None,
) -> Taken:
    """List a package, after looking at it as at any that a stranger sends.

    Args:
        folder: the repository.
        entry_file: ``archives/drivers/puppet/1.0.0.zip``, what it was sent as.
        data: the archive.
        signature: who signed it, if anybody says so.
        examine: returns what is wrong with a document that stands in a folder of packages.
        provenance: where it was made, if anybody says so.
        seal: the keeper's, which signs the index.

    Raises:
        Refused: with what is wrong.
        OSError: the disk is full, for example; what was listed stays as it was.
    """
    package, entry = _opened(entry_file, data, signature)
    with changing(folder) as work:
        with open(folder / INDEX, "rb") as file:
            index = read_index(file.read(INDEX_BYTES + 1), INDEX)
        check_key(head_in(folder), seal)  # before anything is written
        archive = folder / entry.file
        is_known = archive.is_file()
        if is_known and archive.read_bytes() != data:
            raise Refused(
                409,
                f"{entry} is listed with other bytes already;"
                " a changed package needs a new version",
            )
        before = read_signature(archive) if is_known else None
        if before is not None and signature is not None and before != signature:
            raise Refused(409, f"{entry} is listed already, signed by {before}")
        notes = _noted(read_notes(archive) if is_known else Notes(), provenance, entry)
        entry = entry_of(package, signature or before, notes)
        if entry in index.packages:
            return Taken(entry, False)
        others = [one for one in index.packages if one.file != entry.file]
        if not is_known:
            _look(package, entry, others, folder, work, examine)
        entry = keep(folder, package, signature or before, work, notes)
        write_index(folder, index.name, [*others, entry], work, seal)
    return Taken(entry, True)


def _noted(notes: Notes, provenance: Provenance | None, entry: Entry) -> Notes:
    """Return the notes about a version, and where it was made; the first who says that counts."""
    if None not in (notes.provenance, provenance) and notes.provenance != provenance:
        raise Refused(409, f"{entry} is listed already, {notes.provenance}")
    return msgspec.structs.replace(notes, provenance=notes.provenance or provenance)


def _opened(file: str, data: bytes, signature: Signature | None) -> tuple[Package, Entry]:
    """Return the package in an archive that somebody sent, and what the index would say of it."""
    try:
        package = open_package(data, file)
        entry = entry_of(package, signature)
        if entry.file != file:
            raise PackageError(f"{file}: this is {entry}, which belongs to {entry.file}")
        check_names([entry.key])
        if signature is not None:
            signature.check(entry.key, entry.version, entry.sha256)
    except PackageError as error:
        raise Refused(422, str(error)) from None
    return package, entry


def _look(
    package: Package,
    entry: Entry,
    others: list[Entry],
    folder: Path,
    work: Path,
    examine: Callable[[Path], list[str]],
) -> None:
    """Put a package and all that it needs into a folder of its own, and look at it there."""
    known: dict[Key, list[Entry]] = {}
    for one in (*others, entry):
        if not one.why_withdrawn:
            known.setdefault(one.key, []).append(one)
    try:
        chosen = resolve(entry.key, entry.version, known)
        home = work / token_hex(8)
        for key, one in chosen.items():
            files = package.files
            if one is not entry:
                with open(folder / one.file, "rb") as file:
                    files = read_archive(file.read(PACKAGE.archive_bytes + 1), PACKAGE, str(one))
            disk.put_folder(home / str(key), files, work)
    except PackageError as error:
        raise Refused(422, str(error)) from None
    faults = examine(home / str(entry.key) / package.manifest.main)
    if faults:
        told = [fault.replace(f"{home}/", "") for fault in faults]
        raise Refused(422, "; ".join(told))
