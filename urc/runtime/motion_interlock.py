"""The interlock for programs that move a robot without using the robot's server.

Layer 4. Motion is refused while STOP is latched or while an operator has the controls on one of
this user's servers.
"""

import asyncio
import json
import os
import time
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from urllib.parse import quote

from urc.problems import printable
from urc.runtime.latch import LatchStore
from urc.runtime.running_servers import RunningServer, headers, open_connection, servers

__all__ = ["MotionInterlock"]

_ANSWER_S = 2.0
"""Timeout for a server's reply, in seconds. After the timeout, the state of the server counts as
unknown."""
_LOOK_S = 0.1
_ASK_S = 0.5
_MOST_BYTES = 4096


class MotionInterlock:
    """A robot's interlocks: the stored latch, and the servers that use the same data folder."""

    def __init__(self, data: Path, robot: str, clock: Callable[[], float] = time.monotonic) -> None:
        """Prepare the interlocks of one robot without reading files.

        Args:
            data: data folder of URC.
            robot: name of the profile.
            clock: source of monotonic time, in seconds.
        """
        self._data = data
        self._robot = robot
        self._clock = clock
        self._file = data / "latches" / f"{robot}.latch.json"
        self._latch = LatchStore(data / "latches", robot)
        self._seen: tuple[int, int] | None = None
        self._latched = ""
        self._ask_s = float("-inf")
        self._driven = ""
        self.why = ""
        """Reason for refusing motion at the last call to `check`; "" if motion is allowed."""

    async def check(self) -> str:
        """Read the latch, ask the servers if that is due, and return the new `why`."""
        return await asyncio.to_thread(self._check)

    async def follow(self, on_change: Callable[[str], None]) -> None:
        """Read the interlocks repeatedly until cancelled; report every change of `why`."""
        while True:
            before = self.why
            if await self.check() != before:
                on_change(self.why)
            await asyncio.sleep(_LOOK_S)

    def _check(self) -> str:
        self._read_latch()
        if self._clock() >= self._ask_s:
            self._driven = self._asked()
            self._ask_s = self._clock() + _ASK_S
        self.why = self._driven or self._latched
        return self.why

    def _read_latch(self) -> None:
        """Read the stored latch if it has changed."""
        try:
            found = os.stat(self._file)
            seen = (found.st_mtime_ns, found.st_ino)
        except OSError:
            seen = (0, 0)
        if seen != self._seen:
            self._seen = seen
            by = self._latch.load().state.latched_by
            self._latched = f"STOP was latched by {by}: reset it first" if by else ""

    def _asked(self) -> str:
        """Ask all servers who drives the robot; return the first reason to refuse motion, or ""."""
        for file, server in servers(self._data).items():
            why = self._answer(file, server)
            if why:
                return why
        return ""

    def _answer(self, file: Path, server: RunningServer) -> str:
        url = server.address
        line: HTTPConnection | None = None
        try:
            line = open_connection(server, _ANSWER_S)
            path = f"/api/v1/robots/{quote(self._robot, safe='')}/controls"
            line.request("GET", path, headers=headers(server))
            answer = line.getresponse()
            text = answer.read(_MOST_BYTES)
            if answer.status == HTTPStatus.NOT_FOUND:  # this server does not have the robot
                return ""
            found = json.loads(text)
            by, holder = str(found["latched"]), str(found["holder"])
            if found["emulated"]:
                return ""
        except ConnectionRefusedError:
            with suppress(OSError):
                file.unlink()  # its server was killed
            return ""
        except (OSError, HTTPException, ValueError, KeyError, TypeError, RecursionError):
            return f"the server at {url} does not report the operator of the robot"
        finally:
            if line is not None:
                line.close()
        if by:
            return printable(f"STOP was latched by {by}: reset it first on {url}")
        return printable(f"{holder} is driving the robot on {url}") if holder else ""
