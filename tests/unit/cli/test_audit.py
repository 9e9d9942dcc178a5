"""`urc audit` prints what happened, and tells when somebody has changed it."""

import json
import os
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from urc.cli.main import main
from urc.runtime.audit import AuditLog
from urc.runtime.audit_entry import AuditEntry


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    with AuditLog(tmp_path / "audit.sqlite") as log:
        for number in range(6):
            log.add(
                AuditEntry(1000.0 + number, "rover" if number % 2 else "puppet", "moved", "Ann")
            )
        assert log.settle()
    return tmp_path


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> list[float]:
    assert main(["audit", *words]) == 0
    output, errors = capsys.readouterr()
    assert errors == ""
    return [json.loads(line)["at"] for line in output.splitlines()]


def test_entries_come_as_json_lines_oldest_first(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert printed(capsys, "--data-dir", str(folder)) == [1000.0 + n for n in range(6)]
    assert printed(capsys, "--data-dir", str(folder), "--last", "2") == [1004.0, 1005.0]
    only = ("--data-dir", str(folder), "--robot", "rover", "--last", "2")
    assert printed(capsys, *only) == [1003.0, 1005.0]


def test_folder_of_this_user_is_the_usual_one(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.environ", {"URC_DATA_DIR": str(folder)})
    monkeypatch.setattr("urc._folders.data_folder.__defaults__", ({"URC_DATA_DIR": str(folder)},))
    assert len(printed(capsys)) == 6


def test_a_changed_entry_is_told_with_its_number(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = folder / "audit.sqlite"
    with closing(sqlite3.connect(file)) as base, base:
        base.execute("UPDATE entries SET who = 'Bob' WHERE id = 4")
    assert main(["audit", "--data-dir", str(folder)]) == 1
    output, errors = capsys.readouterr()
    assert len(output.splitlines()) == 6
    assert errors == (
        f"urc audit: {file} was tampered with: entry 4 does not follow from entry 3\n"
    )


@pytest.mark.parametrize("text", ["0", "-1", "many", "1000001", "99999999999"])
def test_senseless_number_of_entries_is_wrong_use(
    text: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["audit", "--data-dir", str(folder), f"--last={text}"]) == 2
    assert "expected a number from 1 to 1000000" in capsys.readouterr().err


def test_folder_without_an_audit_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["audit", "--data-dir", str(tmp_path)]) == 1
    output, errors = capsys.readouterr()
    assert output == ""
    assert errors == (
        f"urc audit: {tmp_path / 'audit.sqlite'} does not exist;"
        " start 'urc serve' to create the file, or select its folder with --data-dir\n"
    )


def test_export_is_checked_without_the_log_and_private(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "copy.jsonl"
    assert main(["audit", "--data-dir", str(folder), "--export", str(copy)]) == 0
    assert os.name != "posix" or copy.stat().st_mode & 0o077 == 0
    assert main(["audit", "--check", str(copy)]) == 0
    assert capsys.readouterr().out == f"{copy}: 6 entries, intact\n"
    copy.write_text(copy.read_text().replace("Ann", "Bob", 1))
    assert main(["audit", "--check", str(copy)]) == 1
    assert capsys.readouterr().err == (
        f"urc audit: {copy} cannot be trusted: entry 1 does not follow from entry 0\n"
    )


def test_export_goes_to_standard_output_too(
    folder: Path, tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    assert main(["audit", "--data-dir", str(folder), "--export", "-"]) == 0
    lines = capfdbinary.readouterr().out.splitlines()
    assert [json.loads(line)["id"] for line in lines] == [1, 2, 3, 4, 5, 6]


def test_export_of_one_robot_has_gaps(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "copy.jsonl"
    words = ["audit", "--data-dir", str(folder), "--robot", "rover", "--export", str(copy)]
    assert main(words) == 0
    assert main(["audit", "--check", str(copy)]) == 1
    assert "entry 3 is missing" in capsys.readouterr().err
    assert main(["audit", "--check", str(copy), "--robot", "rover"]) == 0


def test_export_tells_that_the_log_was_cut(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "copy.jsonl"
    assert main(["audit", "--data-dir", str(folder), "--export", str(copy)]) == 0
    assert main(["audit", "--data-dir", str(folder), "--check", str(copy)]) == 0
    with closing(sqlite3.connect(folder / "audit.sqlite")) as base, base:
        base.execute("DELETE FROM entries WHERE id > 4")
    assert main(["audit", "--data-dir", str(folder), "--check", str(copy)]) == 1
    assert "the audit log lacks entry 6 of the export" in capsys.readouterr().err


def test_missing_export_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["audit", "--check", str(tmp_path / "none.jsonl")]) == 1
    assert "none.jsonl" in capsys.readouterr().err


def test_entries_are_searched_by_person_and_text(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert printed(capsys, "--data-dir", str(folder), "--who", "ben") == []
    assert len(printed(capsys, "--data-dir", str(folder), "--who", "ann")) == 6
    assert len(printed(capsys, "--data-dir", str(folder), "--text", "PUPPET")) == 3
