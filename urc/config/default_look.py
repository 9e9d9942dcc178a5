"""The default interface: a grid with a widget for each signal and command.

The result depends only on the driver and the available widgets. If a widget is missing or does not
fit its signal, a simpler widget replaces it. Commands with several arguments may have no widget,
because the developer page has a form for every command.
"""

import math
import re
from collections.abc import Iterator, Mapping
from typing import Final

from urc.config.link.interface import misfit
from urc.config.parse.widget import WidgetFolder
from urc.model.driver import Argument, Command, Driver
from urc.model.interface import Interface, Layout, OutputBinding, Slot, WidgetUse
from urc.model.units import are_apart
from urc.model.values import Signal
from urc.model.widget import Widget

__all__ = ["automatic_slots", "default_interface"]

MOST_PLAIN: Final = 24
"""Maximum number of signals with their own cells; a table shows the remaining signals."""
MOST_COMMANDS: Final = 16

_BATTERY: Final = re.compile(r"batter|charge|\bsoc\b", re.IGNORECASE)
_FORWARD: Final = ("x", "forward", "linear", "vx", "v", "speed", "throttle", "surge")
_TURN: Final = ("y", "turn", "angular", "wz", "w", "yaw", "steering", "rotation", "vy", "sideways")
_GROUPS: Final[tuple[tuple[str, Mapping[str, tuple[str, ...]], frozenset[str]], ...]] = (
    (
        "map",
        {
            "latitude": ("latitude", "lat"),
            "longitude": ("longitude", "lon", "lng", "long"),
        },
        frozenset(("latitude", "longitude")),
    ),
    (
        "attitude",
        {"roll": ("roll",), "pitch": ("pitch",), "yaw": ("yaw",), "heading": ("heading",)},
        frozenset(("roll", "pitch")),
    ),
    ("compass", {"heading": ("heading", "bearing", "course")}, frozenset(("heading",))),
    ("compass", {"yaw": ("yaw",)}, frozenset(("yaw",))),
)
"""Widgets for several signals: name, endings of the signals' names by input, required inputs."""

_COLUMNS: Final = {"landscape": 4, "phone_portrait": 2, "phone_landscape": 7}
"""Maximum number of columns in a default grid, by screen."""
_LOW_ROWS: Final = 2
"""Number of visible rows on a phone in landscape."""
_BIG: Final = frozenset(
    (
        *("attitude", "camera", "depth", "dpad", "image", "joystick", "log", "map", "pano360"),
        *("path-pad", "plot", "scan", "scene3d", "table", "terminal", "transforms", "vector-pad"),
    )
)
"""Names of the widgets that span two rows and two columns."""
_GROUNDS: Final = ("camera", "pano360", "map")
"""Widgets that can fill the background, in order of preference."""
_ACROSS: Final = (0, 4, 1, 3, 2)
"""Columns in front of a background, by number, in the order in which displays fill them."""
_MOST_OVER: Final = 14
"""Maximum number of widgets in front of a background."""
_STEERED: Final = 2
"""Rank of a steering control when widgets are sorted; see `_rank`."""


def automatic_slots(driver: Driver, registry: WidgetFolder) -> dict[str, WidgetUse]:
    """Return the widget for each slot, with signal displays before controls."""
    slots: dict[str, WidgetUse] = {}
    left = dict(driver.signals)
    for use in _grouped(left, registry):
        _put(slots, use)
    plain = [one for one in left.values() if one.type not in ("blob", "object", "array")]
    table = _table(plain[MOST_PLAIN:], registry) if len(plain) > MOST_PLAIN else None
    for signal in plain[:MOST_PLAIN] if table is not None else plain:
        shown = _shown(signal, registry)
        if shown is not None:
            _put(slots, shown)
    if table is not None:
        _put(slots, table)
    given = [_given(one, driver, registry) for one in driver.commands.values()]
    for use in [one for one in given if one is not None][:MOST_COMMANDS]:
        _put(slots, use)
    return slots


def _put(slots: dict[str, WidgetUse], use: WidgetUse) -> None:
    """Add a widget under a free and valid slot name."""
    name = re.sub(r"[^a-z0-9_-]", "-", use.slot.lower()).lstrip("-_0123456789")[:60] or "slot"
    names = (name, *(f"{name}-{number}" for number in range(2, len(slots) + 3)))
    free = next(one for one in names if one not in slots)
    slots[free] = use._replace(slot=free)


# ---- signals


def _grouped(left: dict[str, Signal], registry: WidgetFolder) -> Iterator[WidgetUse]:
    """Yield the widgets that show several signals, and remove these signals from `left`."""
    for widget_name, inputs, needed in _GROUPS:
        widget = registry.get(widget_name)
        if widget is None or not needed <= widget.inputs.keys():
            continue
        for stem, found in _stems(left, inputs).items():
            bound = {
                name: signal
                for name, signal in found.items()
                if name in widget.inputs and not misfit(widget.inputs[name], signal)
            }
            if needed <= bound.keys():
                for signal in bound.values():
                    del left[signal.name]
                title = stem.replace("_", " ").capitalize()
                names = {name: signal.name for name, signal in bound.items()}
                yield _use(widget, stem or widget_name, names, title)


def _stems(
    signals: Mapping[str, Signal], inputs: Mapping[str, tuple[str, ...]]
) -> dict[str, dict[str, Signal]]:
    """Group signals by name minus the last word: ``gps`` for ``gps_lat`` and ``gps_lon``."""
    stems: dict[str, dict[str, Signal]] = {}
    for signal in signals.values():
        stem, _, last = signal.name.rpartition("_")
        for name, words in inputs.items():
            if last.lower() in words:
                stems.setdefault(stem, {}).setdefault(name, signal)
    return stems


def _shown(signal: Signal, registry: WidgetFolder) -> WidgetUse | None:
    """Return the most specific suitable widget for a signal."""
    if signal.type == "occupancy_grid":
        return _view(registry.get("map"), "grids", signal)
    if signal.type == "point_cloud":
        return _view(registry.get("scene3d"), "cloud", signal)
    for name in _candidates(signal):
        use = _one_input(registry.get(name), signal)
        if use is not None:
            return use
    return None


def _view(widget: Widget | None, name: str, signal: Signal) -> WidgetUse | None:
    """Return a map or scene whose input `name` is the signal; None without such a widget."""
    port = widget.inputs.get(name) if widget is not None else None
    if widget is None or port is None or misfit(port, signal):
        return None
    if not port.is_multiple:
        return _use(widget, signal.name, {port.name: signal.name}, signal.title)
    use = _use(widget, signal.name, {}, signal.title)
    return use._replace(lists={port.name: (signal.name,)})


def _candidates(signal: Signal) -> tuple[str, ...]:
    if signal.type in ("image", "video"):
        return ("camera", "image")
    if signal.type == "transform_tree":
        return ("transforms",)
    if signal.type == "boolean" or signal.states:
        return ("state", "value")
    if signal.type not in ("integer", "number"):
        return ("value",)
    if signal.unit == "%" and _BATTERY.search(f"{signal.name} {signal.title}".replace("_", " ")):
        return ("battery", "gauge", "value")
    if signal.min is not None and signal.max is not None:
        return ("gauge", "bar", "value")
    return ("value",)


def _one_input(widget: Widget | None, signal: Signal) -> WidgetUse | None:
    """Return the widget with one input bound to the signal; None if more inputs are required."""
    if widget is None:
        return None
    fitting = [
        port.name
        for port in sorted(widget.inputs.values(), key=lambda port: not port.is_required)
        if not port.is_multiple and not misfit(port, signal)
    ]
    needed = {port.name for port in widget.inputs.values() if port.is_required}
    if not fitting or needed - {fitting[0]}:
        return None
    return _use(widget, signal.name, {fitting[0]: signal.name}, signal.title)


def _table(signals: list[Signal], registry: WidgetFolder) -> WidgetUse | None:
    widget = registry.get("table")
    port = (
        next((one for one in widget.inputs.values() if one.is_multiple), None) if widget else None
    )
    if widget is None or port is None:
        return None
    fitting = tuple(one.name for one in signals if not misfit(port, one))
    if len(fitting) < len(signals):
        return None
    return _use(widget, "more", {}, "More")._replace(lists={port.name: fitting})


# ---- commands


def _given(command: Command, driver: Driver, registry: WidgetFolder) -> WidgetUse | None:
    """Return the widget that sends a command; None if no widget provides all required arguments."""
    if command.hold is not None:
        held = _held(command, registry)
        return held if held is not None and _is_complete(held, command) else None
    needed = [one for one in command.arguments.values() if one.is_required]
    if not needed:
        return _output(registry.get("button"), command, {})
    if len(needed) > 1:
        return None
    for name in _inputs_for(needed[0]):
        use = _output(registry.get(name), command, {needed[0].name: "value"})
        if use is not None:
            return _with_state(use, needed[0], driver, registry)
    return None


def _inputs_for(argument: Argument) -> tuple[str, ...]:
    if argument.type == "boolean":
        return ("switch", "select")
    if argument.choices:
        return ("select",)
    if argument.type in ("integer", "number"):
        has_range = argument.min is not None and argument.max is not None
        return ("slider", "number") if has_range else ("number",)
    return ("text",) if argument.type == "string" else ()


def _held(command: Command, registry: WidgetFolder) -> WidgetUse | None:
    axes = [
        one.name
        for one in command.arguments.values()
        if one.type in ("integer", "number") and one.max is not None
    ]
    if len(axes) == 1:
        return _output(registry.get("axis"), command, {axes[0]: "value"}) or _output(
            registry.get("hold-button"), command, {axes[0]: "level"}
        )
    if axes:
        forward = next((one for one in axes if _says(one, _FORWARD)), axes[0])
        others = [one for one in axes if one != forward]
        turn = next((one for one in others if _says(one, _TURN)), others[0])
        return _output(registry.get("joystick"), command, {forward: "x", turn: "y"})
    return _output(registry.get("hold-button"), command, {})


def _is_complete(use: WidgetUse, command: Command) -> bool:
    """Return whether the control provides every argument that its command requires."""
    given = {name for one in use.given.values() for name in one.names}
    needed = {
        name for name, one in command.arguments.items() if one.is_required and one.default is None
    }
    return needed <= given


def _says(name: str, words: tuple[str, ...]) -> bool:
    return name.lower() in words or name.lower().rpartition("_")[2] in words


def _output(widget: Widget | None, command: Command, names: Mapping[str, str]) -> WidgetUse | None:
    """Bind the command to the widget's first output that provides the values in `names`."""
    if widget is None or any(port.is_required for port in widget.inputs.values()):
        return None
    is_held = command.hold is not None
    for port in widget.outputs.values():
        if port.is_held is is_held and set(names.values()) <= set(port.arguments):
            given = {port.name: OutputBinding(dict(names))}
            use = _use(widget, command.name, {}, command.title)
            return use._replace(outputs={port.name: command.name}, given=given)
    return None


def _with_state(
    use: WidgetUse, argument: Argument, driver: Driver, registry: WidgetFolder
) -> WidgetUse:
    """Also bind the widget to a signal with the same name as the argument or command, if any."""
    widget = registry.get(use.widget)
    port = widget.inputs.get("state") if widget is not None else None
    command = next(iter(use.outputs.values()))
    for name in (argument.name, command):
        signal = driver.signals.get(name)
        if port is None or signal is None or misfit(port, signal):
            continue
        if not port.unit_of or not are_apart(signal.unit, argument.unit):
            return use._replace(inputs={port.name: name})
    return use


def _use(widget: Widget, slot: str, inputs: Mapping[str, str], title: str) -> WidgetUse:
    options = {
        name: schema["default"]
        for name, schema in widget.options.items()
        if isinstance(schema, dict) and "default" in schema
    }
    return WidgetUse(slot, widget.name, dict(inputs), {}, options, title)


def default_interface(slots: Mapping[str, WidgetUse], title: str) -> Interface:
    """Return an interface named ``default`` that shows every slot.

    Displays are at the top of the grid, with the largest display first. Steering controls are at
    the bottom right, near the thumb. Other controls fill the free cells. On a phone in landscape,
    steering controls are in the first rows at the right and left edges; other widgets are between
    them and below.
    """
    ground = _ground(slots)
    if ground:
        over = {name: use for name, use in slots.items() if name != ground}
        layouts = {screen: _over_ground(over, screen) for screen in _COLUMNS}
        return Interface("default", title, layouts, ground)
    return Interface("default", title, {screen: _grid(slots, screen) for screen in _COLUMNS})


def _ground(slots: Mapping[str, WidgetUse]) -> str:
    """Return the background slot; "" if no widget is suitable.

    A single slot needs no background, and too many other widgets would hide the background.
    """
    if not 1 < len(slots) <= _MOST_OVER + 1:
        return ""
    found = {use.widget: name for name, use in reversed(list(slots.items()))}
    return next((found[one] for one in _GROUNDS if one in found), "")


def _over_ground(slots: Mapping[str, WidgetUse], screen: str) -> Layout:
    """Return the layout in front of a background: displays at the top, controls at the bottom.

    Sticks are in the lower corners, with the first stick on the right. The layout for a phone in
    portrait has two columns, with the displays first.
    """
    ranks = {name: _rank(use) for name, use in slots.items()}
    sticks = [name for name, rank in ranks.items() if rank == _STEERED]
    shown = [name for name, rank in ranks.items() if rank in (0, 1)]
    controls = [name for name, rank in ranks.items() if rank == 3]
    if screen == "phone_portrait":
        names = [*sorted(shown, key=lambda name: -ranks[name]), *controls, *reversed(sticks)]
        pairs = (Slot(name, place // 2, place % 2) for place, name in enumerate(names))
        return Layout(math.ceil(len(names) / 2), 2, tuple(pairs))
    top = math.ceil(len(shown) / len(_ACROSS))
    corners = {4: sticks[:1] or controls[:1], 0: sticks[1:2] or controls[1:2]}
    taken = [name for names in corners.values() for name in names]
    rest = [name for name in (*sticks, *controls) if name not in taken]
    last = top + 1 + math.ceil(len(rest) / 3)
    placed = [
        *(Slot(name, place // 5, _ACROSS[place % 5]) for place, name in enumerate(shown)),
        *(Slot(name, last - place // 3, 1 + place % 3) for place, name in enumerate(rest)),
        *(Slot(name, last, column) for column, names in corners.items() for name in names),
    ]
    return Layout(last + 1, len(_ACROSS), tuple(placed))


def _grid(slots: Mapping[str, WidgetUse], screen: str) -> Layout:
    is_low = screen == "phone_landscape"
    sizes = {name: 2 if use.widget in _BIG else 1 for name, use in slots.items()}
    area = sum(size * size for size in sizes.values())
    wanted = math.ceil(area / _LOW_ROWS if is_low else math.sqrt(area))
    columns = max(1, min(_COLUMNS[screen], wanted), *sizes.values())
    taken: set[tuple[int, int]] = set()
    placed: dict[str, Slot] = {}
    ranks = {name: _rank(use) for name, use in slots.items()}
    # In a narrow grid, steering controls come last, at the bottom.
    steered = -1 if is_low else _STEERED if columns > 2 else 4
    order = {name: steered if rank == _STEERED else rank for name, rank in ranks.items()}
    for number, name in enumerate(sorted(slots, key=lambda name: order[name])):
        is_steered = ranks[name] == _STEERED
        is_last = is_steered and not is_low
        first = max((row for row, _ in taken), default=-1) + 1 if is_last else 0
        is_right = is_steered and not (is_low and number % 2)
        row, column = _free(taken, columns, sizes[name], first, is_from_right=is_right)
        taken |= _cells(row, column, sizes[name])
        placed[name] = Slot(name, row, column, sizes[name], sizes[name])
    rows = max((row for row, _ in taken), default=0) + 1
    return Layout(rows, columns, tuple(placed.values()))


def _rank(use: WidgetUse) -> int:
    """Return a widget's rank: 0 large display, 1 small display, 2 steering control, 3 others."""
    if use.widget in _BIG:
        return _STEERED if use.outputs and not use.inputs else 0
    return 3 if use.outputs else 1


def _free(
    taken: set[tuple[int, int]], columns: int, size: int, first: int, *, is_from_right: bool
) -> tuple[int, int]:
    """Return the row and column of the first free square, starting the search in row `first`."""
    places = range(columns - size + 1)
    row = first
    while True:
        for column in reversed(places) if is_from_right else places:
            if not taken & _cells(row, column, size):
                return row, column
        row += 1


def _cells(row: int, column: int, size: int) -> set[tuple[int, int]]:
    return {(row + down, column + right) for down in range(size) for right in range(size)}
