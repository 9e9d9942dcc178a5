"""The HTTP API for STOP: of one robot, and of several robots of this and other sites.

Layer 5. STOP needs no right. A choice by tag, or of all robots, has one limit: of other sites, it
contains only the robots that the visitor may watch.
"""

import asyncio
import secrets
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from starlette.requests import Request
from starlette.responses import Response

from urc.runtime.server_recorder import ServerRecorder
from urc.web.api.local_stops import LocalStops
from urc.web.api.stop import delivered_stop, press_stop
from urc.web.api.stop_wire import RobotStop, StopAnswer, StopAsked
from urc.web.api.wire import RobotSummary
from urc.web.fleet.fleet import service_of
from urc.web.fleet.robots import RobotService
from urc.web.serve.actors import stopper_of
from urc.web.serve.replies import ApiError, Endpoint, answer, answers_errors, body_of
from urc.web.serve.rights import WATCH
from urc.web.serve.visitor import Visitor, visitor_of

__all__ = ["FarRobots", "StopCalls"]

WITHIN_S: Final = 0.7
"""Longest wait for the robots of this server, in seconds. Other sites have 0.75 s, so the reply
arrives within one second."""
_AT: Final = "@"


class FarRobots(NamedTuple):
    """The robots of other sites."""

    listed: Callable[[], Iterable[RobotSummary]]
    """Function that returns all known robots."""
    stop: Callable[[Sequence[str], StopAsked, Visitor, str, str], Awaitable[list[RobotStop]]]
    """Function that stops robots. The arguments are the names, the request with its choice, the
    visitor, the visitor's network address and the identifier of the STOP."""


class StopCalls:
    """The STOP endpoints."""

    def __init__(
        self,
        services: Callable[[], Mapping[str, RobotService]],
        recorder: ServerRecorder,
    ) -> None:
        """Create the endpoints.

        Args:
            services: function that returns the robots, keyed by their names in URLs.
            recorder: receives audit entries for STOP by visitors who have not signed in.
        """
        self._services = services
        self._recorder = recorder
        self.far: FarRobots | None = None
        """The robots of other sites; None for a server alone."""
        self.local = LocalStops(services, recorder)

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the endpoints, keyed by call name."""
        return {"stop": self.stop, "stop_several": self.stop_several}

    @answers_errors
    async def stop(self, request: Request) -> Response:
        """Stop a robot and latch STOP; pages without a working socket use this request."""
        name, service = service_of(self._services(), request)
        press_stop(name, service, stopper_of(request, name), self._recorder)
        return answer(await delivered_stop(service))

    @answers_errors
    async def stop_several(self, request: Request) -> Response:
        """Stop several robots and latch their STOPs; return the result of each robot."""
        asked = await body_of(request, StopAsked)
        if not (asked.robots or asked.tags or asked.all):
            raise ApiError(400, 'name "robots" or "tags", or set "all" to true', "no-robots")
        visitor = visitor_of(request)
        names, unknown = self._selected(asked, visitor)
        stop_id = secrets.token_hex(8)
        far = [one for one in names if self._is_far(one)]
        near = [one for one in names if not self._is_far(one)]
        place = request.client.host if request.client else ""
        found = await asyncio.gather(
            self.local.stop(near, lambda name: stopper_of(request, name), stop_id, WITHIN_S),
            self._far_stop(far, asked, visitor, place, stop_id),
        )
        results = {one.name: one for group in found for one in group}
        if not results and unknown:
            raise ApiError(404, f"no robot has the tag {', '.join(unknown)}", "unknown-tag")
        robots = [results.pop(name) for name in names]
        if results:
            unknown = []  # a site has found robots that this server does not know yet
        return answer(StopAnswer(stop_id, (*robots, *results.values()), tuple(unknown)))

    async def _far_stop(
        self, names: Sequence[str], asked: StopAsked, visitor: Visitor, place: str, stop_id: str
    ) -> list[RobotStop]:
        if self.far is None or not (names or asked.tags or asked.all):
            return []
        return await self.far.stop(names, asked, visitor, place, stop_id)

    def _is_far(self, name: str) -> bool:
        return self.far is not None and _AT in name and name not in self._services()

    def _selected(self, asked: StopAsked, visitor: Visitor) -> tuple[list[str], list[str]]:
        """Return the names of the robots, each once, and the tags that no robot has."""
        tags = dict(self.local.tags())
        for one in self.far.listed() if self.far is not None else ():
            if one.can_stop and visitor.may(WATCH, one.name):
                tags[one.name] = one.tags
        wanted = frozenset(asked.tags)
        chosen = [name for name, own in tags.items() if asked.all or not wanted.isdisjoint(own)]
        known = {tag for own in tags.values() for tag in own}
        names = list(dict.fromkeys((*asked.robots, *chosen)))
        return names, [tag for tag in asked.tags if tag not in known]
