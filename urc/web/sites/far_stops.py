"""STOP of robots of several sites for one visitor of this server.

Layer 5. The audit log of this server gets an entry for each robot, with the identifier that the
audit log of the robot's site also contains.
"""

import asyncio
from collections.abc import Callable, Sequence

from urc.runtime.server_recorder import Actor, ServerRecorder
from urc.web.api.stop_wire import RobotStop, StopAsked
from urc.web.serve.visitor import Visitor
from urc.web.sites.robot_names import FarName, far_name
from urc.web.sites.site_client import SiteFailed
from urc.web.sites.site_stops import SiteStops
from urc.web.sites.site_watch import SiteWatch
from urc.web.sites.stop_routes import SiteStopAnswer, SiteStopAsked, SiteStopper

__all__ = ["FarStops"]

_ADVICE = "use the robot's own stop switch; URC repeats STOP"


class FarStops:
    """Stops robots of other sites."""

    def __init__(
        self,
        stops: SiteStops,
        watch: SiteWatch,
        present: Callable[[], frozenset[str]],
        recorder: ServerRecorder,
    ) -> None:
        """Create the object.

        Args:
            stops: requests to the sites.
            watch: the known robots of the sites.
            present: function that returns the sites that can be reached.
            recorder: receives an audit entry for each robot.
        """
        self._stops = stops
        self._watch = watch
        self._present = present
        self._recorder = recorder

    async def stop(
        self, names: Sequence[str], chosen: StopAsked, visitor: Visitor, place: str, stop_id: str
    ) -> list[RobotStop]:
        """Stop robots, and return the result of each robot.

        If the visitor may watch all robots, each site also applies the choice by tag itself. The
        list that this server has of a site may be old.

        Args:
            names: names of robots of other sites in URLs of this server.
            chosen: the request, with its choice by tag or of all robots.
            visitor: the person or program that presses STOP.
            place: network address of the visitor.
            stop_id: identifier of this STOP.
        """
        who = visitor.identity
        stopper = SiteStopper(who.principal, who.name or place, who.kind or None, place)
        asked: dict[str, SiteStopAsked] = {}
        if (chosen.tags or chosen.all) and (role := visitor.role()) is not None:
            for site in self._present():
                is_all = chosen.all or site in chosen.tags
                asked[site] = SiteStopAsked(stop_id, {}, stopper, chosen.tags, is_all, role)
        for far in filter(None, map(far_name, names)):
            one = asked.setdefault(far.site, SiteStopAsked(stop_id, {}, stopper))
            one.robots[far.robot] = visitor.role(str(far))
        actor = Actor(who.name, who.principal, who.kind, "", who.way, place, who.sign_in)
        asking = (self._stop_site(site, one, actor) for site, one in asked.items())
        return [one for group in await asyncio.gather(*asking) for one in group]

    async def _stop_site(self, site: str, asked: SiteStopAsked, actor: Actor) -> list[RobotStop]:
        def record(_: str, again: SiteStopAsked, answer: SiteStopAnswer) -> None:
            self._record(actor, again, self._results(site, again, answer))

        try:
            results = self._results(site, asked, await self._stops.stop(site, asked, record))
        except SiteFailed as fault:
            reason = f"{fault}; {_ADVICE}"
            robots = [FarName(robot, site) for robot in asked.robots]
            results = [RobotStop(str(one), self._title(one), "no-link", reason) for one in robots]
            # Without a list of the site, its own name stands for its robots.
            results = results or [RobotStop(f"@{site}", site, "no-link", reason)]
        self._record(actor, asked, results)
        return results

    def _results(self, site: str, asked: SiteStopAsked, answer: SiteStopAnswer) -> list[RobotStop]:
        """Return the results of a site with the names of this server."""
        found = [
            RobotStop(str(FarName(one.name, site)), one.title, one.result, one.reason)
            for one in answer.robots
        ]
        told = {one.name for one in answer.robots}
        reason = f"the site {site} has not answered for this robot"
        silent = [FarName(robot, site) for robot in asked.robots if robot not in told]
        return [
            *found,
            *(RobotStop(str(one), self._title(one), "no-link", reason) for one in silent),
        ]

    def _title(self, far: FarName) -> str:
        known = self._watch.sites.get(far.site)
        one = known.robots.get(far.robot) if known is not None else None
        return one.summary.title if one is not None and one.summary.title else far.robot

    def _record(self, actor: Actor, asked: SiteStopAsked, results: Sequence[RobotStop]) -> None:
        for one in results:
            far = far_name(one.name)
            role = asked.robots.get(far.robot, asked.role) if far is not None else asked.role
            outcome = f"{one.result}: {one.reason}" if one.reason else one.result
            who = actor._replace(role=role or "")
            self._recorder.far_stop(who, one.name, asked.id, outcome)
