"""Names on the side of the look: which widget fills a slot, and what it is bound to."""

from collections.abc import Mapping

from urc.config.gather import Sources
from urc.config.link_outputs import link_output
from urc.config.parse_widget import Shelf
from urc.config.part import Findings, Part
from urc.config.shape import check_options
from urc.config.suggest import did_you_mean, listed
from urc.model.driver import Driver
from urc.model.interface import Given, Interface, WidgetUse
from urc.model.values import Signal
from urc.model.widget import Port, Widget

__all__ = ["link_interface", "link_slots"]


def link_slots(
    sources: Sources, driver: Driver, shelf: Shelf, findings: Findings
) -> dict[str, WidgetUse]:
    """Return what fills each slot unless an interface says otherwise."""
    slots: dict[str, WidgetUse] = {}
    for slot, parts in sources.slots.items():
        use: WidgetUse | None = None
        for part in parts:
            use = _use(part, use, driver, shelf, findings) or use
        if use is not None:
            slots[slot] = use
    return slots


def link_interface(
    part: Part,
    interface: Interface,
    slots: Mapping[str, WidgetUse],
    driver: Driver | None,
    shelf: Shelf,
    findings: Findings,
) -> Interface:
    """Return the interface with what it changes in the slots.

    Args:
        part: where the interface stands.
        interface: as parsed.
        slots: what the driver fills.
        driver: None when the interface is checked by itself, without any driver.
        shelf: the widgets there are.
        findings: takes what is wrong.
    """
    shown = {slot.name for grid in interface.grids.values() for slot in grid.slots}
    shown.add(interface.background)
    uses = {}
    for slot, inner in part.named("widgets").items():
        if slot not in shown:
            findings.warn(
                inner,
                "slot-not-shown",
                f"no grid of this interface has a slot {slot!r}",
                key=True,
                hint=did_you_mean(slot, shown - {""}, "slots"),
            )
        use = _use(inner, slots.get(slot), driver, shelf, findings)
        if use is not None:
            uses[slot] = use
    if interface.background and driver is not None:
        _check_background(part, interface, {**slots, **uses}, findings)
    return interface._replace(widgets=uses)


def _check_background(
    part: Part, interface: Interface, slots: Mapping[str, WidgetUse], findings: Findings
) -> None:
    name = interface.background
    if name not in slots:
        findings.warn(
            part,
            "slot-not-filled",
            f"no widget fills the background {name!r}",
            at="background",
            hint=did_you_mean(name, slots, "slots"),
        )


def _use(
    part: Part, base: WidgetUse | None, driver: Driver | None, shelf: Shelf, findings: Findings
) -> WidgetUse | None:
    """Return what `part` makes of a slot that `base` fills so far; None when it was reported."""
    name = part.text("use", base.widget if base else "")
    if not name:
        if driver is not None:
            findings.error(
                part,
                "missing-key",
                f"'use' is missing: no widget fills {part.name!r}",
                key=True,
                hint=shelf.hint(""),
            )
        return None
    widget = shelf.get(name)
    if widget is None:
        if not shelf.has(name):
            findings.error(
                part,
                "unknown-widget",
                f"there is no widget {name!r}",
                at="use",
                hint=shelf.hint(name),
            )
        return None  # a broken manifest is told where it stands
    inputs, outputs, given = _bindings(part, widget, base, driver, findings)
    return WidgetUse(
        slot=part.name,
        widget=name,
        inputs=inputs,
        outputs=outputs,
        options=_options(part, widget, base, findings),
        title=part.text("title", base.title if base else ""),
        given=given,
    )


def _bindings(
    part: Part, widget: Widget, base: WidgetUse | None, driver: Driver | None, findings: Findings
) -> tuple[dict[str, str], dict[str, str], dict[str, Given]]:
    inputs = _kept(base.inputs if base else {}, widget.inputs)
    outputs = _kept(base.outputs if base else {}, widget.outputs)
    given = {key: one for key, one in (base.given if base else {}).items() if key in outputs}
    for key, inner in part.named("bind").items():
        if key in widget.inputs:
            if not isinstance(inner.data, str):
                findings.error(
                    inner,
                    "wrong-type",
                    f"{key!r} is an input: the name of a signal is expected",
                    hint="only outputs take a command with its arguments",
                )
                continue
            inputs[key] = inner.data
            if driver is not None:
                _check_signal(inner, widget, widget.inputs[key], driver, findings)
        elif key in widget.outputs:
            port = widget.outputs[key]
            outputs[key], given[key] = link_output(inner, port, widget, driver, findings)
        else:
            findings.error(
                inner,
                "unknown-input",
                f"widget {widget.name!r} has no input {key!r}",
                key=True,
                hint=did_you_mean(key, (*widget.inputs, *widget.outputs), "inputs"),
            )
    if driver is not None:
        ports = [*widget.inputs.values(), *widget.outputs.values()]
        for port in ports:
            if port.is_required and port.name not in inputs and port.name not in outputs:
                findings.error(
                    part,
                    "unbound-input",
                    f"{port.name!r} of widget {widget.name!r} is not bound",
                    at="bind" if "bind" in part.data else "",
                    key=True,
                    hint=_binding_hint(port, driver),
                )
    return inputs, outputs, given


def _kept(bound: Mapping[str, str], ports: Mapping[str, Port]) -> dict[str, str]:
    return {key: target for key, target in bound.items() if key in ports}


def _binding_hint(port: Port, driver: Driver) -> str:
    fitting = [signal.name for signal in driver.signals.values() if not _misfit(port, signal)]
    return f"signals that fit: {listed(fitting)}" if fitting else "no signal of the driver fits"


def _check_signal(
    part: Part, widget: Widget, port: Port, driver: Driver, findings: Findings
) -> None:
    signal = driver.signals.get(part.data)
    if signal is None:
        findings.error(
            part,
            "unknown-signal",
            f"there is no signal {part.data!r}",
            hint=did_you_mean(part.data, driver.signals, "signals"),
        )
        return
    misfit = _misfit(port, signal)
    if misfit:
        code = "wrong-unit" if misfit.startswith("unit") else "wrong-type"
        findings.error(
            part,
            code,
            f"signal {signal.name!r} does not fit {port.name!r} of widget"
            f" {widget.name!r}: {misfit}",
        )


def _misfit(port: Port, signal: Signal) -> str:
    """Return why a signal cannot be bound to an input, or "" when it can."""
    types = (*port.types, "integer") if "number" in port.types else port.types
    if signal.type not in types:
        return f"type {' or '.join(port.types)} is wanted, the signal is {signal.type}"
    if port.unit and signal.unit != port.unit:
        has = f"in {signal.unit!r}" if signal.unit else "without a unit"
        return f"unit {port.unit!r} is wanted, the signal is {has}"
    return ""


def _options(
    part: Part, widget: Widget, base: WidgetUse | None, findings: Findings
) -> dict[str, object]:
    """Return the options with the manifest's defaults filled in."""
    options: dict[str, object] = {
        name: schema["default"]
        for name, schema in widget.options.items()
        if isinstance(schema, dict) and "default" in schema
    }
    if base is not None and base.widget == widget.name:
        options |= base.options
    given = part.get("options")
    if given is not None:
        findings.problems += check_options(given.document, given.path, given.data, widget.options)
        options |= given.data
    return options
