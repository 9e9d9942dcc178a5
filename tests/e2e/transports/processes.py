"""Third-party servers as processes: started, waited for, stopped with all their children."""

import asyncio
import os
import signal
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

__all__ = ["Server"]

READY_WITHIN_S = 30.0


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

    @property
    def pids(self) -> list[int]:
        """It and all that it has started, the youngest last."""
        return [] if self._process is None else family(self._process.pid)

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
        """End it and all that it has started, without a word; nobody listens any more then."""
        if self._process is None:
            return
        self.stop()  # who was started meanwhile would be missed
        pids = self.pids
        process, self._process = self._process, None
        for pid in pids:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        process.wait(timeout=READY_WITHIN_S)
        until = time.monotonic() + READY_WITHIN_S
        while any(map(_is_alive, pids)):
            assert time.monotonic() < until, f"one of {pids} outlives its end"
            time.sleep(0.005)

    def stop(self) -> None:
        """Freeze it with all that it has started: connections stay, nobody answers.

        Who is frozen starts nobody any more, so it is over when no other one is found.
        """
        frozen: set[int] = set()
        while young := set(self.pids) - frozen:
            for pid in young:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGSTOP)
            until = time.monotonic() + READY_WITHIN_S
            while not all(map(_is_frozen, young)):
                assert time.monotonic() < until, f"one of {young} does not freeze"
                time.sleep(0.001)
            frozen |= young

    def signal(self, number: int) -> None:
        """Send a signal to it and to all that it has started."""
        for pid in self.pids:
            with suppress(ProcessLookupError):
                os.kill(pid, number)


def _is_alive(pid: int) -> bool:
    """Return whether a process runs; one that is dead and not yet buried has closed all it had."""
    return _state(pid) not in "ZX"


def _is_frozen(pid: int) -> bool:
    """Return whether a process that was told to stop does nothing more of its own.

    One in uninterruptible sleep (D) stops before it comes back from the system, and may never:
    a shell sleeps so while its child is about to become another program, and that is frozen too.
    """
    return _state(pid) in "TtDZX"


def _state(pid: int) -> str:
    """Return the letter by which the system tells what a process does; X when there is none."""
    try:
        return Path(f"/proc/{pid}/stat").read_text("utf-8").rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return "X"


def family(pid: int) -> list[int]:
    """Return a process and all below it, the youngest last."""
    found = [pid]
    for one in found:
        with suppress(OSError):
            children = Path(f"/proc/{one}/task/{one}/children").read_text("ascii")
            found += map(int, children.split())
    return found
