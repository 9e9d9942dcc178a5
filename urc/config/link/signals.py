"""Checks computed signals for unknown names and for cycles, and the names in alarm limits."""

from collections.abc import Callable, Iterable, Mapping

from urc.config.link.cycles import cycle_from
from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import did_you_mean
from urc.expressions import Template
from urc.model.driver import Driver
from urc.model.values import Signal

__all__ = ["link_signals"]

_Check = Callable[[Node, Template, Iterable[str]], None]


def link_signals(part: Node, driver: Driver, check: _Check, problems: Problems) -> None:
    """Check computed signals and alarms at `part`; `check` checks the names in a template."""
    set_by_frames = _set_by_frames(driver)
    for name, inner in part.named("signals").items():
        _link_alarms(inner, driver.signals[name], driver, check, problems)
        formula = driver.signals[name].formula
        if formula is None:
            continue
        place = inner.must("value")
        check(place, formula, driver.signals)
        if not any(one in driver.signals for one in formula.names):
            problems.error(
                place,
                "constant-value",
                "this expression uses no signal and would never be computed",
                hint=did_you_mean("", driver.signals, "signals"),
            )
        if name in set_by_frames:
            problems.error(
                place,
                "two-sources",
                f"{name!r} is computed here, but also set by {set_by_frames[name]}",
                key=True,
                hint="use another name for the computed signal or for the field",
            )
        cycle = cycle_from(name, lambda one: _needed(one, driver.signals))
        if cycle:
            problems.error(
                place,
                "circular-value",
                f"{name!r} depends on itself: {' → '.join(cycle)}",
                hint="compute a signal only from signals that do not depend on it",
            )


def _link_alarms(
    part: Node, signal: Signal, driver: Driver, check: _Check, problems: Problems
) -> None:
    """Check the names in the expressions and commands of a signal's alarms."""
    limits = part.get("limits")
    if limits is None or signal.limits.is_empty:
        return
    checked = set()
    for name, attributes in signal.limits.attributes:
        own = limits.named("states").get(name) or limits.must(name)
        places = {
            key: own if isinstance(own.data, dict) and key in own.data else limits
            for key in ("suppressed_when", "command")
        }
        place = places["suppressed_when"]
        if attributes.suppressed_when is not None and place.path not in checked:
            checked.add(place.path)
            check(place.must("suppressed_when"), attributes.suppressed_when, driver.signals)
        command = attributes.command
        if command and command not in driver.commands:
            place = places["command"].must("command")
            problems.unknown(place, "unknown-command", command, driver.commands)


def _set_by_frames(driver: Driver) -> dict[str, str]:
    """Return descriptions of the frames that set signals, by signal name."""
    found: dict[str, str] = {}
    for message in driver.messages.values():
        found |= dict.fromkeys(message.read.fields, f"message {message.name!r}")
    for command in driver.commands.values():
        if command.reply is not None:
            fields = command.reply.read.fields
            found |= dict.fromkeys(fields, f"the reply of command {command.name!r}")
    for poll in driver.polls:
        if poll.reply is not None:
            found |= dict.fromkeys(poll.reply.read.fields, f"poll {poll.name!r}")
    return found


def _needed(name: str, signals: Mapping[str, Signal]) -> list[str]:
    """Return the signals that the computed signal `name` depends on."""
    return sorted(signals[name].inputs & signals.keys())
