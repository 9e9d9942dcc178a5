"""Interfaces: layouts of named slots, independent of transports and signals."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from urc.model.values import NOTHING, Value

__all__ = ["DEBUG", "OutputBinding", "Layout", "Interface", "SCREENS", "Slot", "Tab", "WidgetUse"]

SCREENS: Final = ("landscape", "portrait", "phone_portrait", "phone_landscape")
"""Kinds of screen with separate layouts."""

DEBUG: Final = "debug"
"""Name of the built-in interface of every robot; documents must not use this name."""


class OutputBinding(NamedTuple):
    """The mapping of a widget output's values to command arguments."""

    names: Mapping[str, str] = NOTHING
    """Name of the output value for each command argument with another name than its value."""
    fixed: Mapping[str, Value] = NOTHING
    """Constant values of command arguments, keyed by argument."""


class WidgetUse(NamedTuple):
    """A widget in a slot, with its bindings and options."""

    slot: str
    widget: str
    """Name of the widget, which is also the name of its folder."""
    inputs: Mapping[str, str] = NOTHING
    """Driver signals, keyed by widget input."""
    outputs: Mapping[str, str] = NOTHING
    """Driver commands, keyed by widget output."""
    options: Mapping[str, object] = NOTHING
    """Option values including defaults, validated against the widget's schema."""
    title: str = ""
    given: Mapping[str, OutputBinding] = NOTHING
    """Declared argument mappings, keyed by widget output."""
    lists: Mapping[str, tuple[str, ...]] = NOTHING
    """Lists of driver signals, keyed by the widget's multiple inputs."""
    files: Mapping[str, str] = NOTHING
    """Paths of the files that the options name, keyed by the file name in the option."""
    pages: Mapping[str, tuple[str, ...]] = NOTHING
    """Validated URLs of third-party pages, keyed by option."""


class Slot(NamedTuple):
    """A rectangle of a layout, with a 0-based row and column, and spans of at least 1."""

    name: str
    row: int
    column: int
    row_span: int = 1
    column_span: int = 1


class Layout(NamedTuple):
    """A layout: the number of rows, the number of columns, and the slots."""

    rows: int
    columns: int
    slots: tuple[Slot, ...]


class Tab(NamedTuple):
    """One page of an interface.

    `layouts` contains the declared layouts, keyed by the screens in `SCREENS`.
    """

    name: str = ""
    """Name of the tab; "" for the only page of an interface without tabs."""
    title: str = ""
    layouts: Mapping[str, Layout] = NOTHING
    left_handed: Mapping[str, Layout] = NOTHING
    """Declared left-handed layouts, keyed by screen."""
    is_mirrored: bool = True
    """Whether layouts without a left-handed version are mirrored for left-handed operators."""


class Interface(NamedTuple):
    """A named interface: one page of layouts, or several tabs."""

    name: str
    title: str = ""
    layouts: Mapping[str, Layout] = NOTHING
    """Layouts, keyed by screen; empty for an interface with tabs."""
    background: str = ""
    """Name of the background slot; "" means no background."""
    widgets: Mapping[str, WidgetUse] = NOTHING
    """Widgets that override the driver's widgets, keyed by slot."""
    summary: str = ""
    licence: str = ""
    """SPDX licence identifier from the document."""
    author: str = ""
    left_handed: Mapping[str, Layout] = NOTHING
    """Declared left-handed layouts, keyed by screen."""
    is_mirrored: bool = True
    tabs: Mapping[str, Tab] = NOTHING
    drawer: str = ""
    """Title of the drawer on a phone in landscape; "" means the titles of its first widgets."""

    @property
    def pages(self) -> tuple[Tab, ...]:
        """The tabs of the interface, or its only page."""
        only = Tab("", self.title, self.layouts, self.left_handed, self.is_mirrored)
        return tuple(self.tabs.values()) or (only,)

    @property
    def shown(self) -> tuple[str, ...]:
        """Names of all visible slots: the background first, then the others in reading order."""
        names = dict.fromkeys((self.background,) if self.background else ())
        for page in self.pages:
            for grid in (*page.layouts.values(), *page.left_handed.values()):
                ordered = sorted(grid.slots, key=lambda slot: (slot.row, slot.column))
                names |= dict.fromkeys(slot.name for slot in ordered)
        return tuple(names)
