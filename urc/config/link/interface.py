"""Checks the names in an interface: widgets, and their bindings and options."""

from collections.abc import Mapping
from typing import NamedTuple, TypeVar

from urc.config.link.outputs import Misfit, link_output, takes
from urc.config.link.required_together import link_together
from urc.config.link.resources import link_files, link_pages
from urc.config.node import Node, Problems
from urc.config.parse.widget import WidgetFolder
from urc.config.shape.check import check_options
from urc.config.sources import Sources
from urc.config.spelling_suggestions import closest, did_you_mean, listed
from urc.model.driver import Driver
from urc.model.interface import Interface, OutputBinding, WidgetUse
from urc.model.units import conversion, quantity_of
from urc.model.values import Signal
from urc.model.widget import Widget, WidgetPort

__all__ = ["link_interface", "link_slots", "misfit"]

_T = TypeVar("_T")


def link_slots(
    sources: Sources, driver: Driver, registry: WidgetFolder, problems: Problems
) -> dict[str, WidgetUse]:
    """Return the widget for each slot that the driver or robot fills, before any interface."""
    slots: dict[str, WidgetUse] = {}
    for slot, parts in sources.slots.items():
        use: WidgetUse | None = None
        for part in parts:
            use = _use(part, use, driver, registry, problems) or use
        if use is not None:
            slots[slot] = use
    return slots


def link_interface(
    part: Node,
    interface: Interface,
    slots: Mapping[str, WidgetUse],
    driver: Driver | None,
    registry: WidgetFolder,
    problems: Problems,
) -> Interface:
    """Return the interface with its linked widgets.

    `slots` contains the driver's slots. Without a driver, the check covers only the interface.
    """
    shown = set(interface.shown)
    uses = {}
    for slot, inner in part.named("widgets").items():
        if slot not in shown:
            problems.warn(
                inner,
                "slot-not-shown",
                f"no grid of this interface has a slot {slot!r}",
                key=True,
                hint=did_you_mean(slot, shown, "slots"),
            )
        use = _use(inner, slots.get(slot), driver, registry, problems)
        if use is not None:
            uses[slot] = use
    if interface.background and driver is not None:
        _check_background(part, interface, {**slots, **uses}, problems)
    return interface._replace(widgets=uses)


def _check_background(
    part: Node, interface: Interface, slots: Mapping[str, WidgetUse], problems: Problems
) -> None:
    name = interface.background
    if name not in slots:
        problems.warn(
            part,
            "slot-not-filled",
            f"no widget fills the background {name!r}",
            at="background",
            hint=did_you_mean(name, slots, "slots"),
        )


def _use(
    part: Node,
    base: WidgetUse | None,
    driver: Driver | None,
    registry: WidgetFolder,
    problems: Problems,
) -> WidgetUse | None:
    """Return the slot `base` with the changes at `part`; None if a problem was reported."""
    name = part.text("use", base.widget if base else "")
    if not name:
        if driver is not None:
            problems.error(
                part,
                "missing-key",
                f"'use' is missing, and the driver has no widget for the slot {part.name!r}",
                key=True,
                hint=registry.hint(""),
            )
        return None
    widget = registry.get(name)
    if widget is None:
        if not registry.has(name):
            problems.error(
                part,
                "unknown-widget",
                f"there is no widget {name!r}",
                at="use",
                hint=registry.hint(name),
            )
        return None  # a broken manifest is reported in its own file
    bound = _bindings(part, widget, base, driver, problems)
    options, files, pages = _options(part, widget, base, problems)
    use = WidgetUse(
        slot=part.name,
        widget=name,
        inputs=bound.inputs,
        outputs=bound.outputs,
        options=options,
        title=part.text("title", base.title if base else ""),
        given=bound.given,
        lists=bound.lists,
        files=files,
        pages=pages,
    )
    if driver is not None:
        link_together(part, use, widget, driver, problems)
    return use


class _CollectedBindings(NamedTuple):
    """The collected bindings of a widget; the fields are the same as in `WidgetUse`."""

    inputs: dict[str, str]
    lists: dict[str, tuple[str, ...]]
    outputs: dict[str, str]
    given: dict[str, OutputBinding]


def _bindings(
    part: Node, widget: Widget, base: WidgetUse | None, driver: Driver | None, problems: Problems
) -> _CollectedBindings:
    old = base or WidgetUse("", "")
    outputs = _kept(old.outputs, widget.outputs)
    given = {key: one for key, one in old.given.items() if key in outputs}
    bound = _CollectedBindings(
        _kept(
            old.inputs, {key: port for key, port in widget.inputs.items() if not port.is_multiple}
        ),
        _kept(old.lists, {key: port for key, port in widget.inputs.items() if port.is_multiple}),
        outputs,
        given,
    )
    for key, inner in part.named("bind").items():
        if key in widget.inputs:
            _bind_input(inner, widget, bound, driver, problems)
        elif key not in widget.outputs:
            problems.error(
                inner,
                "unknown-input",
                f"widget {widget.name!r} has no input {key!r}",
                key=True,
                hint=did_you_mean(key, (*widget.inputs, *widget.outputs), "inputs"),
            )
        elif isinstance(inner.data, list):
            problems.error(
                inner,
                "wrong-type",
                f"{key!r} is an output and needs the name of a command",
                hint="only an input for several signals accepts a list",
            )
        else:
            port = widget.outputs[key]
            outputs[key], given[key] = link_output(inner, port, widget, driver, problems)
    if driver is not None:
        _check_required(part, widget, {**bound.inputs, **bound.lists, **outputs}, driver, problems)
    return bound


def _bind_input(
    part: Node, widget: Widget, bound: _CollectedBindings, driver: Driver | None, problems: Problems
) -> None:
    """Bind one input to its signal or signals."""
    port = widget.inputs[part.name]
    if isinstance(part.data, dict):
        problems.error(
            part,
            "wrong-type",
            f"{port.name!r} is an input and needs the name of a signal",
            hint="only outputs accept a command with arguments",
        )
    elif isinstance(part.data, list) and not port.is_multiple:
        problems.error(
            part,
            "wrong-type",
            f"{port.name!r} of widget {widget.name!r} takes one signal, not a list",
        )
    elif port.is_multiple:
        each = part.items() if isinstance(part.data, list) else [part]
        bound.lists[port.name] = tuple(inner.data for inner in each)
        if driver is not None:
            for inner in each:
                _check_signal(inner, widget, port, driver, problems)
    else:
        bound.inputs[port.name] = part.data
        if driver is not None:
            _check_signal(part, widget, port, driver, problems)


def _check_required(
    part: Node, widget: Widget, bound: Mapping[str, object], driver: Driver, problems: Problems
) -> None:
    tried = part.named("bind")  # problems in these bindings are already reported
    ports = (*widget.inputs, *widget.outputs)
    meant = {close for key in tried if key not in ports for close in closest(key, ports)}
    for port in (*widget.inputs.values(), *widget.outputs.values()):
        if port.is_required and port.name not in {*bound, *tried, *meant}:
            problems.error(
                part,
                "unbound-input",
                f"{port.name!r} of widget {widget.name!r} is not bound",
                at="bind" if "bind" in part.data else "",
                key=True,
                hint=_output_hint(port, driver)
                if port.name in widget.outputs
                else _binding_hint(port, driver),
            )


def _kept(bound: Mapping[str, _T], ports: Mapping[str, WidgetPort]) -> dict[str, _T]:
    return {key: target for key, target in bound.items() if key in ports}


def _binding_hint(port: WidgetPort, driver: Driver) -> str:
    fitting = [signal.name for signal in driver.signals.values() if not misfit(port, signal)]
    return (
        f"possible signals: {listed(fitting)}"
        if fitting
        else "the driver has no signal that fits this input"
    )


def _output_hint(port: WidgetPort, driver: Driver) -> str:
    fitting = [one.name for one in driver.commands.values() if takes(one, port)]
    if fitting:
        return f"possible commands: {listed(fitting)}"
    held = "a command with 'hold'" if port.is_held else "a command without 'hold'"
    return f"no command of the driver fits this output, which needs {held}"


def _check_signal(
    part: Node, widget: Widget, port: WidgetPort, driver: Driver, problems: Problems
) -> None:
    signal = driver.signals.get(part.data)
    if signal is None:
        problems.unknown(part, "unknown-signal", part.data, driver.signals)
        return
    wrong = misfit(port, signal)
    if wrong:
        text = f"signal {signal.name!r} does not fit {port.name!r} of widget {widget.name!r}"
        problems.error(part, wrong.code, f"{text}: {wrong.text}")


def misfit(port: WidgetPort, signal: Signal) -> Misfit | None:
    """Return why a signal does not fit an input; None if the signal fits."""
    text = _wrong_type(port, signal)
    if text:
        return Misfit("wrong-type", text)
    text = _wrong_unit(port, signal)
    return Misfit("wrong-unit", text) if text else None


def _wrong_type(port: WidgetPort, signal: Signal) -> str:
    types = (*port.types, "integer") if "number" in port.types else port.types
    if signal.type not in types:
        wanted = " or ".join(port.types)
        return f"type {wanted} is expected, but the signal has type {signal.type}"
    if signal.type != "array":
        return ""
    of = (*port.items, "integer") if "number" in port.items else port.items
    if of and signal.items not in of:
        wanted = " or ".join(port.items)
        return f"an array of {wanted} is expected, but the signal is an array of {signal.items}"
    if None not in (port.size, signal.size) and port.size != signal.size:
        return f"an array of {port.size} elements is expected, but the signal has {signal.size}"
    return ""


def _wrong_unit(port: WidgetPort, signal: Signal) -> str:
    if port.unit and conversion(signal.unit, port.unit) is None:
        has = f"in {signal.unit!r}" if signal.unit else "without a unit"
        return f"unit {port.unit!r} is expected, but the signal is {has}"
    if port.quantity and quantity_of(signal.unit) not in ("", port.quantity):
        return f"a unit of {port.quantity} is expected, but the signal has the unit {signal.unit!r}"
    return ""


def _options(
    part: Node, widget: Widget, base: WidgetUse | None, problems: Problems
) -> tuple[dict[str, object], dict[str, str], dict[str, tuple[str, ...]]]:
    """Return the options, files and pages; the options include the manifest's defaults."""
    options: dict[str, object] = {
        name: schema["default"]
        for name, schema in widget.options.items()
        if isinstance(schema, dict) and "default" in schema
    }
    files: dict[str, str] = {}
    pages: dict[str, tuple[str, ...]] = {}
    if base is not None and base.widget == widget.name:
        options |= base.options
        files |= base.files
        pages |= base.pages
    given = part.get("options")
    if given is not None:
        wrong = check_options(given.document, given.path, given.data, widget.options)
        problems.problems += wrong
        options |= given.data
        if not wrong:
            files |= link_files(given, widget, problems)
            pages |= link_pages(given, widget, problems)
    return options, files, pages
