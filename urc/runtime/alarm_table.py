"""The SQLite file of alarms: the current states of all robots' alarms, and their history.

Layer 4. All functions block, so servers call them in a thread. Each state is a JSON object, so a
newer version of URC can add attributes. Older versions skip unknown attributes.
"""

import json
import logging
import sqlite3
import time
from collections.abc import Collection, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple, get_args

from urc.alarms.record import AlarmEvent, AlarmRecord
from urc.model.values import AlarmPriority
from urc.problems import UrcError
from urc.runtime.sqlite_file import open_for_writing, opened_for_reading

__all__ = [
    "FILE",
    "MOST_EVENTS",
    "AlarmQuery",
    "AlarmHistoryRow",
    "AlarmSearchTimeout",
    "alarm_file",
    "append_events",
    "load_records",
    "prune_events",
    "save_records",
    "search_alarms",
]

FILE: Final = "alarms.sqlite"
"""Name of the file in the data folder."""
MOST_EVENTS: Final = 100_000
"""Number of newest events to keep in the history."""
_SPARE: Final = 1000
"""Number of events beyond the maximum at which the oldest events are deleted."""
_VERSION: Final = 1
_LONGEST_S: Final = 5.0
"""Maximum duration of one search, in seconds."""
_STEPS: Final = 50_000
_COLUMNS: Final = AlarmEvent._fields
_TYPES: Final = {"at": "REAL", "until": "REAL", "times": "INTEGER"}
_CREATE: Final = (
    "CREATE TABLE states (robot TEXT NOT NULL, signal TEXT NOT NULL, record TEXT NOT NULL,"
    " PRIMARY KEY (robot, signal)) WITHOUT ROWID",
    "CREATE TABLE events (id INTEGER PRIMARY KEY, robot TEXT NOT NULL, "
    + ", ".join(f"{name} {_TYPES.get(name, 'TEXT')} NOT NULL" for name in _COLUMNS)
    + ")",
    "CREATE INDEX by_robot ON events (robot, id)",
    f"PRAGMA user_version = {_VERSION}",
)
_INSERT: Final = (
    f"INSERT INTO events (robot, {', '.join(_COLUMNS)})"  # noqa: S608 - names of our own
    f" VALUES ({', '.join('?' * (len(_COLUMNS) + 1))})"
)
_SELECT: Final = f"SELECT id, {', '.join(_COLUMNS)} FROM events"  # noqa: S608 - as above

log = logging.getLogger(__name__)


class AlarmSearchTimeout(UrcError):
    """The search took too long."""


class AlarmHistoryRow(NamedTuple):
    """One event in the history, with its number."""

    id: int
    event: AlarmEvent


class AlarmQuery(NamedTuple):
    """A query for the events of one robot."""

    robot: str
    text: str = ""
    """Text to find in the signal, kind, condition, value or name; the case of ASCII letters is
    ignored."""
    kinds: tuple[str, ...] = ()
    """Kinds of events; empty for all kinds."""
    signals: tuple[str, ...] = ()
    """Names of signals whose titles contain `text`, so that their events match too."""
    since: float = 0.0
    """Start of the period, as UTC time in seconds since 1970."""
    until: float = float("inf")
    """End of the period; events at this time are not included."""
    before: int = 0
    """Number of an event in the history; only older events are returned. 0 starts with the newest
    event."""
    last: int = 100
    """Maximum number of events."""


def alarm_file(file: Path) -> sqlite3.Connection:
    """Return a connection for writing; create a missing file, which only its owner can read.

    Raises:
        sqlite3.DatabaseError: the file is not an alarm file.
        OSError: the file cannot be created.
    """
    base = open_for_writing(file)
    try:
        base.execute("PRAGMA synchronous = FULL")  # an acknowledgement survives a power failure
        _create(base)
    except sqlite3.Error:
        base.close()
        raise
    return base


def _create(base: sqlite3.Connection) -> None:
    base.execute("BEGIN IMMEDIATE")
    try:
        (version,) = base.execute("PRAGMA user_version").fetchone()
        if version == 0:
            for statement in _CREATE:
                base.execute(statement)
        elif version > _VERSION:
            raise sqlite3.OperationalError("a newer version of URC created this file")
        base.execute("COMMIT")
    except sqlite3.Error:
        with suppress(sqlite3.Error):
            base.execute("ROLLBACK")
        raise


def save_records(
    base: sqlite3.Connection, records: Mapping[tuple[str, str], AlarmRecord | None]
) -> None:
    """Write records, keyed by robot and signal, inside a transaction; None deletes a record."""
    gone = [key for key, record in records.items() if record is None]
    base.executemany("DELETE FROM states WHERE robot = ? AND signal = ?", gone)
    there = [
        (*key, json.dumps(record._asdict(), ensure_ascii=True))
        for key, record in records.items()
        if record is not None
    ]
    base.executemany("INSERT OR REPLACE INTO states VALUES (?, ?, ?)", there)


def append_events(base: sqlite3.Connection, events: Iterable[tuple[str, AlarmEvent]]) -> None:
    """Append pairs of robot and event, inside a transaction."""
    base.executemany(_INSERT, [(robot, *event) for robot, event in events])


def prune_events(base: sqlite3.Connection, most: int = MOST_EVENTS) -> None:
    """Inside a transaction, delete the events beyond `most` if there are at least `_SPARE`."""
    first, last = base.execute("SELECT min(id), max(id) FROM events").fetchone()
    if first is not None and last - first >= most + _SPARE:
        base.execute("DELETE FROM events WHERE id <= ?", (last - most,))


def load_records(file: Path) -> list[tuple[str, AlarmRecord]]:
    """Return all stored records, each with its robot; [] if there is no file.

    Raises:
        OSError: the file cannot be read.
    """
    with opened_for_reading(file) as base:
        if base is None:
            return []
        rows = base.execute("SELECT robot, record FROM states").fetchall()
    found = ((robot, _record(text)) for robot, text in rows)
    return [(robot, one) for robot, one in found if one is not None]


def search_alarms(
    file: Path, query: AlarmQuery, longest_s: float = _LONGEST_S
) -> list[AlarmHistoryRow]:
    """Return a query's newest events, newest first; [] if there is no file.

    Raises:
        OSError: the file cannot be read.
        AlarmSearchTimeout: the search takes longer than `longest_s`.
    """
    where, values = _condition(query)
    with opened_for_reading(file) as base:
        if base is None:
            return []
        ends_at = time.monotonic() + longest_s
        base.set_progress_handler(lambda: time.monotonic() > ends_at, _STEPS)
        try:
            order = " ORDER BY id DESC LIMIT ?"
            rows = base.execute(_SELECT + where + order, (*values, query.last)).fetchall()
        except sqlite3.OperationalError:
            if time.monotonic() > ends_at:
                raise AlarmSearchTimeout(
                    f"the search takes more than {longest_s:g} s: choose a shorter period"
                ) from None
            raise
    return [AlarmHistoryRow(number, AlarmEvent._make(row)) for number, *row in rows]


def _condition(query: AlarmQuery) -> tuple[str, list[object]]:
    parts, values = ["robot = ? AND at >= ? AND at < ?"], [query.robot, query.since, query.until]
    found: list[object] = [*values]
    if query.kinds:
        parts.append(f"kind IN ({_marks(query.kinds)})")
        found += query.kinds
    if query.text:
        texts = ("signal", "kind", "condition", "value", "who")
        pattern = query.text.replace("!", "!!").replace("%", "!%").replace("_", "!_")
        either = [f"{name} LIKE ? ESCAPE '!'" for name in texts]
        found += [f"%{pattern}%"] * len(texts)
        if query.signals:
            either.append(f"signal IN ({_marks(query.signals)})")
            found += query.signals
        parts.append(f"({' OR '.join(either)})")
    if query.before:
        parts.append("id < ?")
        found.append(query.before)
    return " WHERE " + " AND ".join(parts), found


def _marks(values: Collection[str]) -> str:
    return ", ".join("?" * len(values))


def _record(text: str) -> AlarmRecord | None:
    """Return a stored record; None if the record is damaged."""
    try:
        given = json.loads(text)
        known = {name: given[name] for name in AlarmRecord._fields if name in given}
        record = AlarmRecord(**known)
        usual = AlarmRecord("", "", "medium", 0, 0, 0.0, 0)
        are_right = all(
            type(one) is type(other) or {type(one), type(other)} == {int, float}
            for one, other in zip(record, usual, strict=True)
        )
    except (ValueError, TypeError, KeyError):
        are_right = False
    if not are_right or record.priority not in get_args(AlarmPriority):
        log.warning("a stored alarm is damaged: %.100s", text)
        return None
    return record
