"""URC as a process, for tests: its lines as they come, waits with a time-out, always killed."""

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO

from anyio import to_thread

from tests.e2e.keys import learn

ROOT = Path(__file__).resolve().parents[2]
READY_TIMEOUT_S = 40.0
EXIT_TIMEOUT_S = 40.0
BUSY_MACHINE = "warning: urc.runtime.loop_watchdog: the server was blocked for "
"""Start of a line that URC writes when the machine delays it, not when something is wrong."""


class UrcProcess:
    """One running ``python -m urc.cli.main …``, started in the checkout.

    The waits block. In an async test that also plays the robot's part, await the ``…_async`` ones.
    """

    def __init__(self, arguments: Sequence[str], environment: Mapping[str, str]) -> None:
        self.arguments = tuple(arguments)
        self.output: list[str] = []
        """Lines of standard output so far, without line ends."""
        self.errors: list[str] = []
        """Lines of standard error so far, without reports of a busy machine."""
        self._changed = threading.Condition()
        self._open_streams = 2
        self._process = subprocess.Popen(
            [sys.executable, "-m", "urc.cli.main", *arguments],
            cwd=ROOT,
            env=os.environ | {"PYTHONUNBUFFERED": "1"} | dict(environment),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            encoding="utf-8",
        )
        self._readers = [self._read(self._process.stdout, self.output)]
        self._readers.append(self._read(self._process.stderr, self.errors))

    @property
    def pid(self) -> int:
        """The process id, to measure or to signal."""
        return self._process.pid

    @property
    def is_running(self) -> bool:
        """Whether it has not ended yet."""
        return self._process.poll() is None

    def wait_for(
        self, pattern: str, timeout_s: float = READY_TIMEOUT_S, *, times: int = 1
    ) -> re.Match[str]:
        """Return the first match in any line of either stream; fail when it ends or time runs out.

        A server is ready when it says so: ``process.wait_for(r"listening .*:(\\d+)")``. With
        `times`, wait until so many lines match, and return the match in the last of them.
        """
        deadline = time.monotonic() + timeout_s
        with self._changed:
            while True:
                lines = (*self.output, *self.errors)
                found = [match for line in lines if (match := re.search(pattern, line))]
                if len(found) >= times:
                    return found[times - 1]
                left = deadline - time.monotonic()
                if left <= 0 or self._open_streams == 0:
                    raise AssertionError(self._story(f"no {times} lines with {pattern!r}"))
                self._changed.wait(left)

    def wait(self, timeout_s: float = EXIT_TIMEOUT_S) -> int:
        """Wait for its own end; return the exit code."""
        try:
            code = self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.kill()
            raise AssertionError(self._story(f"did not end within {timeout_s} s")) from None
        self._join()
        return code

    async def wait_for_async(
        self, pattern: str, timeout_s: float = READY_TIMEOUT_S
    ) -> re.Match[str]:
        """Do as `wait_for`, without holding up the loop."""
        return await to_thread.run_sync(self.wait_for, pattern, timeout_s)

    async def wait_async(self, timeout_s: float = EXIT_TIMEOUT_S) -> int:
        """Do as `wait`, without holding up the loop."""
        return await to_thread.run_sync(self.wait, timeout_s)

    def interrupt(self, timeout_s: float = EXIT_TIMEOUT_S) -> int:
        """Press Ctrl-C, as a person does; return the exit code."""
        return self.end(signal.SIGINT, timeout_s)

    def end(self, number: signal.Signals, timeout_s: float = EXIT_TIMEOUT_S) -> int:
        """Send a signal that ends it; return the exit code."""
        self._process.send_signal(number)
        return self.wait(timeout_s)

    def kill(self) -> None:
        """End it at once, without a word of farewell. Calling it again does nothing."""
        if self.is_running:
            self._process.kill()
        self._process.wait()
        self._join()

    def _join(self) -> None:
        for reader in self._readers:
            reader.join(timeout=5)
        for stream in (self._process.stdout, self._process.stderr):
            if stream:
                stream.close()

    def _read(self, stream: IO[str] | None, lines: list[str]) -> threading.Thread:
        thread = threading.Thread(target=self._read_lines, args=(stream, lines), daemon=True)
        thread.start()
        return thread

    def _read_lines(self, stream: IO[str], lines: list[str]) -> None:
        for line in stream:
            if line.startswith(BUSY_MACHINE):
                continue
            with self._changed:
                lines.append(learn(line.rstrip("\n")))
                self._changed.notify_all()
        with self._changed:
            self._open_streams -= 1
            self._changed.notify_all()

    def _story(self, fault: str) -> str:
        said = "\n".join((*self.output[-20:], *self.errors[-20:])) or "(nothing)"
        return f"urc {' '.join(self.arguments)}: {fault}; it said:\n{said}"
