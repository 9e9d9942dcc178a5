"""The audit keeps what happened, within its bounds, and waits for nothing."""

import os
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from urc.runtime.audit import AuditLog
from urc.runtime.audit_check import check
from urc.runtime.audit_entry import AuditEntry, shown
from urc.runtime.audit_search import AuditQuery, search
from urc.runtime.audit_table import Retention


@pytest.fixture(autouse=True)
def no_batch_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """An entry is written when it comes."""
    monkeypatch.setattr("urc.runtime.audit._GATHER_S", 0.001)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "folder" / "audit.sqlite"


def entry(number: int, robot: str = "puppet", text: str = "") -> AuditEntry:
    return AuditEntry(1000.0 + number, robot, "moved", "screen 1", "drive", "s1", 7, "go", text)


def read(file: Path, robot: str = "", since: float = 0.0, last: int = 200) -> list[AuditEntry]:
    """Return the newest entries, oldest first."""
    query = AuditQuery(robot=robot, since=since, last=last)
    return [row.entry for row in reversed(search(file, query))]


@pytest.fixture
def kept(file: Path) -> Iterator[AuditLog]:
    with AuditLog(file, now=lambda: 5000.0) as log:
        yield log


def test_entries_are_read_in_the_order_in_which_they_were_noted(kept: AuditLog) -> None:
    wanted = [entry(number) for number in range(10)]
    for one in wanted:
        kept.add(one)
    assert kept.settle()
    assert read(kept.file) == wanted
    assert read(kept.file, last=2) == wanted[-2:]
    assert read(kept.file, since=1007.0) == wanted[7:]


def test_one_robot_is_not_shown_what_belongs_to_another(kept: AuditLog) -> None:
    kept.add(entry(1, "puppet"))
    kept.add(entry(2, "rover"))
    assert kept.settle()
    assert [one.robot for one in read(kept.file, robot="rover")] == ["rover"]


def test_it_goes_on_after_a_restart(file: Path) -> None:
    for number in range(3):
        with AuditLog(file) as log:
            log.add(entry(number))
    assert [one.at for one in read(file)] == [1000.0, 1001.0, 1002.0]
    assert check(file) == ""


def test_a_changed_row_shows(kept: AuditLog) -> None:
    for number in range(6):
        kept.add(entry(number))
    assert kept.settle()
    assert check(kept.file) == ""
    with closing(sqlite3.connect(kept.file)) as base, base:
        base.execute("UPDATE entries SET who = 'screen 2' WHERE id = 4")
    assert check(kept.file) == "entry 4 does not follow from entry 3"


def test_a_removed_row_shows(kept: AuditLog) -> None:
    for number in range(6):
        kept.add(entry(number))
    assert kept.settle()
    with closing(sqlite3.connect(kept.file)) as base, base:
        base.execute("DELETE FROM entries WHERE id = 3")
    assert check(kept.file) == "entry 3 is missing"


def test_a_full_file_loses_its_oldest_entries(file: Path) -> None:
    most_bytes = 400_000
    retention = Retention(most_bytes)
    with AuditLog(file, retention=retention, now=lambda: 5000.0) as log:
        for number in range(4000):
            log.add(entry(number, text="x" * 200))
            if number % 500 == 0:
                assert log.settle()
        assert log.settle(20)
        found = read(file, last=100_000)
        assert found[0].at > 2000.0
        assert {4999.0, 5000.0} <= {one.at for one in found}, (
            "the newest entry and the count of lost entries"
        )
        assert check(file) == ""
    assert file.stat().st_size < 2 * most_bytes


def test_a_queue_that_is_full_loses_entries_and_says_how_many(file: Path) -> None:
    with AuditLog(file, most_waiting=10, now=lambda: 5000.0) as log:
        for number in range(2000):
            log.add(entry(number))
        assert log.settle()
        log.add(entry(9999))
        assert log.settle()
        found = read(file, last=5000)
    lost = sum(one.times for one in found if one.what == "lost")
    assert lost > 0
    assert sum(one.what == "moved" for one in found) + lost == 2001


def test_a_folder_that_cannot_be_written_is_told_once_and_holds_nobody_up(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("no folder")
    log = AuditLog(tmp_path / "file" / "audit.sqlite")
    began_s = time.monotonic()
    for number in range(5000):
        log.add(entry(number))
    assert time.monotonic() - began_s < 1.0
    with log._wakes:
        assert log._wakes.wait_for(lambda: log._lost > 0, 5)
    log.close()
    assert [one.getMessage().partition(":")[0] for one in caplog.records] == [
        "the audit log cannot be written"
    ]
    assert log.fault


def test_a_file_that_is_no_database_is_put_aside(
    file: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file.parent.mkdir()
    file.write_bytes(b"this is no database " * 100)
    with AuditLog(file) as log:
        log.add(entry(1))
        assert log.settle()
        assert [one.at for one in read(file)] == [1001.0]
    assert file.with_suffix(".broken").read_bytes().startswith(b"this is no database")
    assert "renamed to audit.broken" in caplog.text


def test_reading_nothing_is_no_error(file: Path) -> None:
    assert read(file) == []


def test_reading_what_is_no_database_is_one_line(file: Path) -> None:
    file.parent.mkdir()
    file.write_bytes(b"this is no database " * 100)
    with pytest.raises(OSError, match="cannot be read: file is not a database"):
        read(file)


def test_texts_have_an_end_and_any_character(kept: AuditLog) -> None:
    kept.add(entry(1, text="é\ud800" + "x" * 5000))
    assert kept.settle()
    (found,) = read(kept.file)
    assert found.arguments == "é?" + "x" * 998


def test_many_bytes_are_shown_by_their_hash() -> None:
    assert shown(b"GO") == "474f"
    assert shown(bytes(100)).startswith("100 bytes, sha256 cd00e292c5970d3c5e2f0ffa5171e555")


def test_two_servers_with_one_folder_keep_one_chain(file: Path) -> None:
    with AuditLog(file) as one, AuditLog(file) as other:
        for number in range(6):
            log = other if number % 2 else one
            log.add(entry(number))
            assert log.settle()
    assert [each.at for each in read(file)] == [1000.0 + number for number in range(6)]
    assert check(file) == ""


def test_an_entry_that_no_file_takes_is_counted_and_the_next_one_is_kept(
    file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("urc.runtime.audit._RETRY_S", 0.0)
    with AuditLog(file) as log:
        log.add(entry(1)._replace(epoch=2**70))
        assert log.settle()
        log.add(entry(2))
        assert log.settle()
    assert [(each.what, each.times) for each in read(file)] == [("moved", 1), ("lost", 1)]


def test_a_file_that_somebody_locks_holds_nobody_up_and_is_told_once(
    file: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("urc.runtime.audit._RETRY_S", 0.0)
    monkeypatch.setattr("urc.runtime.sqlite_file.LOCKED_S", 0.05)
    with AuditLog(file) as log:
        log.add(entry(1))
        assert log.settle()
        base = sqlite3.connect(file, isolation_level=None)
        base.execute("BEGIN IMMEDIATE")
        for number in (2, 3):
            began_s = time.monotonic()
            log.add(entry(number))
            assert time.monotonic() - began_s < 0.5, "the lock is waited for elsewhere"
            assert log.settle(10)
        assert log.fault == "database is locked"
        base.execute("ROLLBACK")
        base.close()
        log.add(entry(4))
        assert log.settle()
    assert [(each.what, each.times) for each in read(file)][1:] == [("moved", 1), ("lost", 2)]
    told = [one.getMessage() for one in caplog.records]
    assert [text for text in told if "locked" in text] == [
        "the audit log cannot be written: database is locked; "
        "robots can still be driven and stopped"
    ]


@pytest.mark.skipif(os.name != "posix", reason="POSIX permissions")
def test_only_its_owner_reads_it(file: Path) -> None:
    """Also one of an older version, and what SQLite puts beside it."""
    file.parent.mkdir(mode=0o755)
    sqlite3.connect(file).close()
    file.chmod(0o644)
    with AuditLog(file) as log:
        log.add(entry(1))
        assert log.settle()
        found = [one for one in file.parent.iterdir() if one.name.startswith(file.name)]
        assert {one.stat().st_mode & 0o777 for one in found} == {0o600}
        assert len(found) > 1
