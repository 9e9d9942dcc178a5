"""The developer start page: robots with their fixed settings, and a button to reload documents.

Layer 5. These routes exist only with ``--dev`` and require the start key. The developer page loads
a document as soon as it is saved. The start page's button reloads all documents of a robot, even if
the server has not noticed a change.
"""

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from urllib.parse import quote

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from urc.problems import UrcError
from urc.runtime.open_profile import open_document
from urc.web.dev.watch import Remake
from urc.web.fleet.fleet import Fleet
from urc.web.fleet.robots import Robot
from urc.web.manage.wire import ReloadResult
from urc.web.serve.replies import Endpoint, answer, told
from urc.web.serve.rights import LOCAL, SIGNED_IN, ProtectedRoute
from urc.web.show.menu import Nav, NavigationLinks, SettingRow, setting_row
from urc.web.show.pages import PageHead, render
from urc.web.words import t

__all__ = ["DevStart", "DevStartPage", "no_dev_start"]

_NO_STORE = {"cache-control": "no-store"}


@dataclass(frozen=True, slots=True)
class PinnedRobot:
    """One robot on the start page, with the fixed settings that the start page uses."""

    name: str
    title: str
    file: str
    interface: str
    rows: tuple[SettingRow, ...]
    start_url: str
    dev_url: str


@dataclass(frozen=True, slots=True)
class DevStartPage:
    """Context for ``dev_start.html.j2``: the fixed settings and the start button."""

    head: PageHead
    nav: Nav
    robots: tuple[PinnedRobot, ...]


class DevStart:
    """The developer start page and the action of its start button."""

    def __init__(
        self,
        fleet: Fleet,
        remake: Mapping[str, Remake],
        take: Callable[[str, Robot], None],
        ways: NavigationLinks,
    ) -> None:
        """Create the page.

        Args:
            fleet: the robots.
            remake: functions that create a robot from a new version of its profile, keyed by robot
                name.
            take: function that switches to a new version of a robot; may raise `UrcError`.
            ways: navigation links of this server.
        """
        self._fleet = fleet
        self._remake = remake
        self._take = take
        self._ways = ways

    def routes(self) -> list[ProtectedRoute]:
        """Return the start page's route."""
        return [ProtectedRoute("/dev", self.page, LOCAL)]

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the endpoint of the page's button, keyed by call name."""
        return {"dev_start": self.start}

    async def page(self, request: Request) -> Response:
        """Return the start page."""
        head = PageHead(request.state.nonce, t("Dev interface"))
        robots = tuple(
            _fixed(name, self._fleet.robots[name])
            for name in self._remake
            if name in self._fleet.robots
        )
        page = DevStartPage(head, Nav("dev", self._ways), robots)
        return HTMLResponse(render("dev_start.html.j2", page), headers=_NO_STORE)

    async def start(self, request: Request) -> Response:
        """Reload all documents of a robot and return the robot's URL."""
        name = request.path_params["name"]
        if name not in self._remake or name not in self._fleet.robots:
            return told(404, "this server has no robot with that name")
        driver = self._fleet.driven_by(name)
        if driver:
            return told(409, f"{name} is being driven ({driver}): release the controls first")
        try:
            robot = await asyncio.to_thread(self._read, name)
            self._take(name, robot)
        except (UrcError, OSError) as error:
            return told(422, str(error).strip().partition("\n")[0])
        return answer(ReloadResult(t("reloaded"), f"/robots/{quote(name, safe='')}/"))

    def _read(self, name: str) -> Robot:
        return self._remake[name](open_document(self._fleet.robots[name].profile.file))


def no_dev_start() -> list[ProtectedRoute]:
    """Return a route for servers without ``--dev``, which explains how to enable the page."""

    async def tell(_: Request) -> Response:
        raise HTTPException(404, t("This page is disabled. Start URC with --dev to enable it."))

    return [ProtectedRoute("/dev", tell, SIGNED_IN)]


def _fixed(name: str, robot: Robot) -> PinnedRobot:
    profile = robot.profile
    place = quote(name, safe="")
    first = next(iter(profile.interfaces.values()), None)
    return PinnedRobot(
        name=name,
        title=profile.title or name,
        file=profile.file,
        interface=(first.title or first.name) if first is not None else "",
        rows=tuple(
            setting_row(one, robot.settings.get(one.name, one.default))
            for one in profile.settings.values()
        ),
        start_url=f"/api/v1/robots/{place}/dev/start",
        dev_url=f"/robots/{place}/dev",
    )
