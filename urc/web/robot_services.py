"""The services of all robots on a server, with stored latches, alarms and audit entries."""

import asyncio
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

from urc.runtime.alarm_store import AlarmStore
from urc.runtime.audit import AuditLog
from urc.runtime.audit_recorder import AuditRecorder
from urc.runtime.clock import LoopClock
from urc.runtime.latch import LatchStore
from urc.runtime.one_shot_commands import can_move
from urc.runtime.redaction import secret_texts
from urc.runtime.robot_alarms import RobotAlarms
from urc.web.alarms.notifier import AlarmNotifier
from urc.web.alarms.routes import alarm_key
from urc.web.fleet.fleet import Fleet
from urc.web.fleet.robots import Robot, RobotService

__all__ = ["Stores", "fleet_of", "latch_of"]


class Stores(NamedTuple):
    """A server's persistent stores; None disables a store."""

    data: Path | None
    """Data folder."""
    audit: AuditLog | None
    alarms: AlarmStore | None
    notifier: AlarmNotifier | None
    """Receiver of all robots' new alarms, which sends the notifications."""


def fleet_of(robots: Mapping[str, Robot], stores: Stores, linger_s: float) -> Fleet:
    """Return the fleet; robots stay connected for `linger_s` after their last page closes."""
    start_lock = asyncio.Lock()
    return Fleet(
        robots,
        lambda name, robot: RobotService(
            robot,
            linger_s=linger_s,
            latch=latch_of(stores.data, robot),
            recorder=_recorder(stores.audit, name, robot),
            start_lock=start_lock,
            alarms=_alarms(stores, name, robot),
        ),
    )


def _alarms(stores: Stores, name: str, robot: Robot) -> RobotAlarms:
    """Return a robot's alarms; a playback's alarms are neither stored nor sent as notifications."""
    is_live = robot.playback is None
    found = RobotAlarms(
        robot.profile.driver,
        LoopClock(),
        time.time,
        key=alarm_key(name, is_emulated=robot.is_emulated),
        memory=stores.alarms if is_live else None,
        is_monitored=robot.is_monitored and is_live,
    )
    if stores.notifier is not None and is_live:
        found.on_events = partial(stores.notifier.queue, name, robot.profile.title or name, found)
    return found


def latch_of(data: Path | None, robot: Robot) -> LatchStore | None:
    """Return the store of a robot's latched STOP; None for a robot that cannot move."""
    if data is None or not can_move(robot.profile.driver):
        return None
    folder = data / "latches"
    return LatchStore(folder / "emulated" if robot.is_emulated else folder, robot.profile.name)


def _recorder(audit: AuditLog | None, name: str, robot: Robot) -> AuditRecorder | None:
    if audit is None:
        return None
    secrets = secret_texts(robot.profile, robot.settings)
    return AuditRecorder(name, audit.add, utc=time.time, secrets=secrets)
