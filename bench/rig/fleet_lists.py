"""The list of robots as the dashboards of a fleet show it, asked for again and again."""

import json
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from http.client import HTTPConnection, HTTPException
from types import TracebackType
from typing import NamedTuple, Self

from bench.rig.programs import Server

__all__ = ["FleetList", "ListWatch"]

EVERY_S = 0.05
ANSWER_S = 2.0


class FleetList(NamedTuple):
    """The robots on a dashboard at one moment."""

    time_ns: int
    """Monotonic time at which the list had arrived."""
    states: Mapping[str, str]
    """State of each robot, by its name on this dashboard."""
    holders: Mapping[str, str]
    """Operator of each robot, or ""."""


class ListWatch:
    """Asks one dashboard for its list, like an open menu, until it is closed."""

    def __init__(self, server: Server) -> None:
        self.lists: list[FleetList] = []
        """All lists so far."""
        self._server = server
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Ask no more."""
        self.close()

    def close(self) -> None:
        """Ask no more."""
        self._ended.set()
        self._thread.join(2 * ANSWER_S)

    def right_ns(self, since_ns: int, is_right: Callable[[FleetList], bool]) -> int | None:
        """Return when the list became right for good, or None if it is wrong now.

        Args:
            since_ns: monotonic time; only later lists count.
            is_right: whether a list is right.
        """
        found: int | None = None
        for one in reversed(tuple(self.lists)):
            if one.time_ns < since_ns or not is_right(one):
                break
            found = one.time_ns
        return found

    def _run(self) -> None:
        server = self._server
        line = HTTPConnection(server.host, server.port, timeout=ANSWER_S)
        while not self._ended.is_set():
            # A killed or frozen dashboard shows nothing; the next answer counts.
            with suppress(OSError, HTTPException):
                line.request(
                    "GET", "/api/v1/robots", headers={"authorization": f"Bearer {server.key}"}
                )
                found = json.loads(line.getresponse().read())["robots"]
                self.lists.append(
                    FleetList(
                        time.monotonic_ns(),
                        {one["name"]: one["state"] for one in found},
                        {one["name"]: one["holder"] for one in found},
                    )
                )
                self._ended.wait(EVERY_S)
                continue
            line.close()
            self._ended.wait(EVERY_S)
        line.close()
