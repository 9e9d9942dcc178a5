"""Check the audit log's hash chain and export the log as JSON Lines for later checks.

Layer 4. All functions block, so servers call them in a thread.

Each exported line has the link before its entry (``before``) and the entry's own link (``chain``).
Each line can be checked on its own, so an export that omits robots can also be checked. Lines
with consecutive numbers must also match each other.
"""

import json
import sqlite3
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

from urc.problems import printable_json
from urc.runtime.audit_entry import COLUMNS, FIRST_COLUMNS, VERSION, AuditEntry, link
from urc.runtime.audit_search import AuditQuery, condition
from urc.runtime.audit_table import PRUNED, AuditRow, is_migrated, row_of, select
from urc.runtime.sqlite_file import opened_for_reading

__all__ = ["LONGEST_LINE", "ExportCheck", "check", "check_export", "compare", "exported", "line_of"]

_AT_ONCE: Final = 500
"""Maximum number of entries per read transaction, so that a slow download does not delay the
writer."""
_SLICE: Final = 25
_PAUSE_S: Final = 0.001
"""Pause after every `_SLICE` entries, in seconds, so that an export does not delay motion."""
LONGEST_LINE: Final = 100_000
"""Maximum length of an export line, in characters."""


class ExportCheck(NamedTuple):
    """The result of an export check."""

    entries: int
    """Number of checked entries."""
    fault: str
    """Message about the first invalid entry; "" if the export is intact."""
    gap: str
    """Message about the first missing entry, or ""; exports for selected robots have such gaps."""
    last: int = 0
    """Number of the last entry."""
    chain: str = ""
    """Link (hash) of the last entry."""


def check(file: Path) -> str:
    """Return a message about the first broken link of the hash chain, or "" if the file is intact.

    Raises:
        OSError: the file cannot be read.
    """
    with opened_for_reading(file) as base:
        if base is None:
            return ""
        # After a deletion, the chain begins with the link in the entry about the deletion. Older
        # versions stored no link. The first row may then have any number, and later gaps are
        # reported.
        last, chain = _last_pruning(base)
        is_explained = bool(last) or is_migrated(base)
        for values in base.execute(select(base) + " ORDER BY id"):
            row = row_of(values)
            if row.id > last + 1 and is_explained:
                return _missing(last + 1, row.id - 1)
            before = "" if row.id == 1 else chain or None
            if fault := _fault_of(row, before):
                return fault
            last, chain, is_explained = row.id, row.chain, True
    return ""


def exported(file: Path, robots: frozenset[str] | None = None) -> Iterator[str]:
    """Yield blocks of JSON lines, oldest entry first.

    Args:
        file: file of the audit log.
        robots: robots whose entries are exported; None exports all entries.

    Raises:
        OSError: the file cannot be read.
    """
    after = 0
    where, values = condition(AuditQuery(robots))
    order = " AND id > ? ORDER BY id LIMIT ?"
    before = "SELECT chain FROM entries WHERE id = ?"
    while True:
        lines = []
        with opened_for_reading(file) as base:
            if base is None:
                return
            found = base.execute(select(base) + where + order, (*values, after, _AT_ONCE))
            for number, row in enumerate(map(row_of, found.fetchall())):
                if number % _SLICE == 0:
                    time.sleep(_PAUSE_S)
                known = base.execute(before, (row.id - 1,)).fetchone()
                chain = known[0] if known else _before_first(base, row.id)
                lines.append(line_of(row, chain))
                after = row.id
        if not lines:
            return
        yield "".join(lines)


def line_of(row: AuditRow, before: str | None) -> str:
    """Return one line of an export; `before` is the link before the entry, or None if unknown."""
    head = {"id": row.id, "version": row.version, "before": before, "chain": row.chain}
    text = json.dumps(head | row.entry._asdict(), ensure_ascii=False)
    return printable_json(text) + "\n"


def check_export(lines: Iterable[str]) -> ExportCheck:
    """Check an export without its audit log."""
    count, last, chain, gap = 0, 0, "", ""
    for number, line in enumerate(lines, 1):
        try:
            row, before = _parsed(line)
        except ValueError as error:
            return ExportCheck(count, f"line {number} is not an entry: {error}", gap, last, chain)
        if count and row.id <= last:
            fault = f"line {number}: entry {row.id} does not follow from entry {last}"
        elif count and row.id == last + 1 and before != chain:
            fault = f"entry {row.id} does not follow from entry {last}"
        else:
            fault = _fault_of(row, "" if row.id == 1 else before, is_first=count == 0)
        if fault:
            return ExportCheck(count, fault, gap, last, chain)
        if count and row.id > last + 1 and not gap:
            gap = _missing(last + 1, row.id - 1)
        count, last, chain = count + 1, row.id, row.chain
    return ExportCheck(count, "", gap, last, chain)


def compare(file: Path, export: ExportCheck) -> str:
    """Return a message if an export's last entry is missing from the audit log or differs, else "".

    An export kept elsewhere therefore shows whether entries were removed from the end of the log.

    Raises:
        OSError: the audit log cannot be read.
    """
    with opened_for_reading(file) as base:
        if base is None:
            return f"{file} does not exist"
        row = base.execute("SELECT chain FROM entries WHERE id = ?", (export.last,)).fetchone()
        if row is None and export.last <= _last_pruning(base)[0]:
            return ""
    if row is None:
        return f"the audit log lacks entry {export.last} of the export"
    return "" if row[0] == export.chain else f"entry {export.last} differs from the export"


def _parsed(line: str) -> tuple[AuditRow, str | None]:
    """Return an exported line as a row, and the link before it; raise `ValueError` if invalid."""
    if len(line) > LONGEST_LINE:
        raise ValueError(f"more than {LONGEST_LINE} characters")
    found: Any = json.loads(line)
    if not isinstance(found, dict):
        raise ValueError("expected an object")
    kinds = AuditEntry.__annotations__ | {"id": int, "version": int, "chain": str}
    for name, kind in kinds.items():
        if type(found.get(name)) is not kind:
            raise ValueError(f"expected {name!r} of type {kind.__name__}")
    if "before" not in found or not isinstance(found["before"], str | None):
        raise ValueError("expected 'before' of type str, or null")
    entry = AuditEntry(*(found[name] for name in COLUMNS))
    return AuditRow(found["id"], found["version"], found["chain"], entry), found["before"]


def _fault_of(row: AuditRow, before: str | None, *, is_first: bool = True) -> str:
    """Return a message about a broken link, or ""; `before` may be None only for the first row."""
    if row.version > VERSION:
        return f"entry {row.id} was written by a newer version of URC"
    if row.version < 1 or (row.version == 1 and any(row.entry[FIRST_COLUMNS:])):
        return f"entry {row.id} was changed"
    if before is None and is_first:
        return ""
    if before is None or row.chain != link(before, row.entry, row.version):
        return f"entry {row.id} does not follow from entry {row.id - 1}"
    return ""


def _missing(first: int, last: int) -> str:
    if first == last:
        return f"entry {first} is missing"
    return f"entries {first} to {last} are missing"


def _before_first(base: sqlite3.Connection, first: int) -> str | None:
    if first == 1:
        return ""
    last, chain = _last_pruning(base)
    return chain or None if last == first - 1 else None


def _last_pruning(base: sqlite3.Connection) -> tuple[int, str]:
    """Return the last deleted entry's number and link; 0 and "" if no entry was deleted."""
    row = base.execute(
        "SELECT arguments FROM entries WHERE what = ? ORDER BY id DESC LIMIT 1", (PRUNED,)
    ).fetchone()
    try:
        found = json.loads(row[0]) if row else {}
        return int(found.get("last", 0)), str(found.get("chain", ""))
    except (ValueError, AttributeError, TypeError):
        return 0, ""  # changed by hand: the check reports the beginning
