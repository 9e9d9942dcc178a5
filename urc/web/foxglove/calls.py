"""Calls of a robot's services by one visitor, with the checks of the HTTP API.

Layer 5. A call runs a command with the same rights, limits, interlock, confirmations and audit
entries as in the HTTP API.
"""

from collections.abc import Callable, Mapping
from typing import Protocol

from urc.model.role import includes
from urc.model.values import Reading
from urc.motion.lease import Operator
from urc.runtime.json_messages import as_json
from urc.runtime.server_recorder import ServerRecorder
from urc.web.api.stop import delivered_stop, press_stop
from urc.web.api.wire import CommandAsked
from urc.web.feed.client_socket import SocketPeer
from urc.web.fleet.robots import RobotService
from urc.web.foxglove.offers import Offer
from urc.web.foxglove.services import BadRequest, request_of
from urc.web.serve.replies import ApiError
from urc.web.serve.rights import DRIVE

__all__ = ["CallFailed", "FoxgloveCalls", "RunCommand"]


class CallFailed(Exception):
    """The failure of a call, as one line of text."""


class RunCommand(Protocol):
    """A function that runs a command; see `urc.web.api.robots.RobotCalls.run`."""

    async def __call__(
        self, name: str, service: RobotService, peer: SocketPeer, wanted: str, asked: CommandAsked
    ) -> Mapping[str, Reading]:
        """Run a command and return the values of its reply; raise `ApiError` if it fails."""


class FoxgloveCalls:
    """Runs the service calls of one visitor."""

    def __init__(
        self, run: RunCommand, visitor: Callable[[str], Operator], recorder: ServerRecorder
    ) -> None:
        """Prepare the calls.

        Args:
            run: function that runs a command.
            visitor: function that returns the visitor as an operator of a robot.
            recorder: receives an audit entry for a STOP by a visitor who has not signed in.
        """
        self._run = run
        self._visitor = visitor
        self._recorder = recorder

    async def run(self, offer: Offer, command: str, data: bytes) -> bytes:
        """Run a command and return its reply as JSON text.

        Args:
            offer: the robot.
            command: name of the command.
            data: the request, as JSON text.

        Raises:
            CallFailed: the request is invalid, or the command was refused or has failed.
        """
        if not includes(offer.role, "drive"):
            self._refuse(offer, command, DRIVE.refusal)
        try:
            arguments, is_confirmed = request_of(data)
            asked = CommandAsked(arguments=arguments, confirmed=is_confirmed)
            values = await self._run(offer.name, offer.service, offer.peer, command, asked)
        except BadRequest as fault:
            raise CallFailed(str(fault)) from None
        except ApiError as failure:
            raise CallFailed(failure.line) from None
        return as_json(values)

    def press_stop(self, offer: Offer) -> None:
        """Stop a robot and latch its STOP before returning; raise `ApiError` if it cannot move."""
        press_stop(offer.name, offer.service, self._visitor(offer.name), self._recorder)

    async def delivered_stop(self, offer: Offer) -> bytes:
        """Wait a short time until the robot receives a STOP; return the result as JSON text."""
        result = await delivered_stop(offer.service)
        return as_json({"latched": result.latched, "confirmed": result.confirmed})

    def _refuse(self, offer: Offer, command: str, reason: str) -> None:
        controls = offer.service.controls
        who, now_s = self._visitor(offer.name), offer.service.clock.now()
        controls.recorder.refused(who, command, reason, now_s)
        raise CallFailed(reason)
