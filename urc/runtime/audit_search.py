"""Search the audit log.

Layer 4. All functions block, so servers call them in a thread. The functions read the file of an
`AuditLog`, which may be writing at the same time.
"""

import sqlite3
import time
from collections.abc import Collection
from pathlib import Path
from typing import Final, NamedTuple

from urc.problems import UrcError
from urc.runtime.audit_entry import COLUMNS, AuditEntry
from urc.runtime.audit_table import AuditRow, row_of, select
from urc.runtime.sqlite_file import opened_for_reading

__all__ = ["MOST", "AuditQuery", "SearchTimeout", "condition", "search"]

MOST: Final = 1000
"""Maximum number of entries in one result for a page or a program."""
_LONGEST_S: Final = 5.0
"""Maximum duration of one search, in seconds."""
_STEPS: Final = 50_000
"""Number of SQLite steps after which a search checks whether it has taken too long."""
_TEXTS: Final = tuple(name for name in COLUMNS if AuditEntry.__annotations__[name] is str)


class SearchTimeout(UrcError):
    """The search took too long."""


class AuditQuery(NamedTuple):
    """A query for audit log entries."""

    robots: frozenset[str] | None = None
    """Robots whose entries may be shown; None allows all entries, including the server's."""
    robot: str = ""
    """Name of one robot; "" for all robots."""
    who: str = ""
    """Part of the name or address of a person, device or program, or its complete identifier."""
    what: tuple[str, ...] = ()
    """Kinds of events to find; empty for all kinds."""
    text: str = ""
    """Text to find in any column; the case of ASCII letters is ignored."""
    since: float = 0.0
    """Start of the period, as UTC time in seconds since 1970."""
    until: float = float("inf")
    """End of the period; entries at this time are not included."""
    before: int = 0
    """Number of an entry; only older entries are returned. 0 starts with the newest entry."""
    last: int = 200
    """Maximum number of entries."""


def search(file: Path, query: AuditQuery, longest_s: float = _LONGEST_S) -> list[AuditRow]:
    """Return a query's newest entries, newest first; return [] if there is no file.

    Raises:
        OSError: the file cannot be read.
        SearchTimeout: the search takes longer than `longest_s`.
    """
    where, values = condition(query)
    order = " ORDER BY id DESC LIMIT ?"
    with opened_for_reading(file) as base:
        if base is None:
            return []
        ends_at = time.monotonic() + longest_s
        base.set_progress_handler(lambda: time.monotonic() > ends_at, _STEPS)
        try:
            found = base.execute(select(base) + where + order, (*values, query.last)).fetchall()
        except sqlite3.OperationalError:
            if time.monotonic() > ends_at:
                raise SearchTimeout(
                    f"the search takes more than {longest_s:g} s: choose a shorter period"
                ) from None
            raise
    return [row_of(row) for row in found]


def condition(query: AuditQuery) -> tuple[str, list[object]]:
    """Return the SQL condition of a query, and the values of its parameters."""
    parts, values = ["at >= ? AND at < ?"], list[object]((query.since, query.until))
    if query.robots is not None:
        parts.append(f"robot IN ({_marks(query.robots)})")
        values += sorted(query.robots)
    if query.robot:
        # Lost entries may concern any robot.
        parts.append("(robot = ? OR what = 'lost')")
        values.append(query.robot)
    if query.what:
        parts.append(f"what IN ({_marks(query.what)})")
        values += query.what
    if query.who:
        parts.append("(principal = ? OR who LIKE ? ESCAPE '!' OR place LIKE ? ESCAPE '!')")
        values += (query.who, _pattern(query.who), _pattern(query.who))
    if query.text:
        parts.append("(" + " OR ".join(f"{name} LIKE ? ESCAPE '!'" for name in _TEXTS) + ")")
        values += [_pattern(query.text)] * len(_TEXTS)
    if query.before:
        parts.append("id < ?")
        values.append(query.before)
    return " WHERE " + " AND ".join(parts), values


def _marks(values: Collection[str]) -> str:
    return ", ".join("?" * len(values))


def _pattern(text: str) -> str:
    escaped = text.replace("!", "!!").replace("%", "!%").replace("_", "!_")
    return f"%{escaped}%"
