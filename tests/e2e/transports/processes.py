"""Third-party servers as processes: started, waited for, stopped with all their children."""

import asyncio
import os
import signal
import socket
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

__all__ = ["Server", "free_port"]

READY_WITHIN_S = 10.0


def free_port() -> int:
    """Return a port of loopback on which nobody listens."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


class Server:
    """A program that listens on a port of loopback, and whatever it starts."""

    def __init__(self, command: Sequence[str], port: int, log: Path) -> None:
        """Prepare; `start` may be called again after `kill`."""
        self._command = command
        self._log = log
        self.port = port
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def said(self) -> str:
        """Everything that it has written so far."""
        return self._log.read_text("utf-8", "replace") if self._log.exists() else ""

    async def start(self) -> None:
        """Start it, and wait until it takes connections."""
        self._process = process = self._begin()
        until = time.monotonic() + READY_WITHIN_S
        while True:
            try:
                _, writer = await asyncio.open_connection("127.0.0.1", self.port)
            except OSError:
                assert process.poll() is None, f"it has ended:\n{self.said}"
                assert time.monotonic() < until, f"it does not listen:\n{self.said}"
                await asyncio.sleep(0.02)
            else:
                writer.transport.abort()
                return

    def _begin(self) -> subprocess.Popen[bytes]:
        with self._log.open("ab") as log:
            return subprocess.Popen(self._command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    def kill(self) -> None:
        """End it and all that it has started, without a word."""
        self.signal(signal.SIGKILL)
        if self._process is not None:
            self._process.wait(timeout=READY_WITHIN_S)
            self._process = None

    def stop(self) -> None:
        """Freeze it with all that it has started: connections stay, nobody answers."""
        self.signal(signal.SIGSTOP)

    def signal(self, number: int) -> None:
        """Send a signal to it and to all that it has started."""
        if self._process is None:
            return
        for pid in family(self._process.pid):
            with suppress(ProcessLookupError):
                os.kill(pid, number)


def family(pid: int) -> list[int]:
    """Return a process and all below it, the youngest last."""
    found = [pid]
    for one in found:
        with suppress(OSError):
            children = Path(f"/proc/{one}/task/{one}/children").read_text("ascii")
            found += map(int, children.split())
    return found
