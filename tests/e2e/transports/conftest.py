"""Fixtures of the tests over real servers."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tests.e2e.transports.ssh_lines import public_folder
from tests.e2e.transports.sshd import Sshd

TOGETHER = {
    "test_ssh": "shell",
    "test_ssh_login": "shell",
    "test_chain": "shell",
    "test_trust": "shell",
    "test_shell_doors": "shell",
    "test_serial": "serial",
    "test_hostile_serial": "serial",
}
"""Modules whose servers share something of the machine: an account, a pair of terminals. Run in
several processes, those of one group stay in one of them."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Keep what shares something of the machine in one process."""
    for item in items:
        group = TOGETHER.get(item.path.stem)
        if group is not None:
            item.add_marker(pytest.mark.xdist_group(group))


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
