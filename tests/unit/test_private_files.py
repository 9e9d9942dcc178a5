"""Files that are there whole or not at all, and are read by their owner alone."""

import os
import stat
from pathlib import Path

import pytest

from urc.cli.data_folder import own_folder
from urc.private_files import put_private


def full(number: int) -> None:
    """Stand in for a disk that has no room."""
    raise OSError(28, "No space left on device")


def test_a_file_is_written_with_its_folder(tmp_path: Path) -> None:
    """What was there before is replaced, and nothing is left beside it."""
    file = tmp_path / "deep" / "kept"
    put_private(file, b"first")
    put_private(file, b"second")
    assert file.read_bytes() == b"second"
    assert os.listdir(file.parent) == ["kept"]


@pytest.mark.skipif(os.name == "nt", reason="Windows has other rights")
def test_only_the_owner_may_read_it(tmp_path: Path) -> None:
    """The folders that are made for it, too; those that were there stay as they are."""
    tmp_path.chmod(0o755)
    file = tmp_path / "keys" / "lab" / "known"
    put_private(file, b"secret")
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert stat.S_IMODE(file.parent.stat().st_mode) == 0o700
    assert stat.S_IMODE(file.parent.parent.stat().st_mode) == 0o700
    assert stat.S_IMODE(tmp_path.stat().st_mode) == 0o755


def test_a_full_disk_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The old file stays, and what was begun is gone."""
    file = tmp_path / "kept"
    put_private(file, b"old")
    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(OSError, match="No space left"):
        put_private(file, b"new")
    assert file.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["kept"]


def test_what_killed_processes_left_is_removed_with_the_next_start(tmp_path: Path) -> None:
    """A file that another process may be writing now stays, and so do all other files."""
    put_private(tmp_path / "contact-times.json", b"{}")
    put_private(tmp_path / "latches" / "tello", b"stopped")
    for name in (".contact-times.json.a1b2.new", "latches/.tello.c3d4.new", "old.new"):
        (tmp_path / name).write_bytes(b"half")
        os.utime(tmp_path / name, (0, 0))
    (tmp_path / "latches" / ".tello.e5f6.new").write_bytes(b"half")
    own_folder(tmp_path)
    assert sorted(os.listdir(tmp_path)) == ["contact-times.json", "latches", "old.new"]
    assert sorted(os.listdir(tmp_path / "latches")) == [".tello.e5f6.new", "tello"]
