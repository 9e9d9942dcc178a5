"""Run a held command from a script for a limited time, under the normal motion rules.

A script has no input to sample, so it renews the lease with regular ticks. If the script hangs, is
killed or loses its connection, the lease expires, and the guard writes the stop.
"""

import asyncio
from collections.abc import Callable, Mapping
from typing import Final

from urc.model.values import Reading
from urc.motion.freshness import ControlInput
from urc.motion.hold_to_run import STOP_FOR_S
from urc.motion.lease import Operator
from urc.protocol.requests.bounds import queue_limit_s
from urc.runtime.held_commands import MotionBackend, is_lossy
from urc.runtime.motion_controller import MotionController
from urc.runtime.session import CommandFailed, Session

__all__ = ["LONGEST_HOLD_S", "hold", "stop_is_out", "until_ready"]

LONGEST_HOLD_S: Final = 60.0
"""Maximum duration of a scripted hold, in seconds; longer motion requires an operator at a
dashboard."""
_TICK_S: Final = 0.05
_LOOK_S: Final = 0.01
_STOP_OUT_S: Final = 10.0
"""Maximum wait for the transport to accept the stop, in seconds."""
_WORKED_OFF_S: Final = 0.5
"""Time that a broker or bridge has to forward the stop before the connection is closed, in
seconds."""
_US: Final = Operator("send", "a program")


async def hold(
    session: Session,
    name: str,
    arguments: Mapping[str, Reading],
    for_s: float,
    why_not: Callable[[], str],
) -> None:
    """Hold a command for a time, release it, and return after its stop is sent.

    Args:
        session: a session opened with ``motion``.
        name: name of a command with ``hold``.
        arguments: values of the arguments, by name.
        for_s: duration, from 0 to `LONGEST_HOLD_S` seconds.
        why_not: function that returns the reason to end early, or "" to continue.

    Raises:
        CommandFailed: the command is not held, was refused or ended early, or the connection
            failed.
    """
    backend = session.backend
    if backend is None:
        raise CommandFailed("unknown-command", f"{name} is not a held command")
    await until_ready(session, backend, name)
    controller = MotionController(session.profile.driver)
    controller.join(_US)
    controller.attach(session)
    follower = asyncio.create_task(_follow(controller, backend))
    try:
        controller.drive(_US.id, "take", _now())
        try:
            has_moved, why = await _ticks(controller, name, arguments, for_s, why_not)
        finally:
            controller.release(_US.id, name)
        if has_moved:
            await stop_is_out(session, controller, backend, name)
        if why:
            raise CommandFailed("stopped" if has_moved else "refused", why)
    finally:
        follower.cancel()
        controller.detach()


def _now() -> float:
    return asyncio.get_running_loop().time()


async def until_ready(session: Session, backend: MotionBackend, name: str) -> None:
    """Wait until the transport is ready; raise `CommandFailed` if it does not become ready."""
    line = session.profile.driver.commands[name].transport
    until = _now() + queue_limit_s(session.profile.driver.transports[line], None)
    while not (backend.is_open(name) and session.frames.is_ready(name)):
        status = session.hub.links[line]
        if status.attempts or _now() >= until:
            why = f": {status.detail}" if status.detail else ""
            raise CommandFailed("disconnected", f"the robot is not connected{why}")
        await asyncio.sleep(_LOOK_S)


async def _ticks(
    controller: MotionController,
    name: str,
    arguments: Mapping[str, Reading],
    for_s: float,
    why_not: Callable[[], str],
) -> tuple[bool, str]:
    """Send ticks for `for_s` seconds, or until there is a reason to end early.

    Return whether the robot moved, and the reason for an early end.
    """
    number, next_s = 0, _now()
    ends_s = next_s + for_s
    while (now := _now()) < ends_s:
        number += 1
        given = ControlInput(
            controller.lease.state.epoch, number, controller.heartbeat(_US.id, now)
        )
        why = why_not() or controller.tick(_US.id, name, arguments, given, now)
        if why:
            return number > 1, why
        next_s = max(next_s + _TICK_S, now)
        await asyncio.sleep(min(next_s, ends_s) - now)
    return number > 0, ""


async def stop_is_out(
    session: Session, controller: MotionController, backend: MotionBackend, name: str
) -> None:
    """Wait until the transport has accepted the stop, including repeats on a lossy transport.

    If the connection is lost, the guard reopens it and sends the stop first.
    """
    driver = session.profile.driver
    until = _now() + _STOP_OUT_S
    while not (controller.rests(name) and backend.is_open(name)):
        if _now() >= until:
            text = f"the connection accepted no data for {_STOP_OUT_S:g} s"
            raise CommandFailed("disconnected", f"the stop has not reached the robot: {text}")
        await asyncio.sleep(_LOOK_S)
    if is_lossy(driver, driver.commands[name].transport):
        await asyncio.sleep(STOP_FOR_S + _WORKED_OFF_S)


async def _follow(controller: MotionController, backend: MotionBackend) -> None:
    while True:
        for command, reason in await backend.stops():
            controller.stopped(command, reason)
