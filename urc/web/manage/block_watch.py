"""A watcher of the block lists, which stops and disables robots with blocked packages.

Layer 5. The lists change through imports on the command line and through this watcher's hourly
requests.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Final

from urc.packages.store import Store, blocked_lines_of
from urc.problems import UrcError
from urc.web.fleet.fleet import BrokenRobot, Fleet
from urc.web.fleet.robots import Robot

__all__ = ["BlockWatch"]

_LOOK_S: Final = 1.0
"""Interval between checks of the block list file, in seconds."""
_FIRST_ASK_S: Final = 60.0
"""Time between the server's start and the first request to the repositories, in seconds."""
_ASK_S: Final = 3600.0
"""Interval between requests to the repositories, in seconds."""

log = logging.getLogger(__name__)


class BlockWatch:
    """The watcher of the block lists for one dashboard."""

    def __init__(
        self,
        store: Store,
        fleet: Fleet,
        remade: Callable[[str, Robot], Robot],
        own_interfaces: Callable[[str, Robot], set[str]],
        ask: Callable[[], None],
    ) -> None:
        """Create the watch.

        Args:
            store: the installed packages.
            fleet: the served robots.
            remade: function that recreates a robot from its documents. The function is called in a
                thread and may raise `UrcError`, for example for a blocked package.
            own_interfaces: function that returns the names of the interfaces in a robot's own
                document. The function is called in a thread and may raise `UrcError`.
            ask: function that starts a request for the block lists of all repositories.
        """
        self._store = store
        self._fleet = fleet
        self._remade = remade
        self._own_interfaces = own_interfaces
        self._ask = ask
        self._disabled: dict[str, Robot] = {}
        """Robots that this watcher has disabled, keyed by name."""

    async def run(self, changed: Callable[[], Awaitable[None]]) -> None:
        """Watch until cancelled.

        Args:
            changed: coroutine function that calls `enforce` and updates the menu.
        """
        loop = asyncio.get_running_loop()
        asks_at_s = loop.time() + _FIRST_ASK_S
        seen: object = None  # a server without block lists has nothing to enforce
        while True:
            await asyncio.sleep(_LOOK_S)
            if loop.time() >= asks_at_s:
                asks_at_s = loop.time() + _ASK_S
                self._ask()
            stamp = await asyncio.to_thread(self._store.blocks.stamp)
            if stamp == seen:
                continue
            try:
                await changed()
            except (UrcError, OSError) as error:
                log.warning("the block lists cannot be read: %s", error)
            seen = stamp

    async def enforce(self) -> None:
        """Stop and disable robots with a blocked package; enable them again after unblocking.

        Raises:
            UrcError: the lists cannot be read; all robots stay unchanged.
        """
        for name, robot in list(self._fleet.robots.items()):
            lines = await asyncio.to_thread(self._lines, name, robot)
            if lines:
                log.warning("%s: stopped and disabled: %s", name, "; ".join(lines))
                await self._disable(name, robot, lines[0])
        for name, robot in list(self._disabled.items()):
            if name in self._fleet.robots:
                del self._disabled[name]
            elif await self._add(name, robot):
                del self._disabled[name]
                log.warning("%s: its package is no longer blocked", name)

    def _lines(self, name: str, robot: Robot) -> list[str]:
        """Return one line for each of a robot's blocked packages; called in a thread."""
        if robot.playback is not None:
            return []
        lines = blocked_lines_of(Path(robot.profile.file))
        if lines:
            return lines
        added = robot.profile.interfaces.keys()
        for lock in self._store.installed():
            if lock.key.kind != "interface" or lock.key.name not in added:
                continue
            blocked = self._store.blocked(lock)
            if blocked and lock.key.name not in self._own_interfaces(name, robot):
                lines += blocked
        return lines

    async def _disable(self, name: str, robot: Robot, line: str) -> None:
        """Stop a robot, latch STOP with the reason and end the robot's session."""
        service = self._fleet.services[name]
        if service.controls.controller.can_move:
            service.controls.stop(f"URC: {line}")
            if service.is_open:
                await service.deliver_stop()
        await service.controls.settle()
        await self._fleet.remove(name)
        if not await self._add(name, robot):  # works if only an added interface is blocked
            self._fleet.broken[name] = BrokenRobot(robot.profile.title or name, line)
            self._disabled[name] = robot

    async def _add(self, name: str, robot: Robot) -> bool:
        """Add a robot again from its documents; return False if this fails."""
        try:
            made = await asyncio.to_thread(self._remade, name, robot)
            self._fleet.add(name, made)
        except (UrcError, OSError):
            return False
        return True
