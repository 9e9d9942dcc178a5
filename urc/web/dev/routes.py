"""Routes for the developer pages: traffic log, parser try-out and command preview of each robot.

Layer 5. These routes exist only with ``--dev``. They require the start key, because the pages show
all of a robot's traffic. `urc.web.app` creates at most one `Dev`.
"""

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from urllib.parse import quote

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import BaseRoute
from starlette.websockets import WebSocket

from urc.web.dev.client import DevClient
from urc.web.dev.watch import ProfileWatch, Remake
from urc.web.fleet.robots import Robot, RobotService
from urc.web.serve.rights import LOCAL, WATCH, ProtectedRoute, ProtectedSocket
from urc.web.show.pages import PageHead, render
from urc.web.wire import messages as wire
from urc.web.words import t

__all__ = ["HOW_TO_TURN_ON", "Dev", "DevPage", "dev_url", "no_dev_routes"]

HOW_TO_TURN_ON = "The developer page is disabled. Start URC with --dev to enable it."
CLIENTS = 16
"""Maximum number of open developer pages."""


@dataclass(frozen=True, slots=True)
class DevPage:
    """Context for ``dev.html.j2``. The page receives the robot's data through two sockets."""

    head: PageHead
    title: str
    url: str
    """Path of the robot's page on the dashboard."""
    values: str
    """Path and query of the dashboard's WebSocket, for values, connection states and commands."""
    socket: str
    """Path of the developer page's WebSocket."""
    timeline: str
    """Path of the robot's timeline in the audit log."""
    has_topics: bool
    """Whether the robot has a ROS connection."""


def dev_url(name: str) -> str:
    """Return the path of a robot's developer page."""
    return f"/robots/{quote(name, safe='')}/dev"


def no_dev_routes() -> list[BaseRoute]:
    """Return routes that explain how to enable the developer pages with ``--dev``."""

    async def tell(_: Request) -> Response:
        raise HTTPException(404, HOW_TO_TURN_ON)

    return [ProtectedRoute("/robots/{name}/dev", tell, WATCH)]


class Dev:
    """The developer pages of all robots."""

    def __init__(
        self,
        services: Mapping[str, RobotService],
        remake: Mapping[str, Remake],
        take: Callable[[str, Robot], None],
    ) -> None:
        """Create the pages.

        Args:
            services: the robots' services, keyed by the robots' names in URLs.
            remake: functions that create a robot from a new version of its profile, keyed by robot
                name.
            take: function that switches to a new version of a robot; may raise `UrcError`.
        """
        self._open = 0
        self._watches = {
            name: ProfileWatch(service, remake[name], partial(take, name))
            for name, service in services.items()
        }

    async def run(self) -> None:
        """Watch the documents of all robots until cancelled."""
        async with asyncio.TaskGroup() as group:
            for watch in self._watches.values():
                group.create_task(watch.run())

    def routes(self) -> list[BaseRoute]:
        """Return the routes for the developer pages and their sockets."""
        return [
            ProtectedRoute("/robots/{name}/dev", self._page, LOCAL),
            ProtectedSocket("/robots/{name}/dev/ws", self._socket, LOCAL),
        ]

    async def _page(self, request: Request) -> Response:
        name = request.path_params["name"]
        watch = self._watches.get(name)
        if watch is None:
            raise HTTPException(404, t("This server has no robot called “{name}”.", name=name))
        title = watch.service.robot.profile.title or name
        quoted = quote(name, safe="")
        page = DevPage(
            head=PageHead(request.state.nonce, f"Dev: {title}"),
            title=title,
            url=f"/robots/{quoted}/",
            values=f"/ws?robot={quoted}",
            socket=f"{dev_url(name)}/ws",
            timeline=f"/api/v1/robots/{quoted}/timeline",
            has_topics=any(
                one.type == "ros" for one in watch.robot.profile.driver.transports.values()
            ),
        )
        return HTMLResponse(render("dev.html.j2", page), headers={"cache-control": "no-store"})

    async def _socket(self, websocket: WebSocket) -> None:
        await websocket.accept()
        watch = self._watches.get(websocket.path_params["name"])
        if watch is None:
            await websocket.close(wire.CLOSE_NO_ROBOT, "this server has no robot with that name")
        elif self._open >= CLIENTS:
            await websocket.close(wire.CLOSE_FULL, f"{CLIENTS} developer pages are already open")
        else:
            self._open += 1
            try:
                flow = websocket.scope["state"]["flow"]
                await DevClient(websocket, watch, flow).serve()
            finally:
                self._open -= 1
