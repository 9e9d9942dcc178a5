"""The robots that are served: by the name in their URL, each with its station. They come and go.

Floor 5. A robot that goes is let go of in good order: what moves is stopped first.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import NamedTuple

from urc.web.fleet.robots import Robot, Station
from urc.web.load.apart import apart, unified
from urc.web.load.assets import Assets, widget_assets
from urc.web.words import t

__all__ = ["Broken", "Fleet"]

_END_S = 15.0
"""How long a robot's session may take to end."""


class Broken(NamedTuple):
    """A robot that should be on the menu and cannot."""

    title: str
    fault: str
    """One line."""


class Fleet:
    """All robots of one dashboard."""

    def __init__(
        self, robots: Mapping[str, Robot], station: Callable[[str, Robot], Station]
    ) -> None:
        """Take up the robots that are there from the start.

        Args:
            robots: by the name in their URL.
            station: makes the station of a robot.

        Raises:
            UrcError: two robots bring different widgets of one name.
        """
        self._station = station
        self.widgets: Assets = _assets(robots)
        self.robots: dict[str, Robot] = dict(robots)
        self.stations: dict[str, Station] = {
            name: station(name, robot) for name, robot in robots.items()
        }
        self.broken: dict[str, Broken] = {}
        """Those that cannot be used, by name."""
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._group: asyncio.TaskGroup | None = None

    @asynccontextmanager
    async def running(self) -> AsyncIterator[asyncio.TaskGroup]:
        """Keep one supervisor a robot for as long as the context lasts."""
        async with asyncio.TaskGroup() as group:
            self._group = group
            for name in self.stations:
                self._start(name)
            try:
                yield group
            finally:
                self._group = None
                for task in self._tasks.values():
                    task.cancel()

    def add(self, name: str, robot: Robot) -> None:
        """Serve another robot; raise `UrcError` when its widgets cannot be served."""
        robot = self._apart(name, robot)
        self.widgets = _assets({**self.robots, name: robot})
        self.robots[name] = robot
        self.stations[name] = self._station(name, robot)
        self.broken.pop(name, None)
        self._start(name)

    def renew(self, name: str, robot: Robot) -> Robot:
        """Take another version of a robot into the lists, and return it as it is served.

        Its station goes on with it when it is told: see `Station.replace`.

        Raises:
            UrcError: its widgets cannot be served.
        """
        robot = self._apart(name, robot)
        self.widgets = _assets({**self.robots, name: robot})
        self.robots[name] = robot
        self.broken.pop(name, None)
        return robot

    async def remove(self, name: str) -> None:
        """Serve a robot no more: its session ends, what moves is stopped first."""
        self.robots.pop(name, None)
        self.broken.pop(name, None)
        self.stations.pop(name, None)
        self.widgets = _assets(self.robots)
        task = self._tasks.pop(name, None)
        if task is not None:
            task.cancel()
            await asyncio.wait((task,), timeout=_END_S)

    def driven_by(self, name: str) -> str:
        """Return who drives a robot now, or "" when nobody does.

        A stop that is still on its way counts while there is a session that delivers it; without
        one, as where the address is wrong, it is no reason to keep that address.
        """
        station = self.stations.get(name)
        if station is None or station.is_at_rest:
            return ""
        holder = station.controls.desk.lease.state.holder
        if holder is not None:
            return holder.name
        return t("a stop that is on its way") if station.is_open else ""

    def _apart(self, name: str, robot: Robot) -> Robot:
        others = [one.profile for other, one in self.robots.items() if other != name]
        return replace(robot, profile=apart(robot.profile, others))

    def _start(self, name: str) -> None:
        if self._group is not None:
            self._tasks[name] = self._group.create_task(self.stations[name].run())


def _assets(robots: Mapping[str, Robot]) -> Assets:
    """Return the files of all widgets; copies of one widget, each in its ecosystem, are one."""
    return widget_assets(
        unified(one for robot in robots.values() for one in robot.profile.widgets.values())
    )
