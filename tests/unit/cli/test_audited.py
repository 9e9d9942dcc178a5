"""Commands on this machine leave a name in the audit, also while a server writes to the file."""

import json
from pathlib import Path

import pytest

from tests.unit.packages.made import package
from urc.cli.audited import audit_access, audit_packages
from urc.cli.main import main
from urc.packages.blocks import Block, BlockList, sign_blocks
from urc.packages.index_head import IndexSigner
from urc.packages.signature import new_signer
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
    assert capsys.readouterr().err.startswith("urc: this action is missing from the audit log: ")


def test_each_change_of_trust_is_recorded(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Waivers and block lists decide about the packages that may move a robot."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path))
    maintainer = new_signer("Anna", tmp_path / "anna.pem")
    listed = BlockList("0" * 32, (Block("It turns the wrong way.", "drivers/rover"),))
    (tmp_path / "blocked.json").write_bytes(
        sign_blocks(listed, 1, IndexSigner(maintainer)).to_bytes()
    )
    bundle = tmp_path / "dial.zip"
    bundle.write_bytes(package("widget", "dial").data)
    for words in (
        ("repo", "unsigned", "add", "widgets/lamp"),
        ("repo", "unsigned", "remove", "widgets/lamp"),
        ("repo", "blocks", "import", str(tmp_path / "blocked.json"),
         "--signed-by", maintainer.fingerprint),
        ("repo", "blocks", "forget", maintainer.fingerprint),
        ("install", str(bundle), "--yes", "--allow-unsigned", "dial"),
    ):  # fmt: skip
        assert main(words) == 0
    assert [(one.command, json.loads(one.arguments)["packages"]) for one in entries_of(file)] == [
        ("unsigned add", ["widgets/lamp"]),
        ("unsigned remove", ["widgets/lamp"]),
        ("blocks import", [str(maintainer), "drivers/rover"]),
        ("blocks forget", [maintainer.fingerprint]),
        ("install", ["widgets/dial 1.0.0", "widgets/dial 1.0.0 without a signature"]),
    ]
