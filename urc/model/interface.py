"""Interfaces: a picture of named slots. They know no transport and no signal of their own."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from urc.model.values import NOTHING, Value

__all__ = ["DEBUG", "Given", "Grid", "Interface", "Slot", "Tab", "WidgetUse"]

DEBUG: Final = "debug"
"""The interface that URC makes for every robot; no document may use its name."""


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
    lists: Mapping[str, tuple[str, ...]] = NOTHING
    """Input of the widget that takes many → signals of the driver, in order."""
    files: Mapping[str, str] = NOTHING
    """File as an option names it → where it is."""
    pages: Mapping[str, tuple[str, ...]] = NOTHING
    """Option → URLs of other people's pages that it names, as they were found to be right."""


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


class Tab(NamedTuple):
    """One page of an interface.

    `grids` has an entry per screen: ``wide``, ``tall``, ``phone``, ``low``.
    """

    name: str = ""
    """"" of the only page of an interface without tabs."""
    title: str = ""
    grids: Mapping[str, Grid] = NOTHING
    left: Mapping[str, Grid] = NOTHING
    """Pictures for who works with the left hand, by screen; those that are drawn."""
    is_mirrored: bool = True
    """Whether that person sees the columns of the other pictures the other way round."""


class Interface(NamedTuple):
    """A named layout: its own grids, or several pages of them."""

    name: str
    title: str = ""
    grids: Mapping[str, Grid] = NOTHING
    """By screen; none when there are tabs."""
    background: str = ""
    """Slot that lies behind everything; "" when there is none."""
    widgets: Mapping[str, WidgetUse] = NOTHING
    """Overrides of what the driver puts into a slot."""
    summary: str = ""
    licence: str = ""
    """SPDX identifier, as the document says."""
    author: str = ""
    left: Mapping[str, Grid] = NOTHING
    """As of a tab."""
    is_mirrored: bool = True
    tabs: Mapping[str, Tab] = NOTHING

    @property
    def pages(self) -> tuple[Tab, ...]:
        """Every page; never empty."""
        only = Tab("", self.title, self.grids, self.left, self.is_mirrored)
        return tuple(self.tabs.values()) or (only,)

    @property
    def shown(self) -> tuple[str, ...]:
        """Every slot that is shown, the background first, then in reading order; each once."""
        names = dict.fromkeys((self.background,) if self.background else ())
        for page in self.pages:
            for grid in (*page.grids.values(), *page.left.values()):
                ordered = sorted(grid.slots, key=lambda slot: (slot.row, slot.column))
                names |= dict.fromkeys(slot.name for slot in ordered)
        return tuple(names)
