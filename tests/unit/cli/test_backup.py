"""`urc backup` and `urc restore`: identities of a restored folder."""

import json
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from urc.access.directory import NOBODY
from urc.access.store import AccessStore, Invitation
from urc.cli.main import main
from urc.runtime.audit_search import AuditQuery, search

Urc = Callable[..., tuple[int, str, str]]


@pytest.fixture
def urc(capsys: pytest.CaptureFixture[str]) -> Urc:
    def run(*words: object) -> tuple[int, str, str]:
        code = main([str(word) for word in words])
        said = capsys.readouterr()
        return code, said.out, said.err

    return run


class Secrets:
    """A data folder with a person, a paired phone, a token and a code, and their secrets."""

    def __init__(self, folder: Path) -> None:
        now = time.time()
        store = AccessStore(folder)
        self.ann = store.add("person", "Ann", now=now)
        store.set_passphrase(self.ann.id, "a hash")
        phone = store.add("device", "Phone", now=now, owner=self.ann.id)
        program = store.add("program", "Night", now=now)
        _, self.browser = store.open_sign_in(self.ann.id, "passphrase", now=now)
        _, self.phone = store.open_sign_in(phone.id, "pairing", now=now)
        _, self.token = store.open_sign_in(program.id, "token", now=now)
        self.code = store.invite(Invitation("device", "", (), self.ann.id, now + 1000), now=now)
        store.close()

    def known(self, folder: Path) -> list[str]:
        """Return the names of those who get in with the secrets."""
        store = AccessStore(folder)
        directory = store.directory()
        found = [
            directory.identify(one, time.time()) for one in (self.browser, self.phone, self.token)
        ]
        names = [one.name for one in found if one != NOBODY]
        if store.redeem(self.code, time.time()) is not None:
            names.append("code")
        assert store.passphrase_of("Ann")[1] == "a hash"
        store.close()
        return names


def test_a_backup_revives_people_devices_and_tokens_but_no_browser(
    urc: Urc, tmp_path: Path
) -> None:
    old, new, file = tmp_path / "old", tmp_path / "new", tmp_path / "backup.zip"
    secrets = Secrets(old)
    code, output, errors = urc("backup", file, "--data-dir", old)
    assert (code, errors) == (0, "")
    assert output.startswith(f"{file}: 1 files, ")
    code, output, errors = urc("restore", file, "--data-dir", new)
    assert (code, errors) == (0, "")
    assert "people: 1, devices: 1, tokens: 1, ended sign-ins: 1\n" in output
    assert secrets.known(new) == ["Phone", "Night"]
    commands = [
        row.entry.command
        for folder in (old, new)
        for row in search(folder / "audit.sqlite", AuditQuery())
    ]
    assert commands == ["backup", "restore"]


def test_a_backup_can_revive_people_alone(urc: Urc, tmp_path: Path) -> None:
    old, file = tmp_path / "old", tmp_path / "backup.zip"
    secrets = Secrets(old)
    urc("backup", file, "--data-dir", old)
    code, output, _ = urc("restore", file, "--data-dir", old, "--replace", "--people-only")
    assert code == 0
    assert "people: 1, devices: 0, tokens: 0, ended sign-ins: 3\n" in output
    assert secrets.known(old) == []


def test_wrong_use_is_one_line(urc: Urc, tmp_path: Path) -> None:
    old, file = tmp_path / "old", tmp_path / "backup.zip"
    assert urc("backup", file, "--data-dir", old) == (
        1,
        "",
        f"urc backup: {old} has nothing to back up; select another folder with --data-dir\n",
    )
    assert not old.exists()
    Secrets(old)
    (old / "notes.txt").write_text("mine")
    code, _, errors = urc("backup", file, "--data-dir", old)
    assert (code, errors) == (0, "not in the backup: notes.txt\n")
    code, _, errors = urc("backup", file, "--data-dir", old)
    assert (code, errors) == (
        1,
        f"urc backup: {file} already exists; use --replace to overwrite the file\n",
    )
    assert urc("backup", file, "--data-dir", old, "--replace")[0] == 0
    code, _, errors = urc("restore", file, "--data-dir", old)
    assert code == 1
    assert "already contains data, such as access.sqlite" in errors
    code, _, errors = urc("backup", tmp_path / "no" / "folder.zip", "--data-dir", old)
    assert code == 1
    assert errors.startswith("urc backup: the backup cannot be written: ")
    assert errors.count("\n") == 1


def test_a_base_of_another_program_is_refused(urc: Urc, tmp_path: Path) -> None:
    import sqlite3

    base = tmp_path / "other.sqlite"
    opened = sqlite3.connect(base)
    opened.execute("CREATE TABLE principals (word TEXT)")
    opened.execute("PRAGMA user_version = 1")
    opened.commit()
    opened.close()
    file = tmp_path / "evil.zip"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("urc-backup.json", json.dumps({"format": 1, "version": "0", "made_at": 0}))
        archive.write(base, "access.sqlite")
    code, output, errors = urc("restore", file, "--data-dir", tmp_path / "new")
    assert (code, output, errors.count("\n")) == (1, "", 1)
    assert not list((tmp_path / "new").iterdir())
