"""Widgets: declared inputs, outputs and options of graphic parts."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from urc.model.values import NOTHING

__all__ = ["WidgetPort", "Widget"]


class WidgetPort(NamedTuple):
    """An input or output of a widget."""

    name: str
    types: tuple[str, ...] = ("number",)
    """Signal types that an input accepts, or value types of an output; () for any."""
    unit: str = ""
    """Required unit; "" accepts any."""
    quantity: str = ""
    """For an input: required quantity, in any of its units without conversion; "" accepts any."""
    unit_of: str = ""
    """Input or output of the same widget with which the unit is shared; "" for none."""
    is_required: bool = True
    description: str = ""
    is_held: bool = False
    """For an output: whether it is a hold-to-run control. A hold-to-run output takes only motion
    commands."""
    arguments: tuple[str, ...] = ()
    """For an output: names of its values; those of a held output range from -1 to 1."""
    items: tuple[str, ...] = ()
    """For an array input: accepted element types; () for any."""
    size: int | None = None
    """For an array input: required number of elements; None for any."""
    is_multiple: bool = False
    """For an input: whether it takes a list of signals, each of which must fit."""
    keeps_all: bool = False
    """For an input: whether it receives every sample, not only the newest."""
    replaces: tuple[str, ...] = ()
    """For an input: inputs and options of the same widget that it replaces when bound."""


class Widget(NamedTuple):
    """A widget as its ``widget.yaml`` declares it."""

    name: str
    """Name of the widget, equal to that of its folder."""
    title: str
    folder: Path
    inputs: Mapping[str, WidgetPort] = NOTHING
    outputs: Mapping[str, WidgetPort] = NOTHING
    options: Mapping[str, object] = NOTHING
    """JSON Schema ``properties`` of its options."""
    at_least_one_of: tuple[str, ...] = ()
    """Inputs, outputs and options, at least one of which is required; () for none."""
    required_together: tuple[tuple[str, ...], ...] = ()
    """Groups of inputs or outputs that work only when all of a group are bound."""
    min_cells: tuple[int, int] = (1, 1)
    """Columns, rows."""
    is_dead_man: bool = False
    """Whether it is a dead-man control: while it is released, no motion is sent."""
    summary: str = ""
    licence: str = ""
    """SPDX identifier from the manifest."""
    author: str = ""
