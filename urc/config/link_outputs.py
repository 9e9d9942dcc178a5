"""Outputs of a widget → commands of the driver: which one, and where its values go."""

from urc.config.part import Findings, Part
from urc.config.suggest import did_you_mean, listed
from urc.config.values import known_argument
from urc.model.driver import Command, Driver
from urc.model.interface import Given
from urc.model.widget import Port, Widget

__all__ = ["link_output"]


def link_output(
    part: Part, port: Port, widget: Widget, driver: Driver | None, findings: Findings
) -> tuple[str, Given]:
    """Return the command that an output is bound to, and what it gives to its arguments.

    Args:
        part: what stands under the output in ``bind``: a name, or a mapping.
        port: the output.
        widget: whose output it is.
        driver: None when the interface is checked by itself, without any driver.
        findings: takes what is wrong.
    """
    is_short = isinstance(part.data, str)
    name = part.data if is_short else part.text("command")
    given = Given() if is_short else _given(part, port, widget, findings)
    if driver is None:
        return name, given
    command = driver.commands.get(name)
    if command is None:
        findings.error(
            part,
            "unknown-command",
            f"there is no command {name!r}",
            at="" if is_short else "command",
            hint=did_you_mean(name, driver.commands, "commands"),
        )
        return name, given
    _check_hold(part, port, widget, command, findings)
    if not is_short:
        _check_targets(part, command, findings)
    if port.is_held:
        _check_complete(part, port, command, given, findings)
    return name, given


def _given(part: Part, port: Port, widget: Widget, findings: Findings) -> Given:
    names: dict[str, str] = {}
    for source, inner in part.named("args").items():
        if source not in port.arguments:
            findings.error(
                inner,
                "unknown-argument",
                f"output {port.name!r} of widget {widget.name!r} gives no {source!r}",
                key=True,
                hint=f"it gives: {listed(port.arguments)}" if port.arguments else "",
            )
        names[inner.data] = source
    return Given(names, {name: inner.data for name, inner in part.named("set").items()})


def _check_hold(
    part: Part, port: Port, widget: Widget, command: Command, findings: Findings
) -> None:
    if port.is_held and command.hold is None:
        findings.error(
            part,
            "not-held",
            f"{port.name!r} of widget {widget.name!r} is held, and command"
            f" {command.name!r} does not say what stops it",
            hint="give the command 'hold: { repeat: 50ms, release: … }'",
        )
    elif command.hold is not None and not port.is_held:
        findings.warn(
            part,
            "not-held",
            f"command {command.name!r} is held, and {port.name!r} of widget"
            f" {widget.name!r} cannot hold it",
            hint="use a widget that holds: joystick, hold-button",
        )


def _check_targets(part: Part, command: Command, findings: Findings) -> None:
    named = [(inner, inner.data, False) for inner in part.named("args").values()]
    named += [(inner, name, True) for name, inner in part.named("set").items()]
    for inner, name, is_key in named:
        known_argument(name, inner, command, findings, key=is_key)


def _check_complete(
    part: Part, port: Port, command: Command, given: Given, findings: Findings
) -> None:
    """Report what a held command needs and nobody gives: it would never move."""
    there = {*given.names, *given.fixed, *port.arguments}
    missing = [
        name
        for name, one in command.arguments.items()
        if one.is_required and one.default is None and name not in there
    ]
    if missing:
        findings.error(
            part,
            "missing-argument",
            f"command {command.name!r} needs {listed(missing)}",
            hint=f"bind it as {{ command: {command.name}, args: {{ …: {missing[0]} }} }}",
        )
