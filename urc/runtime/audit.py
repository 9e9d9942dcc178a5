"""The audit log: the motion commands of each operator, with times and results, in an SQLite file.

Theory of operation. `AuditLog.note` puts an entry into a short queue and returns. The call never
waits for a disk, because motion and STOP call `note`. A separate thread writes the queued entries
in batches, with one transaction per batch. If the queue or the disk is full, entries are lost and
counted; the next written entry records the count. When the file reaches its limit, the oldest
entries are deleted.

Each row contains a hash of itself and the previous row, so `check` detects a changed, removed or
inserted row. The hashes do not protect against an attacker who rewrites the whole file.
"""

import hashlib
import json
import logging
import os
import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

from urc.private_files import make_private

__all__ = ["AuditLog", "AuditEntry", "check", "read", "shown"]

MOST_BYTES: Final = 32 * 1024 * 1024
"""Maximum size of the file, in bytes; beyond this limit, the oldest entries are deleted."""
MOST_WAITING: Final = 4096
"""Maximum number of queued entries."""
_BATCH: Final = 512
_GATHER_S: Final = 0.05
"""Time for collecting the entries of one batch, in seconds; one commit writes the whole batch."""
_RETRY_S: Final = 5.0
"""Delay before the next attempt after a write error, in seconds."""
_LOCKED_S: Final = 1.0
"""Maximum wait for other readers and writers of the file, in seconds."""
_CLOSE_S: Final = 2.0
_LONGEST_TEXT: Final = 1000
_SHARE: Final = 10
"""Divisor for the number of rows that a full file loses: 10 deletes a tenth of the rows."""
_PAGE: Final = 4096

log = logging.getLogger(__name__)


class AuditEntry(NamedTuple):
    """One entry. The caller must remove secrets from all texts."""

    at: float
    """UTC time of this machine's clock, in seconds since 1970."""
    robot: str
    what: str
    """Kind of event: ``moved``, ``stopped``, ``refused``, ``lease``, ``STOP``, ``reset``, ``ran``
    or ``lost``."""
    who: str = ""
    """Name of the person or page that caused the event."""
    role: str = ""
    client: str = ""
    """Identifier of the connection between the page and the server."""
    epoch: int = 0
    """Epoch of the lease at the time of the event."""
    command: str = ""
    arguments: str = ""
    """Arguments as JSON."""
    data: str = ""
    """Sent bytes in hex, or the hash of a long payload; see `shown`."""
    outcome: str = ""
    """Result as text for display."""
    times: int = 1
    """Number of equal events that this entry represents."""
    lasted_s: float = 0.0


_COLUMNS: Final = AuditEntry._fields
_TYPES: Final = {"at": "REAL", "epoch": "INTEGER", "times": "INTEGER", "lasted_s": "REAL"}
_CREATE: Final = (
    "CREATE TABLE IF NOT EXISTS entries (id INTEGER PRIMARY KEY, "
    + ", ".join(f"{name} {_TYPES.get(name, 'TEXT')} NOT NULL" for name in _COLUMNS)
    + ", chain TEXT NOT NULL)"
)
_INSERT: Final = (
    f"INSERT INTO entries ({', '.join(_COLUMNS)}, chain)"  # noqa: S608 - names of our own
    f" VALUES ({', '.join('?' * (len(_COLUMNS) + 1))})"
)
_LAST: Final = "SELECT chain FROM entries ORDER BY id DESC LIMIT 1"
_SELECT: Final = f"SELECT id, {', '.join(_COLUMNS)}, chain FROM entries"  # noqa: S608


class AuditLog:
    """A writer of one audit file. Use the writer as a context manager, or call `close`."""

    def __init__(
        self,
        file: Path,
        *,
        most_bytes: int = MOST_BYTES,
        most_waiting: int = MOST_WAITING,
        now: Callable[[], float] = time.time,
    ) -> None:
        """Start the writer thread, which creates the file.

        Args:
            file: path of the file.
            most_bytes: approximate maximum size of the file, in bytes.
            most_waiting: maximum number of queued entries.
            now: source of UTC time, in seconds.
        """
        self.file = file
        self.fault = ""
        """Reason why entries currently cannot be written, or ""."""
        self._most_bytes = most_bytes
        self._most_waiting = most_waiting
        self._now = now
        self._waiting: deque[AuditEntry] = deque()
        self._lost = 0
        self._wakes = threading.Condition()
        self._is_closing = False
        self._is_busy = False
        self._thread = threading.Thread(target=self._run, name="urc-audit", daemon=True)
        self._thread.start()

    def add(self, entry: AuditEntry) -> None:
        """Queue an entry and return immediately. This method is thread-safe and never raises."""
        with self._wakes:
            if len(self._waiting) >= self._most_waiting:
                self._lost += 1
                return
            self._waiting.append(_cut(entry))
            self._wakes.notify()

    def settle(self, timeout_s: float = _CLOSE_S) -> bool:
        """Wait until all queued entries are written; return whether the wait succeeded."""
        with self._wakes:
            return self._wakes.wait_for(lambda: not self._waiting and not self._is_busy, timeout_s)

    def close(self) -> None:
        """Write the queued entries for at most two seconds, and end the thread."""
        with self._wakes:
            self._is_closing = True
            self._wakes.notify_all()
        self._thread.join(_CLOSE_S)

    def __enter__(self) -> "AuditLog":
        """Return `self`; the end of the `with` block closes the writer."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    # -- the thread

    def _run(self) -> None:
        base: sqlite3.Connection | None = None
        while batch := self._next_batch():
            try:
                if base is None:
                    base = self._opened()
                self._write(base, batch)
                self._well()
            except Exception as error:  # supervisor: the next batch is always tried
                self._unwell(str(error), batch)
                if base is not None:
                    with suppress(sqlite3.Error):
                        base.close()
                base = None
                self._rest()
        if base is not None:
            with suppress(sqlite3.Error):
                base.close()

    def _next_batch(self) -> list[AuditEntry]:
        """Wait briefly for a batch, and return the queued entries; return [] after `close`."""
        with self._wakes:
            self._is_busy = False
            self._wakes.notify_all()
            self._wakes.wait_for(lambda: self._waiting or self._is_closing)
            if not self._is_closing:
                self._wakes.wait(_GATHER_S)
            batch = [self._waiting.popleft() for _ in range(min(_BATCH, len(self._waiting)))]
            self._is_busy = bool(batch)
            return batch

    def _opened(self) -> sqlite3.Connection:
        make_private(self.file.parent)
        try:
            return self._connected()
        except sqlite3.OperationalError:
            raise  # possibly temporary: a full disk, or a folder without write permission
        except sqlite3.DatabaseError as error:
            aside = self.file.with_suffix(".broken")
            log.warning(
                "%s is not an audit file (%s); it was renamed to %s", self.file, error, aside.name
            )
            self.file.replace(aside)
            for ending in ("-wal", "-shm"):
                Path(f"{self.file}{ending}").unlink(missing_ok=True)
            return self._connected()

    def _connected(self) -> sqlite3.Connection:
        # Created before SQLite does, because SQLite's other files copy the mode of this one.
        os.close(os.open(self.file, os.O_RDWR | os.O_CREAT, 0o600))
        for name in ("", "-wal", "-shm"):
            with suppress(FileNotFoundError):
                os.chmod(f"{self.file}{name}", 0o600)
        base = sqlite3.connect(self.file, timeout=_LOCKED_S, isolation_level=None)
        try:
            base.execute(f"PRAGMA page_size = {_PAGE}")
            base.execute("PRAGMA journal_mode = WAL")
            base.execute("PRAGMA synchronous = NORMAL")
            base.execute("PRAGMA journal_size_limit = 1048576")
            base.execute(_CREATE)
            base.execute(_LAST)  # fails if the file is not an audit file
        except sqlite3.Error:
            base.close()
            raise
        return base

    def _write(self, base: sqlite3.Connection, batch: Sequence[AuditEntry]) -> None:
        with self._wakes:
            lost = self._lost
        entries = [*batch]
        if lost:
            text = f"{lost} entries could not be written"
            entries.append(AuditEntry(self._now(), "", "lost", outcome=text, times=lost))
        base.execute("BEGIN IMMEDIATE")
        try:
            last = base.execute(_LAST).fetchone()  # another server may write to this folder
            chain = last[0] if last else ""
            rows: list[tuple[object, ...]] = []
            for entry in entries:
                chain = _link(chain, entry)
                rows.append((*entry, chain))
            base.executemany(_INSERT, rows)
            self._make_room(base)
            base.execute("COMMIT")
        except Exception:
            with suppress(sqlite3.Error):
                base.execute("ROLLBACK")
            raise
        with self._wakes:
            self._lost -= lost

    def _make_room(self, base: sqlite3.Connection) -> None:
        """Delete the oldest rows while the file exceeds its limit; keep the newest row."""
        while True:
            (pages,) = base.execute("PRAGMA page_count").fetchone()
            (free,) = base.execute("PRAGMA freelist_count").fetchone()
            first, last = base.execute("SELECT min(id), max(id) FROM entries").fetchone()
            if (pages - free) * _PAGE <= self._most_bytes or first == last:
                return
            until = first + (last - first) // _SHARE + 1
            base.execute("DELETE FROM entries WHERE id < ?", (until,))

    def _well(self) -> None:
        if self.fault:
            log.warning("the audit log can be written again")
        self.fault = ""

    def _unwell(self, fault: str, batch: Sequence[AuditEntry]) -> None:
        with self._wakes:
            self._lost += len(batch)
        if not self.fault:  # log only the first of several failures
            log.warning(
                "the audit log cannot be written: %s; robots can still be driven and stopped", fault
            )
        self.fault = fault

    def _rest(self) -> None:
        with self._wakes:
            self._wakes.wait_for(lambda: self._is_closing, _RETRY_S)
            if self._is_closing:
                self._waiting.clear()


def shown(data: bytes, most: int = 64) -> str:
    """Return `data` in hex; return size and hash if `data` has more than `most` bytes."""
    if len(data) <= most:
        return data.hex()
    return f"{len(data)} bytes, sha256 {hashlib.sha256(data).hexdigest()}"


def read(file: Path, *, robot: str = "", since: float = 0.0, last: int = 200) -> list[AuditEntry]:
    """Return the newest entries, oldest first, or [] without a file.

    Args:
        file: path of the file of an `AuditLog`, which may still be writing.
        robot: name of the robot whose entries to return, with all entries that name no robot; ""
            for all entries.
        since: start of the period, as UTC time in seconds since 1970.
        last: maximum number of entries.

    Raises:
        OSError: the file cannot be read.
    """
    if not file.is_file():
        return []
    where = " WHERE at >= ? AND (? = '' OR robot IN (?, '')) ORDER BY id DESC LIMIT ?"
    try:
        with closing(_reading(file)) as base:
            rows = base.execute(_SELECT + where, (since, robot, robot, last)).fetchall()
    except sqlite3.Error as error:
        raise OSError(f"{file} cannot be read: {error}") from error
    return [AuditEntry(*row[1:-1]) for row in reversed(rows)]


def check(file: Path) -> str:
    """Return a message about the first broken link of the hash chain, or "" for an intact file.

    Raises:
        OSError: the file cannot be read.
    """
    try:
        with closing(_reading(file)) as base:
            rows = base.execute(_SELECT + " ORDER BY id").fetchall()
    except sqlite3.Error as error:
        raise OSError(f"{file} cannot be read: {error}") from error
    for before, row in pairwise(rows):
        if row[-1] != _link(before[-1], AuditEntry(*row[1:-1])) or row[0] != before[0] + 1:
            return f"entry {row[0]} does not follow from entry {before[0]}"
    return ""


def _reading(file: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True, timeout=_LOCKED_S)


def _link(before: str, entry: AuditEntry) -> str:
    text = before + json.dumps(entry, ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _cut(entry: AuditEntry) -> AuditEntry:
    """Return an entry with shortened texts, without characters that UTF-8 cannot encode."""
    return AuditEntry._make(_text(one) if isinstance(one, str) else one for one in entry)


def _text(text: str) -> str:
    return text[:_LONGEST_TEXT].encode("utf-8", "replace").decode()
