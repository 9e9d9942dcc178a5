"""The server as a service of systemd: ready, heartbeats, and none while it hangs."""

import os
import signal
import socket
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.e2e.processes import UrcProcess

WATCHDOG_S = 1.5
LONGEST_S = 60.0


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[socket.socket]:
    """A stand-in of systemd that receives the messages, as sd_notify(3) describes them."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as opened:
        opened.bind(str(tmp_path / "notify"))
        opened.settimeout(LONGEST_S)
        yield opened


def message_with(manager: socket.socket, word: str) -> str:
    """Return the next message with a word; fail after a minute of silence."""
    while True:
        text = manager.recv(4096).decode()
        if word in text.splitlines() or word in text:
            return text


def forget_messages(manager: socket.socket) -> None:
    """Read what was sent before."""
    manager.setblocking(False)
    with suppress(BlockingIOError):
        while True:
            manager.recv(4096)


def test_service_manager_hears_of_the_life_of_the_server(
    manager: socket.socket, tmp_path: Path
) -> None:
    """A stopped process stands for a blocked event loop: systemd gets no heartbeat."""
    environment = {
        "NOTIFY_SOCKET": manager.getsockname(),
        "WATCHDOG_USEC": str(int(WATCHDOG_S * 1e6)),
        "URC_DATA_DIR": str(tmp_path / "data"),
    }
    server = UrcProcess(("serve", "puppet", "--port", "0"), environment)
    try:
        ready = message_with(manager, "READY=1").splitlines()
        assert ready[1].startswith("STATUS=dashboard http://127.0.0.1:")
        assert "key=" not in ready[1]
        message_with(manager, "WATCHDOG=1")
        message_with(manager, "WATCHDOG=1")
        os.kill(server.pid, signal.SIGSTOP)
        forget_messages(manager)
        manager.settimeout(2 * WATCHDOG_S)
        with pytest.raises(TimeoutError):
            manager.recv(4096)
        os.kill(server.pid, signal.SIGCONT)
        manager.settimeout(LONGEST_S)
        message_with(manager, "WATCHDOG=1")
        os.kill(server.pid, signal.SIGTERM)
        message_with(manager, "STOPPING=1")
        assert server.wait() == 0
    finally:
        server.kill()
