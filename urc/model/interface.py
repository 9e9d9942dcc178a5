"""Interfaces: a picture of named slots. They know no transport and no signal of their own."""

from collections.abc import Mapping
from typing import NamedTuple

from urc.model.values import NOTHING, Value

__all__ = ["Given", "Grid", "Interface", "Slot", "WidgetUse"]


class Given(NamedTuple):
    """What an output of a widget gives to the arguments of its command."""

    names: Mapping[str, str] = NOTHING
    """Argument of the command → argument of the output, where they are not called the same."""
    fixed: Mapping[str, Value] = NOTHING
    """Argument of the command → value that it always has."""


class WidgetUse(NamedTuple):
    """Which widget fills a slot, what its inputs are bound to, and its options."""

    slot: str
    widget: str
    """Name of a widget folder."""
    inputs: Mapping[str, str] = NOTHING
    """Input of the widget → signal of the driver."""
    outputs: Mapping[str, str] = NOTHING
    """Output of the widget → command of the driver."""
    options: Mapping[str, object] = NOTHING
    """Checked against the widget's own option schema, defaults filled in."""
    title: str = ""
    given: Mapping[str, Given] = NOTHING
    """Output of the widget → what goes where, for those that say so."""


class Slot(NamedTuple):
    """A rectangle of a grid; rows and columns are 0-based, spans at least 1."""

    name: str
    row: int
    column: int
    row_span: int = 1
    column_span: int = 1


class Grid(NamedTuple):
    """One picture: how many rows and columns, and the slots in it."""

    rows: int
    columns: int
    slots: tuple[Slot, ...]


class Interface(NamedTuple):
    """A named layout. `grids` has an entry per screen: ``wide``, ``tall``, ``phone``."""

    name: str
    title: str = ""
    grids: Mapping[str, Grid] = NOTHING
    background: str = ""
    """Slot that lies behind everything; "" when there is none."""
    widgets: Mapping[str, WidgetUse] = NOTHING
    """Overrides of what the driver puts into a slot."""
    summary: str = ""
    licence: str = ""
    """SPDX identifier, as the document says."""
    author: str = ""
