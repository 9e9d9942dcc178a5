"""URC's own data belongs to its user alone."""

import os
from pathlib import Path

import pytest

from urc.cli.data_folder import own_folder

pytestmark = pytest.mark.skipif(os.name != "posix", reason="POSIX permissions")


def mode(path: Path) -> int:
    return path.stat().st_mode & 0o777


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user without any data yet."""
    monkeypatch.delenv("URC_DATA_DIR", raising=False)
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "share"))
    return tmp_path


def test_a_folder_that_has_to_be_made_is_nobody_elses(home: Path) -> None:
    """Whatever the umask: the usual one, one that is named, and those above it."""
    assert mode(own_folder()) == 0o700
    assert mode(home / "share") == 0o700
    assert mode(own_folder(home / "lab" / "data")) == 0o700


def test_the_usual_folder_of_an_older_version_is_closed(home: Path) -> None:
    """It was open to all."""
    folder = home / "share" / "urc"
    folder.mkdir(parents=True, mode=0o755)
    assert mode(own_folder()) == 0o700


def test_a_folder_that_was_chosen_is_left_as_it_is(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Others may have a use for it."""
    shared = home / "shared"
    shared.mkdir()
    shared.chmod(0o755)
    assert mode(own_folder(shared)) == 0o755
    monkeypatch.setenv("URC_DATA_DIR", str(shared))
    assert mode(own_folder()) == 0o755


def test_a_folder_that_cannot_be_made_is_no_failure_yet(home: Path) -> None:
    """Who writes there says so."""
    (home / "file").write_text("")
    assert own_folder(home / "file" / "data") == home / "file" / "data"
