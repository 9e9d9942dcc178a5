"""Widgets: declared inputs, outputs and options."""

from collections.abc import Mapping
from pathlib import Path
from typing import Literal, NamedTuple

from urc.model.values import NOTHING

__all__ = ["Footprint", "WidgetPort", "Widget"]

Footprint = Literal["value", "button", "stick", "lever", "instrument", "view", "list"]
"""Size class of a widget in front of a background. A lever is a slider, an instrument is a round
display, a view is a camera or map, and a list contains lines."""


class WidgetPort(NamedTuple):
    """An input or output of a widget."""

    name: str
    types: tuple[str, ...] = ("number",)
    """Signal types accepted by an input, or value types of an output; () means any type."""
    unit: str = ""
    """Required unit of an input or output; "" means any unit."""
    quantity: str = ""
    """For an input: required quantity, in any unit and without conversion; "" means any
    quantity."""
    unit_of: str = ""
    """Name of another input or output that must have the same unit, or ""."""
    is_required: bool = True
    description: str = ""
    is_held: bool = False
    """For an output: whether the output is a hold-to-run control. A hold-to-run output accepts only
    motion commands."""
    arguments: tuple[str, ...] = ()
    """For an output: names of the values; hold-to-run values range from -1 to 1."""
    items: tuple[str, ...] = ()
    """For an array input: accepted element types; () means any type."""
    size: int | None = None
    """For an array input: required number of elements; None means any number."""
    is_multiple: bool = False
    """For an input: whether the input accepts a list of signals, each of an accepted type."""
    keeps_all: bool = False
    """For an input: whether the widget receives every sample, not only the newest."""
    replaces: tuple[str, ...] = ()
    """For an input: inputs and options of the same widget that the input replaces when it is
    bound."""


class Widget(NamedTuple):
    """A widget, as declared in its ``widget.yaml``."""

    name: str
    """Name of the widget, which is also the name of its folder."""
    title: str
    folder: Path
    inputs: Mapping[str, WidgetPort] = NOTHING
    outputs: Mapping[str, WidgetPort] = NOTHING
    options: Mapping[str, object] = NOTHING
    """JSON Schema ``properties`` of the widget's options."""
    at_least_one_of: tuple[str, ...] = ()
    """Inputs, outputs and options of which at least one is required; () means no such rule."""
    required_together: tuple[tuple[str, ...], ...] = ()
    """Groups of inputs or outputs that work only when all members of the group are bound."""
    common_frame: tuple[str, ...] = ()
    """Inputs whose values the widget shows in one coordinate frame."""
    min_cells: tuple[int, int] = (1, 1)
    """Minimum number of columns and rows that the widget needs in its slot."""
    footprint: Footprint = "instrument"
    is_dead_man: bool = False
    """Whether the widget is a dead-man control, whose release blocks all motion commands."""
    summary: str = ""
    licence: str = ""
    """SPDX licence identifier of the widget, from the manifest."""
    author: str = ""
