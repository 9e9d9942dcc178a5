"""The CSS layout of an interface: the position of each cell for each kind of screen.

Layer 5. Pure. The rules contain only numbers, so no text from a document can close the style
element.

A row or column without a slot is a margin. The margin keeps its position, at an eighth of the
normal size. Phones show no margins. A phone in portrait shows the first available grid of
``phone_portrait``, ``portrait`` and ``landscape``. If this grid is ``portrait`` or ``landscape``
and has more than two columns, the phone stacks the slots in reading order. A phone in landscape
shows ``phone_landscape``, or else the rows of ``landscape`` with sticks, or all its rows.

Over a background, each widget has the size of its footprint and is placed on its slot's side of the
screen. Empty rows and columns fill the remaining space, where the background is visible. If a
screen is too low, rows of values and displays shrink. On a phone in portrait, the background fills
the space above the widgets; values in the first two rows are low lines below it. On a small phone,
buttons below a stick move next to it, in the place of further views.

STOP is at the bottom centre of the screen. Widgets end above STOP, but sticks in the lower corners
extend down next to STOP. Over a background, columns of buttons and values in the corners also
extend down, but rows of buttons and values do not.

A screen's grid can lack slots of the base grid, which is ``landscape`` or else the first grid. A
button then switches to a second page with these slots. Over a background on a phone in landscape,
a drawer contains these slots, except for views, which can swap with the background.

All pages of an interface share the cells. The grid attribute ``data-page`` selects the page; a cell
on two pages keeps its state.
"""

from collections.abc import Iterator, Mapping, Sequence

from urc.model.interface import Interface, Layout, Slot, Tab
from urc.model.values import NOTHING
from urc.model.widget import Footprint
from urc.web.show.row_sizes import (
    MARGIN,
    OVER,
    PHONE,
    PHONES,
    SHORT,
    SMALL,
    USED_COLUMN,
    WINDOW,
    Canvas,
    is_corner,
    leading_values,
    least_height,
    row_sizes,
    rows_of,
    tracks,
    used_tracks,
)

__all__ = ["drawer_slots", "grid_css", "mirrored", "needs_turning"]

TALL = "(orientation: portrait)"
LOW = f"{SHORT} and (min-width: 37.5rem)"
"""Screens with a drawer: phones in landscape."""
PHONE_COLUMNS = 2
REST_COLUMNS = 3
REST = "-rest"
"""Suffix of ``data-page`` while a small screen shows the slots that its grid lacks."""
LEFT_HAND = ':root[data-hand="left"]'
"""Selector for left-handed layouts; ``handedness.js`` sets the attribute."""
_LINE = "var(--urc-height-line)"
"""Height of a value below the background on a phone in portrait."""
_PACK_GAP = "var(--urc-gap)"
"""Space between values at the top of a page over a background."""
_MOST_LOW = 3
"""Maximum number of rows next to a stick on a phone in landscape."""
_SIDES = ("start", "center", "end")


def grid_css(
    interface: Interface,
    slots: Sequence[str],
    footprints: Mapping[str, Footprint] = NOTHING,
) -> str:
    """Return the CSS rules for the cells, numbered in the order of `slots`.

    Args:
        interface: the interface.
        slots: names of the slots with widgets.
        footprints: footprint of each slot's widget.
    """
    css = ""
    background = interface.background if interface.background in slots else ""
    drawer = drawer_slots(interface, slots, footprints)
    canvas = Canvas(slots, background, footprints, drawer)
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
            css += "".join(_button(both, right, canvas))
            if left != right:
                css += "".join(_button(both, left, canvas, f"{LEFT_HAND} "))
    return css


def drawer_slots(
    interface: Interface, slots: Sequence[str], footprints: Mapping[str, Footprint]
) -> frozenset[str]:
    """Return the slots in the drawer of a phone in landscape; see `grid_css` for the arguments.

    These are the slots that every page with this slot lacks on such a phone, for both hands.
    """
    if interface.background not in slots:
        return frozenset()
    canvas = Canvas(slots, interface.background, footprints)
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


def _both_hands(
    place: str, right: Mapping[str, Layout], left: Mapping[str, Layout], canvas: Canvas
) -> str:
    css = _screens(place, right, canvas)
    return css if left == right else css + _screens(place, left, canvas, f"{LEFT_HAND} ")


def _missing(grids: Mapping[str, Layout], screen: str, canvas: Canvas) -> list[Slot]:
    """Return the slots of the base grid that a screen's grid and drawer lack, in reading order."""
    names = {slot.name for slot in grids[screen].slots}
    if screen == SHORT:
        names |= canvas.drawer
    missing = [slot for slot in grids["base"].slots if slot.name not in names]
    return sorted(missing, key=lambda slot: (slot.row, slot.column))


def _rest(grids: Mapping[str, Layout], canvas: Canvas) -> dict[str, Layout]:
    """Return grids with the missing slots of each screen; a complete grid stays unchanged."""
    rest = dict(grids)
    for screen in grids:
        columns = PHONE_COLUMNS if screen in PHONES else REST_COLUMNS
        slots = tuple(
            Slot(slot.name, place // columns, place % columns)
            for place, slot in enumerate(_missing(grids, screen, canvas))
        )
        if slots:
            free = int(bool(canvas.background) and screen not in PHONES)
            rest[screen] = Layout(slots[-1].row + 1 + free, columns, slots)
    return rest


def _button(
    place: str, grids: Mapping[str, Layout], canvas: Canvas, hand: str = ""
) -> Iterator[str]:
    """Yield the rules that show the button for the missing slots; see `_screens` for `hand`."""
    for screen in grids:
        missing = _missing(grids, screen, canvas)
        shown = "display:none"
        if missing:
            cells = " ".join(str(canvas.slots.index(slot.name)) for slot in missing)
            shown = f"display:inline-flex;--urc-rest:{cells}"
        rule = f"{hand}.urc-robot:has(> .urc-stage > {place}) [data-rest]{{{shown}}}"
        yield rule if screen == "base" else f"@media {screen}{{{rule}}}"


def _left_hand(page: Tab, right: Mapping[str, Layout], canvas: Canvas) -> dict[str, Layout]:
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
    base = _placed(page.layouts, Canvas(slots)).get("base")
    is_drawn = "phone_portrait" in page.layouts or "portrait" in page.layouts
    return base is not None and not is_drawn and _cropped(base).columns > PHONE_COLUMNS


def _placed(grids: Mapping[str, Layout], canvas: Canvas) -> dict[str, Layout]:
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
    placed[SHORT] = _cleared(low, base, canvas) if over else _cropped(low)
    upright = grids.get("phone_portrait") or grids.get("portrait") or wide
    phone = _cropped(_filled(upright, canvas.slots))
    if "phone_portrait" not in grids and phone.columns > PHONE_COLUMNS:
        phone = _stacked(phone)
    placed[PHONE] = phone
    if (small := _compact(phone, canvas)) != phone:
        placed[SMALL] = small
    return placed


def _cleared(grid: Layout, base: Layout, canvas: Canvas) -> Layout:
    """Return the grid of a phone in landscape with at most one view, so that little is covered.

    The view is the first one of the base grid, in the place of the first one of this grid. The
    button for missing slots lists the others.
    """

    def views(one: Layout) -> list[Slot]:
        found = [slot for slot in one.slots if canvas.footprints.get(slot.name) == "view"]
        return sorted(found, key=lambda slot: (slot.row, slot.column))

    slots = list(grid.slots)
    if len(own := views(grid)) > 1:
        names = [slot.name for slot in views(base)]
        chosen = min(own, key=lambda slot: names.index(slot.name) if slot.name in names else 99)
        slots = [slot for slot in slots if slot not in own]
        slots.append(own[0]._replace(name=chosen.name))
    return grid._replace(slots=tuple(slots))


def _compact(grid: Layout, canvas: Canvas) -> Layout:
    """Return the grid of a small phone in portrait, so that the background keeps its height.

    The last row of buttons is next to the stick, in the place of all views but the first. A button
    in the bar leads to the other views.
    """
    sticks = rows_of("stick", grid, canvas)
    tall = [one for one in grid.slots if one.row_span > 1]
    beside = [one for one in grid.slots if one.row in sticks and one.row_span == 1]
    below = [one for one in grid.slots if one.row > max(sticks, default=grid.rows)]
    kinds = [{canvas.footprints.get(one.name) for one in slots} for slots in (tall, beside, below)]
    is_known = kinds == [{"stick"}, {"view"}, {"button"}] and grid.columns == PHONE_COLUMNS
    if not (canvas.background and is_known and len(tall) == 1 and len(beside) > 1):
        return grid
    start, column = tall[0].row, beside[0].column
    first = min(beside, key=lambda one: one.row)._replace(row=start)
    ordered = sorted(below, key=lambda one: (one.row, one.column))
    moved = [Slot(one.name, start + 1 + place, column) for place, one in enumerate(ordered)]
    above = [one for one in grid.slots if one.row < start]
    stick = tall[0]._replace(row_span=1 + len(moved))
    return Layout(start + stick.row_span, grid.columns, (*above, first, stick, *moved))


def _roomy(grid: Layout, canvas: Canvas) -> Layout:
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


def _stick_rows(grid: Layout, canvas: Canvas) -> Layout:
    """Return the rows that a phone in landscape can show next to a stick; all without a stick."""
    rows = sorted(rows_of("stick", grid, canvas))
    if not rows or len(rows) > _MOST_LOW:
        return grid
    slots = []
    for slot in grid.slots:
        shown = [row for row in rows if slot.row <= row < slot.row + slot.row_span]
        if shown:
            slots.append(slot._replace(row=rows.index(shown[0]), row_span=len(shown)))
    return Layout(len(rows), grid.columns, tuple(slots))


def _screens(place: str, grids: Mapping[str, Layout], canvas: Canvas, hand: str = "") -> str:
    """Return the rules for each screen; `hand` restricts them to left-handed layouts."""
    css = ""
    shifted = {name for grid in grids.values() for name in _packed(grid, canvas)}
    for screen, grid in grids.items():
        rules = hand.join(("", *_rules(place, grid, canvas, screen, shifted)))
        css += rules if screen == "base" else f"@media {screen}{{{rules}}}"
    return css


def _filled(grid: Layout, names: Sequence[str]) -> Layout:
    """Return the grid without unfilled slots."""
    return Layout(grid.rows, grid.columns, tuple(slot for slot in grid.slots if slot.name in names))


def _rules(
    place: str, grid: Layout, canvas: Canvas, screen: str, shifted: set[str]
) -> Iterator[str]:
    yield f"{place}{{{_template(grid, canvas, screen)}}}"
    places = {slot.name: slot for slot in grid.slots}
    is_below = screen in PHONES and bool(canvas.background)
    lines = leading_values(grid, canvas) if is_below else 0
    if is_below:
        yield f'{place} [data-place="ground"]{{grid-row:1/2}}'
    packed = {} if is_below else _packed(grid, canvas)
    for index, name in enumerate(canvas.slots):
        if name != canvas.background:
            slot = places.get(name)
            rules = _place(slot, grid, canvas, is_below)
            if name in shifted:  # by this or another screen's grid
                rules += packed.get(name, ";margin-inline:0")
            if slot and slot.row < lines:
                rules += f";--urc-cell-height:{_LINE}"
            if screen == SHORT and name in canvas.drawer and not place.endswith(f'{REST}"]'):
                rules = "display:grid;grid-area:auto"
            yield f'{place} [data-place="{index}"]{{{rules}}}'
    if canvas.background or "stick" in canvas.footprints.values():
        room = least_height(grid, canvas, screen)
        yield f".urc-stage:has(> {place}){{grid-template-rows:auto minmax({room},1fr)}}"
    corners = _corners(grid, canvas)
    sides = f"--urc-left:{corners['start']};--urc-right:{corners['end']}"
    yield f".urc-robot:has(> .urc-stage > {place}){{{sides}}}"


def _template(grid: Layout, canvas: Canvas, screen: str) -> str:
    """Return a grid's row sizes and column sizes as CSS values."""
    column, empty_column = USED_COLUMN, MARGIN
    if canvas.background:
        empty_column = WINDOW
        column = USED_COLUMN if screen in PHONES else OVER
    used_columns = used_tracks((slot.column, slot.column_span) for slot in grid.slots)
    rows = " ".join(row_sizes(grid, canvas, screen)) or "none"
    columns = " ".join(tracks(grid.columns, used_columns, column, empty_column)) or "none"
    return f"grid-template-rows:{rows};grid-template-columns:{columns}"


def _packed(grid: Layout, canvas: Canvas) -> dict[str, str]:
    """Return the rules that pack values in the upper rows at the sides, without gaps of other rows.

    Values have equal widths, so each is shifted by those before it.
    """
    rules: dict[str, str] = {}
    for row in range(grid.rows if canvas.background else 0):
        own = {slot.column: slot for slot in grid.slots if slot.row == row}
        for side, columns in (
            ("start", range(grid.columns)),
            ("end", range(grid.columns - 1, -1, -1)),
        ):
            for place, column in enumerate(columns):
                slot = own.get(column)
                if slot is None or (slot.row_span, slot.column_span) != (1, 1):
                    break
                kind = canvas.footprints.get(slot.name)
                is_last = kind == "button" and place > 0  # a switch is wider than a value
                if _down(slot, grid) != "start" or not (kind == "value" or is_last):
                    break
                shift = f"calc({place}*(var(--urc-width-tile) + {_PACK_GAP}))"
                margins = f"{shift} 0" if side == "start" else f"0 {shift}"
                rules[slot.name] = f";grid-column:1/-1;--urc-across:{side};margin-inline:{margins}"
                if is_last:
                    break
    return rules


def _corners(grid: Layout, canvas: Canvas) -> dict[str, str]:
    """Return the CSS widths of the widgets in the lower left and lower right corners."""
    found = {"start": "0px", "end": "0px"}
    for slot in grid.slots:
        if is_corner(slot, grid, canvas):
            width = f"var(--urc-width-{canvas.footprints[slot.name]})"
            found[_across(slot, grid)] = f"calc(var(--urc-edge) + {width})"
    return found


def _drops(slot: Slot, grid: Layout, canvas: Canvas) -> bool:
    """Return whether a slot is lowered next to STOP, because it is in or above a corner."""
    if is_corner(slot, grid, canvas):
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


def _place(slot: Slot | None, grid: Layout, canvas: Canvas, is_below: bool) -> str:
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


def _cropped(grid: Layout) -> Layout:
    """Return the grid without empty rows and columns."""
    rows = sorted(used_tracks((slot.row, slot.row_span) for slot in grid.slots))
    columns = sorted(used_tracks((slot.column, slot.column_span) for slot in grid.slots))
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
