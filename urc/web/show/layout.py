"""The layout of an interface as CSS: the position of each cell, for each kind of screen.

Layer 5. Pure. The rules contain only numbers, so no text from a document can close the style
element.

A row or column without a slot is a margin: the margin keeps its position, with an eighth of the
normal size. Phones show no margins. A phone in portrait shows the grid ``phone_portrait``, else
``portrait``, else ``landscape``. The grids ``portrait`` and ``landscape`` are stacked in reading
order on such a phone if they have more than two columns. A phone in landscape shows the grid
``phone_landscape``, else ``landscape``.

Over a background, an empty cell keeps its full size on every screen, so that the background is
visible. On screens of low height, empty rows become smaller, to leave more space for rows with
widgets.

All pages of an interface share the cells. The grid attribute ``data-page`` selects the page; a cell
on two pages keeps its state.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from urc.model.interface import Interface, Layout, Slot, Tab

__all__ = ["grid_css", "mirrored", "needs_turning"]

PHONE = "(max-width: 599.98px)"
SHORT = "(max-height: 479.98px)"
TALL = "(orientation: portrait)"
PHONE_COLUMNS = 2
LEFT_HAND = ':root[data-hand="left"]'
"""Selector for left-handed operators; ``handedness.js`` sets the attribute."""
_USED_COLUMN, _USED_ROW, _MARGIN = "minmax(0,1fr)", "minmax(8rem,1fr)", "minmax(0,.12fr)"
_LOW_ROW = "minmax(6.5rem,1fr)"
"""Height of a row on a phone in landscape; two rows of this height fit on the screen."""
_WINDOW = ("minmax(5rem,1fr)", "minmax(0,1fr)")
"""Sizes of rows and columns through which the background is visible."""


def grid_css(interface: Interface, slots: Sequence[str]) -> str:
    """Return the CSS rules for the cells, which are numbered in the order of `slots`."""
    css = ""
    canvas = _Canvas(slots, interface.background if interface.background in slots else "")
    turned = [needs_turning(page, slots) for page in interface.pages]
    for number, page in enumerate(interface.pages):
        place = f'.urc-grid[data-page="{number}"]'
        if any(turned) and not turned[number]:
            css += f".urc-stage:has(> {place})>.urc-turn{{display:none}}"
        right = _placed(page.layouts, canvas)
        css += _screens(place, right, canvas)
        left = _left_hand(page, right, canvas)
        if left != right:
            css += _screens(f"{LEFT_HAND} {place}", left, canvas)
    return css


class _Canvas(NamedTuple):
    """The slots of a page, and its background slot."""

    slots: Sequence[str]
    background: str
    """Slot behind all other slots, such as a camera. Empty cells keep their full size, so that this
    slot is visible."""


def _left_hand(page: Tab, right: Mapping[str, Layout], canvas: _Canvas) -> dict[str, Layout]:
    """Return the layouts for left-handed operators: designed, mirrored or unchanged."""
    if page.left_handed:
        turn = mirrored if page.is_mirrored else Layout._replace
        others = {screen: turn(grid) for screen, grid in page.layouts.items()}
        return _placed({**others, **page.left_handed}, canvas)
    if not page.is_mirrored:
        return dict(right)
    # Mirrored after stacking, because a stack keeps the reading order.
    return {screen: mirrored(grid) for screen, grid in right.items()}


def mirrored(grid: Layout) -> Layout:
    """Return the grid with the order of its columns reversed."""
    slots = tuple(
        slot._replace(column=grid.columns - slot.column - slot.column_span) for slot in grid.slots
    )
    return grid._replace(slots=slots)


def needs_turning(page: Tab, slots: Sequence[str]) -> bool:
    """Return whether a phone in portrait shows a layout that differs from the designed layout."""
    base = _placed(page.layouts, _Canvas(slots, "")).get("base")
    is_drawn = "phone_portrait" in page.layouts or "portrait" in page.layouts
    return base is not None and not is_drawn and _cropped(base).columns > PHONE_COLUMNS


def _placed(grids: Mapping[str, Layout], canvas: _Canvas) -> dict[str, Layout]:
    """Return the grid for each kind of screen, without unfilled slots."""
    if not grids:
        return {}
    crop = Layout._replace if canvas.background else _cropped
    wide = grids.get("landscape") or next(iter(grids.values()))
    base = _filled(wide, canvas.slots)
    placed = {"base": base}
    if "portrait" in grids:
        placed[TALL] = _filled(grids["portrait"], canvas.slots)
    placed[SHORT] = crop(
        _filled(grids["phone_landscape"], canvas.slots) if "phone_landscape" in grids else base
    )
    upright = grids.get("phone_portrait") or grids.get("portrait") or wide
    phone = crop(_filled(upright, canvas.slots))
    if "phone_portrait" not in grids and phone.columns > PHONE_COLUMNS:
        # The first row stays empty over a background, which shows through it.
        phone = _stacked(phone, first=1 if canvas.background else 0)
    placed[PHONE] = phone
    return placed


def _screens(place: str, grids: Mapping[str, Layout], canvas: _Canvas) -> str:
    css = ""
    for screen, grid in grids.items():
        rules = _rules(place, grid, canvas, _LOW_ROW if screen == SHORT else _USED_ROW)
        css += rules if screen == "base" else f"@media {screen}{{{rules}}}"
    return css


def _filled(grid: Layout, names: Sequence[str]) -> Layout:
    """Return the grid without unfilled slots."""
    return Layout(grid.rows, grid.columns, tuple(slot for slot in grid.slots if slot.name in names))


def _rules(place: str, grid: Layout, canvas: _Canvas, row: str) -> str:
    empty_row, empty_column = _WINDOW if canvas.background else (_MARGIN, _MARGIN)
    if canvas.background and row == _LOW_ROW:
        empty_row = _MARGIN  # shrinks, so that no control lies below the edge
    used_rows = _used((slot.row, slot.row_span) for slot in grid.slots)
    used_columns = _used((slot.column, slot.column_span) for slot in grid.slots)
    rows = _tracks(grid.rows, used_rows, row, empty_row)
    columns = _tracks(grid.columns, used_columns, _USED_COLUMN, empty_column)
    css = f"{place}{{grid-template-rows:{rows};grid-template-columns:{columns}}}"
    places = {slot.name: slot for slot in grid.slots}
    for index, name in enumerate(canvas.slots):
        if name != canvas.background:
            css += f'{place} [data-cell="{index}"]{{{_place(places.get(name))}}}'
    return css


def _place(slot: Slot | None) -> str:
    if slot is None:
        return "display:none"
    row, column = slot.row + 1, slot.column + 1
    area = f"{row}/{column}/{row + slot.row_span}/{column + slot.column_span}"
    return f"display:grid;grid-area:{area}"


def _tracks(count: int, used: set[int], size: str, empty: str) -> str:
    return " ".join(size if place in used else empty for place in range(count)) or "none"


def _used(spans: Iterable[tuple[int, int]]) -> set[int]:
    return {place for start, span in spans for place in range(start, start + span)}


def _cropped(grid: Layout) -> Layout:
    """Return the grid without empty rows and columns."""
    rows = sorted(_used((slot.row, slot.row_span) for slot in grid.slots))
    columns = sorted(_used((slot.column, slot.column_span) for slot in grid.slots))
    row_of = {old: new for new, old in enumerate(rows)}
    column_of = {old: new for new, old in enumerate(columns)}
    slots = tuple(
        Slot(slot.name, row_of[slot.row], column_of[slot.column], slot.row_span, slot.column_span)
        for slot in grid.slots
    )
    return Layout(len(rows), len(columns), slots)


def _stacked(grid: Layout, first: int) -> Layout:
    """Return the slots in one column in reading order, starting at row `first`."""
    ordered = sorted(grid.slots, key=lambda slot: (slot.row, slot.column))
    slots = tuple(Slot(slot.name, row, 0) for row, slot in enumerate(ordered, first))
    return Layout(len(slots) + first, 1, slots)
