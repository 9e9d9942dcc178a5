"""Atomic file operations: a crash never leaves an incomplete file."""

import os
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex
from tempfile import mkdtemp
from typing import Final

from urc.packages.names import PackageError

__all__ = ["clear", "discard", "exclusive", "put_file", "put_folder"]

_WAIT_S: Final = 10.0
_POLL_S: Final = 0.05


def put_file(file: Path, data: bytes, work: Path) -> None:
    """Write a file atomically: a power failure leaves either the old or the new content.

    Args:
        file: the file's path; missing folders are created.
        data: complete content of the file.
        work: folder for incomplete files, on the same file system as `file`.

    Raises:
        OSError: the write failed, for example because the disk is full. The file keeps its old
            content.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    work.mkdir(parents=True, exist_ok=True)
    name = work / f"{token_hex(8)}.new"
    # `mkstemp` is not used, because another user's web server must be able to read a repository.
    number = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    try:
        try:
            _write_all(number, data)
            os.fsync(number)
        finally:
            os.close(number)
        os.replace(name, file)
    except BaseException:
        with suppress(OSError):
            os.unlink(name)
        raise
    _sync_folder(file.parent)


def put_folder(folder: Path, files: Mapping[str, bytes], work: Path) -> None:
    """Create a folder with exactly these files, or replace the folder, in one step.

    WARNING: the files are not synced to the disk, because their archives remain available. Readers
        must compare the files with their archives.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    work.mkdir(parents=True, exist_ok=True)
    made = Path(mkdtemp(dir=work))
    try:
        for path, data in files.items():
            file = made / path
            file.parent.mkdir(parents=True, exist_ok=True)
            number = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
            try:
                _write_all(number, data)
            finally:
                os.close(number)
        discard(folder, work)
        os.replace(made, folder)
    except BaseException:
        shutil.rmtree(made, ignore_errors=True)
        raise


def discard(path: Path, work: Path) -> None:
    """Delete a file or folder if it exists. Folders are deleted in one step."""
    if not path.is_dir():
        path.unlink(missing_ok=True)
        return
    try:
        work.mkdir(parents=True, exist_ok=True)
        gone = Path(mkdtemp(dir=work))
        os.replace(path, gone / "gone")
    except OSError:  # a full disk may have no space for the new name
        gone = path
    shutil.rmtree(gone, ignore_errors=True)


def clear(work: Path) -> None:
    """Delete incomplete files left by an interrupted change."""
    if work.is_dir():
        for entry in work.iterdir():
            if entry.is_dir():
                shutil.rmtree(entry, ignore_errors=True)
            else:
                entry.unlink(missing_ok=True)


@contextmanager
def exclusive(file: Path) -> Iterator[None]:
    """Hold the lock file `file`, which excludes other processes, while the context is active.

    A crash of this process releases the lock.

    Raises:
        PackageError: another process has held the lock for more than ten seconds.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    number = os.open(file, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        deadline = time.monotonic() + _WAIT_S
        while not _is_locked(number):
            if time.monotonic() > deadline:
                raise PackageError(
                    f"{file.parent}: another URC process is changing packages; try again"
                )
            time.sleep(_POLL_S)
        yield
    finally:
        os.close(number)


def _is_locked(number: int) -> bool:
    try:
        import fcntl
    except ImportError:  # Windows
        import msvcrt

        try:
            msvcrt.locking(number, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        except OSError:
            return False
        return True
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _write_all(number: int, data: bytes) -> None:
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(number, rest) :]


def _sync_folder(folder: Path) -> None:
    """Sync a folder, so that its file names survive a power failure.

    Windows does not support or need this step.
    """
    if os.name == "nt":
        return
    number = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)
