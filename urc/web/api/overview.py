"""A robot's state for the menu and for lists: battery, alarms and sort order.

Layer 5. Pure. The functions never connect to a robot, so the battery level is unknown without a
session.
"""

from collections.abc import Iterable
from typing import Final

from urc.model.driver import Driver
from urc.model.profile import Profile
from urc.model.values import Sample, Signal
from urc.web.alarms.counts import count_of
from urc.web.api.wire import ActiveAlarms, BatteryLevel, RobotSummary
from urc.web.fleet.robots import RobotService

__all__ = ["active_alarms", "battery_of", "battery_signal", "in_order"]

_NAMES: Final = ("battery", "battery_level", "battery_percentage", "state_of_charge", "charge")
"""Usual names of battery signals, in order of preference."""
_UNITS: Final = ("%", "V")
_NUMBERS: Final = ("integer", "number")


def battery_signal(profile: Profile) -> str:
    """Return the name of the battery signal; "" if there is no such signal.

    If a battery widget shows a signal as its level, the function returns this signal's name.
    Otherwise, the result is a usual name, such as ``battery``, of a numeric signal in percent or
    volts.
    """
    uses = [*profile.slots.values()]
    for interface in profile.interfaces.values():
        uses += interface.widgets.values()
    for use in uses:
        widget = profile.widgets.get(use.widget)
        if widget is not None and widget.folder.name == "battery" and "level" in use.inputs:
            return use.inputs["level"]
    return next((name for name in _NAMES if _is_battery(profile.driver, name)), "")


def battery_of(service: RobotService, name: str) -> BatteryLevel | None:
    """Return the current value of a battery signal; None if the value is unknown or stale.

    Args:
        service: the robot.
        name: name of the battery signal, as returned by `battery_signal`.
    """
    live = service.open_session
    signal = service.robot.profile.driver.signals.get(name)
    sample = live.session.hub.latest(name) if live is not None and signal is not None else None
    if signal is None or sample is None or _is_stale(sample, signal, service.clock.now()):
        return None
    value = sample.value
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    digits = 0 if signal.unit == "%" else signal.precision
    shown = round(value, 1 if digits is None else digits)
    return BatteryLevel(shown, signal.unit, sample.alarm)


def active_alarms(name: str, service: RobotService) -> ActiveAlarms:
    """Return the number and the highest priority of a robot's annunciated alarms.

    An alarm that has returned to normal is counted until it is acknowledged. Shelved and suppressed
    alarms are not counted. The robot needs no open session.

    Args:
        name: the robot's name in URLs.
        service: the robot.
    """
    records = service.alarms.list.records.values()
    worst = count_of(name, records).worst
    return ActiveAlarms(sum(one.is_annunciated for one in records), worst)


def in_order(robots: Iterable[RobotSummary]) -> tuple[RobotSummary, ...]:
    """Return robots in order of importance to an operator.

    Robots with alarms come first, by priority, followed by connected robots, then by other robots
    in order of last use. Robots of equal rank keep their order.
    """
    return tuple(sorted(robots, key=_rank))


def _rank(robot: RobotSummary) -> tuple[int, int, float]:
    """Return a robot's rank; a connected robot's rank does not depend on its last use."""
    severity = {"high": 0, "medium": 1, "low": 2}.get(robot.alarms.worst, 3)
    is_away = not robot.connected
    return severity, int(is_away), -(robot.used_at or 0.0) if is_away else 0.0


def _is_stale(sample: Sample, signal: Signal, now: float) -> bool:
    return bool(signal.stale_after_s) and now - sample.time_s > signal.stale_after_s


def _is_battery(driver: Driver, name: str) -> bool:
    signal = driver.signals.get(name)
    return signal is not None and signal.type in _NUMBERS and signal.unit in _UNITS
