"""The archive format: reproducible ZIP files without compression.

Entries are stored without compression, sorted by path, and with a fixed date in 1980. The same
files therefore produce the same bytes on every machine, with any version of zlib. No entry can be
larger than its archive. Archives in any other form are rejected. URC uses the module `zipfile` only
to parse archives, never to extract them.
"""

import re
import struct
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO
from typing import Final, NamedTuple

from urc.packages.names import PackageError

__all__ = ["BUNDLE", "PACKAGE", "ArchiveLimits", "read_archive", "write_archive"]


_DEEPEST: Final = 8
_LONGEST: Final = 200
_PART = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,99}", re.ASCII)
_RESERVED = re.compile(r"(?i)(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.ASCII)
_ENDINGS: Final = frozenset(
    (
        "yaml",
        "yml",
        "json",
        "js",
        "css",
        "html",
        "j2",
        "svg",
        "png",
        "jpg",
        "jpeg",
        "webp",
        "gif",
        "txt",
        "md",
        "csv",
        "urdf",
        "stl",
        "glb",
        "gltf",
        "bin",
        "dae",
        "obj",
        "mtl",
        "woff2",
        "wav",
        "mp3",
        "ogg",
        "zip",
    )
)
_BARE: Final = frozenset(("LICENSE", "LICENCE", "NOTICE", "README", "AUTHORS"))


def name_fault(path: str) -> str:
    """Return an error message for an invalid path in a package; "" for a valid path."""
    if path.startswith(("/", "\\")) or re.match(r"[A-Za-z]:", path):
        return f"{path!r} is an absolute path"
    parts = path.split("/")
    if ".." in parts or ".." in path.split("\\"):
        return f"{path!r} points outside the package"
    if len(path) > _LONGEST or len(parts) > _DEEPEST:
        return f"{path[:_LONGEST]!r} is too long or too deep: expected at most {_DEEPEST} levels"
    for part in parts:
        if not _PART.fullmatch(part) or part.endswith(".") or _RESERVED.fullmatch(part):
            return (
                f"{path!r}: the name {part!r} is not allowed;"
                " use letters, digits, '-', '_' and '.', and no reserved system name"
            )
    last = parts[-1]
    if last not in _BARE and last.rpartition(".")[2].lower() not in _ENDINGS:
        return f"{path!r}: files of this type are not allowed in a package"
    return ""


def names_fault(paths: Sequence[str]) -> str:
    """Return an error message if some operating systems confuse two of the paths, otherwise ""."""
    seen: dict[str, str] = {}
    for path in paths:
        other = seen.setdefault(path.casefold(), path)
        if other is not path:
            if other == path:
                return f"{path!r} is present twice"
            return f"{path!r} and {other!r} differ only in case"
    return _folder_fault(seen)


def _folder_fault(seen: dict[str, str]) -> str:
    folders: dict[str, str] = {}
    for path in seen.values():
        for folder in _folders(path):
            other = folders.setdefault(folder.casefold(), folder)
            if other != folder:
                return f"{folder!r} and {other!r} differ only in case"
            if folder.casefold() in seen:
                return f"{folder!r} is both a file and a folder"
    return ""


def _folders(path: str) -> Iterable[str]:
    parts = path.split("/")
    return ("/".join(parts[:at]) for at in range(1, len(parts)))


class ArchiveLimits(NamedTuple):
    """Limits of an archive: number of files, bytes in one file, and bytes in all files."""

    entries: int
    entry_bytes: int
    total_bytes: int

    @property
    def archive_bytes(self) -> int:
        """Maximum size of the archive in bytes, including file headers."""
        return self.total_bytes + 1024 * self.entries


PACKAGE: Final = ArchiveLimits(200, 5 << 20, 20 << 20)
BUNDLE: Final = ArchiveLimits(129, PACKAGE.archive_bytes, 64 << 20)
_DATE: Final = (1980, 1, 1, 0, 0, 0)
_MODE: Final = 0o100644
_END: Final = b"PK\x05\x06"
_END_BYTES: Final = 22
_TYPES: Final = {0o120000: "a link", 0o060000: "a device", 0o020000: "a device", 0o010000: "a pipe"}


def write_archive(files: Mapping[str, bytes], limits: ArchiveLimits, name: str) -> bytes:
    """Return an archive that contains the given files.

    Args:
        files: file contents by path; paths are relative and use '/'.
        limits: the archive's limits.
        name: archive name in error messages.

    Raises:
        PackageError: a path is not portable, or a limit is exceeded.
    """
    _check_names(files, name, limits)
    _check_sizes(((path, len(content)) for path, content in files.items()), limits, name)
    return _written(files)


def read_archive(data: bytes, limits: ArchiveLimits, name: str) -> dict[str, bytes]:
    """Return the contents of an archive's files by path, sorted by path.

    Raises:
        PackageError: the archive is invalid.
    """
    if len(data) > limits.archive_bytes:
        raise PackageError(f"{name}: the archive is larger than {limits.archive_bytes >> 20} MiB")
    _check_end(data, limits, name)
    try:
        files = _read(data, limits, name)
    except (zipfile.BadZipFile, struct.error, EOFError, ValueError, OSError, RuntimeError,
            NotImplementedError, OverflowError) as error:  # fmt: skip
        raise PackageError(f"{name}: the archive is damaged or truncated: {error}") from None
    if _written(files) != data:
        raise PackageError(
            f"{name}: this archive differs from the form that URC writes;"
            " create the archive with 'urc bundle'"
        )
    return files


def _check_end(data: bytes, limits: ArchiveLimits, name: str) -> None:
    """Check a ZIP file's end record and number of entries, before its directory is parsed."""
    if not data.startswith(b"PK"):
        raise PackageError(f"{name}: this is not a package: expected a ZIP archive")
    end = data[-_END_BYTES:]
    if len(end) < _END_BYTES or not end.startswith(_END):
        raise PackageError(f"{name}: the archive is truncated, or has extra data at its end")
    entries, size, start = struct.unpack("<HII", end[10:20])
    if entries > limits.entries:
        raise PackageError(f"{name}: expected at most {limits.entries} entries, found {entries}")
    # `zipfile` reads the whole directory, even if the end record declares fewer entries.
    if start + size + _END_BYTES != len(data) or size > limits.entries * 1024:
        raise PackageError(
            f"{name}: the archive is damaged or truncated: its sizes are inconsistent"
        )


def _read(data: bytes, limits: ArchiveLimits, name: str) -> dict[str, bytes]:
    with zipfile.ZipFile(BytesIO(data)) as archive:
        entries = archive.infolist()
        if len(entries) > limits.entries:
            raise PackageError(
                f"{name}: expected at most {limits.entries} entries, found {len(entries)}"
            )
        for entry in entries:
            _check_entry(entry, name)
        _check_names([entry.orig_filename for entry in entries], name, limits)
        _check_sizes(((entry.filename, entry.file_size) for entry in entries), limits, name)
        return {entry.filename: archive.read(entry) for entry in entries}


def _check_entry(entry: zipfile.ZipInfo, name: str) -> None:
    path = entry.orig_filename
    kind = (entry.external_attr >> 16) & 0o170000
    if kind in _TYPES:
        raise PackageError(f"{name}: {path!r} is {_TYPES[kind]}; only regular files are allowed")
    if fault := name_fault(path):
        raise PackageError(f"{name}: {fault}")
    if entry.flag_bits & 1:
        raise PackageError(f"{name}: {path!r} is encrypted")
    if entry.compress_type != zipfile.ZIP_STORED or entry.compress_size != entry.file_size:
        raise PackageError(f"{name}: {path!r} is compressed; create the archive with 'urc bundle'")


def _check_names(paths: Iterable[str], name: str, limits: ArchiveLimits) -> None:
    known = list(paths)
    if len(known) > limits.entries:
        raise PackageError(f"{name}: expected at most {limits.entries} files, found {len(known)}")
    for fault in (*map(name_fault, known), names_fault(known)):
        if fault:
            raise PackageError(f"{name}: {fault}")


def _check_sizes(sizes: Iterable[tuple[str, int]], limits: ArchiveLimits, name: str) -> None:
    total = 0
    for path, size in sizes:
        total += size
        if size > limits.entry_bytes:
            raise PackageError(
                f"{name}: {path!r}: expected at most {limits.entry_bytes} bytes, found {size}"
            )
    if total > limits.total_bytes:
        raise PackageError(
            f"{name}: expected at most {limits.total_bytes} bytes in all files, found {total}"
        )


def _written(files: Mapping[str, bytes]) -> bytes:
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED, allowZip64=False) as archive:
        for path in sorted(files):
            entry = zipfile.ZipInfo(path, _DATE)
            entry.create_system = 3  # always Unix, as the mode bits require
            entry.external_attr = _MODE << 16
            archive.writestr(entry, files[path])
    return buffer.getvalue()
