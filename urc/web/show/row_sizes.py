"""The heights of the rows of an interface's grid, as CSS values.

Layer 5. Pure. See ``layout.py`` for the position of each cell.

Over a background, rows that contain only values and displays can shrink to the height of a value.
Sticks and buttons therefore stay on the screen. Next to a stick, only the first row grows.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from urc.model.interface import Layout, Slot
from urc.model.values import NOTHING
from urc.model.widget import Footprint

__all__ = [
    "MARGIN", "OVER", "PHONE", "PHONES", "SHORT", "SMALL", "USED_COLUMN", "WINDOW", "Canvas",
    "is_corner", "leading_values", "least_height", "row_sizes", "rows_of", "tracks", "used_tracks",
]  # fmt: skip

PHONE = "(max-width: 37.499rem)"
SMALL = f"{PHONE} and (max-height: 45.999rem)"
"""Small phones in portrait."""
PHONES = (PHONE, SMALL)
SHORT = "(max-height: 29.999rem)"
USED_COLUMN, _USED_ROW, MARGIN = "minmax(0,1fr)", "minmax(8rem,1fr)", "minmax(0,.12fr)"
_LOW_ROW = "minmax(6.5rem,1fr)"
"""Row height on a phone in landscape, where two such rows fit on the screen. A phone in portrait
uses this height for rows of values and buttons, so that a stick next to two such rows is above
STOP."""
OVER, WINDOW = "auto", "minmax(0,1fr)"
"""Sizes of a row or column over a background: with a widget and without a widget."""
_GROUND_ROW = "minmax(var(--urc-ground-height),1fr)"
"""Height of the background on a phone in portrait: all space above the widgets."""
_PLAIN_GAP = "var(--urc-gap)"
"""Space between the rows of a plain grid."""
_MOST_LINES = 2
"""Maximum number of rows of values that are low lines, on a phone in portrait."""
_LOW_OVER = ("stick", "lever", "button", "value")
"""Footprints that extend down next to STOP over a background. Without a background, only sticks
extend down next to STOP."""
_SHRINKING = ("value", "instrument", "view", "list")
"""Footprints whose rows shrink over a background to make room for sticks and buttons."""
_HEIGHTS = {"value": "var(--urc-height-value)", "button": "var(--urc-target-drive)"}
"""Heights of footprints with a fixed height."""
_LEAST_SOFT = "3.625rem"
_SOFT = f"minmax({_LEAST_SOFT},max-content)"
"""Height of a shrinking row: at least the height of a value."""
_SOFT_ROW = "minmax(3.625rem,1fr)"
"""Row of a plain grid without a stick, next to rows with sticks, which get their height first."""
_LEVER_ROW = "minmax(7.25rem,1fr)"
_STICK = "var(--urc-stick) + var(--urc-stick-head)"
"""Height of a stick's cell."""
_BESIDE_STOP = "var(--urc-dock) + var(--urc-space-3)"
"""Added to `_STICK` after a minus: the part of a corner stick's cell that is next to STOP."""
_MOST_SOFT = 6
"""Maximum number of rows that shrink for a stick; a window cannot show more of them."""


class Canvas(NamedTuple):
    """The slots of one page of an interface, including the background slot."""

    slots: Sequence[str]
    background: str = ""
    """Slot behind all other slots, for example with a camera; "" if there is no background."""
    footprints: Mapping[str, Footprint] = NOTHING
    drawer: frozenset[str] = frozenset()
    """Slots that are in the drawer on a phone in landscape."""


def rows_of(footprint: Footprint, grid: Layout, canvas: Canvas) -> set[int]:
    """Return the rows with a widget of this footprint."""
    return used_tracks(
        (slot.row, slot.row_span)
        for slot in grid.slots
        if canvas.footprints.get(slot.name) == footprint
    )


def least_height(grid: Layout, canvas: Canvas, screen: str) -> str:
    """Return the minimum height of a grid as a CSS value.

    A browser computes the minimum height of a grid as if all its rows were as high as the highest
    row or as their content. The height is therefore the sum of the rows' own minimum heights,
    over a background, and in a plain grid with sticks.
    """
    if canvas.background:
        return "min-content" if screen in PHONES else _least_over(grid, canvas, screen)
    if not rows_of("stick", grid, canvas):
        return "min-content"
    sizes = row_sizes(grid, canvas, screen)
    return _sum([size[len("minmax(") : size.rindex(",")] for size in sizes])


def _least_over(grid: Layout, canvas: Canvas, screen: str) -> str:
    """Return the minimum height of a grid over a background as a CSS value."""
    least = []
    for row, size in enumerate(row_sizes(grid, canvas, screen)):
        if size == _SOFT:
            least.append(_LEAST_SOFT)
        elif size in (OVER, WINDOW):
            own = [one for one in grid.slots if one.row == row and one.row_span == 1]
            heights = sorted({_height(one, grid, canvas, screen) for one in own})
            least.append(f"max({','.join(heights)})" if heights else "0px")
        else:
            least.append(size)
    sums = {_sum(least)}
    for slot in grid.slots:
        if slot.row_span > 1 and _is_firm(slot, canvas):
            beside = range(slot.row, slot.row + slot.row_span)
            others = [one for row, one in enumerate(least) if row not in beside]
            sums.add(_sum([*others, _height(slot, grid, canvas, screen)]))
    return f"max({','.join(sorted(sums))})"


def _height(slot: Slot, grid: Layout, canvas: Canvas, screen: str) -> str:
    """Return the height that a widget over a background takes from its rows, as a CSS value."""
    footprint = canvas.footprints.get(slot.name, "")
    if footprint == "stick":
        beside = f" - {_BESIDE_STOP}" if is_corner(slot, grid, canvas) else ""
        return f"calc({_STICK}{beside})"
    if footprint == "view" and screen == SHORT:
        footprint = "value"  # it extends down over the background
    return _HEIGHTS.get(footprint) or f"var(--urc-height-{footprint or 'instrument'})"


def _sum(heights: Sequence[str]) -> str:
    """Return the height of rows with gaps between them as a CSS value."""
    rows = ("0px" if one == "0" else one for one in heights)
    return "calc(" + " + ".join((*rows, f"{len(heights) - 1}*{_PLAIN_GAP}")) + ")"


def row_sizes(grid: Layout, canvas: Canvas, screen: str) -> list[str]:
    """Return a grid's row sizes as CSS values."""
    row = _LOW_ROW if screen == SHORT else _USED_ROW
    empty_row = MARGIN
    if canvas.background:
        row, empty_row = OVER, WINDOW
    used_rows = used_tracks((slot.row, slot.row_span) for slot in grid.slots)
    if canvas.background and screen not in PHONES and len(used_rows) == grid.rows:
        used_rows = used_rows - {grid.rows // 2}  # no row is empty, so the middle row grows
    sizes = tracks(grid.rows, used_rows, row, empty_row)
    if canvas.background:
        sizes = _over_rows(grid, canvas, screen, sizes)
    elif screen in PHONES:
        is_low = [_kinds(place, grid, canvas) <= _HEIGHTS.keys() for place in range(grid.rows)]
        sizes = [_LOW_ROW if low else size for low, size in zip(is_low, sizes, strict=True)]
        sizes = _stick_heights(grid, canvas, sizes)
    else:
        sizes = _around_sticks(grid, canvas, sizes)
    if canvas.background and screen in PHONES:
        sizes = [_GROUND_ROW, *sizes]
    return sizes


def leading_values(grid: Layout, canvas: Canvas) -> int:
    """Return the number of top rows that contain only values, at most `_MOST_LINES`."""
    tall = used_tracks((slot.row, slot.row_span) for slot in grid.slots if slot.row_span > 1)
    is_value = [
        row not in tall and _kinds(row, grid, canvas) == {"value"} for row in range(grid.rows)
    ]
    return min([*is_value, False].index(False), _MOST_LINES)


def _over_rows(grid: Layout, canvas: Canvas, screen: str, sizes: Sequence[str]) -> list[str]:
    """Return the row sizes over a background.

    Next to a slot with several rows, such as a stick, only the first row grows. The widgets next to
    the tall slot are therefore close together. Except on a phone in portrait, which scrolls, rows
    that contain only shrinking footprints, such as views, shrink.
    """
    firm = used_tracks((slot.row, slot.row_span) for slot in grid.slots if _is_firm(slot, canvas))
    lower = used_tracks((slot.row + 1, slot.row_span - 1) for slot in grid.slots)
    rows = []
    for place, size in enumerate(sizes):
        if screen not in PHONES and size == OVER and place not in firm:
            size = _SOFT
        kinds = _kinds(place, grid, canvas)
        if place in lower and kinds and kinds <= _HEIGHTS.keys():
            size = "max(" + ",".join(_HEIGHTS[kind] for kind in sorted(kinds)) + ")"
        rows.append(size)
    return rows


def _around_sticks(grid: Layout, canvas: Canvas, sizes: Sequence[str]) -> list[str]:
    """Return the row sizes of a plain grid: sticks get their height first."""
    sticks = rows_of("stick", grid, canvas)
    others = used_tracks((slot.row, slot.row_span) for slot in grid.slots) - sticks
    if not sticks or len(others) > _MOST_SOFT:
        return _stick_heights(grid, canvas, sizes, is_wide=True)
    levers = rows_of("lever", grid, canvas)
    soft = [
        size if size == MARGIN else _LEVER_ROW if row in levers else _SOFT_ROW
        for row, size in enumerate(sizes)
    ]
    return _stick_heights(grid, canvas, soft, is_wide=True)


def _stick_heights(
    grid: Layout, canvas: Canvas, sizes: Sequence[str], *, is_wide: bool = False
) -> list[str]:
    """Return the row sizes with the height of each stick; `is_wide`: corners are next to STOP."""
    heights: dict[int, set[str]] = {}
    for slot in grid.slots:
        if canvas.footprints.get(slot.name) != "stick" or (slot.row_span > 1 and not is_wide):
            continue
        whole = _STICK
        if is_wide and is_corner(slot, grid, canvas):
            whole += f" - {_BESIDE_STOP}"
        each = f"({whole} - {slot.row_span - 1}*{_PLAIN_GAP})/{slot.row_span}"
        for row in range(slot.row, slot.row + slot.row_span):
            heights.setdefault(row, {"3.625rem"}).add(each)
    return [
        f"minmax(max({','.join(sorted(heights[row]))}),1fr)" if row in heights else size
        for row, size in enumerate(sizes)
    ]


def _kinds(row: int, grid: Layout, canvas: Canvas) -> set[str]:
    """Return the footprints of the widgets that occupy only this row."""
    return {
        canvas.footprints.get(slot.name, "")
        for slot in grid.slots
        if slot.row_span == 1 and slot.row == row
    }


def _is_firm(slot: Slot, canvas: Canvas) -> bool:
    """Return whether a widget over a background keeps its height."""
    return canvas.footprints.get(slot.name, "") not in _SHRINKING


def is_corner(slot: Slot, grid: Layout, canvas: Canvas) -> bool:
    """Return whether a slot extends down next to STOP."""
    is_last = slot.row + slot.row_span == grid.rows
    is_edge = slot.column == 0 or slot.column + slot.column_span == grid.columns
    if not (is_last and is_edge and slot.column_span < grid.columns):
        return False
    footprint = canvas.footprints.get(slot.name)
    if footprint == "stick":
        return True
    return bool(canvas.background) and footprint in _LOW_OVER and not _has_neighbour(slot, grid)


def _has_neighbour(slot: Slot, grid: Layout) -> bool:
    """Return whether a slot is next to another slot in the last row."""
    ends = (slot.column, slot.column + slot.column_span)
    return any(
        other.row + other.row_span == grid.rows
        and (other.column + other.column_span == ends[0] or other.column == ends[1])
        for other in grid.slots
    )


def tracks(count: int, used: set[int], size: str, empty: str) -> list[str]:
    """Return the size of each of `count` rows or columns: `size` with a widget, else `empty`."""
    return [size if place in used else empty for place in range(count)]


def used_tracks(spans: Iterable[tuple[int, int]]) -> set[int]:
    """Return the rows or columns of these spans, each with its start and its length."""
    return {place for start, span in spans for place in range(start, start + span)}
