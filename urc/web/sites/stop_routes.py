"""The route by which another site stops robots of this site.

Layer 5. One request stops all robots that the other site names. TLS has proven the other site; STOP
needs no right, so the visitor's name and role are only for the audit log.
"""

from typing import Annotated

import msgspec
from starlette.requests import Request
from starlette.responses import Response

from urc.access.directory import Kind
from urc.model.role import Role
from urc.motion.lease import Operator
from urc.web.api.local_stops import LocalStops
from urc.web.api.stop_wire import RobotStop
from urc.web.serve.replies import answer, answers_errors, body_of
from urc.web.serve.rights import SITE, ProtectedRoute

__all__ = ["STOP", "SiteStopAnswer", "SiteStopAsked", "StopRoutes", "SiteStopper"]

STOP = "/fleet/stop"
MAX_ROBOTS = 5000

_Word = Annotated[str, msgspec.Meta(max_length=200)]


class SiteStopper(msgspec.Struct, frozen=True):
    """The visitor of another site who pressed STOP."""

    principal: _Word
    """Identifier at the other site; "" for a visitor without a sign-in."""
    name: _Word
    kind: Kind | None = None
    """Kind of the principal; null for a visitor without a sign-in."""
    place: _Word = ""
    """Network address of the visitor at the other site."""


class SiteStopAsked(msgspec.Struct, frozen=True):
    """STOP of robots of this site; other sites may be newer, so unknown keys are ignored."""

    id: Annotated[str, msgspec.Meta(min_length=1, max_length=64)]
    """Identifier of this STOP; a repetition has the same identifier."""
    robots: Annotated[dict[_Word, Role | None], msgspec.Meta(max_length=MAX_ROBOTS)]
    """The visitor's role for each robot, by the robot's name at this site."""
    who: SiteStopper
    tags: Annotated[tuple[_Word, ...], msgspec.Meta(max_length=MAX_ROBOTS)] = ()
    """Tags of further robots; this site knows its robots better than another site."""
    all: bool = False
    """Whether to stop all robots of this site that can move."""
    role: Role | None = None
    """The visitor's role for the robots that `tags` and `all` choose."""
    within_s: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.4
    """Longest wait for the robots, in seconds."""


class SiteStopAnswer(msgspec.Struct, frozen=True):
    """The result of each robot, with the names at this site."""

    robots: tuple[RobotStop, ...]


class StopRoutes:
    """The route of a server that belongs to a fleet."""

    def __init__(self, stops: LocalStops) -> None:
        self._stops = stops

    def routes(self) -> list[ProtectedRoute]:
        """Return the route."""
        return [ProtectedRoute(STOP, self.stop, SITE, methods=["POST"])]

    @answers_errors
    async def stop(self, request: Request) -> Response:
        """Stop robots, and return the result of each robot."""
        asked = await body_of(request, SiteStopAsked)
        site = request.scope["state"]["site"].name
        wanted = frozenset(asked.tags)
        tags = self._stops.tags()
        more = [one for one, own in tags.items() if asked.all or not wanted.isdisjoint(own)]
        names = tuple(dict.fromkeys((*asked.robots, *more)))
        found = await self._stops.stop(
            names, lambda name: _operator(asked, site, name), asked.id, asked.within_s
        )
        return answer(SiteStopAnswer(tuple(found)))


def _operator(asked: SiteStopAsked, site: str, robot: str) -> Operator:
    """Return the visitor under the same names as `urc.access.visits` gives."""
    who = asked.who
    name = f"{who.name or who.place} ({site})" if who.name or who.place else site
    if not who.principal:
        return Operator("", name, None, place=who.place)
    principal = f"{site}/{who.principal}"
    return Operator(
        "",
        name,
        asked.robots.get(robot, asked.role),
        who=name,
        principal=principal,
        person=principal,
        way="site",
        place=who.place,
        kind=who.kind or "",
    )
