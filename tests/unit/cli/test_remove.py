"""`urc remove` takes what was filled in along with the package, unless it is told not to."""

from pathlib import Path

import pytest

from tests.unit.packages.made import install, keep_settings, package
from urc.cli.main import main
from urc.packages.store import Store
from urc.runtime.audit_search import AuditQuery, search
from urc.runtime.settings_store import SettingsStore, StoredSettings

SECRET = {"key": "open sesame"}


@pytest.fixture
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder of URC's data, with a driver whose secret was filled in."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path))
    install(Store(tmp_path / "packages"), package("driver", "rover"))
    keep_settings(tmp_path, "rover", SECRET)
    return tmp_path


def test_what_was_filled_in_goes_along(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["remove", "drivers/rover"]) == 0
    assert "deleted the settings of rover, including its secrets" in capsys.readouterr().out
    assert not SettingsStore(data / "robots", "rover").file.exists()
    (row,) = search(data / "audit.sqlite", AuditQuery())
    assert (row.entry.what, row.entry.command) == ("package", "remove")
    assert "drivers/rover 1.0.0" in row.entry.arguments
    assert "sesame" not in str(row)


def test_what_was_filled_in_may_stay(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["remove", "rover", "--keep-settings"]) == 0
    assert "kept the settings of rover: " in capsys.readouterr().out
    assert SettingsStore(data / "robots", "rover").load().settings == SECRET


def test_what_is_of_another_robot_of_that_name_stays(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A document that was named at the start, or another version that is still installed."""
    file = SettingsStore(data / "robots", "rover")
    file.save(StoredSettings(settings=SECRET, destination="somewhere"))
    assert main(["remove", "rover"]) == 0
    assert "filled in" not in capsys.readouterr().out
    assert file.load().settings == SECRET
    store = Store(data / "packages")
    install(store, package("driver", "rover"))
    install(store, package("driver", "rover", "2.0.0"))
    keep_settings(data, "rover", SECRET)
    assert main(["remove", "rover@1.0.0"]) == 0
    assert file.load().settings == SECRET
