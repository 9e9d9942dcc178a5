"""Descriptions of robots for programs, built from profiles and current states.

Layer 5. Pure.
"""

from collections.abc import Callable, Mapping
from typing import Final

from urc.model.driver import Argument, Command
from urc.model.exchange import Confirm
from urc.model.role import Role, includes
from urc.model.values import Signal
from urc.runtime.contact_times import NO_CONTACT, ContactTimes
from urc.runtime.hub import LinkState, LinkStatus
from urc.web.api.overview import active_alarms, battery_of, battery_signal
from urc.web.api.readings import plain
from urc.web.api.stop import can_stop
from urc.web.api.wire import (
    ArgumentInfo,
    CommandInfo,
    ConfirmInfo,
    ConnectionInfo,
    HoldInfo,
    RobotInfo,
    RobotSummary,
    SignalInfo,
)
from urc.web.fleet.robots import RobotService, missing_settings

__all__ = ["may_run", "robot_info", "summary"]

_WORST_FIRST: Final[tuple[LinkState, ...]] = ("lost", "silent", "connecting", "live", "idle")
_ABNORMAL: Final = ("lost", "silent")
_LIMITS: Final = ("lolo", "low", "high", "hihi")


def summary(
    name: str, service: RobotService, role: Role, times: ContactTimes = NO_CONTACT
) -> RobotSummary:
    """Return a robot's entry in the list of robots.

    Args:
        name: the robot's name in URLs.
        service: the robot.
        role: the visitor's role for the robot.
        times: when the robot was last used and last sent data.
    """
    profile = service.robot.profile
    links = _links(service).values()
    by_state = {one.state: one for one in links}
    state: LinkState = next((one for one in _WORST_FIRST if one in by_state), "idle")
    controls = service.control_state()
    return RobotSummary(
        name=name,
        title=profile.title,
        summary=profile.summary,
        tags=profile.tags,
        state=state,
        holder=str(controls["holder"]),
        latched=str(controls["latched"]),
        emulated=bool(controls["emulated"]),
        role=role,
        connected=service.is_open,
        detail=by_state[state].detail if state in _ABNORMAL else "",
        battery=battery_of(service, battery_signal(profile)),
        alarms=active_alarms(name, service),
        used_at=times.used_at,
        seen_at=times.seen_at,
        can_stop=can_stop(service),
        confirmed=service.controls.controller.is_certain,
    )


def robot_info(
    name: str,
    service: RobotService,
    role: Role,
    may_give: Callable[[str], bool],
    times: ContactTimes = NO_CONTACT,
) -> RobotInfo:
    """Return a robot with its signals and commands.

    Args:
        name: the robot's name in URLs.
        service: the robot.
        role: the visitor's role for the robot.
        may_give: function that returns whether the visitor's token permits a command.
        times: when the robot was last used and last sent data.
    """
    profile = service.robot.profile
    controller, links = service.controls.controller, _links(service)
    return RobotInfo(
        robot=summary(name, service, role, times),
        missing=tuple(one.name for one in missing_settings(service.robot)),
        connections=tuple(
            _connection(transport, links.get(transport)) for transport in profile.driver.transports
        ),
        confirmed=controller.is_confirmed and not controller.is_unanswered,
        stops=controller.lease.state.stops,
        signals=tuple(_signal(one) for one in profile.driver.signals.values()),
        commands=tuple(
            _command(one, is_allowed=may_run(one, role) and may_give(one.name))
            for one in profile.driver.commands.values()
        ),
    )


def may_run(command: Command, role: Role | None) -> bool:
    """Return whether a role permits a command."""
    return includes(role, command.role)


def _links(service: RobotService) -> Mapping[str, LinkStatus]:
    live = service.open_session
    return live.session.hub.links if live is not None else {}


def _connection(transport: str, link: LinkStatus | None) -> ConnectionInfo:
    if link is None:
        return ConnectionInfo(transport, "idle")
    return ConnectionInfo(transport, link.state, link.address, link.detail)


def _signal(signal: Signal) -> SignalInfo:
    limits = {name: getattr(signal.limits, name) for name in _LIMITS}
    return SignalInfo(
        name=signal.name,
        type=signal.type,
        title=signal.title,
        description=signal.description,
        unit=signal.unit,
        min=signal.min,
        max=signal.max,
        precision=signal.precision,
        states=dict(signal.states),
        limits={name: value for name, value in limits.items() if value is not None},
        stale_after_s=signal.stale_after_s,
        axes=signal.axes,
        items=signal.items if signal.type == "array" else "",
    )


def _command(command: Command, *, is_allowed: bool) -> CommandInfo:
    hold = command.hold
    return CommandInfo(
        name=command.name,
        title=command.title,
        description=command.description,
        role=command.role,
        allowed=is_allowed,
        moves=command.moves,
        stops=command.stops,
        sequence=bool(command.steps),
        hold=None
        if hold is None
        else HoldInfo(
            hold.repeat_s,
            hold.lease_s,
            {name: plain(value) for name, value in hold.release.items()},
        ),
        confirm=_confirm(command.confirm) if command.confirm is not None else None,
        arguments=tuple(_argument(one) for one in command.arguments.values()),
    )


def _argument(argument: Argument) -> ArgumentInfo:
    return ArgumentInfo(
        name=argument.name,
        type=argument.type,
        title=argument.title,
        description=argument.description,
        unit=argument.unit,
        min=argument.min,
        max=argument.max,
        choices=argument.choices,
        default=plain(argument.default),
        required=argument.is_required and argument.default is None,
        items=argument.items if argument.type == "array" else "",
        size=argument.size,
        confirm={value: _confirm(one) for value, one in argument.confirm.items()},
    )


def _confirm(confirm: Confirm) -> ConfirmInfo:
    return ConfirmInfo(confirm.text, confirm.level, confirm.is_two_person)
