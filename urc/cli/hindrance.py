"""Interlock of the command line: a latched STOP or a driving operator prevents motion."""

import asyncio
import json
import os
from collections.abc import Callable
from contextlib import suppress
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from urllib.parse import quote, urlsplit

from urc.problems import printable
from urc.runtime.latch import LatchFile
from urc.runtime.servers import Server, headers, servers

__all__ = ["Hindrance"]

_ANSWER_S = 2.0
"""A server that has not answered by then hangs; what it knows is not known."""
_LOOK_S = 0.1
_ASK_S = 0.5
_MOST_BYTES = 4096


class Hindrance:
    """Looks at the kept latch, and asks the servers that run on the same data folder."""

    def __init__(self, data: Path, robot: str, clock: Callable[[], float]) -> None:
        """Prepare for one robot; nothing is read yet.

        Args:
            data: folder of URC's own data.
            robot: name of the profile.
            clock: monotonic seconds.
        """
        self._data = data
        self._robot = robot
        self._clock = clock
        self._file = data / "latches" / f"{robot}.latch.json"
        self._latch = LatchFile(data / "latches", robot)
        self._seen: tuple[int, int] | None = None
        self._latched = ""
        self._ask_s = float("-inf")
        self._driven = ""
        self.why = ""
        """Why nothing may be moved, as of the last `look`; "": it may."""

    async def look(self) -> str:
        """Look now; return `why`."""
        return await asyncio.to_thread(self._look)

    async def follow(self, on_change: Callable[[str], None]) -> None:
        """Look again and again, until cancelled; tell every other `why`."""
        while True:
            before = self.why
            if await self.look() != before:
                on_change(self.why)
            await asyncio.sleep(_LOOK_S)

    def _look(self) -> str:
        self._read_latch()
        if self._clock() >= self._ask_s:
            self._driven = self._asked()
            self._ask_s = self._clock() + _ASK_S
        self.why = self._driven or self._latched
        return self.why

    def _read_latch(self) -> None:
        """Read the kept latch, unless it is the one that was read before."""
        try:
            found = os.stat(self._file)
            seen = (found.st_mtime_ns, found.st_ino)
        except OSError:
            seen = (0, 0)
        if seen != self._seen:
            self._seen = seen
            by = self._latch.load().state.latched_by
            self._latched = f"STOP is latched, pressed by {by}: reset it first" if by else ""

    def _asked(self) -> str:
        """Return what the first server says that has something against it."""
        for file, server in servers(self._data).items():
            why = self._answer(file, server)
            if why:
                return why
        return ""

    def _answer(self, file: Path, server: Server) -> str:
        url = server.address
        place = urlsplit(url)
        line = HTTPConnection(place.hostname or "", place.port, timeout=_ANSWER_S)
        try:
            path = f"/api/v1/robots/{quote(self._robot, safe='')}/controls"
            line.request("GET", path, headers=headers(server))
            answer = line.getresponse()
            text = answer.read(_MOST_BYTES)
            if answer.status == HTTPStatus.NOT_FOUND:  # it does not serve this robot
                return ""
            found = json.loads(text)
            by, holder = str(found["latched"]), str(found["holder"])
            if found["emulated"]:
                return ""
        except ConnectionRefusedError:
            with suppress(OSError):
                file.unlink()  # of a server that was killed
            return ""
        except (OSError, HTTPException, ValueError, KeyError, TypeError, RecursionError):
            return f"the server at {url} does not say who drives the robot"
        finally:
            line.close()
        if by:
            return printable(f"STOP is latched, pressed by {by}: reset it first on {url}")
        return printable(f"{holder} drives the robot on {url}") if holder else ""
