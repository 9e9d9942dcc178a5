"""Data and documents of each release, opened by the present code."""

import sqlite3
import time
from contextlib import closing
from pathlib import Path

import pytest

from urc import __version__
from urc.access.administration import overview
from urc.access.store import AccessStore
from urc.cli.main import main
from urc.config.load import load_profile
from urc.runtime.audit import FILE as AUDIT_FILE
from urc.runtime.document_tests import exercise
from urc.runtime.latch import LatchStore
from urc.runtime.registries import built_in_catalog
from urc.runtime.settings_store import SettingsStore

HOME = Path(__file__).parents[1] / "upgrade"
RELEASES = sorted(path.name for path in HOME.iterdir() if (path / "backup.zip").is_file())
DOCUMENTS = sorted(path.relative_to(HOME).as_posix() for path in HOME.glob("*/*.yaml"))


def test_the_first_release_is_kept() -> None:
    assert RELEASES[0] == "0.1.0"
    assert len(DOCUMENTS) >= 3
    assert __version__ in RELEASES, "run python -m tests.upgrade.write"


@pytest.mark.parametrize("document", DOCUMENTS)
def test_document_of_a_release_is_valid(document: str) -> None:
    """It loads without an error, and its own tests pass."""
    profile = load_profile(HOME / document, built_in_catalog())
    assert profile.tests
    assert exercise(profile).problems == []


@pytest.mark.parametrize("release", RELEASES)
def test_data_of_a_release_is_kept(
    release: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """People, tokens, settings and a latched STOP are the same after the restore of a backup."""
    data = tmp_path / "data"
    assert main(["restore", str(HOME / release / "backup.zip"), "--data-dir", str(data)]) == 0
    assert f"(URC {release})" in capsys.readouterr().out
    with closing(AccessStore(data)) as store:
        rights = {
            one.principal.name: [str(grant) for grant in one.principal.grants]
            for one in overview(store, time.time())
        }
    assert rights == {"Ann": ["drive@cart"], "Ben": ["administer"], "Patrol": ["drive@cart"]}
    kept = SettingsStore(data / "robots", "cart").load()
    assert kept.settings == {"host": "10.0.0.5", "port": "2001"}
    latch = LatchStore(data / "latches", "cart").load()
    assert (latch.state.latched_by, latch.state.epoch) == ("Ann, before a restart", 7)
    with closing(sqlite3.connect(data / AUDIT_FILE)) as audit:
        (entries,) = audit.execute("SELECT count(*) FROM entries").fetchone()
    assert entries >= 4
