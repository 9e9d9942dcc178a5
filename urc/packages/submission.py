"""Uploads to a repository: package checks and listing."""

from collections.abc import Callable
from pathlib import Path
from secrets import token_hex
from typing import NamedTuple

import msgspec

from urc.packages import atomic_files
from urc.packages.archive import PACKAGE, read_archive
from urc.packages.index import INDEX, INDEX_BYTES, IndexEntry, entry_of, read_index
from urc.packages.index_builder import changing, head_in, keep, read_signature, write_index
from urc.packages.index_head import IndexSigner, check_key
from urc.packages.install import check_names
from urc.packages.names import PackageError, PackageId
from urc.packages.package import Package, open_package
from urc.packages.resolver import resolve
from urc.packages.signature import Signature
from urc.packages.version_notes import Notes, Provenance, read_notes

__all__ = ["SubmissionRefused", "SubmissionResult", "take"]


class SubmissionRefused(PackageError):
    """Raised for a rejected upload, with the HTTP status of the response."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


class SubmissionResult(NamedTuple):
    """Result of an accepted upload: its index entry, and whether the version is new."""

    entry: IndexEntry
    is_new: bool
    """Whether the version is new; False if the repository already listed the version."""


def take(
    folder: Path,
    entry_file: str,
    data: bytes,
    signature: Signature | None,
    examine: Callable[[Path], list[str]],
    provenance: Provenance | None = None,
    index_signer: IndexSigner | None = None,
) -> SubmissionResult:
    """Check an untrusted package and list it in the repository's index.

    Args:
        folder: the repository's folder.
        entry_file: path of the upload, such as ``archives/drivers/puppet/1.0.0.zip``.
        data: the archive.
        signature: the package's signature; None for an unsigned package.
        examine: function that returns the errors in a document within a folder of packages.
        provenance: declared origin of the package, if any.
        index_signer: signer of the index, with the maintainer's key.

    Raises:
        SubmissionRefused: the upload is rejected.
        OSError: writing failed, for example because the disk is full. A failed write leaves the
            repository's index unchanged.
    """
    package, entry = _opened(entry_file, data, signature)
    with changing(folder) as work:
        with open(folder / INDEX, "rb") as file:
            index = read_index(file.read(INDEX_BYTES + 1), INDEX)
        check_key(head_in(folder), index_signer)  # before any write
        archive = folder / entry.file
        is_known = archive.is_file()
        if is_known and archive.read_bytes() != data:
            raise SubmissionRefused(
                409,
                f"{entry} is already listed with different content;"
                " a changed package needs a new version",
            )
        before = read_signature(archive) if is_known else None
        if before is not None and signature is not None and before != signature:
            raise SubmissionRefused(409, f"{entry} is already listed, signed by {before}")
        notes = _noted(read_notes(archive) if is_known else Notes(), provenance, entry)
        entry = entry_of(package, signature or before, notes)
        if entry in index.packages:
            return SubmissionResult(entry, False)
        others = [one for one in index.packages if one.file != entry.file]
        if not is_known:
            _look(package, entry, others, folder, work, examine)
        entry = keep(folder, package, signature or before, work, notes)
        write_index(folder, index.name, [*others, entry], work, index_signer)
    return SubmissionResult(entry, True)


def _noted(notes: Notes, provenance: Provenance | None, entry: IndexEntry) -> Notes:
    """Return the notes with the declared origin; refuse an origin that contradicts the notes."""
    if None not in (notes.provenance, provenance) and notes.provenance != provenance:
        raise SubmissionRefused(409, f"{entry} is already listed, {notes.provenance}")
    return msgspec.structs.replace(notes, provenance=notes.provenance or provenance)


def _opened(file: str, data: bytes, signature: Signature | None) -> tuple[Package, IndexEntry]:
    """Return the package in an uploaded archive and its index entry."""
    try:
        package = open_package(data, file)
        entry = entry_of(package, signature)
        if entry.file != file:
            raise PackageError(f"{file}: expected {entry} at {entry.file}")
        check_names([entry.key])
        if signature is not None:
            signature.check(entry.key, entry.version, entry.sha256)
    except PackageError as error:
        raise SubmissionRefused(422, str(error)) from None
    return package, entry


def _look(
    package: Package,
    entry: IndexEntry,
    others: list[IndexEntry],
    folder: Path,
    work: Path,
    examine: Callable[[Path], list[str]],
) -> None:
    """Extract a package and its dependencies into a separate folder, and check the package."""
    known: dict[PackageId, list[IndexEntry]] = {}
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
            atomic_files.put_folder(home / str(key), files, work)
    except PackageError as error:
        raise SubmissionRefused(422, str(error)) from None
    faults = examine(home / str(entry.key) / package.manifest.main)
    if faults:
        told = [fault.replace(f"{home}/", "") for fault in faults]
        raise SubmissionRefused(422, "; ".join(told))
