"""STOP from a program, or from a page that has lost its WebSocket.

Layer 5. HTTP and the Foxglove server share this code.
"""

from urc.motion.lease import Operator
from urc.runtime.server_recorder import ServerRecorder
from urc.web.fleet.robots import RobotService, missing_settings
from urc.web.manage.wire import StopResult
from urc.web.serve.replies import ApiError

__all__ = ["can_stop", "delivered_stop", "press_stop"]


def can_stop(service: RobotService) -> bool:
    """Return whether the STOP of several robots includes a robot.

    Without its settings, a robot has never been connected, and STOP could not reach it.
    """
    return _has_motion(service) and not missing_settings(service.robot)


def press_stop(
    name: str, service: RobotService, who: Operator, recorder: ServerRecorder, stop_id: str = ""
) -> None:
    """Stop a robot and latch its STOP before returning.

    Args:
        name: name of the robot in URLs.
        service: the robot.
        who: the person or program that presses STOP.
        recorder: receives an audit entry for a STOP by a visitor who has not signed in.
        stop_id: identifier of the STOP of several robots in the audit log; "" for one robot.

    Raises:
        ApiError: the robot cannot move.
    """
    if not _has_motion(service):
        raise ApiError(409, "this robot has no motion to stop", "no-motion")
    was_latched = bool(service.controls.controller.lease.latched)
    service.controls.stop(who.name, who, stop_id)
    if was_latched and not who.principal:
        recorder.stopped_by_unknown(name, who.place)


async def delivered_stop(service: RobotService) -> StopResult:
    """Wait a short time until the robot has received a STOP; connect if no session is open."""
    is_confirmed = await service.deliver_stop()
    return StopResult(service.controls.controller.lease.state.latched_by, is_confirmed)


def _has_motion(service: RobotService) -> bool:
    return service.controls.controller.can_move and service.robot.playback is None
