"""A package: its manifest, its files and its reproducible archive."""

import hashlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from urc.packages.archive import PACKAGE, read_archive, write_archive
from urc.packages.manifest import MANIFEST, Manifest, parse_manifest
from urc.packages.names import PackageError
from urc.problems import ProblemsError
from urc.source import parse_document

__all__ = ["LEFT_OUT", "Package", "open_package", "pack_folder", "sha256"]

LEFT_OUT = ("urcpm.json",)
"""Generated files in a package's folder that are not part of the package."""


class Package(NamedTuple):
    """A complete package in memory, whose manifest and files have been checked."""

    manifest: Manifest
    files: dict[str, bytes]
    data: bytes
    """Bytes of the package's archive."""
    digest: str
    """SHA-256 of the archive, as 64 hexadecimal digits."""


def sha256(data: bytes) -> str:
    """Return the SHA-256 digest as hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()


def open_package(data: bytes, name: str) -> Package:
    """Return the package in an archive; raise `PackageError` with `name` in the message."""
    return _package(read_archive(data, PACKAGE, name), data, name)


def pack_folder(folder: Path) -> Package:
    """Return the package in a folder. Hidden files (names with a leading '.') are omitted.

    Raises:
        PackageError: the manifest is missing, or the folder contains a link or a forbidden file.
    """
    files: dict[str, bytes] = {}
    total = 0
    try:
        for path, file in _files(folder):
            if len(files) >= PACKAGE.entries:
                raise PackageError(f"{folder}: more than {PACKAGE.entries} files")
            with open(file, "rb") as opened:
                files[path] = opened.read(PACKAGE.entry_bytes + 1)
            total += len(files[path])
            if total > PACKAGE.total_bytes:
                raise PackageError(f"{folder}: more than {PACKAGE.total_bytes} bytes")
    except OSError as error:
        raise PackageError(f"{error.filename or folder}: {error.strerror or error}") from None
    if MANIFEST not in files:
        raise PackageError(f"{folder}: this is not a package: it has no {MANIFEST}")
    data = write_archive(files, PACKAGE, str(folder))
    return _package(dict(sorted(files.items())), data, str(folder))


def _files(folder: Path, below: str = "", depth: int = 0) -> Iterator[tuple[str, str]]:
    """Yield the relative and the absolute path of every file in a folder."""
    if depth > 8:
        raise PackageError(f"{folder}: folders are nested too deeply")
    with os.scandir(folder) as entries:
        found = sorted(entries, key=lambda entry: entry.name)
    for entry in found:
        path = f"{below}{entry.name}"
        if entry.name.startswith(".") or path in LEFT_OUT:
            continue
        mode = entry.stat(follow_symlinks=False).st_mode
        if stat.S_ISDIR(mode):
            yield from _files(folder / entry.name, f"{path}/", depth + 1)
        elif stat.S_ISREG(mode):
            yield path, entry.path
        else:
            raise PackageError(f"{entry.path}: only regular files are allowed in a package")


def _package(files: dict[str, bytes], data: bytes, name: str) -> Package:
    if MANIFEST not in files:
        raise PackageError(f"{name}: this is not a package: it has no {MANIFEST}")
    manifest = parse_manifest(files[MANIFEST], f"{name}/{MANIFEST}")
    if manifest.main not in files:
        raise PackageError(f"{name}: its document {manifest.main} is missing")
    _check_document(files[manifest.main], manifest, f"{name}/{manifest.main}")
    return Package(manifest, files, data, sha256(data))


def _check_document(content: bytes, manifest: Manifest, file: str) -> None:
    """Check that the document's kind and name agree with the manifest."""
    try:
        data = parse_document(content, file).data
    except ProblemsError as error:
        raise PackageError(str(error)) from None
    said = data if isinstance(data, dict) else {}
    for key, wanted in (("kind", manifest.key.kind), ("name", manifest.key.name)):
        if said.get(key) != wanted:
            raise PackageError(
                f"{file}: {key}: expected {wanted!r}, as in {MANIFEST}; found {said.get(key)!r}"
            )
