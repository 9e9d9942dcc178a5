"""Interfaces: layouts of named slots, independent of transports and signals."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from urc.model.values import NOTHING, Value

__all__ = ["DEBUG", "OutputBinding", "Layout", "Interface", "SCREENS", "Slot", "Tab", "WidgetUse"]

SCREENS: Final = ("landscape", "portrait", "phone_portrait", "phone_landscape")
"""Kinds of screen that have a layout of their own."""

DEBUG: Final = "debug"
"""The built-in interface of every robot; documents must not use its name."""


class OutputBinding(NamedTuple):
    """Values that an output of a widget gives to the arguments of its command."""

    names: Mapping[str, str] = NOTHING
    """Argument of the command → argument of the output, where the names differ."""
    fixed: Mapping[str, Value] = NOTHING
    """Argument of the command → constant value."""


class WidgetUse(NamedTuple):
    """The widget in a slot, with its bindings and options."""

    slot: str
    widget: str
    """Name of a widget folder."""
    inputs: Mapping[str, str] = NOTHING
    """Input of the widget → signal of the driver."""
    outputs: Mapping[str, str] = NOTHING
    """Output of the widget → command of the driver."""
    options: Mapping[str, object] = NOTHING
    """Options with defaults, validated against the schema of the widget."""
    title: str = ""
    given: Mapping[str, OutputBinding] = NOTHING
    """Output of the widget → its binding, where one is declared."""
    lists: Mapping[str, tuple[str, ...]] = NOTHING
    """List input of the widget → signals of the driver, in order."""
    files: Mapping[str, str] = NOTHING
    """File name in an option → path of the file."""
    pages: Mapping[str, tuple[str, ...]] = NOTHING
    """Option → validated URLs of third-party pages."""


class Slot(NamedTuple):
    """A rectangle of a layout; rows and columns are 0-based, spans at least 1."""

    name: str
    row: int
    column: int
    row_span: int = 1
    column_span: int = 1


class Layout(NamedTuple):
    """One layout: numbers of rows and columns, and its slots."""

    rows: int
    columns: int
    slots: tuple[Slot, ...]


class Tab(NamedTuple):
    """One page of an interface.

    `layouts` has the layout of each screen of `SCREENS` that is drawn.
    """

    name: str = ""
    """Name of the page; "" for an interface without tabs."""
    title: str = ""
    layouts: Mapping[str, Layout] = NOTHING
    left_handed: Mapping[str, Layout] = NOTHING
    """Screen → declared left-handed layout."""
    is_mirrored: bool = True
    """Whether all other layouts are mirrored for left-handed operators."""


class Interface(NamedTuple):
    """A named interface: its own layouts, or several pages of them."""

    name: str
    title: str = ""
    layouts: Mapping[str, Layout] = NOTHING
    """Screen → layout; empty when there are tabs."""
    background: str = ""
    """Name of the slot behind all others; "" for no background."""
    widgets: Mapping[str, WidgetUse] = NOTHING
    """Overrides of the widgets of the driver, by slot."""
    summary: str = ""
    licence: str = ""
    """SPDX identifier from the document."""
    author: str = ""
    left_handed: Mapping[str, Layout] = NOTHING
    """Left-handed layouts, as in a tab."""
    is_mirrored: bool = True
    tabs: Mapping[str, Tab] = NOTHING

    @property
    def pages(self) -> tuple[Tab, ...]:
        """All pages of the interface; never empty."""
        only = Tab("", self.title, self.layouts, self.left_handed, self.is_mirrored)
        return tuple(self.tabs.values()) or (only,)

    @property
    def shown(self) -> tuple[str, ...]:
        """All visible slots, each once: the background first, then in reading order."""
        names = dict.fromkeys((self.background,) if self.background else ())
        for page in self.pages:
            for grid in (*page.layouts.values(), *page.left_handed.values()):
                ordered = sorted(grid.slots, key=lambda slot: (slot.row, slot.column))
                names |= dict.fromkeys(slot.name for slot in ordered)
        return tuple(names)
