"""Commands on this machine leave a name in the audit, also while a server writes to the file."""

import json
from pathlib import Path

import pytest

from urc.cli.audited import audit_access, audit_packages
from urc.runtime.audit import AuditLog
from urc.runtime.audit_check import check
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.audit_search import AuditQuery, search


@pytest.fixture(autouse=True)
def ann(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urc.runtime.server_recorder._user", lambda: "ann")


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("urc._folders.data_folder.__defaults__", ({"URC_DATA_DIR": str(tmp_path)},))
    return tmp_path / "audit.sqlite"


def entries_of(file: Path) -> list[AuditEntry]:
    return [row.entry for row in reversed(search(file, AuditQuery()))]


def test_change_of_people_has_user_right_and_way(file: Path) -> None:
    audit_access(file.parent, "people grant", name="Ben", roles="drive@#lab")
    (found,) = entries_of(file)
    assert (found.what, found.command) == ("access", "people grant")
    assert json.loads(found.arguments) == {"name": "Ben", "roles": "drive@#lab"}
    assert (found.who, found.role, found.way) == ("ann on this computer", "administer", "terminal")


def test_command_and_server_write_one_chain(file: Path) -> None:
    with AuditLog(file) as server:
        for number in range(5):
            server.add(AuditEntry(1000.0 + number, "puppet", "moved"))
            audit_packages("install", [f"drivers/puppet 1.0.{number}"])
        assert server.settle()
    assert [one.what for one in entries_of(file)].count("package") == 5
    assert len(entries_of(file)) == 10
    assert check(file) == ""


def test_log_that_cannot_be_written_is_told(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file.mkdir()
    audit_packages("remove", ["drivers/puppet 1.0.0"])
    assert capsys.readouterr().err.startswith("urc: the audit log has no entry about this: ")
