"""Links a widget's outputs to the driver's commands."""

from collections.abc import Mapping, Sequence
from typing import Final, Literal, NamedTuple

from urc.config.link.flow import check_value
from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import listed
from urc.config.values import known_argument
from urc.model.binding import targets
from urc.model.driver import Argument, Command, Driver
from urc.model.interface import OutputBinding
from urc.model.units import are_apart
from urc.model.widget import Widget, WidgetPort

__all__ = ["Misfit", "link_output", "takes"]

_GIVERS: Final = {
    "integer": "slider, knob, number",
    "number": "slider, knob, number",
    "boolean": "switch",
    "string": "text",
}
"""Names of shipped widgets that provide a value, separated by commas, by type of the value."""


class Misfit(NamedTuple):
    """The reason why a signal or argument does not fit an input or output, with a hint."""

    code: Literal["wrong-type", "wrong-unit"]
    text: str


def link_output(
    part: Node, port: WidgetPort, widget: Widget, driver: Driver | None, problems: Problems
) -> tuple[str, OutputBinding]:
    """Return the command of an output, and the arguments for the output's values.

    `part` is the output's value in ``bind``: a name or a mapping. Without a driver, the check
    covers only the interface.
    """
    is_short = isinstance(part.data, str)
    name = part.data if is_short else part.text("command")
    given = OutputBinding() if is_short else _given(part, port, widget, problems)
    if driver is None:
        return name, given
    command = driver.commands.get(name)
    if command is None:
        problems.unknown(
            part, "unknown-command", name, driver.commands, at="" if is_short else "command"
        )
        return name, given
    is_right = _check_hold(part, port, widget, command, problems)
    is_right &= is_short or _check_targets(part, command, problems)
    if is_right:
        _check_values(part, port, widget, command, given, problems)
    return name, given


def _given(part: Node, port: WidgetPort, widget: Widget, problems: Problems) -> OutputBinding:
    names: dict[str, str] = {}
    for source, inner in part.named("args").items():
        if source not in port.arguments and inner.data in port.arguments:
            problems.error(
                inner,
                "unknown-argument",
                f"write the value of output {port.name!r} first, then the command's argument",
                key=True,
                hint=f"swap the two names: {inner.data}: {source}",
            )
        elif source not in port.arguments:
            problems.error(
                inner,
                "unknown-argument",
                f"output {port.name!r} of widget {widget.name!r} has no value {source!r}",
                key=True,
                hint=f"values: {listed(port.arguments)}" if port.arguments else "",
            )
        elif inner.data in names:
            problems.error(
                inner,
                "given-twice",
                f"{source!r} sets {inner.data!r}, but {names[inner.data]!r} already sets it",
                hint="an argument accepts only one value",
            )
        names[inner.data] = source
    fixed = part.named("set")
    for name, inner in fixed.items():
        if name in names:
            problems.error(
                inner,
                "given-twice",
                f"{name!r} is set here, but {names[name]!r} of {port.name!r} also sets it",
                key=True,
                hint="an argument accepts only one value",
            )
    return OutputBinding(names, {name: inner.data for name, inner in fixed.items()})


def _check_hold(
    part: Node, port: WidgetPort, widget: Widget, command: Command, problems: Problems
) -> bool:
    """Return whether a hold-to-run output has a held command; report a mismatch."""
    if port.is_held and command.hold is None:
        problems.error(
            part,
            "not-held",
            f"{port.name!r} of widget {widget.name!r} is a hold-to-run control, but command"
            f" {command.name!r} has no 'hold'",
            hint="give the command 'hold: { repeat: 50ms, release: … }'",
        )
    elif command.hold is not None and not port.is_held:
        problems.warn(
            part,
            "not-held",
            f"command {command.name!r} is a held command, but {port.name!r} of widget"
            f" {widget.name!r} is not a hold-to-run control",
            hint="use a hold-to-run widget: joystick, hold-button",
        )
    return port.is_held is (command.hold is not None)


def _check_targets(part: Node, command: Command, problems: Problems) -> bool:
    """Check the arguments and constants of a binding; return whether every argument exists."""
    is_known = True
    for inner in part.named("args").values():
        is_known &= known_argument(inner.data, inner, command, problems, key=False) is not None
    for name, inner in part.named("set").items():
        argument = known_argument(name, inner, command, problems)
        if argument is None:
            is_known = False
        else:
            check_value(inner, argument, problems)
    return is_known


def _check_values(
    part: Node,
    port: WidgetPort,
    widget: Widget,
    command: Command,
    given: OutputBinding,
    problems: Problems,
) -> None:
    """Report required arguments without a value, and values of the wrong type or unit."""
    if port.types and not port.arguments:
        return  # the output provides a value without a name
    taken = targets(command, port, given)
    missing = [
        name
        for name, one in command.arguments.items()
        if one.is_required and name not in taken and name not in given.fixed
    ]
    if missing:
        problems.error(
            part,
            "missing-argument",
            f"{port.name!r} of widget {widget.name!r} does not set these arguments of"
            f" {command.name!r}: {listed(missing)}",
            hint=_remedy(command, port, taken, missing),
        )
    elif port.arguments and not taken:
        _check_nothing(part, port, widget, command, given, problems)
    for target, source in taken.items():
        wrong = _misfit(port, command.arguments[target])
        if wrong and source in port.arguments:
            problems.error(
                _place(part, source),
                wrong.code,
                f"{source!r} of widget {widget.name!r} does not fit argument {target!r} of command"
                f" {command.name!r}: {wrong.text}",
                hint="" if wrong.code == "wrong-unit" else _giver(command.arguments[target]),
            )


def takes(command: Command, port: WidgetPort) -> bool:
    """Return whether a command may be bound to an output, possibly with `args`."""
    if port.is_held is not (command.hold is not None):
        return False
    if not port.arguments:
        return bool(port.types) or not any(one.is_required for one in command.arguments.values())
    return any(not _misfit(port, one) for one in command.arguments.values())


def _remedy(
    command: Command, port: WidgetPort, taken: Mapping[str, str], missing: Sequence[str]
) -> str:
    free = [name for name in port.arguments if name not in taken.values()]
    wrong = [name for name in missing if not _is_of_type(port, command.arguments[name])]
    if free and wrong:
        return _giver(command.arguments[wrong[0]])
    pairs = [f"{source}: {name}" for source, name in zip(free, missing, strict=False)]
    key = "args" if pairs else "set"
    what = ", ".join(pairs or [f"{name}: …" for name in missing])
    return f"bind it as {{ command: {command.name}, {key}: {{ {what} }} }}"


def _giver(argument: Argument) -> str:
    """Return a hint with the names of widgets that provide a value for an argument."""
    widgets = "select" if argument.choices else _GIVERS.get(argument.type, "")
    return (
        f"use a widget that provides a value for '{argument.name}', such as {widgets}"
        if widgets
        else ""
    )


def _check_nothing(
    part: Node,
    port: WidgetPort,
    widget: Widget,
    command: Command,
    given: OutputBinding,
    problems: Problems,
) -> None:
    """Report an output if none of its values matches an argument of the command."""
    what = f"{port.name!r} of widget {widget.name!r} provides {listed(port.arguments)}"
    free = [name for name in command.arguments if name not in given.fixed]
    if free:
        where = f"but command {command.name!r} takes {listed(command.arguments)}"
        hint = _remedy(command, port, {}, free)
    else:
        where = f"but command {command.name!r} takes no value"
        plain = "hold-button" if port.is_held else "button"
        hint = f"use a widget without values: {plain}"
    if not port.is_held or _stands_still(command, given):
        problems.error(part, "nothing-given", f"{what}, {where}", hint=hint)
    elif len(port.arguments) > 1:
        problems.warn(part, "nothing-given", f"{what}, {where}", hint=hint)


def _stands_still(command: Command, given: OutputBinding) -> bool:
    """Return whether a held command would send its release values while its control is held."""
    release = command.hold.release if command.hold is not None else {}
    return bool(command.arguments) and all(
        given.fixed.get(name, one.default) == release.get(name, one.default)
        for name, one in command.arguments.items()
    )


def _is_of_type(port: WidgetPort, argument: Argument) -> bool:
    types = ("number",) if port.is_held else port.types
    fitting = (*types, "integer") if "number" in types else types
    return not types or argument.type in fitting


def _misfit(port: WidgetPort, argument: Argument) -> Misfit | None:
    """Return why an output's value does not fit an argument; None if the value fits."""
    if not _is_of_type(port, argument):
        given = "number" if port.is_held else " or ".join(port.types)
        text = f"the value has type {given}, but the argument has type {argument.type}"
        return Misfit("wrong-type", text)
    if port.unit and are_apart(port.unit, argument.unit):
        text = f"the value is in {port.unit!r}, but the argument is in {argument.unit!r}"
        return Misfit("wrong-unit", text)
    return None


def _place(part: Node, source: str) -> Node:
    """Return the node of a value in `args`, or the binding's node if `args` lacks the value."""
    args = part.get("args") if isinstance(part.data, dict) else None
    return (args.get(source) if args is not None else None) or part
