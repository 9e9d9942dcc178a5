"""The dashboard as one ASGI application: routes to pages, files and sockets. Only wires.

Floor 5. `build_app` is handed the robots and everything that tells them apart; `serve` runs it.
"""

import asyncio
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from http import HTTPStatus

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp
from starlette.websockets import WebSocket

from urc import __version__
from urc.shipped import vendored
from urc.web import wire
from urc.web.assets import STATIC, Assets, folder_assets, import_map, widget_assets
from urc.web.pages import Head, error_page, menu_page, robot_page
from urc.web.policy import Policy
from urc.web.robots import LINGER_S, Robot, Station, missing_settings
from urc.web.server import serve
from urc.web.socket import Client

__all__ = ["Robot", "build_app", "serve"]

_PAGE = {"cache-control": "no-store"}


def build_app(
    robots: Mapping[str, Robot],
    *,
    allowed_hosts: Iterable[str] = (),
    linger_s: float = LINGER_S,
) -> Starlette:
    """Return the application that serves `robots`.

    Args:
        robots: by the name in their URL.
        allowed_hosts: names it answers to, besides addresses, ``localhost`` and ``*.local``.
        linger_s: how long a robot stays connected after its last client has gone, in seconds.

    Raises:
        UrcError: two robots bring different widgets of one name.
    """
    vendor = vendored()
    routes = _Routes(
        robots=robots,
        stations={name: Station(robot, linger_s=linger_s) for name, robot in robots.items()},
        modules=import_map(vendor),
        static=folder_assets(STATIC),
        vendor=folder_assets(vendor) if vendor else Assets(),
        widgets=widget_assets(
            widget for robot in robots.values() for widget in robot.profile.widgets.values()
        ),
    )
    return _Dashboard(routes, frozenset(allowed_hosts))


class _Dashboard(Starlette):
    """Starlette with the page policy outermost, so that its own error answers pass through it."""

    def __init__(self, routes: "_Routes", allowed_hosts: frozenset[str]) -> None:
        self._allowed_hosts = allowed_hosts
        super().__init__(
            routes=[
                Route("/", routes.menu),
                Route("/robots/{name}/", routes.robot),
                Route("/healthz", routes.health),
                Route("/favicon.ico", routes.favicon),
                Route("/static/{file:path}", routes.static_file),
                Route("/vendor/{file:path}", routes.vendor_file),
                Route("/widgets/{file:path}", routes.widget_file),
                WebSocketRoute("/ws", routes.socket),
            ],
            exception_handlers={HTTPException: _told, 404: _told, 405: _told, Exception: _broken},
            lifespan=routes.lifespan,
        )

    def build_middleware_stack(self) -> ASGIApp:
        """Put the policy around everything, the handler of unexpected errors included."""
        return Policy(super().build_middleware_stack(), allowed_hosts=self._allowed_hosts)


@dataclass(frozen=True, slots=True)
class _Routes:
    robots: Mapping[str, Robot]
    stations: Mapping[str, Station]
    modules: Mapping[str, object]
    static: Assets
    vendor: Assets
    widgets: Assets

    @asynccontextmanager
    async def lifespan(self, _: Starlette) -> AsyncIterator[None]:
        """Keep one supervisor a robot for as long as the server runs."""
        async with asyncio.TaskGroup() as group:
            tasks = [group.create_task(station.run()) for station in self.stations.values()]
            yield
            for task in tasks:
                task.cancel()

    async def menu(self, request: Request) -> Response:
        head = Head(request.state.nonce, "URC")
        return HTMLResponse(menu_page(head, self.robots), headers=_PAGE)

    async def robot(self, request: Request) -> Response:
        name = request.path_params["name"]
        robot = self.robots.get(name)
        if robot is None:
            raise HTTPException(404, "No robot of that name is served here.")
        if missing_settings(robot):
            return RedirectResponse("/", status_code=303)
        interfaces = robot.profile.interfaces
        wanted = request.query_params.get("interface", next(iter(interfaces)))
        interface = interfaces.get(wanted)
        if interface is None:
            raise HTTPException(404, "This robot has no interface of that name.")
        html = robot_page(request.state.nonce, name, robot.profile, interface, self.modules)
        return HTMLResponse(html, headers=_PAGE)

    async def health(self, _: Request) -> Response:
        return JSONResponse({"status": "ok", "version": __version__}, headers=_PAGE)

    async def favicon(self, request: Request) -> Response:
        return self.static.respond("favicon.svg", request)

    async def static_file(self, request: Request) -> Response:
        return self.static.respond(request.path_params["file"], request)

    async def vendor_file(self, request: Request) -> Response:
        return self.vendor.respond(request.path_params["file"], request)

    async def widget_file(self, request: Request) -> Response:
        return self.widgets.respond(request.path_params["file"], request)

    async def socket(self, websocket: WebSocket) -> None:
        await websocket.accept()
        names = list(self.stations)
        default = names[0] if len(names) == 1 else ""
        station = self.stations.get(websocket.query_params.get("robot", default))
        if station is None:
            await websocket.close(wire.CLOSE_NO_ROBOT, "no robot of that name is served here")
            return
        await Client(websocket, station, websocket.scope["state"].get("flow")).serve()


async def _told(request: Request, error: Exception) -> Response:
    if not isinstance(error, HTTPException):
        raise error
    standard = HTTPStatus(error.status_code).phrase
    text = "There is no such page." if error.detail == standard == "Not Found" else error.detail
    html = error_page(request.state.nonce, error.status_code, text)
    headers = {**_PAGE, **(error.headers or {})}
    return HTMLResponse(html, status_code=error.status_code, headers=headers)


async def _broken(request: Request, _: Exception) -> Response:
    text = "Something broke inside URC. The server's log says what."
    return HTMLResponse(error_page(request.state.nonce, 500, text), 500, headers=_PAGE)
