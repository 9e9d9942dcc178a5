"""The served robots and their services, keyed by the robots' names in URLs.

Layer 5. Robots can be added and removed at run time. Removing a robot first stops its motion.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import NamedTuple

from starlette.requests import Request

from urc.model.profile import Profile
from urc.runtime.missing_packages import dark_videos
from urc.runtime.registries import built_in_catalog
from urc.web.fleet.robots import Robot, RobotService
from urc.web.load.assets import Assets, widget_assets
from urc.web.load.widget_versions import apart, unified
from urc.web.serve.replies import ApiError
from urc.web.words import t

__all__ = ["BrokenRobot", "Fleet", "service_of"]

_END_S = 15.0
"""Maximum wait for a robot's session to end, in seconds."""


class BrokenRobot(NamedTuple):
    """A robot with unusable documents or widgets."""

    title: str
    fault: str
    """Reason for the failure, in one line."""


class Fleet:
    """All robots that a dashboard serves, with one service for each robot."""

    def __init__(
        self, robots: Mapping[str, Robot], service: Callable[[str, Robot], RobotService]
    ) -> None:
        """Prepare the robots that are known when the server starts.

        Args:
            robots: the robots, keyed by their names in URLs.
            service: function that creates the service of a robot.

        Raises:
            UrcError: two robots use different widgets with the same name.
        """
        self._service = service
        self.widgets: Assets = _assets(robots)
        self.robots: dict[str, Robot] = dict(robots)
        self.services: dict[str, RobotService] = {
            name: service(name, robot) for name, robot in robots.items()
        }
        self.broken: dict[str, BrokenRobot] = {}
        """Unusable robots, keyed by their names in URLs."""
        self._far: dict[str, tuple[Profile, Robot]] = {}
        """Robots of other sites with opened pages: the received profile, and the robot."""
        self._dark: dict[str, frozenset[str]] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._group: asyncio.TaskGroup | None = None

    @asynccontextmanager
    async def running(self) -> AsyncIterator[asyncio.TaskGroup]:
        """Run one session supervisor for each robot while the context is open."""
        async with asyncio.TaskGroup() as group:
            self._group = group
            for name in self.services:
                self._start(name)
            try:
                yield group
            finally:
                self._group = None
                for task in self._tasks.values():
                    task.cancel()

    def add(self, name: str, robot: Robot) -> None:
        """Add a robot; raise `UrcError` if its widgets cannot be served."""
        robot = self._apart(name, robot)
        self.widgets = self._assets_with(name, robot)
        self.robots[name] = robot
        self.services[name] = self._service(name, robot)
        self._dark.pop(name, None)
        self.broken.pop(name, None)
        self._start(name)

    def renew(self, name: str, robot: Robot) -> Robot:
        """Register another version of a robot; return the robot with its served widget names.

        The caller must pass the returned robot to its service with `RobotService.replace`.

        Raises:
            UrcError: the widgets of the robot cannot be served.
        """
        robot = self._apart(name, robot)
        self.widgets = self._assets_with(name, robot)
        self.robots[name] = robot
        self._dark.pop(name, None)
        self.broken.pop(name, None)
        return robot

    async def remove(self, name: str) -> None:
        """Remove a robot: stop its motion, then end its session."""
        self.robots.pop(name, None)
        self.broken.pop(name, None)
        self._dark.pop(name, None)
        self.services.pop(name, None)
        self.widgets = self._assets_with()
        task = self._tasks.pop(name, None)
        if task is not None:
            task.cancel()
            await asyncio.wait((task,), timeout=_END_S)

    def shown(self, name: str, far: Robot) -> Robot:
        """Return a robot of another site for its page, and serve its widgets from now on.

        Raises:
            UrcError: the widgets of the robot cannot be served.
        """
        kept = self._far.get(name)
        if kept is None or kept[0] is not far.profile:
            robot = self._apart(name, far)
            self.widgets = self._assets_with(name, robot)
            kept = self._far[name] = (far.profile, robot)
        return replace(kept[1], is_emulated=far.is_emulated)

    def _assets_with(self, name: str = "", robot: Robot | None = None) -> Assets:
        far = {each: one for each, (_, one) in self._far.items()}
        more = {} if robot is None else {name: robot}
        return _assets({**far, **self.robots, **more})

    def driven_by(self, name: str) -> str:
        """Return the name of the operator who controls a robot; "" if the robot is at rest.

        A running goal counts as driving: with other settings, STOP would not reach it. A pending
        stop counts while a session can deliver it. Without a session, it does not count, so that
        a wrong robot address can still be corrected.
        """
        service = self.services.get(name)
        if service is None or service.is_at_rest:
            return ""
        holder = service.controls.controller.lease.state.holder
        if holder is not None:
            return holder.name
        if service.has_goal:
            return t("a running goal")
        return t("a pending stop") if service.is_open else ""

    def dark_videos(self, name: str) -> frozenset[str]:
        """Return the signals of a robot's cameras whose package is missing.

        The videos of a recording need no package. The result changes only with the robot, or when
        the missing package is installed.
        """
        robot = self.robots[name]
        if self._dark.get(name) is None or self._dark[name]:
            is_played, table = robot.playback is not None, built_in_catalog().transports
            self._dark[name] = (
                frozenset() if is_played else dark_videos(robot.profile, robot.settings, table)
            )
        return self._dark[name]

    def is_out_of_reach(self, name: str) -> bool:
        """Return whether a robot has no operator, client or live connection."""
        service = self.services.get(name)
        if service is None or service.controls.controller.lease.state.holder is not None:
            return False
        return not (service.is_used or service.is_heard)

    def _apart(self, name: str, robot: Robot) -> Robot:
        far = {each: one for each, (_, one) in self._far.items()}
        others = [one.profile for other, one in {**far, **self.robots}.items() if other != name]
        return replace(robot, profile=apart(robot.profile, others))

    def _start(self, name: str) -> None:
        if self._group is not None:
            self._tasks[name] = self._group.create_task(self.services[name].run())


def service_of(services: Mapping[str, RobotService], request: Request) -> tuple[str, RobotService]:
    """Return the name and service of the robot in a request's path, or raise `ApiError` 404.

    Args:
        services: the robots' services, keyed by the robots' names in URLs.
        request: a request whose path has the parameter `name`.
    """
    name = request.path_params["name"]
    service = services.get(name)
    if service is None:
        raise ApiError(404, "this server has no robot with that name", "unknown-robot")
    return name, service


def _assets(robots: Mapping[str, Robot]) -> Assets:
    """Return the files of all widgets; identical widgets from several robots are merged."""
    return widget_assets(
        unified(one for robot in robots.values() for one in robot.profile.widgets.values())
    )
