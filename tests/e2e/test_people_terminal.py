"""The commands for people and devices as real processes: terminals, many at once, a server."""

import fcntl
import os
import pty
import re
import subprocess
import termios
import time
from collections.abc import Callable
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from tests.e2e.command_line import TIMEOUT_S, URC, run
from tests.e2e.processes import ROOT, UrcProcess
from urc.access.passphrases import matches
from urc.access.store import AccessStore

Start = Callable[..., UrcProcess]
PASSPHRASE = "correct horse battery"  # noqa: S105

PAUSES_S = 2.0
"""Pauses of a busy machine, which the promise of 300 ms does not count."""


class Terminal:
    """One command in a terminal of its own, 100 columns wide."""

    def __init__(self, *words: str) -> None:
        self._master, slave = pty.openpty()
        termios.tcsetwinsize(slave, (40, 100))

        def take_terminal() -> None:
            fcntl.ioctl(0, termios.TIOCSCTTY, 0)

        self._process = subprocess.Popen(
            [*URC, *words],
            cwd=ROOT,
            env=os.environ | {"PYTHONPATH": str(ROOT), "LC_ALL": "C.UTF-8"},
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            preexec_fn=take_terminal,
        )
        os.close(slave)
        self.text = ""

    def until(self, words: str) -> None:
        """Read until the terminal shows `words`."""
        deadline = time.monotonic() + TIMEOUT_S
        while words not in self.text:
            assert time.monotonic() < deadline, self.text
            self._read()

    def type(self, text: str) -> None:
        os.write(self._master, text.encode())

    def wait(self) -> int:
        """Read to the end; return the exit code."""
        while self._read():
            pass
        os.close(self._master)
        return self._process.wait(TIMEOUT_S)

    def _read(self) -> bool:
        try:
            data = os.read(self._master, 65536)
        except OSError:  # EIO: the other end is closed
            return False
        self.text += data.decode("utf-8", "replace")
        return bool(data)


def test_a_passphrase_in_a_terminal_is_never_shown(tmp_path: Path) -> None:
    folder = ("--data-dir", str(tmp_path))
    assert run("people", "add", "Ann", "--role", "administer", *folder).returncode == 0
    terminal = Terminal("people", "passphrase", "Ann", *folder)
    terminal.until("New passphrase for Ann: ")
    terminal.type(f"{PASSPHRASE}\n")
    terminal.until("Repeat the passphrase: ")
    terminal.type(f"{PASSPHRASE}\n")
    assert terminal.wait() == 0
    assert PASSPHRASE not in terminal.text
    assert "Ann has a new passphrase" in terminal.text
    store = AccessStore(tmp_path)
    assert matches(PASSPHRASE, store.passphrase_of("Ann")[1])
    store.close()


def test_a_passphrase_is_read_from_a_pipe(tmp_path: Path) -> None:
    folder = ("--data-dir", str(tmp_path))
    run("people", "add", "Ann", "--role", "drive", *folder)
    piped = subprocess.run(
        [*URC, "people", "passphrase", "Ann", *folder],
        cwd=ROOT,
        input=PASSPHRASE.encode(),
        capture_output=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    assert (piped.returncode, piped.stderr) == (0, b"")


def test_pairing_in_a_terminal_shows_a_qr_code_of_the_running_server(
    urc_process: Start, tmp_path: Path
) -> None:
    server = urc_process(
        "serve", "robots/tello.yaml", "--simulate", "--port", "0", "--data-dir", str(tmp_path)
    )
    address = server.wait_for(r"dashboard (http://[^/]+/)")[1]
    terminal = Terminal("devices", "pair", "--data-dir", str(tmp_path))
    assert terminal.wait() == 0
    link = re.search(rf"{re.escape(address)}pair#[\w-]{{22}}\r\n", terminal.text)
    assert link, terminal.text
    drawn = [line for line in terminal.text.splitlines() if "▀" in line]
    assert 18 <= len(drawn) <= 24, "it fits into a terminal of 24 lines"
    assert "works once, valid for 2 minutes" in terminal.text
    piped = run("devices", "pair", "--data-dir", str(tmp_path))
    assert re.fullmatch(rf"{re.escape(address)}pair#[\w-]{{22}}\n", piped.stdout)


def status(address: str, token: str) -> int:
    """Return the status of a request that needs the role `watch` at the robot."""
    asked = Request(  # noqa: S310 (URC's own address)
        f"{address}api/v1/robots/tello/controls", headers={"Authorization": f"Bearer {token}"}
    )
    try:
        with urlopen(asked, timeout=TIMEOUT_S) as answer:  # noqa: S310
            return int(answer.status)
    except HTTPError as error:
        return error.code


def test_commands_act_on_a_running_server_within_300_ms(urc_process: Start, tmp_path: Path) -> None:
    """A token works and ends, and so do its socket and each role, without a restart."""
    folder = ("--data-dir", str(tmp_path))
    server = urc_process("serve", "tello", "--simulate", "--port", "0", *folder)
    address = server.wait_for(r"dashboard (http://[^/]+/)")[1]
    assert status(address, "guess") == 401
    token = run("tokens", "add", "Bot", "--role", "watch@tello", *folder).stdout.strip()
    until(lambda: status(address, token) == 200)
    with connect(
        address.replace("http", "ws") + "ws",
        additional_headers={"Authorization": f"Bearer {token}"},
        proxy=None,
    ) as socket:
        assert run("tokens", "remove", "Bot", *folder).returncode == 0
        ended = time.monotonic()
        until(lambda: status(address, token) == 401)
        with pytest.raises(ConnectionClosed):
            read_to_the_end(socket)
        took_s = time.monotonic() - ended
    assert took_s < 0.3 + PAUSES_S


def read_to_the_end(socket: ClientConnection) -> None:
    while True:
        socket.recv(timeout=TIMEOUT_S)


def until(is_true: Callable[[], bool]) -> None:
    """Wait for the server, which looks at the store ten times a second."""
    deadline = time.monotonic() + 0.3 + PAUSES_S
    while not is_true():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_commands_at_once_lose_no_change(tmp_path: Path) -> None:
    """Twelve real processes change one new folder at the same time."""
    students = [f"Student {number}" for number in range(12)]
    running = [
        subprocess.Popen(
            [*URC, "people", "add", name, "--role", "drive@#class", "--data-dir", str(tmp_path)],
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        for name in students
    ]
    errors = [process.communicate(timeout=TIMEOUT_S * 2)[1].decode() for process in running]
    assert [process.returncode for process in running] == [0] * len(students), errors
    store = AccessStore(tmp_path)
    names = sorted(one.name for one in store.directory().principals.values())
    store.close()
    assert names == sorted(students)
    audited = run("audit", "--data-dir", str(tmp_path))
    assert (audited.returncode, audited.stdout.count("people add")) == (0, len(students))
