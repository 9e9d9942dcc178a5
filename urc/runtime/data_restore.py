"""Restore a backup into a data folder, either completely or not at all.

Layer 4. The files are extracted and checked in a separate folder, ``restoring-…``. Then the old
files move to ``replaced-…``, and the new files replace them. After an error, the old files are
moved back.

After the restore, every STOP is latched that was latched in the data folder or in the backup. If
the data folder has a newer block list than the backup, the newer block list stays in force. A
replaced audit log stays in the data folder under another name.
"""

import json
import os
import secrets
import shutil
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from urc.packages.block_store import BlockStore
from urc.packages.names import PackageError
from urc.private_files import make_private, put_private
from urc.runtime.audit import FILE as AUDIT_FILE
from urc.runtime.backup_archive import BackupError, BackupReader, parts_in
from urc.runtime.running_servers import servers

__all__ = ["check_target", "is_interrupted", "restore"]

_LATCHES: Final = "latches"
_PACKAGES: Final = "packages"
_SIDE_FILES: Final = ("-wal", "-shm", "-journal")
"""Suffixes of the additional files that SQLite writes for a database."""
_LATCH_BYTES: Final = 4096
_OLD: Final = "replaced-????????"
"""Pattern for the names of the folders that contain replaced files."""


def check_target(data: Path, *, replaces: bool) -> None:
    """Raise an error if a backup cannot be restored into a data folder.

    Args:
        data: the data folder.
        replaces: whether existing data may be replaced.

    Raises:
        BackupError: a server is running, or the folder has data.
    """
    for file, server in servers(data).items():
        raise BackupError(
            f"a server is running at {server.address} (process {server.pid});"
            f" stop the server first, or delete {file} if that process is not a server"
        )
    parts, _ = parts_in(data)
    if parts and not replaces:
        raise BackupError(
            f"{data} already contains data, such as {parts[0]};"
            " make a backup of it, then add --replace to replace the data"
        )


def is_interrupted(data: Path) -> bool:
    """Return whether an earlier restore was interrupted, such as by a power failure."""
    return any(data.glob(_OLD))


def restore(reader: BackupReader, data: Path, adjust: Callable[[Path], None]) -> None:
    """Replace the content of a data folder with a backup.

    Args:
        reader: the opened backup.
        data: the data folder, checked with `check_target`.
        adjust: function that changes the extracted files before they replace the old files.

    Raises:
        BackupError: the backup is damaged, or a file cannot be written. The folder is unchanged,
            except that robots stopped in the backup are now stopped.
    """
    try:
        make_private(data)
        _tidy(data)
        with _folder(data, "restoring") as new:
            reader.extract(new)
            for file in new.glob("*.sqlite"):
                _check_base(file)
            adjust(new)
            _merge_latches(new / _LATCHES, data / _LATCHES)
            _merge_blocks(new / _PACKAGES, data / _PACKAGES)
            with _folder(data, "replaced") as old:
                _swap(new, old, data)
                _keep_audit(old, data)
    except (OSError, sqlite3.Error) as error:
        raise BackupError(f"{data} cannot be restored: {error}") from None


@contextmanager
def _folder(data: Path, purpose: str) -> Iterator[Path]:
    folder = data / f"{purpose}-{secrets.token_hex(4)}"
    folder.mkdir(mode=0o700)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _tidy(data: Path) -> None:
    """Remove the folders left by an interrupted restore, but keep the replaced audit log."""
    for folder in data.glob(_OLD):
        _keep_audit(folder, data)
        shutil.rmtree(folder, ignore_errors=True)
    for folder in data.glob("restoring-????????"):
        shutil.rmtree(folder, ignore_errors=True)


def _check_base(file: Path) -> None:
    try:
        with closing(sqlite3.connect(file)) as base:
            (result,) = base.execute("PRAGMA quick_check(1)").fetchone()
    except sqlite3.Error as error:
        result = str(error)
    if result != "ok":
        raise BackupError(f"{file.name} in the backup is damaged: {result}")


def _merge_latches(new: Path, old: Path) -> None:
    """Latch each STOP that is latched in either folder, and keep the higher counters."""
    for kept in old.rglob("*.latch.json"):
        restored = new / kept.relative_to(old)
        now, then = _latch(kept), _latch(restored)
        if now is None or now["latched_by"] or then is None:
            make_private(restored.parent)
            put_private(restored, kept.read_bytes()[:_LATCH_BYTES])
        else:
            counters = {"epoch": max(now["epoch"], then["epoch"])}
            if "stops" in now or "stops" in then:
                counters["stops"] = max(_stops(now), _stops(then))
            merged = {**then, **counters}
            put_private(restored, json.dumps(merged).encode())


def _merge_blocks(new: Path, old: Path) -> None:
    """Keep the newer of the two versions of each block list."""
    try:
        known = BlockStore(old).all()
    except PackageError:
        known = ()  # damaged, so the backup's list is better
    if known:
        make_private(new)
    for one in known:
        with suppress(PackageError):  # the backup's list is newer
            BlockStore(new).keep(one, one.number, one.listed, one.place)


def _latch(file: Path) -> dict[str, Any] | None:
    """Return the content of a latch file; None if the file is missing or damaged."""
    try:
        with file.open("rb") as opened:
            found = json.loads(opened.read(_LATCH_BYTES))
        is_latch = type(found["epoch"]) is int and type(found["latched_by"]) is str
    except (OSError, ValueError, TypeError, KeyError):
        return None
    return found if is_latch else None


def _stops(latch: dict[str, Any]) -> int:
    """Return the number of STOPs in a latch file; 0 if it is missing or damaged."""
    found = latch.get("stops", 0)
    return found if type(found) is int else 0


def _swap(new: Path, old: Path, data: Path) -> None:
    """Move the data folder's files to `old`, and the files of `new` to the data folder."""
    # After a crash or an error at this point, stopped robots stay stopped.
    for file in (new / _LATCHES).rglob("*.latch.json"):
        put_private(data / file.relative_to(new), file.read_bytes())
    leaving, arriving = (
        [path for path in parts_in(folder)[0] if not path.startswith(f"{_LATCHES}/")]
        for folder in (data, new)
    )
    if AUDIT_FILE not in arriving:
        leaving = [path for path in leaving if path != AUDIT_FILE]
    leaving += [
        f"{path}{end}"
        for path in leaving
        for end in _SIDE_FILES
        if (data / f"{path}{end}").exists()
    ]
    moved: list[tuple[Path, Path]] = []
    try:
        for paths, source, target in ((leaving, data, old), (arriving, new, data)):
            for path in paths:
                make_private((target / path).parent)
                os.rename(source / path, target / path)
                moved.append((source / path, target / path))
    except BaseException:
        for was, now in reversed(moved):
            with suppress(OSError):
                os.rename(now, was)
        raise


def _keep_audit(old: Path, data: Path) -> None:
    """Keep a replaced audit log under a new name, because a restore must not delete entries."""
    if (old / AUDIT_FILE).exists():
        name = f"audit-before-{time.strftime('%Y%m%dT%H%M%S')}_{secrets.token_hex(2)}.sqlite"
        for end in ("", *_SIDE_FILES):
            with suppress(FileNotFoundError):
                os.rename(old / f"{AUDIT_FILE}{end}", data / f"{name}{end}")
