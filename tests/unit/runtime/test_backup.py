"""Backup and restore of a data folder, and archives that attack it."""

import base64
import json
import multiprocessing
import os
import shutil
import sqlite3
import stat
import zipfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import NoReturn

import pytest

from urc.packages.block_store import BlockStore, KnownBlocks
from urc.packages.blocks import BlockList
from urc.packages.signature import fingerprint
from urc.runtime import backup_archive, data_restore
from urc.runtime.backup_archive import (
    BackupError,
    BackupManifest,
    opened_backup,
    parts_in,
    write_backup,
)
from urc.runtime.data_restore import check_target, is_interrupted, restore
from urc.runtime.running_servers import RunningServer, announced

MADE = BackupManifest(1, "0.1.0", 1_000_000.0)
BLOB = f"packages/blobs/{'0a' * 32}.zip"


def latch(by: str, epoch: int = 7) -> str:
    return json.dumps({"epoch": epoch, "latched_by": by, "owed": False})


def base(file: Path, text: str) -> None:
    with closing(sqlite3.connect(file)) as opened, opened:
        opened.execute("CREATE TABLE words (word TEXT)")
        opened.execute("INSERT INTO words VALUES (?)", (text,))
    file.chmod(0o600)


def word_in(file: Path) -> str:
    with closing(sqlite3.connect(file)) as opened:
        (word,) = opened.execute("SELECT word FROM words").fetchone()
    return str(word)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data folder with one file of each kind, and files that no backup needs."""
    folder = tmp_path / "data"
    kept = {
        "known_hosts": "robot ssh-ed25519 AAAA",
        "publisher.pem": "a key",
        "tls/authority.pem": "a certificate",
        "tls/authority.key": "its key",
        "fleet/fleet.json": "{}",
        "fleet/site.key": "a key",
        "fleet/authority/root.key": "a key",
        "robots/cart%20one.json": "{}",
        "latches/cart.latch.json": latch("Ann"),
        "latches/emulated/cart.latch.json": latch(""),
        "packages/state.json": '{"format": 1, "installed": []}',
        "packages/repositories/list.json": "[]",
    }
    left_out = {
        "servers/1a2b3c4d.json": "{}",
        "packages/ecosystems/x/robot.yaml": "",
        "packages/changing": "",
        "fleet/lock": "",
        "fleet/authority/lock": "",
        "latches/.cart.latch.json.ab12.new": "",
    }
    for path, text in (kept | left_out).items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        file.chmod(0o644 if path.startswith("packages/") else 0o600)
    base(folder / "access.sqlite", "people")
    base(folder / "audit.sqlite", "entries")
    return folder


def nothing(_: Path) -> None:
    """Change nothing."""


def restored(
    file: Path, target: Path, *, replaces: bool = False, adjust: Callable[[Path], None] = nothing
) -> None:
    with opened_backup(file) as reader:
        check_target(target, replaces=replaces)
        restore(reader, target, adjust)


def content(folder: Path) -> dict[str, tuple[int, bytes]]:
    return {
        path: (stat.S_IMODE((folder / path).stat().st_mode), (folder / path).read_bytes())
        for path in parts_in(folder)[0]
        if not path.endswith(".sqlite")
    }


def test_a_backup_has_all_lasting_files_with_their_modes(data: Path, tmp_path: Path) -> None:
    file = tmp_path / "backup.zip"
    (data / "notes.txt").write_text("mine")
    (data / "linked").symlink_to(data / "notes.txt")
    (data / "robots" / "linked.json").symlink_to(data / "notes.txt")
    (data / "tls" / "folder").symlink_to(tmp_path)
    written, unknown = write_backup(data, file, MADE)
    assert unknown == ["linked", "notes.txt", "robots/linked.json", "tls/folder"]
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert sorted(one.name for one in tmp_path.iterdir()) == ["backup.zip", "data"]
    with opened_backup(file) as reader:
        assert reader.manifest == MADE
        assert [one.path for one in reader.files] == written
    target = tmp_path / "new" / "data"
    restored(file, target)
    assert len(content(target)) == 12
    assert content(target) == content(data)
    assert word_in(target / "access.sqlite") == "people"
    assert word_in(target / "audit.sqlite") == "entries"
    modes = {stat.S_IMODE(one.stat().st_mode) for one in (target, target / "tls")}
    assert modes == {0o700}
    assert sorted(one.name for one in target.iterdir()) == [
        "access.sqlite", "audit.sqlite", "fleet", "known_hosts", "latches", "packages",
        "publisher.pem", "robots", "tls",
    ]  # fmt: skip


def test_a_copy_of_a_base_is_consistent_while_others_write(data: Path, tmp_path: Path) -> None:
    """An open transaction, and pages in the write-ahead log, which a plain copy would lose."""
    with closing(sqlite3.connect(data / "audit.sqlite", isolation_level=None)) as writer:
        writer.execute("PRAGMA journal_mode = WAL")
        writer.execute("UPDATE words SET word = 'committed'")
        writer.execute("BEGIN IMMEDIATE")
        writer.execute("UPDATE words SET word = 'half a change'")
        write_backup(data, tmp_path / "backup.zip", MADE)
        writer.execute("ROLLBACK")
    restored(tmp_path / "backup.zip", tmp_path / "new")
    assert word_in(tmp_path / "new" / "audit.sqlite") == "committed"


def test_existing_data_is_replaced_only_on_request(data: Path, tmp_path: Path) -> None:
    file, target = tmp_path / "backup.zip", tmp_path / "new"
    write_backup(data, file, MADE)
    target.mkdir()
    (target / "notes.txt").write_text("mine")
    (target / "robots").mkdir()
    (target / "robots" / "other.json").write_text("{}")
    with pytest.raises(BackupError, match=r"already contains data, such as robots/other\.json"):
        restored(file, target)
    assert sorted(one.name for one in target.iterdir()) == ["notes.txt", "robots"]
    restored(file, target, replaces=True)
    assert content(target) == content(data)
    assert (target / "notes.txt").read_text() == "mine", "not a part of URC"


def test_a_running_server_is_never_restored_over(data: Path, tmp_path: Path) -> None:
    file = tmp_path / "backup.zip"
    write_backup(data, file, MADE)
    running = RunningServer("http://127.0.0.1:8080/", "key", os.getpid())
    with (
        announced(data, "one", running),
        pytest.raises(BackupError, match=r"a server is running at http://127\.0\.0\.1:8080/"),
    ):
        restored(file, data, replaces=True)
    restored(file, data, replaces=True)


def test_a_stopped_robot_stays_stopped(data: Path, tmp_path: Path) -> None:
    file, latches = tmp_path / "backup.zip", data / "latches"
    (latches / "free.latch.json").write_text(latch("", epoch=3))
    (latches / "damaged.latch.json").write_text(latch(""))
    write_backup(data, file, MADE)
    (latches / "cart.latch.json").write_text(latch("", epoch=90))
    (latches / "free.latch.json").write_text(latch("Ben", epoch=91))
    (latches / "damaged.latch.json").write_text("power failure")
    (latches / "new.latch.json").write_text(latch("Cem"))
    (latches / "emulated" / "cart.latch.json").write_text(latch("", epoch=92))
    restored(file, data, replaces=True)
    found = {
        one.relative_to(latches).as_posix(): one.read_text() for one in latches.rglob("*.json")
    }
    assert json.loads(found["cart.latch.json"]) == {
        "epoch": 90, "latched_by": "Ann", "owed": False,
    }, "the backup stops the robot"  # fmt: skip
    assert found["free.latch.json"] == latch("Ben", epoch=91), "now stopped"
    assert found["damaged.latch.json"] == "power failure", "which counts as stopped"
    assert found["new.latch.json"] == latch("Cem"), "unknown to the backup"
    assert json.loads(found["emulated/cart.latch.json"])["epoch"] == 92


def test_the_higher_number_of_stops_is_kept(data: Path, tmp_path: Path) -> None:
    """So that a reset from before the restore undoes no later STOP."""
    file, cart = tmp_path / "backup.zip", data / "latches" / "cart.latch.json"
    numbered = json.loads(latch("Ann")) | {"stops": 2}
    cart.write_text(json.dumps(numbered))
    write_backup(data, file, MADE)
    cart.write_text(json.dumps(numbered | {"latched_by": "", "stops": 5}))
    restored(file, data, replaces=True)
    assert json.loads(cart.read_text()) == numbered | {"stops": 5}


def test_a_replaced_audit_log_is_kept(data: Path, tmp_path: Path) -> None:
    file = tmp_path / "backup.zip"
    write_backup(data, file, MADE)
    with closing(sqlite3.connect(data / "audit.sqlite")) as opened, opened:
        opened.execute("UPDATE words SET word = 'newer'")
    restored(file, data, replaces=True)
    (kept,) = data.glob("audit-before-*.sqlite")
    assert (word_in(kept), word_in(data / "audit.sqlite")) == ("newer", "entries")
    assert kept.relative_to(data).as_posix() not in parts_in(data)[1]
    (data / "audit.sqlite").unlink()
    write_backup(data, file, MADE)
    base(data / "audit.sqlite", "the present one")
    restored(file, data, replaces=True)
    assert word_in(data / "audit.sqlite") == "the present one", "the backup has no audit log"


def test_an_error_in_the_middle_leaves_the_folder_unchanged(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "backup.zip"
    write_backup(data, file, MADE)
    (data / "servers" / "1a2b3c4d.json").unlink()
    before, names = content(data), sorted(data.rglob("*"))
    rename, done = os.rename, 0

    def failing(source: Path, target: Path) -> None:
        nonlocal done
        done += 1
        if done == 15:
            raise OSError(28, "No space left on device")
        rename(source, target)

    monkeypatch.setattr(data_restore.os, "rename", failing)
    with pytest.raises(BackupError, match="No space left on device"):
        restored(file, data, replaces=True)
    assert done > 15, "the files were moved back"
    assert content(data) == before
    assert word_in(data / "access.sqlite") == "people"
    assert sorted(data.rglob("*")) == names

    def refused(_: Path) -> None:
        raise BackupError("refused")

    monkeypatch.setattr(data_restore.os, "rename", rename)
    with pytest.raises(BackupError, match="refused"):
        restored(file, data, replaces=True, adjust=refused)
    assert (content(data), sorted(data.rglob("*"))) == (before, names)


def test_a_newer_list_of_blocked_packages_stays_in_force(data: Path, tmp_path: Path) -> None:
    """Lists of two maintainers: one is newer in the backup, the other in the present data."""
    file = tmp_path / "backup.zip"
    keys = [base64.b64encode(bytes([number] * 32)).decode() for number in (1, 2)]
    holders = [KnownBlocks("Ann", key, 0, BlockList("0a" * 16), "") for key in keys]
    kept, listed = BlockStore(data / "packages"), BlockList("0a" * 16)
    kept.keep(holders[0], 5, listed, "http://one/")
    kept.keep(holders[1], 1, listed, "http://two/")
    written, unknown = write_backup(data, file, MADE)
    assert "packages/blocks.json" in written
    assert unknown == []
    kept.forget(fingerprint(keys[0]))
    kept.keep(holders[0], 3, listed, "http://one/")
    kept.keep(holders[1], 9, listed, "http://two/")
    restored(file, data, replaces=True)
    found = BlockStore(data / "packages").all()
    assert sorted((one.place, one.number) for one in found) == [
        ("http://one/", 5), ("http://two/", 9),
    ]  # fmt: skip
    (data / "packages" / "blocks.json").write_text("damaged")
    restored(file, data, replaces=True)
    assert len(BlockStore(data / "packages").all()) == 2


def die_at(step: int, file: Path, folder: Path) -> NoReturn:
    """Restore in this process, and end the process instead of one renaming."""
    rename, done = os.rename, 0

    def dying(source: Path, target: Path) -> None:
        nonlocal done
        done += 1
        if done == step:
            os._exit(9)
        rename(source, target)

    os.rename = dying  # type: ignore[assignment]
    restored(file, folder, replaces=True)
    os._exit(0)


def test_a_power_failure_at_any_step_loses_no_stop_and_no_audit_log(
    data: Path, tmp_path: Path
) -> None:
    """The process ends at every third renaming; the next restoring completes the work."""
    file = tmp_path / "backup.zip"
    write_backup(data, file, MADE)
    wanted = content(data)
    base_name = "audit.sqlite"
    for step in range(1, 200, 3):
        folder = tmp_path / f"at-{step}"
        shutil.copytree(data, folder)
        (folder / "latches" / "cart.latch.json").write_text(latch("Zoe"))
        child = multiprocessing.get_context("spawn").Process(
            target=die_at, args=(step, file, folder)
        )
        child.start()
        child.join(60)
        assert child.exitcode in (0, 9)
        is_complete = child.exitcode == 0
        assert is_interrupted(folder) is not is_complete
        now = json.loads((folder / "latches" / "cart.latch.json").read_text())
        assert now["latched_by"] == "Zoe"
        if is_complete:
            break
        restored(file, folder, replaces=True)
        assert not is_interrupted(folder)
        assert content(folder).keys() == wanted.keys()
        bases = [folder / base_name, *folder.glob("audit-before-*.sqlite")]
        assert len(bases) >= 2, "the old audit log is kept"
        assert {word_in(one) for one in bases} == {"entries"}
    assert step > 15


def test_the_remains_of_an_interrupted_restoring_are_removed(data: Path, tmp_path: Path) -> None:
    file = tmp_path / "backup.zip"
    write_backup(data, file, MADE)
    for name in ("restoring-0a1b2c3d", "replaced-0a1b2c3d"):
        (data / name).mkdir()
        base(data / name / "audit.sqlite", name)
    assert not [path for path in parts_in(data)[1] if path.startswith("re")]
    restored(file, data, replaces=True)
    kept = sorted(word_in(one) for one in data.glob("audit-before-*.sqlite"))
    assert kept == ["entries", "replaced-0a1b2c3d"]
    assert not list(data.glob("re*-*"))


# Archives that are damaged, or written by an attacker


def archive(
    file: Path, *entries: tuple[str | zipfile.ZipInfo, bytes], manifest: bytes | None = None
) -> Path:
    """Write an archive with a good description and the given entries."""
    good = b'{"format": 1, "version": "0.1.0", "made_at": 1.0}'
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as opened:
        opened.writestr(backup_archive.MANIFEST, good if manifest is None else manifest)
        for name, text in entries:
            opened.writestr(name, text)
    return file


def typed(path: str, kind: int, mode: int = 0o600) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(path)
    entry.create_system = 3
    entry.external_attr = (kind | mode) << 16
    return entry


@pytest.mark.parametrize(
    "path",
    [
        "../known_hosts", "/known_hosts", "robots/../../x.json", "robots/../x.json", "tls/..",
        "tls/.", "tls/a/b", "tls\\..\\..\\x", "C:known_hosts", "servers/1a2b3c4d.json",
        "known_hosts/", "Known_hosts", "packages/blobs/x.zip", "packages/ecosystems/x/robot.yaml",
        "robots/.json", "robots/a\nb.json", "robots/ä.json", ".bashrc", "robots/a.json/b.json",
    ],
)  # fmt: skip
def test_other_paths_are_refused(tmp_path: Path, path: str) -> None:
    file = archive(tmp_path / "evil.zip", (path, b"evil"))
    with pytest.raises(BackupError, match="is not part of a backup"):
        restored(file, tmp_path / "new")
    assert [one.name for one in tmp_path.iterdir()] == ["evil.zip"]


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFDIR, stat.S_IFIFO, stat.S_IFCHR])
def test_links_and_devices_are_refused(tmp_path: Path, kind: int) -> None:
    file = archive(tmp_path / "evil.zip", (typed("known_hosts", kind), b"/etc/passwd"))
    with pytest.raises(BackupError, match="is not an ordinary file"):
        restored(file, tmp_path / "new")


@pytest.mark.parametrize(
    ("path", "mode", "wanted"),
    [
        ("tls/authority.key", 0o4777, 0o600),
        ("tls/authority.key", 0, 0o600),
        ("packages/state.json", 0o4777, 0o644),
        ("packages/state.json", 0o600, 0o600),
    ],
)
def test_a_mode_never_exposes_a_key(tmp_path: Path, path: str, mode: int, wanted: int) -> None:
    file = archive(tmp_path / "evil.zip", (typed(path, stat.S_IFREG, mode), b"{}"))
    before = os.umask(0)
    try:
        restored(file, tmp_path / "new")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new" / path).stat().st_mode) == wanted


def test_a_link_in_the_target_is_never_followed(data: Path, tmp_path: Path) -> None:
    file, elsewhere = tmp_path / "backup.zip", tmp_path / "elsewhere"
    write_backup(data, file, MADE)
    elsewhere.mkdir()
    target = tmp_path / "new"
    target.mkdir()
    (target / "known_hosts").symlink_to(elsewhere / "file")
    restored(file, target, replaces=True)
    assert list(elsewhere.iterdir()) == []
    assert not (target / "known_hosts").is_symlink()


def test_twice_the_same_file_is_refused(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="Duplicate name"):
        file = archive(tmp_path / "evil.zip", ("known_hosts", b"a"), ("known_hosts", b"b"))
    with pytest.raises(BackupError, match="a file occurs twice"):
        restored(file, tmp_path / "new")


def test_sizes_and_counts_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entries = [(f"robots/r{number}.json", b"x" * 1000) for number in range(20)]
    file = archive(tmp_path / "large.zip", *entries)
    monkeypatch.setattr(backup_archive, "MOST_BYTES", 19_999)
    with pytest.raises(BackupError, match="expected at most 19999 bytes in total"):
        restored(file, tmp_path / "new")
    monkeypatch.setattr(backup_archive, "MOST_BYTES", 20_000)
    monkeypatch.setattr(backup_archive, "MOST_FILES", 20)
    with pytest.raises(BackupError, match="too many files"):
        restored(file, tmp_path / "new")
    monkeypatch.setattr(backup_archive, "MOST_FILES", 21)
    restored(file, tmp_path / "new")
    monkeypatch.setattr(backup_archive, "MOST_BYTES", 19_999)
    with pytest.raises(BackupError, match="more than 19999 bytes"):
        write_backup(tmp_path / "new", tmp_path / "again.zip", MADE)
    assert not (tmp_path / "again.zip").exists()
    monkeypatch.setattr(backup_archive, "MOST_FILES", 20)
    with pytest.raises(BackupError, match="20 files; expected at most 19"):
        write_backup(tmp_path / "new", tmp_path / "again.zip", MADE)


def test_a_bomb_that_hides_its_size_is_refused(tmp_path: Path) -> None:
    """Ten megabytes of zeros, declared as ten bytes in the directory of the archive."""
    file = archive(tmp_path / "bomb.zip", ("known_hosts", b"\0" * 10_000_000))
    raw = file.read_bytes()
    assert raw.count((10_000_000).to_bytes(4, "little")) == 2
    file.write_bytes(raw.replace((10_000_000).to_bytes(4, "little"), (10).to_bytes(4, "little")))
    with pytest.raises(BackupError, match=r"damaged|a different size"):
        restored(file, tmp_path / "new")
    assert list((tmp_path / "new").iterdir()) == []


def test_every_truncation_and_every_changed_byte_is_survived(data: Path, tmp_path: Path) -> None:
    """A damaged archive is refused in one line, or is intact where it matters."""
    file, target = tmp_path / "backup.zip", tmp_path / "new"
    for one in (data / "access.sqlite", data / "audit.sqlite"):
        one.unlink()
    write_backup(data, file, MADE)
    raw = file.read_bytes()
    damaged = [raw[:at] for at in range(0, len(raw), 97)]
    damaged += [raw[:at] + bytes([raw[at] ^ 0xFF]) + raw[at + 1 :] for at in range(0, len(raw), 61)]
    errors = []
    for each in damaged:
        file.write_bytes(each)
        try:
            restored(file, target, replaces=True)
        except BackupError as error:
            errors.append(str(error))
    assert len(errors) > len(damaged) // 2
    assert not [one for one in errors if "\n" in one]
    assert not list(target.glob("re*-*"))


@pytest.mark.parametrize(
    ("manifest", "message"),
    [
        (b"", "the description of the backup is damaged"),
        (b"[]", "the description of the backup is damaged"),
        (b"\xff", "the description of the backup is damaged"),
        (b'{"format": 2, "version": "9", "made_at": 1.0}', "a newer version of URC"),
        (b'{"format": 1, "version": "' + b"9" * 5000 + b'", "made_at": 1.0}', "is damaged"),
    ],
)
def test_a_description_is_needed(tmp_path: Path, manifest: bytes, message: str) -> None:
    with pytest.raises(BackupError, match=message):
        restored(archive(tmp_path / "evil.zip", manifest=manifest), tmp_path / "new")


def test_other_files_are_no_backup(tmp_path: Path) -> None:
    other = tmp_path / "other.zip"
    with zipfile.ZipFile(other, "w") as opened:
        opened.writestr("known_hosts", "")
    for file, text in ((other, "not a URC backup"), (tmp_path / "missing", "No such file")):
        with pytest.raises(BackupError, match=text):
            restored(file, tmp_path / "new")
    other.write_bytes(b"")
    with pytest.raises(BackupError, match="this is not a URC backup, or the file is truncated"):
        restored(other, tmp_path / "new")


def test_a_damaged_base_is_refused(data: Path, tmp_path: Path) -> None:
    file = archive(tmp_path / "evil.zip", ("access.sqlite", b"no base at all " * 100))
    before = content(data)
    with pytest.raises(BackupError, match=r"access\.sqlite in the backup is damaged"):
        restored(file, data, replaces=True)
    assert content(data) == before
