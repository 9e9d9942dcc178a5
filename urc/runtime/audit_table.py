"""The SQLite table of the audit log: creation, migration, writing and deletion of old entries.

Layer 4. In a file from an older version, missing columns are added in place. Existing rows keep
version 1, so their links stay valid. After old entries are deleted, a new entry records the link of
the last deleted entry. The chain can therefore be checked from its new start.
"""

import json
import sqlite3
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

from urc.runtime.audit_entry import COLUMNS, FIRST_COLUMNS, VERSION, AuditEntry, link
from urc.runtime.sqlite_file import open_for_writing

__all__ = [
    "FOLLOWS",
    "PRUNED",
    "AuditRow",
    "Retention",
    "append",
    "connected",
    "is_migrated",
    "prune",
    "row_of",
    "select",
]

PRUNED: Final = "pruned"
"""Kind of the entry that records deleted entries."""
FOLLOWS: Final = "SELECT id, chain FROM entries ORDER BY id DESC LIMIT 1"
_SHARE: Final = 10
"""Divisor that sets how many rows are deleted from a full file: 10 deletes a tenth of the rows."""
_TYPES: Final = {"at": "REAL", "epoch": "INTEGER", "times": "INTEGER", "lasted_s": "REAL"}
_LATER: Final = (
    *(f"{name} TEXT NOT NULL DEFAULT ''" for name in COLUMNS[FIRST_COLUMNS:]),
    "version INTEGER NOT NULL DEFAULT 1",
)
_CREATE: Final = (
    "CREATE TABLE entries (id INTEGER PRIMARY KEY, "
    + ", ".join(f"{name} {_TYPES.get(name, 'TEXT')} NOT NULL" for name in COLUMNS[:FIRST_COLUMNS])
    + ", chain TEXT NOT NULL, "
    + ", ".join(_LATER)
    + ")"
)
_INSERT: Final = (
    f"INSERT INTO entries ({', '.join(COLUMNS)}, chain, version)"  # noqa: S608 - names of our own
    f" VALUES ({', '.join('?' * (len(COLUMNS) + 2))})"
)


class AuditRow(NamedTuple):
    """One entry and its place in the hash chain."""

    id: int
    version: int
    """Version of the link."""
    chain: str
    """Link of the entry: a hash that covers this entry and all earlier entries."""
    entry: AuditEntry


class Retention(NamedTuple):
    """The limits of the file; beyond a limit, the oldest entries are deleted."""

    most_bytes: int = 100_000_000
    """Approximate maximum size of the file, in bytes."""
    most_age_s: float = 90 * 86_400.0
    """Maximum age of an entry, in seconds."""
    fewest: int = 1000
    """Number of newest entries to keep regardless of their age. The whole log is therefore not
    deleted, even if the clock jumps ahead by years."""
    group: int = 100
    """Minimum number of expired entries that are deleted together."""


def connected(file: Path) -> sqlite3.Connection:
    """Return a connection for writing; create or migrate the file, which only its owner can read.

    Raises:
        sqlite3.DatabaseError: the file is not an audit log.
        OSError: the file cannot be created.
    """
    base = open_for_writing(file)
    try:
        base.execute("PRAGMA synchronous = NORMAL")
        if not is_migrated(base):
            _migrate(base)
        base.execute(FOLLOWS)  # fails if the file is not an audit file
    except sqlite3.Error:
        base.close()
        raise
    return base


def select(base: sqlite3.Connection) -> str:
    """Return the start of a query whose rows `row_of` can read, even in older tables."""
    has = _columns(base)
    later = [name if name in has else f"'' AS {name}" for name in COLUMNS[FIRST_COLUMNS:]]
    version = "version" if is_migrated(base) else "1 AS version"
    names = ", ".join((*COLUMNS[:FIRST_COLUMNS], *later))
    return f"SELECT id, {version}, chain, {names} FROM entries"  # noqa: S608 - names of our own


def row_of(values: tuple[object, ...]) -> AuditRow:
    """Return one result row of a query from `select` as an `AuditRow`."""
    number, version, chain, *entry = values
    return AuditRow(number, version, chain, AuditEntry._make(entry))  # type: ignore[arg-type]


def append(base: sqlite3.Connection, entries: Iterable[AuditEntry]) -> None:
    """Append entries inside a transaction."""
    last = base.execute(FOLLOWS).fetchone()  # another process may write to this file
    chain = last[1] if last else ""
    rows: list[tuple[object, ...]] = []
    for entry in entries:
        chain = link(chain, entry)
        rows.append((*entry, chain, VERSION))
    base.executemany(_INSERT, rows)


def prune(base: sqlite3.Connection, retention: Retention, now: float) -> None:
    """Delete the oldest entries beyond the limits, inside a transaction, and record the deletion.

    Args:
        base: connection with an open transaction.
        retention: the limits.
        now: UTC time in seconds since 1970.
    """
    first, last = base.execute("SELECT min(id), max(id) FROM entries").fetchone()
    if first is None:
        return
    until = min(_young(base, now - retention.most_age_s), last - retention.fewest + 1)
    if until - first >= retention.group:
        _delete(base, until, now, f"older than {retention.most_age_s / 86_400:g} days")
    while _size(base) > retention.most_bytes:
        first, last = base.execute("SELECT min(id), max(id) FROM entries").fetchone()
        if first == last:
            return
        until = first + (last - first) // _SHARE + 1
        _delete(base, until, now, f"the log has more than {retention.most_bytes} bytes")


def _columns(base: sqlite3.Connection) -> set[str]:
    return {row[1] for row in base.execute("PRAGMA table_info(entries)")}


def is_migrated(base: sqlite3.Connection) -> bool:
    """Return whether the table has the columns of this URC version."""
    return "version" in _columns(base)


def _migrate(base: sqlite3.Connection) -> None:
    """Create the table, or add the columns that a table from an older version lacks."""
    base.execute("BEGIN IMMEDIATE")
    try:
        if not _columns(base):
            base.execute(_CREATE)
        elif not is_migrated(base):  # another process may have been faster
            for column in _LATER:
                base.execute(f"ALTER TABLE entries ADD COLUMN {column}")
            _explain_beginning(base)
        base.execute("COMMIT")
    except sqlite3.Error:
        with suppress(sqlite3.Error):
            base.execute("ROLLBACK")
        raise


def _explain_beginning(base: sqlite3.Connection) -> None:
    """Record the entries that an older version deleted without recording the deletion."""
    first, at = base.execute("SELECT min(id), max(at) FROM entries").fetchone()
    if first is not None and first > 1:
        append(base, [_pruning(first - 1, first - 1, "", at, "by an older version of URC")])


def _young(base: sqlite3.Connection, since: float) -> int:
    """Return the number of the first entry at or after `since`."""
    found = base.execute("SELECT id FROM entries WHERE at >= ? ORDER BY id LIMIT 1", (since,))
    row = found.fetchone()
    return row[0] if row else 2**62


def _delete(base: sqlite3.Connection, until: int, now: float, reason: str) -> None:
    """Delete all entries before entry number `until`."""
    before = base.execute(
        "SELECT id, chain FROM entries WHERE id < ? ORDER BY id DESC LIMIT 1", (until,)
    ).fetchone()
    # Recorded in the same transaction, with the link before the new start, so that the remaining
    # entries can be checked.
    count = base.execute("DELETE FROM entries WHERE id < ?", (until,)).rowcount
    append(base, [_pruning(count, before[0], before[1], now, reason)])


def _pruning(count: int, last: int, chain: str, at: float, reason: str) -> AuditEntry:
    outcome = f"{count} entries were deleted: {reason}"
    data = json.dumps({"last": last, "chain": chain})
    return AuditEntry(at, "", PRUNED, arguments=data, outcome=outcome, times=count)


def _size(base: sqlite3.Connection) -> int:
    (pages,) = base.execute("PRAGMA page_count").fetchone()
    (free,) = base.execute("PRAGMA freelist_count").fetchone()
    (page,) = base.execute("PRAGMA page_size").fetchone()
    return int(pages - free) * int(page)
