"""A robot, its dashboard and its operator's sockets, in one worker of a browser.

Everything above the transports is what a server runs: the session with its engine, the motion
contract with a guard in the same process, the hub, the templates and the page's protocol. The robot
is the emulated robot of the profile.

A guard in the worker stops a robot of a page that goes silent. It cannot act while the worker
itself is busy, so the page must never run a check in this worker.
"""

import asyncio
import json
import shutil
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Final
from urllib.parse import parse_qs, urlsplit

from playground.checker import file_name
from playground.direct import transports_to
from playground.port import Port, PortSocket
from urc.alarms.alarm_list import AlarmActor
from urc.model.profile import Profile
from urc.model.values import Value
from urc.problems import ProblemsError, UrcError, to_text
from urc.runtime.document_tests import sample_settings
from urc.runtime.open_profile import open_document
from urc.runtime.session import Session
from urc.shipped import shipped, vendored
from urc.simulator.emulated_robot import EmulatedRobot
from urc.web.drive.redundant_socket import RedundantSocket
from urc.web.fleet.robots import Robot, RobotService
from urc.web.load.assets import import_map
from urc.web.page_socket import BrowserClient
from urc.web.show.interfaces import chosen
from urc.web.show.pages import RobotPageRequest, ServerParts, robot_page

__all__ = ["Playground"]

OPERATOR: Final = "this page"
"""Name of the only operator, for the alarms."""
NONCE: Final = "playground"
"""Static files have no policy that would ask for a nonce."""
_LOOK_S: Final = 0.02
"""Interval between two looks whether the earlier robot has been replaced, in seconds."""
_SHELVES: Final = ("drivers", "interfaces", "models")


class Playground:
    """One robot and its pages.

    Args:
        folder: folder for the documents.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._service: RobotService | None = None
        self._tasks: set[asyncio.Task[None]] = set()

    async def open(self, text: str) -> str | None:
        """Load a document as the robot, in place of an earlier one; return its name.

        Nothing is replaced while the earlier robot is not at rest: the result is then None.

        Raises:
            UrcError: the document has errors.
        """
        robot = self._robot(text)
        service = self._service
        if service is None:
            service = self._service = RobotService(robot)
            self._start(service.run())
        elif service.is_at_rest:
            service.replace(robot)
            # Until the switch, pages would show the earlier robot.
            while service.is_switching:  # noqa: ASYNC110  # the switch has no event
                await asyncio.sleep(_LOOK_S)
        else:
            return None
        return robot.profile.name

    def page(self, query: str) -> str:
        """Return the HTML of an interface of the robot, with the query of its URL.

        Raises:
            UrcError: the robot has no such interface.
        """
        robot = self._opened.robot
        asked = {name: values[0] for name, values in parse_qs(query, True).items()}
        interface = chosen(robot.profile, asked.get("interface"), "")
        if interface is None:
            raise UrcError("this robot has no interface of that name")
        request = RobotPageRequest(
            NONCE,
            tab=asked.get("tab", ""),
            is_watching="watch" in asked,
            is_part="part" in asked,
        )
        shared = ServerParts(import_map(vendored()))
        return robot_page(robot.profile.name, robot, interface, shared, request)

    def connect(self, url: str, port: Port) -> PortSocket:
        """Serve a socket of a page, by the URL that the page would open on a server."""
        line, service = PortSocket(port), self._opened
        if urlsplit(url).path.endswith("/spare"):
            work = RedundantSocket(line, service.controls, service.clock, line).serve()
        else:
            work = BrowserClient(line, service, line).serve()
        self._start(_served(work, line))
        return line

    async def ask(self, method: str, url: str, body: str = "") -> tuple[int, str]:
        """Answer a request of the page to its server; return status and JSON text."""
        path, service = urlsplit(url).path, self._opened
        asked: dict[str, Any] = json.loads(body or "{}")
        if method == "POST" and path.endswith("/stop"):
            service.controls.stop("another screen")
            is_confirmed = await service.deliver_stop()
            latched = service.controls.controller.lease.state.latched_by
            return 200, json.dumps({"latched": latched, "confirmed": is_confirmed})
        if method == "POST" and path.endswith("/alarms/acknowledge"):
            done = service.alarms.acknowledge(asked["alarms"], AlarmActor(OPERATOR))
            return 200, json.dumps({"done": list(done)})
        return 404, json.dumps({"error": "the playground has no server for this request"})

    @property
    def _opened(self) -> RobotService:
        if self._service is None:
            raise UrcError("no robot is open")
        return self._service

    def _robot(self, text: str) -> Robot:
        self._folder.mkdir(parents=True, exist_ok=True)
        for name in _SHELVES:
            if not (self._folder / name).exists():
                shutil.copytree(shipped("robots") / name, self._folder / name)
        file = self._folder / file_name(text)
        file.parent.mkdir(exist_ok=True)
        file.write_text(text, "utf-8", newline="")
        try:
            profile = open_document(file)
        except ProblemsError as fault:
            raise UrcError(to_text(fault.problems[0])) from fault
        settings: dict[str, Value] = {
            name: one.default for name, one in profile.settings.items() if one.default is not None
        }
        settings = {**sample_settings(profile.settings), **settings}
        emulated = EmulatedRobot(profile, settings, is_plain=True)
        return Robot(profile, settings, _opener(profile, settings, emulated), is_emulated=True)

    def _start(self, work: Any) -> None:
        task = asyncio.ensure_future(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


def _opener(
    profile: Profile, settings: Mapping[str, Value], emulated: EmulatedRobot
) -> Callable[[], Any]:
    @asynccontextmanager
    async def opened() -> AsyncIterator[Session]:
        table = transports_to(emulated, profile.driver)
        async with Session(profile, settings, table, motion="here") as session:
            yield session

    return opened


async def _served(work: Any, line: PortSocket) -> None:
    try:
        await work
    finally:
        await line.close()
