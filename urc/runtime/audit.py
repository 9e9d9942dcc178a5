"""The audit: who made a robot move, when, and what came of it, in one bounded SQLite file.

Theory of operation. `AuditLog.note` puts an entry into a short queue and returns: it never waits
for a disk, because motion and STOP pass by here. A thread of its own writes what waits, a batch a
transaction. When the queue is full, or the disk is, entries are lost, and counted; the next one
that can be written says how many. A file that has grown to its limit loses its oldest entries.

Each row carries a hash over itself and the row before it, so that a changed, removed or inserted
row shows (`check`); it does not keep out who can write the whole file anew.
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

__all__ = ["AuditLog", "Entry", "check", "read", "shown"]

MOST_BYTES: Final = 32 * 1024 * 1024
"""Of the file; the oldest entries go first."""
MOST_WAITING: Final = 4096
"""Entries that wait to be written."""
_BATCH: Final = 512
_GATHER_S: Final = 0.05
"""How long a batch is gathered: one commit for many entries."""
_RETRY_S: Final = 5.0
"""After how long a disk that took nothing is tried again."""
_LOCKED_S: Final = 1.0
"""How long whoever else writes the file, or looks at it, is waited for."""
_CLOSE_S: Final = 2.0
_LONGEST_TEXT: Final = 1000
_SHARE: Final = 10
"""One of so many rows goes when the file is full."""
_PAGE: Final = 4096

log = logging.getLogger(__name__)


class Entry(NamedTuple):
    """One thing that happened. Nothing in it is secret: whoever makes it leaves secrets out."""

    at: float
    """UTC, in seconds since 1970, as this machine's clock had it."""
    robot: str
    what: str
    """``moved``, ``stopped``, ``refused``, ``lease``, ``STOP``, ``reset``, ``ran`` or ``lost``."""
    who: str = ""
    """Name of the person or screen."""
    role: str = ""
    client: str = ""
    """Id of the connection."""
    epoch: int = 0
    """Of the lease."""
    command: str = ""
    arguments: str = ""
    """As JSON."""
    data: str = ""
    """Bytes as hex, or their hash when they are many: see `shown`."""
    outcome: str = ""
    """What came of it, for people."""
    times: int = 1
    """How many such things this one stands for."""
    lasted_s: float = 0.0


_COLUMNS: Final = Entry._fields
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
    """The one writer of a file. Use as a context, or call `close`."""

    def __init__(
        self,
        file: Path,
        *,
        most_bytes: int = MOST_BYTES,
        most_waiting: int = MOST_WAITING,
        now: Callable[[], float] = time.time,
    ) -> None:
        """Start the thread that writes; the file is made by it.

        Args:
            file: where.
            most_bytes: about how large the file may become.
            most_waiting: entries that may wait to be written.
            now: the time, UTC in seconds.
        """
        self.file = file
        self.fault = ""
        """Why nothing can be written now; "" while all is well."""
        self._most_bytes = most_bytes
        self._most_waiting = most_waiting
        self._now = now
        self._waiting: deque[Entry] = deque()
        self._lost = 0
        self._wakes = threading.Condition()
        self._is_closing = False
        self._is_busy = False
        self._thread = threading.Thread(target=self._run, name="urc-audit", daemon=True)
        self._thread.start()

    def note(self, entry: Entry) -> None:
        """Keep an entry soon. Returns at once, from any thread; never raises."""
        with self._wakes:
            if len(self._waiting) >= self._most_waiting:
                self._lost += 1
                return
            self._waiting.append(_cut(entry))
            self._wakes.notify()

    def settle(self, timeout_s: float = _CLOSE_S) -> bool:
        """Wait until all that was noted is written; return whether it is."""
        with self._wakes:
            return self._wakes.wait_for(lambda: not self._waiting and not self._is_busy, timeout_s)

    def close(self) -> None:
        """Write what waits, for two seconds at most, and end the thread."""
        with self._wakes:
            self._is_closing = True
            self._wakes.notify_all()
        self._thread.join(_CLOSE_S)

    def __enter__(self) -> "AuditLog":
        """Return it; it is closed with the block."""
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
            except Exception as error:  # a supervisor: whatever it is, the next batch is tried
                self._unwell(str(error), batch)
                if base is not None:
                    with suppress(sqlite3.Error):
                        base.close()
                base = None
                self._rest()
        if base is not None:
            with suppress(sqlite3.Error):
                base.close()

    def _next_batch(self) -> list[Entry]:
        """Return what waits, after a moment in which more may come; nothing: it is over."""
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
            raise  # a disk that is full, a folder that may not be written: it may pass
        except sqlite3.DatabaseError as error:
            aside = self.file.with_suffix(".broken")
            log.warning("%s is no audit file (%s): it is now %s", self.file, error, aside.name)
            self.file.replace(aside)
            for ending in ("-wal", "-shm"):
                Path(f"{self.file}{ending}").unlink(missing_ok=True)
            return self._connected()

    def _connected(self) -> sqlite3.Connection:
        # Before SQLite makes it: the files that it puts beside have the rights of this one.
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
            base.execute(_LAST)  # says whether it is a file of ours
        except sqlite3.Error:
            base.close()
            raise
        return base

    def _write(self, base: sqlite3.Connection, batch: Sequence[Entry]) -> None:
        with self._wakes:
            lost = self._lost
        entries = [*batch]
        if lost:
            text = f"{lost} entries could not be kept"
            entries.append(Entry(self._now(), "", "lost", outcome=text, times=lost))
        base.execute("BEGIN IMMEDIATE")
        try:
            last = base.execute(_LAST).fetchone()  # maybe of another server with this folder
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
        """Let the oldest rows go while the file holds more than it may; the newest one stays."""
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
            log.warning("the audit is kept again")
        self.fault = ""

    def _unwell(self, fault: str, batch: Sequence[Entry]) -> None:
        with self._wakes:
            self._lost += len(batch)
        if not self.fault:  # told once, however long it lasts
            log.warning(
                "the audit cannot be kept: %s; robots are driven and stopped as ever", fault
            )
        self.fault = fault

    def _rest(self) -> None:
        with self._wakes:
            self._wakes.wait_for(lambda: self._is_closing, _RETRY_S)
            if self._is_closing:
                self._waiting.clear()


def shown(data: bytes, most: int = 64) -> str:
    """Return bytes for an entry: as hex, or the hash of more than `most`."""
    if len(data) <= most:
        return data.hex()
    return f"{len(data)} bytes, sha256 {hashlib.sha256(data).hexdigest()}"


def read(file: Path, *, robot: str = "", since: float = 0.0, last: int = 200) -> list[Entry]:
    """Return the newest entries, oldest first; none when there is no file.

    Args:
        file: of an `AuditLog`, which may be writing it.
        robot: of this one only, and what belongs to none; "": of all.
        since: not those before this time, UTC in seconds.
        last: at most so many.

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
    return [Entry(*row[1:-1]) for row in reversed(rows)]


def check(file: Path) -> str:
    """Return where the chain of hashes is broken, or "" when nothing was changed.

    Raises:
        OSError: the file cannot be read.
    """
    try:
        with closing(_reading(file)) as base:
            rows = base.execute(_SELECT + " ORDER BY id").fetchall()
    except sqlite3.Error as error:
        raise OSError(f"{file} cannot be read: {error}") from error
    for before, row in pairwise(rows):
        if row[-1] != _link(before[-1], Entry(*row[1:-1])) or row[0] != before[0] + 1:
            return f"entry {row[0]} does not follow from entry {before[0]}"
    return ""


def _reading(file: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{file.absolute().as_uri()}?mode=ro", uri=True, timeout=_LOCKED_S)


def _link(before: str, entry: Entry) -> str:
    text = before + json.dumps(entry, ensure_ascii=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _cut(entry: Entry) -> Entry:
    """Return an entry whose texts have an end, and no lone surrogates, which no file takes."""
    return Entry._make(_text(one) if isinstance(one, str) else one for one in entry)


def _text(text: str) -> str:
    return text[:_LONGEST_TEXT].encode("utf-8", "replace").decode()
