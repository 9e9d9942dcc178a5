"""A sensible look for a profile that says nothing about it."""

import math
from collections.abc import Iterable, Mapping
from typing import Final

from urc.config.parse_widget import Shelf
from urc.model.driver import Driver
from urc.model.interface import Grid, Interface, Slot, WidgetUse

__all__ = ["default_interface", "default_slots"]

_COLUMNS: Final = {"wide": 4, "phone": 2}
"""Most columns of a made grid."""
_PLAIN_WIDGET: Final = "value"
"""Shows any signal."""


def default_slots(driver: Driver, shelf: Shelf) -> dict[str, WidgetUse]:
    """Return a slot for each signal, with the widget that shows any value."""
    widget = shelf.get(_PLAIN_WIDGET)
    if widget is None:
        return {}
    slots = {}
    for name, signal in driver.signals.items():
        for port in widget.inputs.values():
            if signal.type in port.types and port.unit in ("", signal.unit):
                slots[name] = WidgetUse(
                    name,
                    widget.name,
                    {port.name: name},
                    {},
                    _defaults(widget.options),
                    signal.title,
                )
                break
    return slots


def _defaults(options: Mapping[str, object]) -> dict[str, object]:
    return {
        name: schema["default"]
        for name, schema in options.items()
        if isinstance(schema, dict) and "default" in schema
    }


def default_interface(slots: Iterable[str], title: str) -> Interface:
    """Return an interface named ``default`` that shows every slot, row by row."""
    names = list(slots)
    return Interface(
        name="default",
        title=title,
        grids={screen: _grid(names, most) for screen, most in _COLUMNS.items()},
    )


def _grid(names: list[str], most: int) -> Grid:
    columns = max(1, min(most, math.ceil(math.sqrt(len(names)))))
    rows = max(1, math.ceil(len(names) / columns))
    slots = (Slot(name, place // columns, place % columns) for place, name in enumerate(names))
    return Grid(rows, columns, tuple(slots))
