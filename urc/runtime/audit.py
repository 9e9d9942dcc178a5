"""The writer of the audit log, an SQLite file.

The file records motion and administration: who caused each event, and by which right.

Theory of operation. `AuditLog.add` puts an entry into a short queue and returns. The call never
waits for a disk, because motion and STOP call `add`. A separate thread writes the queued entries
in batches, with one transaction per batch. If the queue or the disk is full, entries are lost and
counted; the next written entry records the count. Entries beyond the limits are deleted, oldest
first.

Each row contains a hash of itself and the previous row, so `urc.runtime.audit_check.check` detects
a changed, removed or inserted row. The hashes do not protect against an attacker who rewrites the
whole file. Only a copy exported to another place reveals such a change.
"""

import logging
import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from urc.private_files import make_private
from urc.runtime.audit_entry import AuditEntry, cleaned
from urc.runtime.audit_table import Retention, append, connected, prune
from urc.runtime.sqlite_file import set_aside

__all__ = ["FILE", "AuditLog"]

FILE: Final = "audit.sqlite"
"""Name of the file in the data folder."""
MOST_WAITING: Final = 4096
"""Maximum number of queued entries."""
_BATCH: Final = 512
_GATHER_S: Final = 0.05
"""How long the thread collects entries for one batch, in seconds; one commit writes the batch."""
_RETRY_S: Final = 5.0
"""Delay before the next attempt after a write error, in seconds."""
_CLOSE_S: Final = 2.0

log = logging.getLogger(__name__)


class AuditLog:
    """A writer of one audit file. Use the writer as a context manager, or call `close`."""

    def __init__(
        self,
        file: Path,
        *,
        retention: Retention = Retention(),  # noqa: B008  # immutable
        most_waiting: int = MOST_WAITING,
        now: Callable[[], float] = time.time,
    ) -> None:
        """Start the writer thread, which creates the file.

        Args:
            file: path of the file.
            retention: limits of the file.
            most_waiting: maximum number of queued entries.
            now: source of UTC time, in seconds.
        """
        self.file = file
        self.fault = ""
        """Reason why entries currently cannot be written, or ""."""
        self._retention = retention
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
        """Queue an entry and return immediately.

        This method is thread-safe and never raises an exception.
        """
        with self._wakes:
            if len(self._waiting) >= self._most_waiting:
                self._lost += 1
                return
            self._waiting.append(cleaned(entry))
            self._wakes.notify()

    def settle(self, timeout_s: float = _CLOSE_S) -> bool:
        """Wait until all queued entries are written; return False after a timeout."""
        with self._wakes:
            return self._wakes.wait_for(lambda: not self._waiting and not self._is_busy, timeout_s)

    def close(self) -> None:
        """Spend at most two seconds writing the queued entries, then end the thread."""
        with self._wakes:
            self._is_closing = True
            self._wakes.notify_all()
        self._thread.join(_CLOSE_S)

    def __enter__(self) -> "AuditLog":
        """Return `self`; the end of the `with` block closes the writer."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the writer."""
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
            except Exception as error:  # supervisor: the next batch is always attempted
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
        """Wait for entries and return a batch; [] once the log is closed and the queue is empty."""
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
            return connected(self.file)
        except sqlite3.OperationalError:
            raise  # possibly temporary: a full disk, or a folder without write permission
        except sqlite3.DatabaseError as error:
            aside = set_aside(self.file)
            log.warning(
                "%s is not an audit file (%s); it was renamed to %s", self.file, error, aside.name
            )
            return connected(self.file)

    def _write(self, base: sqlite3.Connection, batch: Sequence[AuditEntry]) -> None:
        with self._wakes:
            lost = self._lost
        entries = [*batch]
        if lost:
            text = f"entries that could not be written: {lost}"
            entries.append(AuditEntry(self._now(), "", "lost", outcome=text, times=lost))
        base.execute("BEGIN IMMEDIATE")
        try:
            append(base, entries)
            prune(base, self._retention, self._now())
            base.execute("COMMIT")
        except Exception:
            with suppress(sqlite3.Error):
                base.execute("ROLLBACK")
            raise
        with self._wakes:
            self._lost -= lost

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
