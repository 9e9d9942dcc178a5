"""Comparison of the machine's clock with all recorded times in the data folder.

Layer 5. `clock_warning` reads files, so call it in a thread.
"""

import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Final

from urc.access.administration import newest_time
from urc.access.grants import AccessError
from urc.access.store import FILE, AccessStore
from urc.access.wrong_clock import KnownTime, clock_fault
from urc.runtime.audit import FILE as AUDIT_FILE
from urc.runtime.sqlite_file import opened_for_reading

__all__ = ["clock_warning"]

_NEWEST: Final = "SELECT max(at) FROM (SELECT at FROM entries ORDER BY id DESC LIMIT 1000)"


def clock_warning(data: Path, now: float | None = None) -> str:
    """Return a one-line warning if the clock is earlier than a recorded event; otherwise "".

    Unreadable files are ignored.

    Args:
        data: data folder.
        now: UTC time on the machine's clock, in seconds since 1970; None reads the clock.
    """
    return clock_fault(time.time() if now is None else now, _known(data))


def _known(data: Path) -> Iterator[KnownTime]:
    if (data / FILE).is_file():
        try:
            with closing(AccessStore(data)) as store:
                yield KnownTime(newest_time(store), "the newest sign-in")
        except AccessError:
            pass
    try:
        with opened_for_reading(data / AUDIT_FILE) as base:
            (newest,) = base.execute(_NEWEST).fetchone() if base else (None,)
    except (OSError, sqlite3.Error):
        newest = None
    if newest is not None:
        yield KnownTime(newest, "the newest entry of the audit log")
    yield from _of_certificates(data)


def _of_certificates(data: Path) -> Iterator[KnownTime]:
    """Yield the issue times of the local authority's certificates."""
    from urc.access.authority import AUTHORITY_FOLDER, issued_at  # slow to load

    for name in ("authority.pem", "server.pem"):
        file = data / AUTHORITY_FOLDER / name
        at = issued_at(file) if file.is_file() else None
        if at is not None:
            yield KnownTime(at.timestamp(), "the local certificate")
