"""Files of SQLite that several servers open at once."""

import sqlite3
import stat
import threading
from contextlib import closing
from pathlib import Path

import pytest

from urc.runtime import sqlite_file
from urc.runtime.sqlite_file import open_for_writing, opened_for_reading, set_aside


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "base.sqlite"


def test_file_is_created_for_its_owner_only_and_can_be_read(file: Path) -> None:
    with closing(open_for_writing(file)) as base:
        base.execute("CREATE TABLE one (number)")
        base.execute("INSERT INTO one VALUES (7)")
        with opened_for_reading(file) as other:
            assert other is not None
            assert other.execute("SELECT number FROM one").fetchall() == [(7,)]
        modes = [stat.S_IMODE(one.stat().st_mode) for one in file.parent.iterdir()]
    assert len(modes) == 3
    assert set(modes) == {0o600}


def test_second_server_waits_while_the_first_changes_the_journal(file: Path) -> None:
    """SQLite says "database is locked" at once here, whatever its time-out is."""
    with closing(sqlite3.connect(file, isolation_level=None, check_same_thread=False)) as first:
        first.execute("CREATE TABLE one (number)")
        first.execute("BEGIN IMMEDIATE")
        first.execute("INSERT INTO one VALUES (7)")
        witness = sqlite3.connect(file, timeout=5)
        with closing(witness), pytest.raises(sqlite3.OperationalError, match="locked"):
            witness.execute("PRAGMA journal_mode = WAL")
        threading.Timer(0.1, first.execute, ["COMMIT"]).start()
        with closing(open_for_writing(file)) as second:
            assert second.execute("PRAGMA journal_mode").fetchone() == ("wal",)
            assert second.execute("SELECT number FROM one").fetchall() == [(7,)]


def test_lock_that_stays_is_an_error_in_the_end(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sqlite_file, "LOCKED_S", 0.05)
    with closing(sqlite3.connect(file, isolation_level=None)) as first:
        first.execute("BEGIN EXCLUSIVE")
        with pytest.raises(sqlite3.OperationalError, match="locked"):
            open_for_writing(file)


def test_damaged_file_is_an_error_and_never_replaces_an_earlier_one(file: Path) -> None:
    for number in range(3):
        file.write_bytes(b"damaged %d" % number * 100)
        with pytest.raises(sqlite3.DatabaseError):
            open_for_writing(file)
        set_aside(file)
    names = ["base.broken", "base.broken2", "base.broken3"]
    assert [one.name for one in sorted(file.parent.iterdir())] == names
    assert file.with_name("base.broken2").read_bytes()[:9] == b"damaged 1"
