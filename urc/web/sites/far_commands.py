"""Commands to robots of other sites for a visitor of this server, as the gateway passes them on.

Layer 5. Each request carries an assertion for its robot, so the robot's site checks the rights.
"""

from collections.abc import Mapping
from urllib.parse import quote

import msgspec

from urc.model.driver import Command
from urc.web.api.group_wire import RobotReply
from urc.web.api.wire import CommandAnswer, CommandAsked
from urc.web.serve.replies import Failure
from urc.web.serve.visitor import Visitor
from urc.web.sites.robot_names import FarName, far_name
from urc.web.sites.site_client import SiteClient, SiteFailed
from urc.web.sites.site_watch import SiteWatch
from urc.web.sites.visitor_proof import VisitorProofs

__all__ = ["FarCommandCalls"]

_JSON = (b"content-type", b"application/json")


class FarCommandCalls:
    """Runs commands of robots of other sites."""

    def __init__(self, client: SiteClient, watch: SiteWatch, proofs: VisitorProofs) -> None:
        """Create the object.

        Args:
            client: requests to other sites.
            watch: the known robots of the sites.
            proofs: headers that tell the other site who acts.
        """
        self._client = client
        self._watch = watch
        self._proofs = proofs

    async def commands(self, name: str) -> Mapping[str, Command]:
        """Return the commands of a robot; raise `UrcError` if its site cannot be reached."""
        found = await self._watch.robot(_far(name))
        return found.profile.driver.commands

    async def run(
        self, name: str, command: str, asked: CommandAsked, visitor: Visitor, place: str
    ) -> RobotReply:
        """Run a command, and return its result."""
        far = _far(name)
        known = self._watch.sites.get(far.site)
        one = known.robots.get(far.robot) if known is not None else None
        title = one.summary.title if one is not None and one.summary.title else name
        proof = self._proofs.header(visitor, place, far)
        headers = (_JSON,) if proof is None else (_JSON, proof)
        robot, wanted = quote(far.robot, safe=""), quote(command, safe="")
        target = f"/api/v1/robots/{robot}/commands/{wanted}"
        body = msgspec.json.encode(asked)
        try:
            asking = self._client.request(far.site, "POST", target, headers, body, lane="control")
            async with asking as response:
                text = await response.whole()
            if response.status == 200:
                values = msgspec.json.decode(text, type=CommandAnswer).values
                return RobotReply(name, title, True, values=values)
            failure = msgspec.json.decode(text, type=Failure)
            return RobotReply(name, title, False, failure.code, failure.message)
        except (SiteFailed, msgspec.MsgspecError) as fault:
            return RobotReply(name, title, False, "site-failed", str(fault))


def _far(name: str) -> FarName:
    found = far_name(name)
    if found is None:
        raise SiteFailed(f"{name} is not a robot of another site")
    return found
