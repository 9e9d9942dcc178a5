"""Fixtures of the tests over real servers."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tests.e2e.transports.ssh_lines import public_folder
from tests.e2e.transports.sshd import Sshd


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Trust nothing that another test, or the person who runs this, trusts."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path / "data"))
    monkeypatch.delenv("SSH_AUTH_SOCK", raising=False)


@pytest.fixture
async def sshd(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Sshd]:
    """Run one server for one test."""
    server = Sshd(public_folder(tmp_path_factory))
    await server.start()
    yield server
    server.kill()
