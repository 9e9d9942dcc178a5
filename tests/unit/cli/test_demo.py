"""The demo for a phone: who may enter, and by which code."""

import time
from contextlib import closing
from pathlib import Path

import pytest

from urc.access.store import AccessStore
from urc.cli import demo
from urc.cli.main import main


def test_phone_gets_a_link_with_a_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The code pairs one device, which may drive; a pipe gets no QR code."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path))
    demo._invite_phone("https://192.0.2.7:8080/")
    link, errors = capsys.readouterr()
    address, _, code = link.strip().partition("#")
    assert address == "https://192.0.2.7:8080/pair"
    assert "pairs one device (drive): works once, valid for 2 minutes" in errors
    with closing(AccessStore(tmp_path)) as store:
        invitation = store.redeem(code, time.time())
    assert invitation is not None
    assert [str(grant) for grant in invitation.grants] == ["drive"]


def test_phone_and_developer_pages_exclude_each_other(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--phone", "--dev"]) == 2
    assert "allowed only on this machine; found --phone" in capsys.readouterr().err
