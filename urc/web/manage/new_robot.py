"""The page for a new ROS robot: find its topics, choose, and drive, without writing a document.

Layer 5. The page's robot is an installed package like any other, so the manager pages list and
remove it. Its address and topics are settings.
"""

import asyncio
import re
from dataclasses import dataclass
from typing import Final
from urllib.parse import quote

import yaml
from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

from urc.packages.archive import PACKAGE, write_archive
from urc.packages.install import plan_file
from urc.packages.manifest import LANGUAGE, MANIFEST
from urc.packages.names import PackageId
from urc.packages.package import open_package
from urc.packages.sources import FileSource
from urc.problems import UrcError
from urc.runtime.registries import built_in_catalog
from urc.runtime.ros_profile import (
    PARTS,
    STAMPED,
    BaseProfile,
    candidates,
    document_of,
    settings_of,
)
from urc.runtime.ros_survey import survey
from urc.runtime.server_recorder import ServerRecorder
from urc.runtime.settings_store import StoredSettings
from urc.web.manage.jobs import Busy
from urc.web.manage.manager import Manager
from urc.web.manage.wire import FoundTopic, NewRobot, NewRobotAdded, TopicsAsked, TopicsFound
from urc.web.serve.actors import actor_of
from urc.web.serve.replies import ApiError, Endpoint, answer, body_of, told
from urc.web.serve.rights import MAINTAIN_SERVER, SIGNED_IN, ProtectedRoute
from urc.web.serve.visitor import visitor_of
from urc.web.show.menu import Nav, NavigationLinks
from urc.web.show.pages import PageHead, render
from urc.web.words import t

__all__ = ["NewRobotPage", "NewRobotRoutes"]

_NO_STORE: Final = {"cache-control": "no-store"}
_VERSION: Final = "0.0.1"
_NOT_NAME: Final = re.compile("[^a-z0-9]+")


@dataclass(frozen=True, slots=True)
class NewRobotPage:
    """Context for ``new_robot.html.j2``."""

    head: PageHead
    nav: Nav
    parts: dict[str, str]
    """Title of each part of a robot, keyed by part."""
    needed: tuple[str, ...]
    """Parts without which the robot cannot be driven."""
    may_manage: bool
    is_shown: bool
    """Whether the menu shows installed robots."""


class NewRobotRoutes:
    """The routes of the page."""

    def __init__(self, manager: Manager, ways: NavigationLinks, recorder: ServerRecorder) -> None:
        """Create the routes.

        Args:
            manager: the operations on packages and robots.
            ways: navigation links of this server.
            recorder: receives an entry for each new robot.
        """
        self._manager = manager
        self._ways = ways
        self._recorder = recorder
        self._is_asking = False
        self._adding = asyncio.Lock()

    def routes(self) -> list[ProtectedRoute]:
        """Return the route of the page."""
        return [ProtectedRoute("/new", self.page, SIGNED_IN)]

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the API endpoints, keyed by call name."""
        return {"topics_find": self.find, "robots_add": self.add}

    async def page(self, request: Request) -> Response:
        """Show the page."""
        page = NewRobotPage(
            PageHead(request.state.nonce, t("New ROS robot")),
            Nav("new", self._ways),
            {
                "cmd_vel": t("Commands"),
                "odom": t("Position of the robot"),
                "scan": t("Laser scanner"),
                "camera": t("Camera"),
                "battery": t("Battery"),
                "map": t("Map"),
                "imu": t("Attitude"),
            },
            ("cmd_vel", "odom"),
            visitor_of(request).may(MAINTAIN_SERVER),
            self._manager.factory.robot_options.shows_installed,
        )
        return HTMLResponse(render("new_robot.html.j2", page), headers=_NO_STORE)

    async def find(self, request: Request) -> Response:
        """Connect to an address and return the topics that fit the parts of a robot."""
        try:
            said = await body_of(request, TopicsAsked)
            if self._is_asking:
                raise Busy(t("another address is already being tried"))
            self._is_asking = True
            try:
                found = await survey(built_in_catalog().transports, said.host.strip(), said.port)
            finally:
                self._is_asking = False
        except ApiError as refusal:
            return told(refusal.status, refusal.line, refusal.code)
        except Busy as error:
            return told(409, str(error))
        except UrcError as error:
            return told(422, str(error).strip().partition("\n")[0])
        parts = {
            part: tuple(FoundTopic(name, kind) for name, kind in fits)
            for part, fits in candidates(found.topics).items()
        }
        version = found.topics.version or 2
        return answer(TopicsFound(found.via, found.port, version, found.topics.total, parts))

    async def add(self, request: Request) -> Response:
        """Write the robot's document, install it, and return the path of its page."""
        try:
            said = await body_of(request, NewRobot)
            if not self._manager.factory.robot_options.shows_installed:
                text = t(
                    "To add robots on this page, start URC without a profile or with --installed."
                )
                raise ApiError(409, text)
            async with self._adding:
                name = await self._add(said)
        except ApiError as refusal:
            return told(refusal.status, refusal.line, refusal.code)
        except UrcError as error:
            return told(422, str(error).strip().partition("\n")[0])
        except OSError as error:
            return told(503, f"{error.filename or 'the disk'}: {error.strerror or error}")
        self._recorder.package_changed(actor_of(request), "install", [f"robots/{name} {_VERSION}"])
        return answer(NewRobotAdded(name, f"/robots/{quote(name, safe='')}/"), 201)

    async def _add(self, said: NewRobot) -> str:
        manager = self._manager
        installed = await asyncio.to_thread(manager.factory.store.installed)
        taken = {*manager.fleet.robots, *manager.fleet.broken, *(one.key.name for one in installed)}
        title = " ".join(said.title.split()) or t("New ROS robot")
        base = BaseProfile(
            name=_free_name(title, taken),
            title=title,
            host=said.host.strip(),
            port=said.port,
            via=said.via,
            version=said.version,
            topics={part.name: said.topics.get(part.name, "") for part in PARTS},
            is_stamped=said.command_type == STAMPED,
        )
        await asyncio.to_thread(self._install, base)
        await manager.changed()
        if base.name in manager.fleet.broken:
            raise UrcError(manager.fleet.broken[base.name].fault)
        return base.name

    def _install(self, base: BaseProfile) -> None:
        """Install the robot's package with its settings."""
        factory = self._manager.factory
        source = _source_of(base)
        plan = plan_file(source, (), factory.store, lambda _: None)
        kept = StoredSettings(settings=settings_of(base), package=f"robots/{base.name}")
        factory.settings_store(base.name).save(kept)
        with factory.store.changing() as change:
            change.stage(plan)
            change.commit(plan)


def _source_of(base: BaseProfile) -> FileSource:
    """Return the package source of a new robot."""
    key = PackageId("robot", base.name)
    manifest = {
        "urc": LANGUAGE,
        "package": "robot",
        "name": base.name,
        "version": _VERSION,
        "licence": "LicenseRef-own",
        "authors": ["URC"],
        "summary": base.title,
    }
    files = {
        MANIFEST: yaml.safe_dump(manifest, sort_keys=False, allow_unicode=True).encode(),
        "robot.yaml": document_of(base).encode(),
    }
    package = open_package(write_archive(files, PACKAGE, str(key)), str(key))
    source = FileSource(str(key), [package], [key])
    source.is_folder = True  # the document was written on this machine, so it is the user's own
    return source


def _free_name(title: str, taken: set[str]) -> str:
    """Return an unused name of a package, made from a title."""
    stem = _NOT_NAME.sub("-", title.lower()).strip("-")[:40].strip("-")
    stem = stem if stem and stem[0].isalpha() else f"robot-{stem}".strip("-")
    names = (stem, *(f"{stem}-{number}" for number in range(2, 1000)))
    name = next((one for one in names if one not in taken), "")
    if not name:
        raise UrcError(t("there are too many robots with this name"))
    return name
