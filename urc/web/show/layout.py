"""The CSS layout of an interface: the position of each cell for each kind of screen.

Layer 5. Pure. The rules contain only numbers and escaped titles, so no text from a document can
close the style element.

A row or column without a slot is a margin. The margin keeps its position, at an eighth of the
normal size. Phones show no margins. A phone in portrait shows the first available grid of
``phone_portrait``, ``portrait`` and ``landscape``. If this grid is ``portrait`` or ``landscape``
and has more than two columns, the phone stacks the slots in reading order. A phone in landscape
shows ``phone_landscape``, or else the rows of ``landscape`` with sticks, or all its rows.

Over a background, each widget has the size of its footprint and is placed on its slot's side of the
screen. Empty rows and columns fill the remaining space, where the background is visible. On a phone
in portrait, the background fills the space above the widgets; values in the first two rows cover
its lower edge.

STOP is at the bottom centre of the screen. Widgets end above STOP, but sticks in the lower corners
extend down next to STOP. Over a background, columns of buttons and values in the corners also
extend down, but rows of buttons and values do not.

A screen's grid can lack slots of the base grid, which is ``landscape`` or else the first grid. A
button then switches to a second page with these slots. Over a background on a phone in landscape,
a drawer contains these slots, except for views, which can swap with the background.

All pages of an interface share the cells. The grid attribute ``data-page`` selects the page; a cell
on two pages keeps its state.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from urc.model.interface import Interface, Layout, Slot, Tab
from urc.model.values import NOTHING
from urc.model.widget import Footprint

__all__ = ["drawer_slots", "grid_css", "mirrored", "needs_turning"]

PHONE = "(max-width: 37.499rem)"
SHORT = "(max-height: 29.999rem)"
TALL = "(orientation: portrait)"
LOW = f"{SHORT} and (min-width: 37.5rem)"
"""Screens with a drawer: phones in landscape."""
PHONE_COLUMNS = 2
REST_COLUMNS = 3
REST = "-rest"
"""Suffix of ``data-page`` while a small screen shows the slots that its grid lacks."""
LEFT_HAND = ':root[data-hand="left"]'
"""Selector for left-handed layouts; ``handedness.js`` sets the attribute."""
_USED_COLUMN, _USED_ROW, _MARGIN = "minmax(0,1fr)", "minmax(8rem,1fr)", "minmax(0,.12fr)"
_LOW_ROW = "minmax(6.5rem,1fr)"
"""Row height on a phone in landscape, where two such rows fit on the screen. A phone in portrait
uses this height for rows of values and buttons, so that a stick next to two such rows is above
STOP."""
_OVER, _WINDOW = "auto", "minmax(0,1fr)"
"""Sizes of a row or column over a background: with a widget and without a widget."""
_GROUND_ROW = "minmax(var(--urc-ground-height),1fr)"
"""Height of the background on a phone in portrait: all space above the widgets."""
_GAP = "var(--urc-space-3)"
"""Space between the rows of a grid over a background."""
_PLAIN_GAP = "var(--urc-gap)"
"""Space between the rows of a plain grid."""
_MOST_COVERED = 2
"""Maximum number of rows of values over the background on a phone in portrait. More rows would hide
the middle of the background, for example the robot on a map."""
_LOW_OVER = ("stick", "lever", "button", "value")
"""Footprints that extend down next to STOP over a background. Without a background, only sticks
extend down next to STOP."""
_SHRINKING = ("value", "instrument", "view", "list")
"""Footprints whose rows shrink to make room for sticks and buttons on a phone in landscape."""
_HEIGHTS = {"value": "var(--urc-height-value)", "button": "var(--urc-target-drive)"}
"""Heights of footprints with a fixed height."""
_SOFT = "minmax(3.625rem,max-content)"
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
_MOST_LOW = 3
"""Maximum number of rows next to a stick on a phone in landscape."""
_SIDES = ("start", "center", "end")
_ESCAPED = frozenset('"\\<>&\n\r\f\0')


def grid_css(
    interface: Interface,
    slots: Sequence[str],
    footprints: Mapping[str, Footprint] = NOTHING,
    titles: Mapping[str, str] = NOTHING,
) -> str:
    """Return the CSS rules for the cells, numbered in the order of `slots`.

    Args:
        interface: the interface.
        slots: names of the slots with widgets.
        footprints: footprint of each slot's widget.
        titles: title of each slot's widget, for the button that shows the missing slots.
    """
    css = ""
    background = interface.background if interface.background in slots else ""
    drawer = drawer_slots(interface, slots, footprints)
    canvas = _Canvas(slots, background, footprints, drawer)
    for number, page in enumerate(interface.pages):
        place = f'.urc-grid[data-page="{number}"]'
        rest = f'.urc-grid[data-page="{number}{REST}"]'
        right = _placed(page.layouts, canvas)
        left = _left_hand(page, right, canvas)
        css += _both_hands(place, right, left, canvas)
        if drawer and drawer & {slot.name for slot in right["base"].slots}:
            shown = "[data-drawer-handle]{display:inline-flex}"
            css += f"@media {LOW}{{.urc-robot:has(> .urc-stage > {place}) {shown}}}"
        if any(_missing(grids, screen, canvas) for grids in (right, left) for screen in grids):
            css += _both_hands(rest, _rest(right, canvas), _rest(left, canvas), canvas)
            both = f":is({place},{rest})"
            css += "".join(_button(both, right, titles, canvas))
            if left != right:
                css += "".join(_button(both, left, titles, canvas, f"{LEFT_HAND} "))
    return css


def drawer_slots(
    interface: Interface, slots: Sequence[str], footprints: Mapping[str, Footprint]
) -> frozenset[str]:
    """Return the slots in the drawer of a phone in landscape; see `grid_css` for the arguments.

    These are the slots that every page with this slot lacks on such a phone, for both hands.
    """
    if interface.background not in slots:
        return frozenset()
    canvas = _Canvas(slots, interface.background, footprints)
    lacking: set[str] = set()
    kept = {slot for slot in slots if footprints.get(slot) == "view"}
    for page in interface.pages:
        right = _placed(page.layouts, canvas)
        for grids in (right, _left_hand(page, right, canvas)) if right else ():
            missing = {slot.name for slot in _missing(grids, SHORT, canvas)}
            lacking |= missing
            kept |= {slot.name for slot in grids["base"].slots} - missing
            kept |= {slot.name for slot in grids[SHORT].slots}
    return frozenset(lacking - kept)


class _Canvas(NamedTuple):
    """The slots of one page of an interface, including the background slot."""

    slots: Sequence[str]
    background: str = ""
    """Slot behind all other slots, for example with a camera; "" if there is no background."""
    footprints: Mapping[str, Footprint] = NOTHING
    drawer: frozenset[str] = frozenset()
    """Slots that are in the drawer on a phone in landscape."""


def _both_hands(
    place: str, right: Mapping[str, Layout], left: Mapping[str, Layout], canvas: _Canvas
) -> str:
    css = _screens(place, right, canvas)
    return css if left == right else css + _screens(place, left, canvas, f"{LEFT_HAND} ")


def _missing(grids: Mapping[str, Layout], screen: str, canvas: _Canvas) -> list[Slot]:
    """Return the slots of the base grid that a screen's grid and drawer lack, in reading order."""
    names = {slot.name for slot in grids[screen].slots}
    if screen == SHORT:
        names |= canvas.drawer
    missing = [slot for slot in grids["base"].slots if slot.name not in names]
    return sorted(missing, key=lambda slot: (slot.row, slot.column))


def _rest(grids: Mapping[str, Layout], canvas: _Canvas) -> dict[str, Layout]:
    """Return grids with the missing slots of each screen; a complete grid stays unchanged."""
    rest = dict(grids)
    for screen in grids:
        columns = PHONE_COLUMNS if screen == PHONE else REST_COLUMNS
        slots = tuple(
            Slot(slot.name, place // columns, place % columns)
            for place, slot in enumerate(_missing(grids, screen, canvas))
        )
        if slots:
            free = int(bool(canvas.background) and screen != PHONE)
            rest[screen] = Layout(slots[-1].row + 1 + free, columns, slots)
    return rest


def _button(
    place: str,
    grids: Mapping[str, Layout],
    titles: Mapping[str, str],
    canvas: _Canvas,
    hand: str = "",
) -> Iterator[str]:
    """Yield the rules that show the button for the missing slots; see `_screens` for `hand`."""
    for screen in grids:
        missing = _missing(grids, screen, canvas)
        shown = "display:none"
        if missing:
            first, others = missing[0].name, len(missing) - 1
            shown = f"display:inline-flex;--urc-rest:{_more(len(missing))}"
            shown += f";--urc-rest-first:{_css_string(titles.get(first, first))}"
            shown += f";--urc-rest-others:{_more(others, ', ') or _css_string('')}"
        rule = f"{hand}.urc-robot:has(> .urc-stage > {place}) [data-rest]{{{shown}}}"
        yield rule if screen == "base" else f"@media {screen}{{{rule}}}"


def _more(count: int, before: str = "") -> str:
    """Return CSS for “3 more widgets” in the language of the page; "" for 0."""
    if count == 1:
        return f'"{before}" attr(data-rest-one)' if before else "attr(data-rest-one)"
    return f'"{before}{count} " attr(data-rest-many)' if count else ""


def _css_string(text: str) -> str:
    """Return text as a string literal for a style sheet.

    All characters that could end the string or the sheet are escaped (CSS Syntax Level 3, section
    4.3.7).
    """
    return '"' + "".join(f"\\{ord(one):x} " if one in _ESCAPED else one for one in text) + '"'


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
    """Return the grid with its columns in reverse order."""
    slots = tuple(
        slot._replace(column=grid.columns - slot.column - slot.column_span) for slot in grid.slots
    )
    return grid._replace(slots=slots)


def needs_turning(page: Tab, slots: Sequence[str]) -> bool:
    """Return whether a phone in portrait shows a layout that differs from the designed layout."""
    base = _placed(page.layouts, _Canvas(slots)).get("base")
    is_drawn = "phone_portrait" in page.layouts or "portrait" in page.layouts
    return base is not None and not is_drawn and _cropped(base).columns > PHONE_COLUMNS


def _placed(grids: Mapping[str, Layout], canvas: _Canvas) -> dict[str, Layout]:
    """Return the grid for each kind of screen, without unfilled slots."""
    if not grids:
        return {}
    over = bool(canvas.background)
    wide = grids.get("landscape") or next(iter(grids.values()))
    base = _roomy(_filled(wide, canvas.slots), canvas)
    placed = {"base": base}
    if "portrait" in grids:
        placed[TALL] = _roomy(_filled(grids["portrait"], canvas.slots), canvas)
    if "phone_landscape" in grids:
        low = _roomy(_filled(grids["phone_landscape"], canvas.slots), canvas)
    else:
        low = base if over else _stick_rows(base, canvas)
    placed[SHORT] = low if over else _cropped(low)
    upright = grids.get("phone_portrait") or grids.get("portrait") or wide
    phone = _cropped(_filled(upright, canvas.slots))
    if "phone_portrait" not in grids and phone.columns > PHONE_COLUMNS:
        phone = _stacked(phone)
    placed[PHONE] = phone
    return placed


def _roomy(grid: Layout, canvas: _Canvas) -> Layout:
    """Return a plain grid whose one-row sticks also take the empty cells above them."""
    if canvas.background:
        return grid
    taken = {cell for slot in grid.slots for cell in _cells(slot)}
    filled = {row for row, _ in taken}
    slots = []
    for slot in grid.slots:
        above = slot._replace(row=slot.row - 1, row_span=1)
        is_stick = canvas.footprints.get(slot.name) == "stick" and slot.row_span == 1
        if is_stick and above.row in filled and taken.isdisjoint(_cells(above)):
            slot = above._replace(row_span=2)
        slots.append(slot)
    return grid._replace(slots=tuple(slots))


def _cells(slot: Slot) -> set[tuple[int, int]]:
    """Return the row and column of each cell of a slot."""
    return {
        (slot.row + down, slot.column + across)
        for down in range(slot.row_span)
        for across in range(slot.column_span)
    }


def _stick_rows(grid: Layout, canvas: _Canvas) -> Layout:
    """Return the rows that a phone in landscape can show next to a stick; all without a stick."""
    rows = sorted(_rows_of("stick", grid, canvas))
    if not rows or len(rows) > _MOST_LOW:
        return grid
    slots = []
    for slot in grid.slots:
        shown = [row for row in rows if slot.row <= row < slot.row + slot.row_span]
        if shown:
            slots.append(slot._replace(row=rows.index(shown[0]), row_span=len(shown)))
    return Layout(len(rows), grid.columns, tuple(slots))


def _rows_of(footprint: Footprint, grid: Layout, canvas: _Canvas) -> set[int]:
    """Return the rows with a widget of this footprint."""
    return _used(
        (slot.row, slot.row_span)
        for slot in grid.slots
        if canvas.footprints.get(slot.name) == footprint
    )


def _screens(place: str, grids: Mapping[str, Layout], canvas: _Canvas, hand: str = "") -> str:
    """Return the rules for each screen; `hand` restricts them to left-handed layouts."""
    css = ""
    for screen, grid in grids.items():
        rules = hand.join(("", *_rules(place, grid, canvas, screen)))
        css += rules if screen == "base" else f"@media {screen}{{{rules}}}"
    return css


def _filled(grid: Layout, names: Sequence[str]) -> Layout:
    """Return the grid without unfilled slots."""
    return Layout(grid.rows, grid.columns, tuple(slot for slot in grid.slots if slot.name in names))


def _rules(place: str, grid: Layout, canvas: _Canvas, screen: str) -> Iterator[str]:
    yield f"{place}{{{_template(grid, canvas, screen)}}}"
    places = {slot.name: slot for slot in grid.slots}
    is_below = screen == PHONE and bool(canvas.background)
    if is_below:
        yield f'{place} [data-place="ground"]{{{_ground(_leading_values(grid, canvas))}}}'
    for index, name in enumerate(canvas.slots):
        if name != canvas.background:
            rules = _place(places.get(name), grid, canvas, is_below)
            if screen == SHORT and name in canvas.drawer and not place.endswith(f'{REST}"]'):
                rules = "display:grid;grid-area:auto"
            yield f'{place} [data-place="{index}"]{{{rules}}}'
    if not canvas.background and "stick" in canvas.footprints.values():
        room = _grid_height(grid, canvas, screen)
        yield f".urc-stage:has(> {place}){{grid-template-rows:auto auto minmax({room},1fr)}}"
    corners = _corners(grid, canvas)
    sides = f"--urc-left:{corners['start']};--urc-right:{corners['end']}"
    yield f".urc-robot:has(> .urc-stage > {place}){{{sides}}}"


def _grid_height(grid: Layout, canvas: _Canvas, screen: str) -> str:
    """Return the minimum height of a plain grid as a CSS value.

    A browser computes the minimum height of a grid as if all its rows were as high as the highest
    row. With sticks, the height is therefore the sum of the rows' own minimum heights.
    """
    if not _rows_of("stick", grid, canvas):
        return "min-content"
    least = [size[len("minmax(") : size.rindex(",")] for size in _row_sizes(grid, canvas, screen)]
    gaps = f"{len(least) - 1}*{_PLAIN_GAP}"
    return "calc(" + " + ".join("0px" if one == "0" else one for one in (*least, gaps)) + ")"


def _template(grid: Layout, canvas: _Canvas, screen: str) -> str:
    """Return a grid's row sizes and column sizes as CSS values."""
    column, empty_column = _USED_COLUMN, _MARGIN
    if canvas.background:
        empty_column = _WINDOW
        column = _USED_COLUMN if screen == PHONE else _OVER
    used_columns = _used((slot.column, slot.column_span) for slot in grid.slots)
    rows = " ".join(_row_sizes(grid, canvas, screen)) or "none"
    columns = " ".join(_tracks(grid.columns, used_columns, column, empty_column)) or "none"
    return f"grid-template-rows:{rows};grid-template-columns:{columns}"


def _row_sizes(grid: Layout, canvas: _Canvas, screen: str) -> list[str]:
    """Return a grid's row sizes as CSS values."""
    row = _LOW_ROW if screen == SHORT else _USED_ROW
    empty_row = _MARGIN
    if canvas.background:
        row, empty_row = _OVER, _WINDOW
    used_rows = _used((slot.row, slot.row_span) for slot in grid.slots)
    if canvas.background and screen != PHONE and len(used_rows) == grid.rows:
        used_rows = used_rows - {grid.rows // 2}  # no row is empty, so the middle row grows
    sizes = _tracks(grid.rows, used_rows, row, empty_row)
    if canvas.background:
        sizes = _over_rows(grid, canvas, screen, sizes)
    elif screen == PHONE:
        is_low = [_kinds(place, grid, canvas) <= _HEIGHTS.keys() for place in range(grid.rows)]
        sizes = [_LOW_ROW if low else size for low, size in zip(is_low, sizes, strict=True)]
        sizes = _stick_heights(grid, canvas, sizes)
    else:
        sizes = _around_sticks(grid, canvas, sizes)
    if canvas.background and screen == PHONE:
        sizes = [_GROUND_ROW, *sizes]
    return sizes


def _ground(covered: int) -> str:
    """Return the rules for the background on a phone in portrait; values cover `covered` rows."""
    area = f"grid-row:1/{2 + covered}"
    if not covered:
        return area
    height = f"calc({covered}*(var(--urc-height-value) + {_GAP}))"
    return f"{area};--urc-ground-foot:{height};margin-block-end:calc(-.5*{_GAP})"


def _leading_values(grid: Layout, canvas: _Canvas) -> int:
    """Return the number of top rows that contain only values, at most `_MOST_COVERED`."""
    tall = _used((slot.row, slot.row_span) for slot in grid.slots if slot.row_span > 1)
    is_value = [
        row not in tall and _kinds(row, grid, canvas) == {"value"} for row in range(grid.rows)
    ]
    return min([*is_value, False].index(False), _MOST_COVERED)


def _over_rows(grid: Layout, canvas: _Canvas, screen: str, sizes: Sequence[str]) -> list[str]:
    """Return the row sizes over a background.

    Next to a slot with several rows, such as a stick, only the first row grows. The widgets next to
    the tall slot are therefore close together. On a phone in landscape, rows that contain only
    shrinking footprints, such as views, shrink.
    """
    firm = _used((slot.row, slot.row_span) for slot in grid.slots if _is_firm(slot, canvas))
    lower = _used((slot.row + 1, slot.row_span - 1) for slot in grid.slots)
    rows = []
    for place, size in enumerate(sizes):
        if screen == SHORT and size == _OVER and place not in firm:
            size = _SOFT
        kinds = _kinds(place, grid, canvas)
        if place in lower and kinds and kinds <= _HEIGHTS.keys():
            size = "max(" + ",".join(_HEIGHTS[kind] for kind in sorted(kinds)) + ")"
        rows.append(size)
    return rows


def _around_sticks(grid: Layout, canvas: _Canvas, sizes: Sequence[str]) -> list[str]:
    """Return the row sizes of a plain grid: sticks get their height first."""
    sticks = _rows_of("stick", grid, canvas)
    others = _used((slot.row, slot.row_span) for slot in grid.slots) - sticks
    if not sticks or len(others) > _MOST_SOFT:
        return _stick_heights(grid, canvas, sizes, is_wide=True)
    levers = _rows_of("lever", grid, canvas)
    soft = [
        size if size == _MARGIN else _LEVER_ROW if row in levers else _SOFT_ROW
        for row, size in enumerate(sizes)
    ]
    return _stick_heights(grid, canvas, soft, is_wide=True)


def _stick_heights(
    grid: Layout, canvas: _Canvas, sizes: Sequence[str], *, is_wide: bool = False
) -> list[str]:
    """Return the row sizes with the height of each stick; `is_wide`: corners are next to STOP."""
    heights: dict[int, set[str]] = {}
    for slot in grid.slots:
        if canvas.footprints.get(slot.name) != "stick" or (slot.row_span > 1 and not is_wide):
            continue
        whole = _STICK
        if is_wide and _is_corner(slot, grid, canvas):
            whole += f" - {_BESIDE_STOP}"
        each = f"({whole} - {slot.row_span - 1}*{_PLAIN_GAP})/{slot.row_span}"
        for row in range(slot.row, slot.row + slot.row_span):
            heights.setdefault(row, {"3.625rem"}).add(each)
    return [
        f"minmax(max({','.join(sorted(heights[row]))}),1fr)" if row in heights else size
        for row, size in enumerate(sizes)
    ]


def _kinds(row: int, grid: Layout, canvas: _Canvas) -> set[str]:
    """Return the footprints of the widgets that occupy only this row."""
    return {
        canvas.footprints.get(slot.name, "")
        for slot in grid.slots
        if slot.row_span == 1 and slot.row == row
    }


def _is_firm(slot: Slot, canvas: _Canvas) -> bool:
    """Return whether a widget keeps its height on a phone in landscape."""
    return canvas.footprints.get(slot.name, "") not in _SHRINKING


def _corners(grid: Layout, canvas: _Canvas) -> dict[str, str]:
    """Return the CSS widths of the widgets in the lower left and lower right corners."""
    found = {"start": "0px", "end": "0px"}
    for slot in grid.slots:
        if _is_corner(slot, grid, canvas):
            width = f"var(--urc-width-{canvas.footprints[slot.name]})"
            found[_across(slot, grid)] = f"calc(var(--urc-edge) + {width})"
    return found


def _is_corner(slot: Slot, grid: Layout, canvas: _Canvas) -> bool:
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


def _drops(slot: Slot, grid: Layout, canvas: _Canvas) -> bool:
    """Return whether a slot is lowered next to STOP, because it is in or above a corner."""
    if _is_corner(slot, grid, canvas):
        return True
    if not canvas.background or _down(slot, grid) != "end":
        return False
    return any(
        other.row == slot.row + slot.row_span
        and (other.column, other.column_span) == (slot.column, slot.column_span)
        and canvas.footprints.get(other.name) != "stick"
        and _drops(other, grid, canvas)
        for other in grid.slots
    )


def _across(slot: Slot, grid: Layout) -> str:
    """Return a slot's horizontal position: the left, middle or right third of the screen."""
    return _SIDES[_third(slot.column, slot.column_span, grid.columns)]


def _down(slot: Slot, grid: Layout) -> str:
    """Return a slot's vertical position: the upper or lower half of the screen."""
    return "start" if 2 * slot.row + slot.row_span < grid.rows else "end"


def _beside(slot: Slot, grid: Layout) -> bool:
    """Return whether a one-row slot is next to a slot with several rows."""
    return slot.row_span == 1 and any(
        tall.row_span > 1 and tall.row <= slot.row < tall.row + tall.row_span for tall in grid.slots
    )


def _third(first: int, span: int, count: int) -> int:
    return min(2, int(3 * (first + span / 2) / count)) if span < count else 1


def _place(slot: Slot | None, grid: Layout, canvas: _Canvas, is_below: bool) -> str:
    """Return the rules for one cell; if `is_below` is true, the background fills the first row."""
    if slot is None:
        return "display:none"
    row, column = slot.row + 1 + is_below, slot.column + 1
    area = f"{row}/{column}/{row + slot.row_span}/{column + slot.column_span}"
    across, down = _across(slot, grid), _down(slot, grid)
    if is_below and _beside(slot, grid):
        down = "end"
    corner = int(_drops(slot, grid, canvas))
    sides = f"--urc-across:{across};--urc-down:{down};--urc-corner:{corner}"
    return f"display:grid;grid-area:{area};{sides}"


def _tracks(count: int, used: set[int], size: str, empty: str) -> list[str]:
    return [size if place in used else empty for place in range(count)]


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


def _stacked(grid: Layout) -> Layout:
    """Return the slots in one column, in reading order."""
    ordered = sorted(grid.slots, key=lambda slot: (slot.row, slot.column))
    slots = tuple(Slot(slot.name, row, 0) for row, slot in enumerate(ordered))
    return Layout(len(slots), 1, slots)
