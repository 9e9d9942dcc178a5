"""STOP of several robots of this server: all are stopped first, then their results are awaited.

Layer 5. A robot that is not connected is connected for its stop. The reply does not wait for it:
the attempt goes on in the background.
"""

import asyncio
import logging
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from typing import Final

from urc.motion.lease import Operator
from urc.runtime.server_recorder import ServerRecorder
from urc.web.api.stop import can_stop, press_stop
from urc.web.api.stop_wire import RobotStop
from urc.web.fleet.robots import RobotService, SessionFailed
from urc.web.serve.replies import ApiError

__all__ = ["LocalStops"]

_KNOWN_STOPS: Final = 256
"""Number of identifiers whose repetition is recognised."""

log = logging.getLogger(__name__)


class LocalStops:
    """Stops robots of this server."""

    def __init__(
        self, services: Callable[[], Mapping[str, RobotService]], recorder: ServerRecorder
    ) -> None:
        """Create the object.

        Args:
            services: function that returns the robots, keyed by their names in URLs.
            recorder: receives audit entries for STOP by visitors who have not signed in.
        """
        self._services = services
        self._recorder = recorder
        self._pressed: dict[str, frozenset[str]] = {}
        """Robots that each identifier has stopped, oldest identifier first."""
        self._waiting: set[asyncio.Task[None]] = set()

    def tags(self) -> dict[str, tuple[str, ...]]:
        """Return the tags of all robots that the STOP of several robots includes, by name."""
        found = self._services().items()
        return {name: one.robot.profile.tags for name, one in found if can_stop(one)}

    async def stop(
        self, names: Collection[str], who: Callable[[str], Operator], stop_id: str, within_s: float
    ) -> list[RobotStop]:
        """Stop robots, and return the result of each robot.

        A repeated identifier does not stop a robot again, because it may have been reset since.

        Args:
            names: names of the robots in URLs.
            who: function that returns who stops a robot.
            stop_id: identifier of this STOP.
            within_s: longest wait for the robots, in seconds.
        """
        refused = self._press(names, who, stop_id)
        services = {name: self._services()[name] for name in names if name not in refused}
        tasks = [asyncio.create_task(_delivered(one, within_s)) for one in services.values()]
        for task in tasks:
            self._waiting.add(task)
            task.add_done_callback(self._waiting.discard)
        if tasks:
            await asyncio.wait(tasks, timeout=within_s)
        results = {name: _result(name, one) for name, one in services.items()} | refused
        return [results[name] for name in names]

    def _press(
        self, names: Iterable[str], who: Callable[[str], Operator], stop_id: str
    ) -> dict[str, RobotStop]:
        """Stop the robots at once; return the refusals."""
        refused: dict[str, RobotStop] = {}
        known = self._pressed.pop(stop_id, frozenset())
        pressed = set(known)
        for name in names:
            service = self._services().get(name)
            if service is None:
                reason = "this server has no robot with that name"
                refused[name] = RobotStop(name, name, "refused", reason)
            elif name not in known:
                try:
                    press_stop(name, service, who(name), self._recorder, stop_id)
                    pressed.add(name)
                except ApiError as error:
                    refused[name] = RobotStop(name, _title(name, service), "refused", error.line)
                except Exception:  # a supervisor: one robot's bug must not keep others moving
                    log.exception("STOP of %s failed", name)
                    reason = "STOP failed; the reason is in the server's log"
                    refused[name] = RobotStop(name, _title(name, service), "no-link", reason)
        self._pressed[stop_id] = frozenset(pressed)
        while len(self._pressed) > _KNOWN_STOPS:
            self._pressed.pop(next(iter(self._pressed)))
        return refused


async def _delivered(service: RobotService, within_s: float) -> None:
    """Wait until the stop is certain, or an open session can go on delivering it."""
    with service.visit(), suppress(SessionFailed):
        if not await service.deliver_stop(within_s):
            await service.live()


def _result(name: str, service: RobotService) -> RobotStop:
    controller = service.controls.controller
    title = _title(name, service)
    if controller.is_certain:
        return RobotStop(name, title, "confirmed")
    if not controller.has_own_stop:
        reason = "the driver defines no stop to send; STOP only blocks new motion"
        return RobotStop(name, title, "latched", reason)
    return RobotStop(name, title, "no-link", _why(service))


def _title(name: str, service: RobotService) -> str:
    return service.robot.profile.title or name


def _why(service: RobotService) -> str:
    """Return why a stop is not certain yet."""
    live = service.open_session
    if live is None:
        return "the robot is not connected"
    links = live.session.hub.links.values()
    lost = next((one for one in links if one.state in ("lost", "silent")), None)
    if lost is not None:
        return lost.detail or "the robot is not connected"
    if service.controls.controller.is_confirmed:
        return "the robot has not answered the cancellation of its goals"
    return "the robot has not accepted the stop yet"
