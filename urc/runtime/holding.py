"""A held command that a program gives for a time, under the motion contract.

The program is the hand: it samples nothing, but it is alive as long as it ticks. When it hangs, is
killed or is cut off, the lease runs out, and the guard writes the stop.
"""

import asyncio
from collections.abc import Callable, Mapping
from typing import Final

from urc.model.values import Reading
from urc.motion.fresh import Input
from urc.motion.hold import STOP_FOR_S
from urc.motion.lease import Client
from urc.protocol.bounds import queue_limit_s
from urc.runtime.held import Movers, is_lossy
from urc.runtime.motion import MotionDesk
from urc.runtime.session import CommandFailed, Session

__all__ = ["LONGEST_HOLD_S", "hold"]

LONGEST_HOLD_S: Final = 60.0
"""Nobody watches: what takes longer is driven on a dashboard."""
_TICK_S: Final = 0.05
_LOOK_S: Final = 0.01
_STOP_OUT_S: Final = 10.0
"""How long the line may take to take the stop."""
_WORKED_OFF_S: Final = 0.5
"""What a broker or bridge may need for a stop that it has: it may forget it with the line."""
_US: Final = Client("send", "a program")


async def hold(
    session: Session,
    name: str,
    arguments: Mapping[str, Reading],
    for_s: float,
    why_not: Callable[[], str],
) -> None:
    """Give a held command for a time, release it, and return when its stop is out.

    Args:
        session: opened with ``motion``.
        name: of a command with ``hold``.
        arguments: name → value.
        for_s: 0 to `LONGEST_HOLD_S`.
        why_not: why it has to end before its time, or "".

    Raises:
        CommandFailed: it was refused, or ended early; the robot was told to stop.
    """
    movers = session.movers
    if movers is None:
        raise CommandFailed("unknown-command", f"{name} is no held command")
    await _until_ready(session, movers, name)
    desk = MotionDesk(session.profile.driver)
    desk.join(_US)
    desk.attach(session.frames, movers)
    follower = asyncio.create_task(_follow(desk, movers))
    try:
        desk.drive(_US.id, "take", _now())
        try:
            has_moved, why = await _ticks(desk, name, arguments, for_s, why_not)
        finally:
            desk.release(_US.id, name)
        if has_moved:
            await _stop_is_out(session, desk, movers, name)
        if why:
            raise CommandFailed("stopped" if has_moved else "refused", why)
    finally:
        follower.cancel()
        desk.detach()


def _now() -> float:
    return asyncio.get_running_loop().time()


async def _until_ready(session: Session, movers: Movers, name: str) -> None:
    """Wait until the line is connected and its start-up steps are done, or cannot be."""
    line = session.profile.driver.commands[name].transport
    until = _now() + queue_limit_s(session.profile.driver.transports[line], None)
    while not (movers.is_open(name) and session.frames.is_ready(name)):
        status = session.hub.links[line]
        if status.attempts or _now() >= until:
            why = f": {status.detail}" if status.detail else ""
            raise CommandFailed("disconnected", f"the robot is not connected{why}")
        await asyncio.sleep(_LOOK_S)


async def _ticks(
    desk: MotionDesk,
    name: str,
    arguments: Mapping[str, Reading],
    for_s: float,
    why_not: Callable[[], str],
) -> tuple[bool, str]:
    """Tick until the time is over; return whether anything moved, and why it ended early."""
    number, next_s = 0, _now()
    ends_s = next_s + for_s
    while (now := _now()) < ends_s:
        number += 1
        given = Input(desk.lease.state.epoch, number, desk.beat(_US.id, now))
        why = why_not() or desk.tick(_US.id, name, arguments, given, now)
        if why:
            return number > 1, why
        next_s = max(next_s + _TICK_S, now)
        await asyncio.sleep(min(next_s, ends_s) - now)
    return number > 0, ""


async def _stop_is_out(session: Session, desk: MotionDesk, movers: Movers, name: str) -> None:
    """Wait until the line has taken the stop, and its repetitions where one may be lost.

    A line that was cut is opened again by its owner, and the stop is the first thing on it.
    """
    driver = session.profile.driver
    until = _now() + _STOP_OUT_S
    while not (desk.rests(name) and movers.is_open(name)):
        if _now() >= until:
            text = f"the robot has not heard the stop: its line took none for {_STOP_OUT_S:g} s"
            raise CommandFailed("disconnected", text)
        await asyncio.sleep(_LOOK_S)
    if is_lossy(driver, driver.commands[name].transport):
        await asyncio.sleep(STOP_FOR_S + _WORKED_OFF_S)


async def _follow(desk: MotionDesk, movers: Movers) -> None:
    while True:
        for command, reason in await movers.stops():
            desk.stopped(command, reason)
