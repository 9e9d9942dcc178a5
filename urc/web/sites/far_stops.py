"""STOP of robots of several sites for one visitor of this server.

Layer 5. The audit log of this server gets an entry for each robot, with the identifier that the
audit log of the robot's site also contains.
"""

import asyncio
from collections.abc import Sequence

from urc.runtime.server_recorder import Actor, ServerRecorder
from urc.web.api.stop_wire import RobotStop
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

    def __init__(self, stops: SiteStops, watch: SiteWatch, recorder: ServerRecorder) -> None:
        """Create the object.

        Args:
            stops: requests to the sites.
            watch: the known robots of the sites.
            recorder: receives an audit entry for each robot.
        """
        self._stops = stops
        self._watch = watch
        self._recorder = recorder

    async def stop(
        self, names: Sequence[str], visitor: Visitor, place: str, stop_id: str
    ) -> list[RobotStop]:
        """Stop robots, and return the result of each robot in the order of `names`.

        Args:
            names: names of robots of other sites in URLs of this server.
            visitor: the person or program that presses STOP.
            place: network address of the visitor.
            stop_id: identifier of this STOP.
        """
        by_site: dict[str, list[FarName]] = {}
        for name in names:
            if (far := far_name(name)) is not None:
                by_site.setdefault(far.site, []).append(far)
        asking = (
            self._stop_site(site, group, visitor, place, stop_id) for site, group in by_site.items()
        )
        found = {one.name: one for group in await asyncio.gather(*asking) for one in group}
        return [found[name] for name in names]

    async def _stop_site(
        self, site: str, robots: Sequence[FarName], visitor: Visitor, place: str, stop_id: str
    ) -> list[RobotStop]:
        who = visitor.identity
        roles = {one.robot: visitor.role(str(one)) for one in robots}
        stopper = SiteStopper(who.principal, who.name or place, who.kind or None, place)
        asked = SiteStopAsked(stop_id, roles, stopper)
        actor = Actor(who.name, who.principal, who.kind, "", who.way, place, who.sign_in)

        def record(_: str, again: SiteStopAsked, answer: SiteStopAnswer) -> None:
            self._record(actor, again, self._results(site, again, answer))

        try:
            answer = await self._stops.stop(site, asked, record)
            results = self._results(site, asked, answer)
        except SiteFailed as fault:
            reason = f"{fault}; {_ADVICE}"
            results = [RobotStop(str(one), self._title(one), "no-link", reason) for one in robots]
        self._record(actor, asked, results)
        return results

    def _results(self, site: str, asked: SiteStopAsked, answer: SiteStopAnswer) -> list[RobotStop]:
        """Return the results of a site with the names of this server."""
        said = {one.name: one for one in answer.robots}
        found = []
        for robot in asked.robots:
            far, one = FarName(robot, site), said.get(robot)
            if one is None:
                reason = f"the site {site} has not answered for this robot"
                found.append(RobotStop(str(far), self._title(far), "no-link", reason))
            else:
                found.append(RobotStop(str(far), one.title, one.result, one.reason))
        return found

    def _title(self, far: FarName) -> str:
        known = self._watch.sites.get(far.site)
        one = known.robots.get(far.robot) if known is not None else None
        return one.summary.title if one is not None and one.summary.title else far.robot

    def _record(self, actor: Actor, asked: SiteStopAsked, results: Sequence[RobotStop]) -> None:
        for role, one in zip(asked.robots.values(), results, strict=True):
            who = actor._replace(role=role or "")
            outcome = f"{one.result}: {one.reason}" if one.reason else one.result
            self._recorder.far_stop(who, one.name, asked.id, outcome)
