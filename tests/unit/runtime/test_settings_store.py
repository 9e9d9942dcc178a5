"""What the operator filled in: kept whole or not at all, and read by nobody else."""

import os
import stat
from pathlib import Path

import pytest

from urc.problems import UrcError
from urc.runtime.settings_store import SettingsStore, StoredSettings

KEPT = StoredSettings(
    version="1.0.0", interface="wide", settings={"host": "10.0.0.5", "key": "hush"}
)


def test_what_was_kept_comes_back(tmp_path: Path) -> None:
    file = SettingsStore(tmp_path / "robots", "rover")
    assert file.load() == StoredSettings()
    file.save(KEPT)
    assert SettingsStore(tmp_path / "robots", "rover").load() == KEPT
    file.forget()
    assert file.load() == StoredSettings()


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such rights")
def test_only_its_owner_can_read_it(tmp_path: Path) -> None:
    file = SettingsStore(tmp_path, "rover")
    file.save(KEPT)
    assert stat.S_IMODE(file.file.stat().st_mode) == 0o600


def test_a_name_never_leads_out_of_the_folder(tmp_path: Path) -> None:
    assert SettingsStore(tmp_path, "../../etc/passwd").file.parent == tmp_path


@pytest.mark.parametrize("text", ["", "[]", '{"format": 2}', '{"settings": {"a": 1}}', "\xff"])
def test_a_damaged_file_is_told_in_one_line(tmp_path: Path, text: str) -> None:
    file = SettingsStore(tmp_path, "rover")
    file.file.write_text(text, encoding="latin-1")
    with pytest.raises(UrcError, match="this file is damaged") as caught:
        file.load()
    assert "\n" not in str(caught.value)


def test_a_failure_to_write_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = SettingsStore(tmp_path, "rover")
    file.save(KEPT)

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.fsync", full)
    with pytest.raises(UrcError, match="No space left on device"):
        file.save(StoredSettings())
    assert file.load() == KEPT
    assert list(tmp_path.iterdir()) == [file.file]
