"""The writer of the alarm file.

Layer 4. `AlarmStore.save` queues records and events in memory and returns. A separate thread writes
the queue, with one transaction per batch. The queue contains only the newest record of each alarm,
so its size is limited by the number of signals. If too many events are waiting, the oldest events
are dropped and counted.
"""

import logging
import sqlite3
import threading
from collections import deque
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from urc.alarms.record import AlarmEvent, AlarmRecord
from urc.private_files import make_private
from urc.runtime.alarm_table import (
    MOST_EVENTS,
    alarm_file,
    append_events,
    load_records,
    prune_events,
    save_records,
)
from urc.runtime.sqlite_file import set_aside

__all__ = ["AlarmStore"]

MOST_WAITING: Final = 20_000
"""Maximum number of waiting events."""
_GATHER_S: Final = 0.02
"""How long the thread collects changes for one batch, in seconds."""
_RETRY_S: Final = 5.0
"""Delay before another attempt after a write error, in seconds."""
_CLOSE_S: Final = 2.0

log = logging.getLogger(__name__)
_Records = dict[tuple[str, str], AlarmRecord | None]


class AlarmStore:
    """A writer of one alarm file, for all robots of a server."""

    def __init__(self, file: Path, *, most_events: int = MOST_EVENTS) -> None:
        """Prepare the writer; the first change starts the thread.

        Args:
            file: path of the file.
            most_events: number of newest events to keep in the history.
        """
        self.file = file
        self.fault = ""
        """Reason why alarms currently cannot be stored, or ""."""
        self.lost = 0
        """Number of events dropped since the start because too many events were waiting."""
        self._most_events = most_events
        self._known: dict[str, dict[str, AlarmRecord]] | None = None
        """Newest record of each alarm, keyed by robot and signal; None before the first `load`."""
        self._records: _Records = {}
        self._events: deque[tuple[str, AlarmEvent]] = deque()
        self._wakes = threading.Condition()
        self._is_closing = False
        self._is_busy = False
        self._thread: threading.Thread | None = None

    def load(self, robot: str) -> list[AlarmRecord]:
        """Return a robot's stored alarm records; [] if the file cannot be read.

        Only the first call reads the file, when the server starts.
        """
        with self._wakes:
            if self._known is None:
                self._known = self._read()
            return [*self._known.get(robot, {}).values()]

    def _read(self) -> dict[str, dict[str, AlarmRecord]]:
        known: dict[str, dict[str, AlarmRecord]] = {}
        try:
            for robot, record in load_records(self.file):
                known.setdefault(robot, {})[record.signal] = record
        except OSError as error:
            log.warning("the alarms of the previous run are lost: %s", error)
        return known

    def save(
        self,
        robot: str,
        records: Mapping[str, AlarmRecord | None],
        events: Iterable[AlarmEvent],
    ) -> None:
        """Queue events and records, keyed by signal (None means no alarm); return immediately."""
        with self._wakes:
            self._records |= {(robot, signal): one for signal, one in records.items()}
            if self._known is not None:
                kept = {**self._known.get(robot, {}), **records}
                self._known[robot] = {name: one for name, one in kept.items() if one is not None}
            for event in events:
                if len(self._events) >= MOST_WAITING:
                    self._events.popleft()
                    self.lost += 1
                self._events.append((robot, event))
            if self._thread is None and not self._is_closing:
                self._thread = threading.Thread(target=self._run, name="urc-alarms", daemon=True)
                self._thread.start()
            self._wakes.notify()

    def settle(self, timeout_s: float = _CLOSE_S) -> bool:
        """Wait until all changes are written; return False after a timeout.

        Never call this method on the event loop.
        """
        with self._wakes:
            return self._wakes.wait_for(
                lambda: not (self._records or self._events or self._is_busy), timeout_s
            )

    def close(self) -> None:
        """Spend at most two seconds writing the queued changes, then end the thread."""
        with self._wakes:
            self._is_closing = True
            self._wakes.notify_all()
        if self._thread is not None:
            self._thread.join(_CLOSE_S)

    # The thread

    def _run(self) -> None:
        base: sqlite3.Connection | None = None
        while batch := self._next_batch():
            try:
                if base is None:
                    base = self._opened()
                self._write(base, *batch)
                self._report("")
            except Exception as error:  # supervisor: the next batch is always attempted
                self._put_back(*batch)
                self._report(str(error))
                if base is not None:
                    with suppress(sqlite3.Error):
                        base.close()
                base = None
                self._rest()
        if base is not None:
            with suppress(sqlite3.Error):
                base.close()

    def _next_batch(self) -> tuple[_Records, list[tuple[str, AlarmEvent]]] | None:
        """Wait for changes and return them; None if the store is closed and has no more changes."""
        with self._wakes:
            self._is_busy = False
            self._wakes.notify_all()
            self._wakes.wait_for(lambda: self._records or self._events or self._is_closing)
            if not self._is_closing:
                self._wakes.wait(_GATHER_S)
            records, events = self._records, [*self._events]
            self._records = {}
            self._events.clear()
            self._is_busy = bool(records or events)
            return (records, events) if self._is_busy else None

    def _put_back(self, records: _Records, events: list[tuple[str, AlarmEvent]]) -> None:
        with self._wakes:
            self._records = records | self._records  # newer records win
            self._events.extendleft(reversed(events))
            while len(self._events) > MOST_WAITING:
                self._events.popleft()
                self.lost += 1

    def _opened(self) -> sqlite3.Connection:
        make_private(self.file.parent)
        try:
            return alarm_file(self.file)
        except sqlite3.OperationalError:
            raise  # possibly temporary: a full disk, or a folder without write permission
        except sqlite3.DatabaseError as error:
            aside = set_aside(self.file)
            log.warning(
                "%s is not a file of alarms (%s); renamed to %s", self.file, error, aside.name
            )
            return alarm_file(self.file)

    def _write(
        self, base: sqlite3.Connection, records: _Records, events: list[tuple[str, AlarmEvent]]
    ) -> None:
        base.execute("BEGIN IMMEDIATE")
        try:
            save_records(base, records)
            append_events(base, events)
            prune_events(base, self._most_events)
            base.execute("COMMIT")
        except Exception:
            with suppress(sqlite3.Error):
                base.execute("ROLLBACK")
            raise

    def _report(self, fault: str) -> None:
        if fault and not self.fault:  # only the first of several failures
            log.warning("alarms cannot be stored: %s; a restart would lose them", fault)
        elif self.fault and not fault:
            log.warning("alarms can be stored again")
        self.fault = fault

    def _rest(self) -> None:
        with self._wakes:
            self._is_busy = False
            self._wakes.wait_for(lambda: self._is_closing, _RETRY_S)
            if self._is_closing:
                self._records.clear()
                self._events.clear()
