"""A backup archive: one private ZIP file with the permanent content of a data folder.

Layer 4. The archive begins with ``urc-backup.json``. All other files match `PARTS`. Links,
oversized files and paths that do not match `PARTS` are rejected, so a foreign archive cannot write
outside the data folder. Copies of SQLite files are consistent, even while a server is writing.
"""

import os
import re
import sqlite3
import stat
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import IO, Annotated, Final, NamedTuple

import msgspec

from urc.packages.store import Store
from urc.private_files import make_private
from urc.problems import UrcError

__all__ = [
    "BackupError",
    "BackupReader",
    "BackupManifest",
    "opened_backup",
    "parts_in",
    "write_backup",
]

PARTS: Final = re.compile(
    r"(?:access\.sqlite|alarms\.sqlite|audit\.sqlite|known_hosts|publisher\.pem"
    r"|contact-times\.json"
    r"|fleet/(?:authority/)?\w[\w-]{0,100}\.(?:pem|key|json)"
    r"|tls/\w[\w.-]{0,100}|robots/[\w%~-][\w.%~-]{0,250}\.json"
    r"|latches/(?:emulated/)?\w[\w.-]{0,100}\.latch\.json"
    r"|packages/(?:state|blocks)\.json|packages/blobs/[0-9a-f]{64}\.zip"
    r"|packages/signatures/[0-9a-f]{64}\.json|packages/repositories/\w[\w.-]{0,100}\.json)",
    re.ASCII,
)
"""Paths of the files in a backup, relative to the data folder."""
LEFT_OUT: Final = re.compile(
    r"(?:servers|packages/(?:ecosystems|work|blocking-work)|restoring-\w+|replaced-\w+)/.*"
    r"|fleet/(?:authority/)?lock|packages/(?:changing|blocking|repositories/changing)"
    r"|simulator_host_key|audit-before-\w+\.sqlite|.*\.(?:new|broken)|.*\.sqlite-(?:wal|shm|journal)",
    re.ASCII,
)
"""Files that are not backed up: URC recreates them, or they belong to one run of a server."""
MANIFEST: Final = "urc-backup.json"
MOST_FILES: Final = 20_000
MOST_BYTES: Final = 2_000_000_000
"""Maximum total size of all files, in bytes."""
_MANIFEST_BYTES: Final = 4096
_BLOCK: Final = 1 << 20
_END_BYTES: Final = 22
_ENTRY_BYTES: Final = 512
"""Maximum average size of the entries in the archive's directory, in bytes."""
_DAMAGE: Final = (
    zipfile.BadZipFile, zlib.error, struct.error, EOFError, ValueError, RuntimeError, OverflowError,
)  # fmt: skip
"""Exceptions that `zipfile` raises for damaged archives."""
_READABLE: Final = 0o644
_PRIVATE: Final = 0o600


class BackupError(UrcError):
    """A backup cannot be written, read or restored; the message states the reason."""


class BackupManifest(msgspec.Struct, frozen=True):
    """The description of a backup."""

    format: Annotated[int, msgspec.Meta(ge=1)]
    version: Annotated[str, msgspec.Meta(max_length=100)]
    """Version of URC that wrote the backup."""
    made_at: float
    """UTC time of the backup, in seconds since 1970."""


class BackupFile(NamedTuple):
    """One file in an archive."""

    path: str
    """Path relative to the data folder, with ``/`` as the separator."""
    size: int
    mode: int
    """Permission bits."""


def parts_in(data: Path) -> tuple[list[str], list[str]]:
    """Return the files in a data folder that belong in a backup, and all unknown files.

    Links count as unknown files.
    """
    parts: list[str] = []
    unknown: list[str] = []
    for folder, folders, files in os.walk(data):
        links = [name for name in folders if Path(folder, name).is_symlink()]
        for name in (*files, *links):
            file = Path(folder, name)
            path = file.relative_to(data).as_posix()
            if LEFT_OUT.fullmatch(path) or LEFT_OUT.fullmatch(f"{path}/"):
                continue
            is_file = stat.S_ISREG(file.lstat().st_mode)
            (parts if is_file and PARTS.fullmatch(path) else unknown).append(path)
    return sorted(parts), sorted(unknown)


def write_backup(data: Path, file: Path, manifest: BackupManifest) -> tuple[list[str], list[str]]:
    """Write a backup of a data folder; return the files in the backup and the unknown files.

    The file gets its name only when it is complete, and only its owner can read it.

    Args:
        data: the data folder.
        file: path of the archive; an existing file is replaced.
        manifest: description of the backup.

    Raises:
        BackupError: a file is too large, or a file cannot be read or written.
    """
    try:
        with tempfile.TemporaryDirectory(dir=file.parent, prefix=".urc-backup-") as work:
            new = Path(work) / "backup.zip"
            with open(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, _PRIVATE), "wb") as opened:
                with zipfile.ZipFile(opened, "w", zipfile.ZIP_DEFLATED) as archive:
                    archive.writestr(_entry(MANIFEST, _PRIVATE), msgspec.json.encode(manifest))
                    written, unknown = _write_parts(archive, data, Path(work))
                opened.flush()
                os.fsync(opened.fileno())
            os.replace(new, file)
    except (OSError, sqlite3.Error) as error:
        raise BackupError(f"the backup cannot be written: {_reason(error)}") from None
    return written, unknown


def _write_parts(archive: zipfile.ZipFile, data: Path, work: Path) -> tuple[list[str], list[str]]:
    total = 0
    written: list[str] = []
    with _still(data / "packages"):
        parts, unknown = parts_in(data)
        if len(parts) >= MOST_FILES:
            raise BackupError(f"{data} has {len(parts)} files; expected at most {MOST_FILES - 1}")
        for path in parts:
            source = data / path
            try:
                mode = stat.S_IMODE(source.lstat().st_mode)
                if path.endswith(".sqlite"):
                    source = _copy_of_base(source, work)
                total += _write_part(archive, _entry(path, mode), source, MOST_BYTES - total)
            except FileNotFoundError:
                continue  # since removed by the running server
            written.append(path)
    return written, unknown


@contextmanager
def _still(packages: Path) -> Iterator[None]:
    """Keep other processes from changing the installed packages while the context is open."""
    if not packages.is_dir():
        yield
        return
    with Store(packages).changing():
        yield


def _copy_of_base(source: Path, work: Path) -> Path:
    """Return a consistent copy of an SQLite file, even while other processes write to it."""
    copy = work / source.name
    with (
        closing(sqlite3.connect(f"{source.absolute().as_uri()}?mode=ro", uri=True)) as old,
        closing(sqlite3.connect(copy)) as new,
    ):
        old.backup(new)
        new.execute("PRAGMA journal_mode = DELETE")
    return copy


def _write_part(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, source: Path, most: int) -> int:
    size = 0
    number = os.open(source, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0))
    with open(number, "rb") as opened, archive.open(entry, "w") as target:
        while block := opened.read(_BLOCK):
            size += len(block)
            if size > most:
                raise BackupError(f"the data folder has more than {MOST_BYTES} bytes")
            target.write(block)
    return size


def _entry(path: str, mode: int) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(path)
    entry.create_system = 3  # Unix, which defines the meaning of the mode
    entry.external_attr = (stat.S_IFREG | mode) << 16
    entry.compress_type = zipfile.ZIP_DEFLATED
    return entry


class BackupReader:
    """An open archive with checked names and sizes."""

    def __init__(self, opened: IO[bytes], name: str) -> None:
        """Read the archive's directory and check every entry.

        Args:
            opened: the archive.
            name: name of the archive, for messages.

        Raises:
            BackupError: the file is not a backup, or this version cannot restore it.
        """
        self._name = name
        try:
            _check_end(opened, name)
            self._archive = zipfile.ZipFile(opened)
            entries = self._archive.infolist()
        except (OSError, *_DAMAGE) as error:
            raise BackupError(f"{name}: the archive is damaged: {error}") from None
        if not entries or entries[0].filename != MANIFEST:
            raise BackupError(f"{name}: this is not a URC backup")
        self.manifest = self._manifest(entries[0])
        self.files = [self._checked(entry) for entry in entries[1:]]
        """All files in the archive."""
        paths = [one.path for one in self.files]
        if len(set(map(str.casefold, paths))) != len(paths):
            raise BackupError(f"{name}: a file occurs twice")
        if sum(one.size for one in self.files) > MOST_BYTES:
            raise BackupError(f"{name}: expected at most {MOST_BYTES} bytes in total")

    def extract(self, folder: Path) -> None:
        """Write all files into an empty folder; folders are accessible only to the owner.

        Raises:
            BackupError: the archive is damaged, or a file cannot be written.
        """
        try:
            for one in self.files:
                target = folder / one.path
                make_private(target.parent)
                flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
                with (
                    self._archive.open(one.path) as source,
                    open(os.open(target, flags, one.mode), "wb") as opened,
                ):
                    self._copy(source, opened, one)
                    opened.flush()
                    os.fsync(opened.fileno())
        except _DAMAGE as error:
            raise BackupError(f"{self._name}: the archive is damaged: {error}") from None
        except OSError as error:
            raise BackupError(f"the backup cannot be extracted: {_reason(error)}") from None

    def _copy(self, source: IO[bytes], target: IO[bytes], one: BackupFile) -> None:
        left = one.size
        while block := source.read(_BLOCK):
            left -= len(block)
            if left < 0:
                break
            target.write(block)
        if left:
            raise BackupError(f"{self._name}: {one.path!r} does not have its declared size")

    def _manifest(self, entry: zipfile.ZipInfo) -> BackupManifest:
        try:
            with self._archive.open(entry) as opened:
                data = opened.read(_MANIFEST_BYTES)
            manifest = msgspec.json.decode(data, type=BackupManifest)
        except (msgspec.DecodeError, OSError, *_DAMAGE):
            raise BackupError(f"{self._name}: the description of the backup is damaged") from None
        if manifest.format != 1:
            raise BackupError(f"{self._name}: a newer version of URC created this backup")
        return manifest

    def _checked(self, entry: zipfile.ZipInfo) -> BackupFile:
        path, mode = entry.orig_filename, entry.external_attr >> 16
        if not PARTS.fullmatch(path) or path != entry.filename:
            raise BackupError(f"{self._name}: {path[:200]!r} is not part of a backup")
        if stat.S_IFMT(mode) not in (0, stat.S_IFREG):
            raise BackupError(f"{self._name}: {path!r} is not an ordinary file")
        if entry.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise BackupError(f"{self._name}: {path!r} uses an unknown compression method")
        # Only package files may be readable by others: a changed mode must not expose a key.
        allowed = _READABLE if path.startswith("packages/") else _PRIVATE
        return BackupFile(path, entry.file_size, mode & allowed | _PRIVATE)


@contextmanager
def opened_backup(file: Path) -> Iterator[BackupReader]:
    """Open a backup.

    Raises:
        BackupError: the file cannot be read or is not a backup.
    """
    try:
        opened = file.open("rb")
    except OSError as error:
        raise BackupError(f"{file}: {error.strerror or error}") from None
    with opened:
        yield BackupReader(opened, str(file))


def _check_end(opened: IO[bytes], name: str) -> None:
    """Check the size of the archive's directory, because `zipfile` reads it completely."""
    size = os.fstat(opened.fileno()).st_size
    opened.seek(max(0, size - _END_BYTES))
    end = opened.read(_END_BYTES)
    if len(end) < _END_BYTES or not end.startswith(b"PK\x05\x06"):
        raise BackupError(f"{name}: this is not a URC backup, or the file is truncated")
    count, directory = struct.unpack("<HI", end[10:16])
    if count > MOST_FILES or directory > MOST_FILES * _ENTRY_BYTES:
        raise BackupError(f"{name}: the archive has too many files")


def _reason(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror}"
    return str(error)
