"""The HTTP API for one confirmed command to several robots of this and other sites.

Layer 5. All robots must declare the command alike, so that one value means the same for each robot.
Held commands are never sent to several robots: one person cannot watch all of them.
"""

import asyncio
from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import Final, NamedTuple

from starlette.requests import Request
from starlette.responses import Response

from urc.model.driver import Command
from urc.problems import UrcError
from urc.runtime.one_shot_commands import HELD
from urc.web.api.group_wire import GroupAnswer, GroupAsked, RobotReply
from urc.web.api.readings import plain
from urc.web.api.robots import RobotCalls
from urc.web.api.wire import CommandAsked, RobotSummary
from urc.web.fleet.robots import RobotService
from urc.web.serve.replies import ApiError, Endpoint, answer, answers_errors, body_of
from urc.web.serve.rights import DRIVE, WATCH
from urc.web.serve.visitor import Visitor, peer_of, visitor_of

__all__ = ["FarCommands", "GroupCalls"]

_NO_COMMAND: Final = "unknown-command"
AT_ONCE: Final = 8
"""Number of robots that run the command at the same time."""


class FarCommands(NamedTuple):
    """Commands of robots of other sites."""

    listed: Callable[[], Iterable[RobotSummary]]
    """Function that returns all known robots."""
    commands: Callable[[str], Awaitable[Mapping[str, Command]]]
    """Function that returns the commands of a robot; it raises `UrcError` without its site."""
    run: Callable[[str, str, CommandAsked, Visitor, str], Awaitable[RobotReply]]
    """Function that runs a command. The arguments are the robot, the command, the request, the
    visitor and the visitor's network address."""


class _Robot(NamedTuple):
    title: str
    tags: tuple[str, ...]
    service: RobotService | None
    """The robot's service; None for a robot of another site."""


class _Reason(NamedTuple):
    code: str
    message: str


class GroupCalls:
    """The endpoint for commands to several robots."""

    def __init__(
        self, services: Callable[[], Mapping[str, RobotService]], calls: RobotCalls
    ) -> None:
        """Create the endpoint.

        Args:
            services: function that returns the robots, keyed by their names in URLs.
            calls: the endpoints for one robot.
        """
        self._services = services
        self._calls = calls
        self.far: FarCommands | None = None
        """The robots of other sites; None for a server alone."""

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the endpoint, keyed by call name."""
        return {"group_command": self.command}

    @answers_errors
    async def command(self, request: Request) -> Response:
        """Run a command of several robots; return the result of each robot."""
        asked = await body_of(request, GroupAsked)
        if not (asked.robots or asked.tags):
            raise ApiError(400, 'name "robots" or "tags"', "no-robots")
        visitor = visitor_of(request)
        known = self._known(visitor)
        found = await self._found(asked, known)
        wanted = _wanted(asked, found)
        replies = {
            name: RobotReply(name, known[name].title if name in known else name, False, *reason)
            for name, one in found.items()
            if (reason := _refusal(one, wanted, visitor, name))
        }
        ready = [name for name in found if name not in replies]
        if ready and not asked.confirmed:
            text = f"{asked.command} for {len(ready)} robots needs a confirmation"
            raise ApiError(428, text, "not-confirmed")
        turns = asyncio.Semaphore(AT_ONCE)
        running = (self._run(request, name, known[name], asked, turns) for name in ready)
        replies |= {one.name: one for one in await asyncio.gather(*running)}
        return answer(GroupAnswer(tuple(replies[name] for name in found)))

    async def _found(
        self, asked: GroupAsked, known: Mapping[str, _Robot]
    ) -> dict[str, Command | _Reason]:
        """Return the command of each chosen robot, or why it is missing.

        A tag also contains robots without the command; they are left out.
        """
        chosen = [name for name, one in known.items() if not set(asked.tags).isdisjoint(one.tags)]
        names = tuple(dict.fromkeys((*asked.robots, *chosen)))
        commands = await asyncio.gather(
            *(self._command(name, known, asked.command) for name in names)
        )
        return {
            name: one
            for name, one in zip(names, commands, strict=True)
            if name in asked.robots or not isinstance(one, _Reason) or one.code != _NO_COMMAND
        }

    def _known(self, visitor: Visitor) -> dict[str, _Robot]:
        """Return the robots that the visitor may watch."""
        found = {
            name: _Robot(one.robot.profile.title or name, one.robot.profile.tags, one)
            for name, one in self._services().items()
        }
        for far in self.far.listed() if self.far is not None else ():
            found[far.name] = _Robot(far.title or far.name, far.tags, None)
        return {name: one for name, one in found.items() if visitor.may(WATCH, name)}

    async def _command(
        self, name: str, known: Mapping[str, _Robot], command: str
    ) -> "Command | _Reason":
        """Return the robot's command, or why it is missing."""
        robot = known.get(name)
        if robot is None:
            return _Reason("unknown-robot", "this server has no robot with that name")
        commands: Mapping[str, Command] = {}
        if robot.service is not None:
            commands = robot.service.robot.profile.driver.commands
        elif self.far is not None:
            try:
                commands = await self.far.commands(name)
            except UrcError as fault:
                return _Reason("site-failed", str(fault))
        return commands.get(command) or _Reason(_NO_COMMAND, f"{name} has no command {command!r}")

    async def _run(
        self,
        request: Request,
        name: str,
        robot: _Robot,
        asked: GroupAsked,
        turns: asyncio.Semaphore,
    ) -> RobotReply:
        """Run the command of one robot."""
        one = CommandAsked(asked.arguments, asked.timeout_s, confirmed=True)
        async with turns:
            if robot.service is None and self.far is not None:
                place = request.client.host if request.client else ""
                return await self.far.run(name, asked.command, one, visitor_of(request), place)
            if robot.service is None:
                raise ApiError(404, "this server has no robot with that name", "unknown-robot")
            try:
                values = await self._calls.run(
                    name, robot.service, peer_of(request, name), asked.command, one
                )
            except ApiError as failure:
                return RobotReply(name, robot.title, False, failure.code, failure.line)
        shown = {key: plain(value) for key, value in values.items()}
        return RobotReply(name, robot.title, True, values=shown)


def _wanted(asked: GroupAsked, found: Mapping[str, Command | _Reason]) -> Command:
    """Return the command of the first robot with it; raise `ApiError` if it cannot be sent."""
    wanted = next((one for one in found.values() if isinstance(one, Command)), None)
    if wanted is None:
        text = f"none of these robots has the command {asked.command!r}"
        raise ApiError(404, text, _NO_COMMAND)
    if any(isinstance(one, Command) and one.hold is not None for one in found.values()):
        raise ApiError(409, HELD, "held")
    return wanted


def _refusal(
    one: Command | _Reason, wanted: Command, visitor: Visitor, name: str
) -> _Reason | None:
    """Return why a robot does not get the command; None if it does."""
    if isinstance(one, _Reason):
        return one
    if one.arguments != wanted.arguments:
        return _Reason("other-arguments", f"{name} declares other arguments for {one.name}")
    if not visitor.may(DRIVE, name):
        return _Reason("forbidden", DRIVE.refusal)
    return None
