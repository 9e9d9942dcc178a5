"""Checks the relations that a widget's manifest declares between bindings and options."""

import re
from collections.abc import Iterator, Mapping
from typing import Any, Final

from urc.config.link.resources import named_texts
from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import did_you_mean, listed
from urc.model.binding import targets
from urc.model.driver import Argument, Driver
from urc.model.interface import OutputBinding, WidgetUse
from urc.model.units import are_apart
from urc.model.widget import Widget, WidgetPort

__all__ = ["link_together"]

_NOTHING_GIVEN: Final = OutputBinding()
_LOCAL: Final = re.compile(r"/(?![/\\])")
"""Pattern for an absolute path on the same server."""


def link_together(
    part: Node, use: WidgetUse, widget: Widget, driver: Driver, problems: Problems
) -> None:
    """Check that the slot's bindings and options satisfy the relations that the manifest declares.

    `use` is the complete declaration of the slot. `part` is the part of the slot that this document
    declares.
    """
    bound = {**use.inputs, **use.lists, **use.outputs}
    _check_needs(part, use, widget, bound, problems)
    _check_groups(part, widget, bound, problems)
    _check_instead(part, widget, bound, problems)
    _check_units(part, use, widget, driver, problems)
    _check_frames(part, use, widget, driver, problems)
    _check_order(part, use, widget, problems)
    _check_local(part, widget, problems)
    _check_given(part, use, widget, driver, problems)


def _check_needs(
    part: Node, use: WidgetUse, widget: Widget, bound: Mapping[str, object], problems: Problems
) -> None:
    tried = part.named("bind")  # problems in these bindings are already reported
    given = {name for name, value in use.options.items() if value not in ("", None)}
    if widget.at_least_one_of and not {*bound, *tried, *given} & {*widget.at_least_one_of}:
        options = [name for name in widget.at_least_one_of if name in widget.options]
        ports = [name for name in widget.at_least_one_of if name not in widget.options]
        ways = [f"bind {_one_of(ports)}"] if ports else []
        ways += [f"set the option {_one_of(options)}"] if options else []
        problems.error(
            part,
            "unbound-input",
            f"widget {widget.name!r} has no bindings and would be empty",
            key=True,
            hint=", or ".join(ways),
        )


def _one_of(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"one of {listed(names)}"


def _check_groups(
    part: Node, widget: Widget, bound: Mapping[str, object], problems: Problems
) -> None:
    tried = part.named("bind")
    for group in widget.required_together:
        there = [name for name in group if name in bound or name in tried]
        missing = [name for name in group if name not in there]
        mine = [name for name in there if name in tried]
        if mine and missing:
            problems.error(
                tried[mine[0]],
                "half-bound",
                f"{mine[0]!r} of widget {widget.name!r} needs {listed(missing)}",
                key=True,
                hint=f"bind {listed(missing)} too, or remove '{mine[0]}'",
            )


def _check_instead(
    part: Node, widget: Widget, bound: Mapping[str, object], problems: Problems
) -> None:
    """Warn about a binding or option in this document that another binding of the slot replaces.

    Bindings in a driver cause no warning, because an interface may override them.
    """
    said = (*part.named("bind").items(), *part.named("options").items())
    for port in widget.inputs.values():
        lost = [inner for name, inner in said if port.name in bound and name in port.replaces]
        for inner in lost:
            problems.warn(
                inner,
                "unused-binding",
                f"{inner.name!r} of widget {widget.name!r} has no effect with {port.name!r}",
                key=True,
                hint=f"remove '{inner.name}', or do not bind '{port.name}'",
            )


# ---- units


def _check_units(
    part: Node, use: WidgetUse, widget: Widget, driver: Driver, problems: Problems
) -> None:
    """Report two bindings of a widget that need the same unit but have different units."""
    mine = part.named("bind")
    for port in (*widget.inputs.values(), *widget.outputs.values()):
        place = mine.get(port.name) or mine.get(port.unit_of)
        other = widget.inputs.get(port.unit_of) or widget.outputs.get(port.unit_of)
        if place is None or other is None:
            continue
        wanted = next(_units(use, other, driver), ("", ""))
        for what, unit in _units(use, port, driver):
            if are_apart(unit, wanted[1]):
                problems.error(
                    place,
                    "wrong-unit",
                    f"{port.name!r} and {other.name!r} of widget {widget.name!r} need the same"
                    f" unit: {what} is in {unit!r}, {wanted[0]} in {wanted[1]!r}",
                    hint="the widget does not convert units; bind other signals, or compute a"
                    " signal in that unit",
                )
                break


def _check_frames(
    part: Node, use: WidgetUse, widget: Widget, driver: Driver, problems: Problems
) -> None:
    """Warn about a binding in another coordinate frame than the widget's other bindings."""
    mine = part.named("bind")
    known: dict[str, tuple[str, str]] = {}
    for port in widget.common_frame:
        for name in (use.inputs[port],) if port in use.inputs else use.lists.get(port, ()):
            signal = driver.signals.get(name)
            if signal is not None and signal.frame is not None:
                known[port] = name, signal.frame.source
    if len({frame for _, frame in known.values()}) < 2:
        return
    first, *others = known
    for port in others:
        place = mine.get(port) or mine.get(first)
        (name, frame), (base, wanted) = known[port], known[first]
        if place is not None and frame != wanted:
            problems.warn(
                place,
                "mixed-frames",
                f"widget {widget.name!r} shows one coordinate frame, but {base!r} refers to"
                f" {wanted!r} and {name!r} to {frame!r}",
                hint="bind a signal with 'transform', which changes the value to that frame",
            )
            return


def _units(use: WidgetUse, port: WidgetPort, driver: Driver) -> Iterator[tuple[str, str]]:
    """Yield the description and unit of each signal or argument bound to an input or output."""
    single = use.inputs.get(port.name)
    for name in (single,) if single is not None else use.lists.get(port.name, ()):
        signal = driver.signals.get(name)
        if signal is not None:
            yield f"signal {name!r}", port.unit or signal.unit
    for argument in _arguments(use, port, driver):
        yield f"argument {argument.name!r}", argument.unit


def _arguments(use: WidgetUse, port: WidgetPort, driver: Driver) -> Iterator[Argument]:
    """Yield the command arguments that receive the values of an output."""
    command = driver.commands.get(use.outputs.get(port.name, ""))
    if command is not None:
        taken = targets(command, port, use.given.get(port.name, _NOTHING_GIVEN))
        yield from (command.arguments[name] for name in taken if name in command.arguments)


# ---- options


def _check_order(part: Node, use: WidgetUse, widget: Widget, problems: Problems) -> None:
    """Report an option whose value is not smaller than that of the option under `less_than`."""
    own = part.named("options")
    for name, schema in widget.options.items():
        above = schema.get("less_than") if isinstance(schema, Mapping) else None
        if above is None or not (name in own or above in own):
            continue
        low, high = use.options.get(name), use.options.get(above)
        if isinstance(low, (int, float)) and isinstance(high, (int, float)) and low >= high:
            problems.error(
                own.get(name) or own[above],
                "wrong-order",
                f"option {name!r} is {low:g}, but must be below {above!r} ({high:g})",
                hint="change one of the two options"
                if above in own
                else f"set the option {above} too",
            )


def _check_local(part: Node, widget: Widget, problems: Problems) -> None:
    options = part.get("options")
    for name, inner in named_texts(options, widget.options, "same_origin") if options else ():
        if inner.data and not _LOCAL.match(inner.data):
            problems.error(
                inner,
                "not-local",
                f"option {name!r} must be an address on this dashboard's server,"
                f" found {inner.data!r}",
                hint="a page loads nothing from other servers; start the address with one slash",
            )


def _check_given(
    part: Node, use: WidgetUse, widget: Widget, driver: Driver, problems: Problems
) -> None:
    """Report an option value that is invalid for the command argument that the option sets."""
    options = part.get("options")
    if options is None:
        return
    for name, inner in named_texts(options, widget.options, "argument_of"):
        schema: Any = widget.options[name]
        is_item = "argument_of" not in schema
        port = widget.outputs[schema["items"]["argument_of"] if is_item else schema["argument_of"]]
        text = inner.data.partition("=")[0] if is_item else inner.data
        for argument in _arguments(use, port, driver):
            _check_text(inner, text, argument, use.outputs[port.name], problems)


def _check_text(
    part: Node, text: str, argument: Argument, command: str, problems: Problems
) -> None:
    value = _read(text, argument)
    if value is None:
        code, wrong = "wrong-type", f"has the type {argument.type}"
    elif argument.choices and value not in argument.choices:
        code, wrong = "unknown-word", "has other choices"
    elif not isinstance(value, str) and _is_outside(value, argument):
        code, wrong = "out-of-range", f"allows {_bound(argument.min)} to {_bound(argument.max)}"
    else:
        return
    choices = [str(one) for one in argument.choices]
    problems.error(
        part,
        code,
        f"command {command!r} does not accept {text!r}: its argument {argument.name!r} {wrong}",
        hint=did_you_mean(text, choices, "choices") if choices else "",
    )


def _read(text: str, argument: Argument) -> bool | float | str | None:
    """Convert text to an argument's value in the same way as pages; None for invalid text."""
    if argument.type == "boolean":
        return {"true": True, "false": False}.get(text)
    if argument.type not in ("integer", "number"):
        return text
    try:
        number = float(text)
    except ValueError:
        return None
    is_whole = number.is_integer()
    return number if is_whole or argument.type == "number" else None


def _is_outside(value: float, argument: Argument) -> bool:
    low, high = argument.min, argument.max
    return (low is not None and value < low) or (high is not None and value > high)


def _bound(value: float | None) -> str:
    return "any" if value is None else f"{value:g}"
