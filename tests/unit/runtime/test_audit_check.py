"""The chain of the audit shows each change, over migrations, deletions and exports."""

import hashlib
import json
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from urc.runtime.audit import AuditLog
from urc.runtime.audit_check import check, check_export, compare, exported
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_search import AuditQuery, search
from urc.runtime.audit_table import Retention

DAY_S = 86_400.0
NOW = 20_000 * DAY_S


@pytest.fixture(autouse=True)
def no_batch_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """An entry is written when it comes."""
    monkeypatch.setattr("urc.runtime.audit._GATHER_S", 0.001)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "audit.sqlite"


def entry(number: int, robot: str = "puppet", at: float = NOW) -> AuditEntry:
    return AuditEntry(
        at, robot, "moved", "Ann", "drive", "s1", 7, "go", str(number),
        principal="p1", kind="person", way="passkey", place="192.0.2.7",
    )  # fmt: skip


def write(file: Path, *entries: AuditEntry, retention: Retention | None = None) -> None:
    with AuditLog(file, retention=retention or Retention(), now=lambda: NOW) as log:
        for one in entries:
            log.add(one)
        assert log.settle(10)


def change(file: Path, statement: str) -> None:
    with closing(sqlite3.connect(file)) as base, base:
        base.execute(statement)


def write_old(file: Path, numbers: range) -> None:
    """Write entries as URC did before entries had principals."""
    names = (
        "at REAL, robot TEXT, what TEXT, who TEXT, role TEXT, client TEXT, epoch INTEGER,"
        " command TEXT, arguments TEXT, data TEXT, outcome TEXT, times INTEGER, lasted_s REAL,"
    ).replace(",", " NOT NULL,")
    chain = ""
    with closing(sqlite3.connect(file)) as base, base:
        base.execute(f"CREATE TABLE entries (id INTEGER PRIMARY KEY, {names} chain TEXT NOT NULL)")
        for number in numbers:
            row = (number + 0.5, "puppet", "moved", "screen 1", "drive", "s1", 7, "go", "", "", "",
                   1, 0.0)  # fmt: skip
            chain = hashlib.sha256((chain + json.dumps(row)).encode()).hexdigest()
            marks = ", ".join("?" * 15)
            base.execute(f"INSERT INTO entries VALUES ({marks})", (number, *row, chain))  # noqa: S608


def entries_of(file: Path) -> list[AuditEntry]:
    return [row.entry for row in reversed(search(file, AuditQuery(last=10_000)))]


def lines_of(file: Path, robots: frozenset[str] | None = None) -> list[str]:
    return "".join(exported(file, robots)).splitlines(keepends=True)


# Files of an older version


def test_old_file_is_read_and_checked_before_any_server_has_migrated_it(file: Path) -> None:
    write_old(file, range(1, 6))
    assert check(file) == ""
    assert [one.at for one in entries_of(file)] == [1.5, 2.5, 3.5, 4.5, 5.5]
    assert entries_of(file)[0].principal == ""
    assert check_export(lines_of(file))[:3] == (5, "", "")


def test_old_file_goes_on_with_new_columns_in_one_chain(file: Path) -> None:
    write_old(file, range(1, 6))
    write(file, entry(6))
    assert check(file) == ""
    found = entries_of(file)
    assert len(found) == 6
    assert (found[4].who, found[4].way) == ("screen 1", "")
    assert (found[5].who, found[5].way, found[5].place) == ("Ann", "passkey", "192.0.2.7")
    assert list(file.parent.glob("*.broken*")) == []


@pytest.mark.parametrize("column", ["who", "place", "way", "principal"])
def test_change_of_an_old_row_shows_after_the_migration(file: Path, column: str) -> None:
    write_old(file, range(1, 6))
    write(file, entry(6))
    change(file, f"UPDATE entries SET {column} = 'Eve' WHERE id = 3")  # noqa: S608
    assert "entry 3" in check(file)


def test_new_row_cannot_pass_as_an_old_one(file: Path) -> None:
    write(file, entry(1), entry(2), entry(3))
    change(file, "UPDATE entries SET version = 1, place = '' WHERE id = 2")
    assert "entry 2" in check(file)


def test_old_file_that_lost_its_beginning_says_so_and_stays_checkable(file: Path) -> None:
    write_old(file, range(500, 510))
    assert check(file) == ""
    write(file, entry(1))
    assert check(file) == ""
    told = [one for one in entries_of(file) if one.what == "pruned"]
    assert [one.outcome for one in told] == ["499 entries were deleted: by an older version of URC"]
    change(file, "DELETE FROM entries WHERE id = 500")
    assert check(file) == "entry 500 is missing"


def test_two_servers_migrate_one_file(file: Path) -> None:
    write_old(file, range(1, 3))
    with AuditLog(file) as one, AuditLog(file) as other:
        one.add(entry(3))
        other.add(entry(4))
        assert one.settle()
        assert other.settle()
    assert len(entries_of(file)) == 4
    assert check(file) == ""


def test_file_of_a_newer_version_is_told(file: Path) -> None:
    write(file, entry(1))
    change(file, "UPDATE entries SET version = 9")
    assert check(file) == "entry 1 was written by a newer version of URC"


# Deletion of old entries


def test_entries_older_than_the_limit_are_deleted_and_counted(file: Path) -> None:
    keeps = Retention(most_age_s=90 * DAY_S, fewest=10, group=5)
    old = [entry(number, at=NOW - 100 * DAY_S) for number in range(20)]
    young = [entry(number, at=NOW - 80 * DAY_S) for number in range(20)]
    write(file, *old, *young, retention=keeps)
    found = entries_of(file)
    assert [one.what for one in found] == ["moved"] * 20 + ["pruned"]
    assert (found[-1].times, found[-1].outcome) == (
        20,
        "20 entries were deleted: older than 90 days",
    )
    assert check(file) == ""


def test_clock_that_jumps_ahead_leaves_the_newest_entries(file: Path) -> None:
    write(file, *(entry(number, at=NOW - 9000 * DAY_S) for number in range(200)))
    write(file, entry(1), retention=Retention(fewest=50, group=20))
    found = entries_of(file)
    assert [one.what for one in found] == ["moved"] * 50 + ["pruned"]
    assert check(file) == ""


def test_few_old_entries_wait_for_more(file: Path) -> None:
    """Otherwise each new entry would cause an entry about a deletion."""
    keeps = Retention(fewest=1, group=100)
    write(file, *(entry(number, at=1.0) for number in range(50)), retention=keeps)
    assert [one.what for one in entries_of(file)] == ["moved"] * 50


def test_deleted_beginning_is_explained_by_nothing_else(file: Path) -> None:
    write(file, *(entry(number) for number in range(9)))
    change(file, "DELETE FROM entries WHERE id <= 4")
    assert check(file) == "entries 1 to 4 are missing"


def test_deletion_after_a_recorded_deletion_shows(file: Path) -> None:
    keeps = Retention(most_bytes=40_000)
    write(file, *(entry(number) for number in range(1000)), retention=keeps)
    first = search(file, AuditQuery(last=10_000))[-1].id
    assert first > 100
    assert check(file) == ""
    change(file, f"DELETE FROM entries WHERE id = {first}")  # noqa: S608
    assert check(file) == f"entry {first} is missing"


def test_first_entry_after_a_deletion_cannot_be_changed(file: Path) -> None:
    keeps = Retention(most_bytes=40_000)
    write(file, *(entry(number) for number in range(1000)), retention=keeps)
    first = search(file, AuditQuery(last=10_000))[-1].id
    change(file, f"UPDATE entries SET who = 'Eve' WHERE id = {first}")  # noqa: S608
    assert check(file) == f"entry {first} does not follow from entry {first - 1}"


# Exports


@pytest.fixture
def lines(file: Path) -> list[str]:
    write(file, *(entry(number, "rover" if number % 3 else "puppet") for number in range(1200)))
    return lines_of(file)


def test_export_has_all_entries_and_is_intact(file: Path, lines: list[str]) -> None:
    found = check_export(lines)
    assert found[:4] == (1200, "", "", 1200)
    assert compare(file, found) == ""
    first = json.loads(lines[0])
    assert (first["id"], first["before"], first["who"]) == (1, "", "Ann")
    assert first["chain"] == json.loads(lines[1])["before"]


def test_export_of_one_robot_has_gaps_and_each_line_proves_itself(
    file: Path, lines: list[str]
) -> None:
    some = lines_of(file, frozenset({"rover"}))
    assert {json.loads(line)["robot"] for line in some} == {"rover"}
    assert check_export(some)[:3] == (800, "", "entry 4 is missing")
    some[400] = some[400].replace("Ann", "Eve")
    assert "does not follow" in check_export(some).fault


def test_each_changed_byte_of_an_export_shows(lines: list[str]) -> None:
    text = lines[10]
    for at in range(len(text) - 1):
        changed = text[:at] + chr(ord(text[at]) ^ 1) + text[at + 1 :]
        found = check_export([*lines[:10], changed, *lines[11:20]])
        same = _parsed(changed) == json.loads(text)
        assert same or found.fault or found.gap, changed


def _parsed(text: str) -> object:
    try:
        return json.loads(text)
    except ValueError:
        return None


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("[]\n", "line 2 is not an entry: expected an object"),
        ("{\n", "line 2 is not an entry: Expecting property name"),
        ("{}\n", "line 2 is not an entry: expected 'at' of type float"),
        ("x" * 100_001, "line 2 is not an entry: more than 100000 characters"),
    ],
)
def test_line_that_is_no_entry_is_told(lines: list[str], line: str, told: str) -> None:
    assert check_export([lines[0], line, lines[1]]).fault.startswith(told)


def test_removed_and_swapped_lines_show(lines: list[str]) -> None:
    assert check_export([*lines[:5], *lines[6:]]).gap == "entry 6 is missing"
    assert "entry 1 does not follow" in check_export([lines[1], lines[0]]).fault


def test_export_proves_that_the_log_lost_its_newest_entries(file: Path, lines: list[str]) -> None:
    found = check_export(lines)
    change(file, "DELETE FROM entries WHERE id > 1190")
    assert check(file) == ""
    assert compare(file, found) == "the audit log lacks entry 1200 of the export"
    write(file, *(entry(number) for number in range(20)))
    assert compare(file, found) == "entry 1200 differs from the export"


def test_export_of_what_the_log_deleted_by_itself_stays_good(file: Path) -> None:
    write(file, *(entry(number) for number in range(300)))
    found = check_export(lines_of(file))
    write(file, *(entry(n) for n in range(3000)), retention=Retention(most_bytes=40_000))
    assert compare(file, found) == ""
    assert check_export(lines_of(file)).fault == ""


# One byte, and several processes


@pytest.mark.parametrize("column", [*AuditEntry._fields, "chain"])
def test_change_of_any_column_shows(file: Path, column: str) -> None:
    write(file, *(entry(number) for number in range(5)))
    kind = AuditEntry.__annotations__.get(column, str)
    value = {float: "7.5", int: "9"}.get(kind, "'Eve'")
    change(file, f"UPDATE entries SET {column} = {value} WHERE id = 3")  # noqa: S608
    assert "entry" in check(file)


def test_swapped_rows_show(file: Path) -> None:
    write(file, *(entry(number) for number in range(5)))
    for step in ("id = -1 WHERE id = 2", "id = 2 WHERE id = 3", "id = 3 WHERE id = -1"):
        change(file, f"UPDATE entries SET {step}")  # noqa: S608
    assert "entry 2" in check(file)


_WRITER = """
import sys
from pathlib import Path
from urc.runtime.audit import AuditLog
from urc.runtime.audit_entry import AuditEntry
with AuditLog(Path(sys.argv[1])) as log:
    print("ready", flush=True)
    for number in range(300):
        log.add(AuditEntry(1000.0 + number, "", "access", sys.argv[2]))
        if number % 10 == 0:
            assert log.settle(30)
    assert log.settle(30)
"""


def test_several_processes_write_one_chain(file: Path) -> None:
    """As a server does with the commands that manage people."""
    commands = [[sys.executable, "-c", _WRITER, str(file), name] for name in ("Ann", "Ben", "Cid")]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE) for command in commands]
    for one in running:
        _, _ = one.communicate(timeout=60)
        assert one.returncode == 0
    found = entries_of(file)
    whos = [each.who for each in found if each.what == "access"]
    assert [whos.count(name) for name in ("Ann", "Ben", "Cid")] == [300] * 3
    assert whos != sorted(whos), "they took turns"
    assert check(file) == ""
