"""The machine's clock against the times in the data folder."""

import asyncio
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from urc.access.authority import AUTHORITY_FOLDER, CertificateAuthority
from urc.access.store import FILE, AccessStore
from urc.access.wrong_clock import RELEASED
from urc.cli import doctor
from urc.cli.main import main
from urc.runtime.audit import AuditLog
from urc.runtime.audit_entry import AuditEntry
from urc.web.serve.clock_check import clock_warning

LATER = RELEASED + timedelta(days=100)
NOW = LATER.timestamp()


def test_an_empty_folder_knows_the_release_alone(tmp_path: Path) -> None:
    assert clock_warning(tmp_path / "missing", NOW) == ""
    assert "the release" in clock_warning(tmp_path, 1e9)
    assert list(tmp_path.iterdir()) == [], "a check creates no file"


def test_a_sign_in_shows_that_the_clock_was_ahead(tmp_path: Path) -> None:
    store = AccessStore(tmp_path)
    ann = store.add("person", "Ann", now=NOW)
    store.open_sign_in(ann.id, "passphrase", now=NOW + 300)
    store.close()
    assert "the newest sign-in" in clock_warning(tmp_path, NOW + 100)
    assert clock_warning(tmp_path, NOW + 300) == ""
    present = clock_warning(tmp_path)
    assert ("newest sign-in" in present) == (time.time() < NOW)


def test_the_audit_log_shows_it(tmp_path: Path) -> None:
    with AuditLog(tmp_path / "audit.sqlite") as log:
        log.add(AuditEntry(NOW, "cart", "moved"))
        assert log.settle()
    assert "the newest entry of the audit log" in clock_warning(tmp_path, NOW - 1000)


def test_certificates_show_their_day_of_issue(tmp_path: Path) -> None:
    folder = tmp_path / AUTHORITY_FOLDER
    CertificateAuthority(folder, ["lab.local"], LATER)
    assert "the local certificate" in clock_warning(tmp_path, NOW - 86400)
    later = LATER + timedelta(days=300)
    CertificateAuthority(folder, ["lab.local"], later).issue()
    assert "the local certificate" in clock_warning(tmp_path, NOW + 86400)
    assert clock_warning(tmp_path, later.timestamp()) == ""


def test_damaged_files_prove_nothing(tmp_path: Path) -> None:
    for name in (FILE, "audit.sqlite", f"{AUTHORITY_FOLDER}/authority.pem"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"damaged, and long enough to be read as something" * 5)
    assert clock_warning(tmp_path, NOW) == ""


def test_the_doctor_tells_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doctor, "_load_robots", lambda: "not looked at here")
    with AuditLog(tmp_path / "audit.sqlite") as log:
        log.add(AuditEntry(datetime(2999, 1, 1, tzinfo=UTC).timestamp(), "cart", "moved"))
        assert log.settle()
    main(["doctor", "--port", "0", "--data-dir", str(tmp_path)])
    (line,) = [one for one in capsys.readouterr().out.splitlines() if " clock " in one]
    assert line.startswith("note ")
    assert "earlier than the newest entry of the audit log (2999-01-01" in line
    main(["doctor", "--port", "0", "--data-dir", str(tmp_path / "other")])
    (line,) = [one for one in capsys.readouterr().out.splitlines() if " clock " in one]
    assert line.startswith("ok ")


def test_the_start_of_a_server_tells_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from urc.cli import dashboard

    async def served(*_: object, **__: object) -> None:
        await asyncio.sleep(0)

    monkeypatch.setattr(dashboard, "serve", served)
    with AuditLog(tmp_path / "audit.sqlite") as log:
        log.add(AuditEntry(datetime(2999, 1, 1, tzinfo=UTC).timestamp(), "cart", "moved"))
        assert log.settle()
    assert main(["serve", "tello", "--simulate", "--data-dir", str(tmp_path)]) == 0
    assert "urc: the clock of this computer shows " in capsys.readouterr().err
