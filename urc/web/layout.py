"""The picture of an interface as CSS: where each cell lies, for each kind of screen.

Floor 5. Pure. The rules hold numbers only, so nothing out of a document can end the style element.

A row or column in which no slot stands is a margin: it keeps its place in the picture, and gets an
eighth of the room of one that is used. A phone has no room for margins: they are left out there.
Held upright it stacks more than two columns in reading order, unless there is a ``phone`` grid.
"""

from collections.abc import Iterable, Sequence

from urc.model.interface import Grid, Interface, Slot

__all__ = ["grid_css"]

PHONE = "(max-width: 599.98px)"
SHORT = "(max-height: 479.98px)"
TALL = "(orientation: portrait)"
PHONE_COLUMNS = 2
_USED_COLUMN, _USED_ROW, _MARGIN = "minmax(0,1fr)", "minmax(8rem,1fr)", "minmax(0,.12fr)"


def grid_css(interface: Interface, slots: Sequence[str]) -> str:
    """Return the rules for the cells, which are numbered in the order of `slots`."""
    grids = dict(interface.grids)
    if not grids:
        return ""
    base = grids.get("wide") or next(iter(grids.values()))
    css = _rules(_filled(base, slots), slots, interface.background)
    if "tall" in grids:
        tall = _filled(grids["tall"], slots)
        css += f"@media {TALL}{{{_rules(tall, slots, interface.background)}}}"
    short = _cropped(_filled(base, slots))
    css += f"@media {SHORT}{{{_rules(short, slots, interface.background)}}}"
    drawn = grids.get("phone")
    phone = _cropped(_filled(drawn or base, slots))
    if drawn is None and phone.columns > PHONE_COLUMNS:
        phone = _stacked(phone)
    return css + f"@media {PHONE}{{{_rules(phone, slots, interface.background)}}}"


def _filled(grid: Grid, names: Sequence[str]) -> Grid:
    """Return the grid without the slots that nobody fills."""
    return Grid(grid.rows, grid.columns, tuple(slot for slot in grid.slots if slot.name in names))


def _rules(grid: Grid, names: Sequence[str], background: str) -> str:
    rows = _tracks(grid.rows, _used((slot.row, slot.row_span) for slot in grid.slots), _USED_ROW)
    columns = _tracks(
        grid.columns,
        _used((slot.column, slot.column_span) for slot in grid.slots),
        _USED_COLUMN,
    )
    css = f".urc-grid{{grid-template-rows:{rows};grid-template-columns:{columns}}}"
    places = {slot.name: slot for slot in grid.slots}
    for index, name in enumerate(names):
        if name == background:
            continue
        css += f'[data-cell="{index}"]{{{_place(places.get(name))}}}'
    return css


def _place(slot: Slot | None) -> str:
    if slot is None:
        return "display:none"
    row, column = slot.row + 1, slot.column + 1
    area = f"{row}/{column}/{row + slot.row_span}/{column + slot.column_span}"
    return f"display:grid;grid-area:{area}"


def _tracks(count: int, used: set[int], size: str) -> str:
    return " ".join(size if place in used else _MARGIN for place in range(count)) or "none"


def _used(spans: Iterable[tuple[int, int]]) -> set[int]:
    return {place for start, span in spans for place in range(start, start + span)}


def _cropped(grid: Grid) -> Grid:
    """Return the grid without the rows and columns in which no slot stands."""
    rows = sorted(_used((slot.row, slot.row_span) for slot in grid.slots))
    columns = sorted(_used((slot.column, slot.column_span) for slot in grid.slots))
    row_of = {old: new for new, old in enumerate(rows)}
    column_of = {old: new for new, old in enumerate(columns)}
    slots = tuple(
        Slot(slot.name, row_of[slot.row], column_of[slot.column], slot.row_span, slot.column_span)
        for slot in grid.slots
    )
    return Grid(len(rows), len(columns), slots)


def _stacked(grid: Grid) -> Grid:
    """Return the slots one below the other, in reading order."""
    ordered = sorted(grid.slots, key=lambda slot: (slot.row, slot.column))
    slots = tuple(Slot(slot.name, row, 0) for row, slot in enumerate(ordered))
    return Grid(len(slots), 1, slots)
