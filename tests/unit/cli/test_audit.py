"""`urc audit` prints what happened, and tells when somebody has changed it."""

import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from urc.cli.main import main
from urc.runtime.audit import AuditEntry, AuditLog


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
