"""The picture of an interface as CSS."""

import pytest

from urc.model.interface import Interface, Layout, Slot, Tab
from urc.model.widget import Footprint
from urc.web.show.layout import LEFT_HAND, drawer_slots, grid_css, needs_turning

MARGIN = "minmax(0,.12fr)"
ROW = "minmax(8rem,1fr)"
COLUMN = "minmax(0,1fr)"


def css(*grids: tuple[str, Layout], slots: tuple[str, ...]) -> str:
    """Return the rules for an interface of those grids."""
    return grid_css(Interface("i", layouts=dict(grids)), slots)


def test_the_picture_keeps_its_margins_on_a_wide_screen() -> None:
    """Rows and columns without a slot stay where they are, and are small."""
    text = css(("landscape", Layout(2, 3, (Slot("battery", 1, 2),))), slots=("battery",))
    wide = text.split("@media")[0]
    assert f"grid-template-rows:{MARGIN} {ROW};" in wide
    assert f"grid-template-columns:{MARGIN} {MARGIN} {COLUMN}}}" in wide
    assert '[data-place="0"]{display:grid;grid-area:2/3/3/4;' in wide


def test_a_phone_gets_no_margins() -> None:
    """The one cell fills the phone."""
    text = css(("landscape", Layout(2, 3, (Slot("battery", 1, 2),))), slots=("battery",))
    phone = text.split("@media (max-width: 37.499rem)")[1]
    assert f"grid-template-rows:{ROW};grid-template-columns:{COLUMN}}}" in phone
    assert "grid-area:1/1/2/2" in phone


def test_more_than_two_columns_are_stacked_on_a_phone_in_reading_order() -> None:
    """Unless the author drew a phone grid."""
    slots = (Slot("c", 1, 0, 1, 3), Slot("a", 0, 0), Slot("b", 0, 2), Slot("m", 0, 1))
    text = css(("landscape", Layout(2, 3, slots)), slots=("a", "m", "b", "c"))
    phone = text.split("@media (max-width: 37.499rem)")[1]
    for index, row in enumerate((1, 2, 3, 4)):
        assert f'[data-place="{index}"]{{display:grid;grid-area:{row}/1/{row + 1}/2;' in phone


def test_a_drawn_phone_grid_is_kept_and_hides_what_it_leaves_out() -> None:
    """A slot that the phone grid does not have is not shown on a phone."""
    wide = Layout(1, 3, (Slot("a", 0, 0), Slot("b", 0, 1), Slot("c", 0, 2)))
    phone = Layout(1, 3, (Slot("c", 0, 0), Slot("a", 0, 1, 1, 2)))
    text = css(("landscape", wide), ("phone_portrait", phone), slots=("a", "b", "c"))
    rules = text.split("@media (max-width: 37.499rem)")[1]
    assert '[data-place="0"]{display:grid;grid-area:1/2/2/4;' in rules
    assert '[data-place="1"]{display:none}' in rules


def test_a_low_screen_has_a_picture_of_its_own_where_one_is_drawn() -> None:
    """Without its margins; else it shows the wide one, in lower rows."""
    wide = Layout(3, 1, (Slot("a", 0, 0), Slot("b", 1, 0), Slot("c", 2, 0)))
    low = Layout(1, 3, (Slot("c", 0, 0), Slot("a", 0, 2)))
    rule = "@media (max-height: 29.999rem)"
    drawn = css(("landscape", wide), ("phone_landscape", low), slots=("a", "b", "c")).split(rule)[1]
    assert '[data-place="0"]{display:grid;grid-area:1/2/2/3;' in drawn
    assert '[data-place="1"]{display:none}' in drawn.split("@media")[0]
    assert '[data-place="2"]{display:grid;grid-area:1/1/2/2;' in drawn
    other = css(("landscape", wide), slots=("a", "b", "c")).split(rule)[1]
    assert f"grid-template-rows:{' '.join(['minmax(6.5rem,1fr)'] * 3)};" in other


def test_slots_that_nobody_fills_take_no_room() -> None:
    """One interface serves many drivers."""
    wide = Layout(1, 2, (Slot("a", 0, 0), Slot("camera", 0, 1)))
    text = css(("landscape", wide), slots=("a",))
    assert f"grid-template-columns:{COLUMN} {MARGIN}}}" in text


def test_the_rules_hold_nothing_out_of_a_document() -> None:
    """A slot's name cannot end the style element."""
    text = css(("landscape", Layout(1, 1, (Slot("</style><b>", 0, 0),))), slots=("</style><b>",))
    assert "<" not in text.replace("minmax", "")


def test_the_left_hand_gets_the_columns_the_other_way_round() -> None:
    """Only for who asked for it; what is stacked stays in reading order."""
    wide = Layout(1, 3, (Slot("a", 0, 0, 1, 2), Slot("b", 0, 2)))
    text = css(("landscape", wide), slots=("a", "b"))
    right, left = text.split(LEFT_HAND, 1)
    assert '[data-place="0"]{display:grid;grid-area:1/1/2/3;' in right
    assert '[data-place="0"]{display:grid;grid-area:1/2/2/4;' in left
    assert '[data-place="1"]{display:grid;grid-area:1/1/2/2;' in left
    stacked = text.split("@media (max-width: 37.499rem)")[2]
    assert '[data-place="0"]{display:grid;grid-area:1/1/2/2;' in stacked


def test_an_author_may_forbid_it_or_draw_it() -> None:
    """A picture for the left hand goes before the mirrored one, screen by screen."""
    wide = Layout(1, 2, (Slot("a", 0, 0), Slot("b", 0, 1)))
    tall = Layout(2, 1, (Slot("a", 0, 0), Slot("b", 1, 0)))
    fixed = Interface("i", layouts={"landscape": wide}, is_mirrored=False)
    assert LEFT_HAND not in grid_css(fixed, ("a", "b"))
    own = Layout(1, 2, (Slot("b", 0, 0, 1, 2),))
    drawn = Interface(
        "i", layouts={"landscape": wide, "portrait": tall}, left_handed={"landscape": own}
    )
    left = grid_css(drawn, ("a", "b")).split(LEFT_HAND, 1)[1]
    assert '[data-place="0"]{display:none}' in left.split("@media")[0]
    assert '[data-place="0"]{display:grid;grid-area:1/1/2/2;' in left.split("portrait")[1]


def test_each_page_places_the_cells_that_all_pages_share() -> None:
    """A cell that is in two pages stays the same; one that is not in a page is hidden there."""
    first = Tab("one", "One", {"landscape": Layout(1, 2, (Slot("a", 0, 0), Slot("b", 0, 1)))})
    second = Tab("two", "Two", {"landscape": Layout(1, 1, (Slot("b", 0, 0),))})
    both = Interface("i", tabs={"one": first, "two": second})
    text = grid_css(both, both.shown)
    assert '.urc-grid[data-page="0"] [data-place="1"]{display:grid;grid-area:1/2/2/3;' in text
    assert '.urc-grid[data-page="1"] [data-place="1"]{display:grid;grid-area:1/1/2/2;' in text
    assert '.urc-grid[data-page="1"] [data-place="0"]{display:none}' in text


def over(wide: Layout, *names: str, **footprints: Footprint) -> str:
    """Return the rules for an interface with the background ``v``."""
    interface = Interface("i", layouts={"landscape": wide}, background="v")
    return grid_css(interface, ("v", *names), footprints)


def test_over_a_background_widgets_keep_their_size_and_the_rest_is_free() -> None:
    wide = Layout(2, 3, (Slot("a", 0, 0), Slot("b", 1, 2)))
    base = over(wide, "a", "b").split("@media")[0]
    assert "grid-template-rows:auto minmax(0,1fr);" in base
    assert "grid-template-columns:auto minmax(0,1fr) auto}" in base
    assert '[data-place="0"]' not in base


def test_over_a_background_an_empty_row_grows() -> None:
    wide = Layout(3, 1, (Slot("a", 0, 0), Slot("b", 2, 0)))
    assert "grid-template-rows:auto minmax(0,1fr) auto;" in over(wide, "a", "b")


def test_over_a_background_a_widget_is_at_the_side_of_its_slot() -> None:
    slots = (Slot("a", 0, 0), Slot("b", 0, 1), Slot("c", 1, 2))
    base = over(Layout(2, 3, slots), "a", "b", "c").split("@media")[0]
    assert "grid-area:1/1/2/2;--urc-across:start;--urc-down:start" in base
    assert "grid-area:1/2/2/3;--urc-across:center;--urc-down:start" in base
    assert "grid-area:2/3/3/4;--urc-across:end;--urc-down:end" in base


def test_a_phone_in_portrait_has_the_background_above_the_widgets() -> None:
    wide = Layout(2, 3, (Slot("a", 0, 0), Slot("b", 0, 2)))
    phone = over(wide, "a", "b").split("@media (max-width: 37.499rem)")[1]
    assert "grid-template-rows:minmax(var(--urc-ground-height),1fr) " in phone
    assert '[data-place="1"]{display:grid;grid-area:2/1/3/2;' in phone


def test_on_a_phone_in_portrait_only_the_background_grows() -> None:
    """A growing row of sticks would make the background as high as the sticks, and hide them."""
    slots = (Slot("a", 0, 0), Slot("lift", 1, 0, 2, 1), Slot("move", 1, 1, 2, 1))
    phone = over(Layout(3, 2, slots), "a", "lift", "move", lift="stick", move="stick").split(
        "@media (max-width: 37.499rem)"
    )[1]
    rows = phone.split("grid-template-rows:")[1].split(";")[0]
    assert rows == "minmax(var(--urc-ground-height),1fr) auto auto auto"


def phone_rules(*rows: str, **footprints: Footprint) -> str:
    """Return the rules of a phone in portrait for the rows of a grid, over a background."""
    slots: dict[str, Slot] = {}
    for row, line in enumerate(rows):
        for column, name in enumerate(line.split()):
            last = slots.get(name)
            span = 1 if last is None else last.row_span + (last.row + last.row_span == row)
            slots[name] = Slot(name, row, column) if last is None else last._replace(row_span=span)
    grid = Layout(len(rows), 2, tuple(slots.values()))
    return over(grid, *slots, **footprints).split("@media (max-width: 37.499rem)")[1]


VALUES: dict[str, Footprint] = {"a": "value", "b": "value", "c": "value", "d": "value"}


LINE = "--urc-cell-height:var(--urc-height-line)"


def test_on_a_phone_in_portrait_the_first_values_are_lines_below_the_background() -> None:
    """They cover nothing of the background; at most two rows are lines."""
    phone = phone_rules("a b", "go stop", go="button", stop="button", **VALUES)
    assert '[data-place="ground"]{grid-row:1/2}' in phone
    assert '[data-place="1"]{display:grid;grid-area:2/1/3/2;' in phone
    assert phone.count(LINE) == 2
    values: dict[str, Footprint] = dict.fromkeys("abcdefgh", "value")
    assert phone_rules("a b", "c d", "e f", "g h", **values).count(LINE) == 4


SMALL = "@media (max-width: 37.499rem) and (max-height: 45.999rem)"


def test_on_a_small_phone_the_buttons_below_a_stick_are_next_to_it() -> None:
    """The background gets their height; the button for missing slots leads to further views."""
    slots = (
        Slot("a", 0, 0), Slot("b", 0, 1), Slot("laser", 1, 0), Slot("map", 2, 0),
        Slot("move", 1, 1, 2, 1), Slot("go", 3, 0), Slot("off", 3, 1),
    )  # fmt: skip
    kinds: dict[str, Footprint] = {"laser": "view", "map": "view", "move": "stick"}
    buttons: dict[str, Footprint] = {"go": "button", "off": "button"}
    names = [slot.name for slot in slots]
    text = over(Layout(4, 2, slots), *names, **kinds, **buttons, **VALUES)
    small = text.split(SMALL)[1]
    for place, area in ((3, "3/1/4/2"), (5, "3/2/6/3"), (6, "4/1/5/2"), (7, "5/1/6/2")):
        assert f'[data-place="{place}"]{{display:grid;grid-area:{area};' in small
    assert '[data-place="4"]{display:none}' in small
    assert "--urc-rest:4}" in text


def test_a_small_phone_has_the_grid_of_a_phone_where_nothing_would_be_gained() -> None:
    """As with two sticks, and without buttons below the stick."""
    for rows in (["lift move", "lift move", "go off"], ["a move", "b move"]):
        grid = phone_rules(*rows, lift="stick", move="stick", go="button", off="button", **VALUES)
        assert SMALL not in grid


def test_on_a_phone_in_portrait_controls_are_never_over_the_background() -> None:
    """Nor are values below or next to a control."""
    for rows in (["go a", "b c"], ["a move", "b move"]):
        phone = phone_rules(*rows, go="button", move="stick", **VALUES)
        assert '[data-place="ground"]{grid-row:1/2}' in phone


def test_a_stick_in_a_lower_corner_reaches_down_next_to_stop() -> None:
    """STOP is between the sticks."""
    slots = (Slot("lift", 1, 0), Slot("move", 1, 2), Slot("a", 0, 1))
    interface = Interface("i", layouts={"landscape": Layout(2, 3, slots)})
    sticks: dict[str, Footprint] = {"lift": "stick", "move": "stick", "a": "button"}
    base = grid_css(interface, ("lift", "move", "a"), sticks).split("@media")[0]
    corner = "calc(var(--urc-edge) + var(--urc-width-stick))"
    assert f"--urc-left:{corner};--urc-right:{corner}" in base
    assert base.count("--urc-corner:1") == 2


def rules_of(css: str, index: int) -> str:
    """Return the rules of a cell."""
    return css.split(f'[data-place="{index}"]{{')[1].split("}")[0]


def test_buttons_above_a_corner_reach_down_with_it() -> None:
    """They are a pile: the gaps between them are equal."""
    slots = (Slot("dock", 2, 0), Slot("undock", 3, 0), Slot("a", 0, 0))
    names = ("dock", "undock", "a")
    base = over(Layout(4, 3, slots), *names, **dict.fromkeys(names, "button")).split("@media")[0]
    corners = [rules_of(base, index)[-1] for index in (1, 2, 3)]
    assert corners == ["1", "1", "0"]


def test_a_row_of_buttons_stays_a_row() -> None:
    """A button in the corner is as high as its neighbour, which is above STOP."""
    slots = (Slot("on", 1, 0), Slot("off", 1, 1))
    base = over(Layout(2, 4, slots), "on", "off", on="button", off="button").split("@media")[0]
    assert "--urc-left:0px" in base
    assert rules_of(base, 1).endswith("--urc-corner:0")


def test_next_to_a_stick_only_the_first_row_grows() -> None:
    slots = (Slot("dock", 1, 0), Slot("undock", 2, 0), Slot("move", 1, 2, 2, 1))
    feet: dict[str, Footprint] = {"dock": "button", "undock": "button", "move": "stick"}
    css = over(Layout(3, 3, slots), "dock", "undock", "move", **feet)
    last = "max(var(--urc-target-drive))"
    base, phone = css.split("@media")[0], css.split("@media (max-width: 37.499rem)")[1]
    assert f"auto {last};" in base
    assert f" {last};" in phone
    assert "--urc-down:end" in rules_of(phone, 1)


def test_over_a_background_displays_give_way_to_sticks_and_buttons_on_a_low_screen() -> None:
    """The page scrolls only if all displays are as low as values and the rest is still too high."""
    slots = (Slot("map", 0, 2), Slot("dock", 1, 0), Slot("move", 1, 2, 2, 1), Slot("low", 2, 0))
    feet: dict[str, Footprint] = {
        "map": "view", "dock": "button", "move": "stick", "low": "button"
    }  # fmt: skip
    css = over(Layout(3, 3, slots), "map", "dock", "move", "low", **feet)
    base, phone = css.split("@media")[0], css.split("@media (max-width: 37.499rem)")[1]
    assert "grid-template-rows:minmax(3.625rem,max-content) " in base
    room = base.split(">.urc-stage:has(")[0].split("grid-template-rows:auto ")[1]
    assert room.startswith("minmax(max(calc(3.625rem + ")
    stick = "calc(var(--urc-stick) + var(--urc-stick-head) - var(--urc-dock) + var(--urc-space-3))"
    assert f"calc(3.625rem + {stick} + 1*var(--urc-gap))" in room
    assert "grid-template-rows:auto minmax(min-content,1fr)" in phone
    assert "max-content" not in phone.split(LEFT_HAND)[0]


def test_views_give_way_to_sticks_on_a_phone_in_landscape() -> None:
    slots = (Slot("map", 0, 2), Slot("move", 1, 2, 2, 1))
    css = over(Layout(3, 3, slots), "map", "move", map="view", move="stick")
    low = css.split("@media (max-height: 29.999rem)")[1]
    assert "grid-template-rows:minmax(3.625rem,max-content) " in low


def test_rows_of_values_and_buttons_are_low_on_a_phone_in_portrait() -> None:
    """Sticks below them are then above STOP; a map keeps its height."""
    slots = (Slot("a", 0, 0), Slot("b", 1, 0), Slot("move", 1, 1, 2, 1), Slot("map", 3, 0, 1, 2))
    feet: dict[str, Footprint] = {"a": "value", "b": "button", "move": "stick", "map": "view"}
    css = grid_css(Interface("i", layouts={"landscape": Layout(4, 2, slots)}), tuple(feet), feet)
    phone = css.split("@media (max-width: 37.499rem)")[1]
    low = "minmax(6.5rem,1fr)"
    assert f"grid-template-rows:{low} {low} {low} {ROW};" in phone


def test_only_a_background_lets_a_button_reach_down_next_to_stop() -> None:
    """A button of a plain grid is as wide as its column, which may be under STOP."""
    wide = Layout(2, 3, (Slot("a", 1, 0),))
    corner = "--urc-left:calc(var(--urc-edge) + var(--urc-width-button));--urc-right:0px"
    assert corner in over(wide, "a", a="button")
    plain = Interface("i", layouts={"landscape": wide})
    assert "--urc-left:0px;--urc-right:0px" in grid_css(plain, ("a",), {"a": "button"})


def test_a_phone_upright_falls_back_on_the_tall_picture() -> None:
    """It is nearer to it than the wide one."""
    wide = Layout(1, 2, (Slot("a", 0, 0), Slot("b", 0, 1)))
    tall = Layout(2, 1, (Slot("b", 0, 0), Slot("a", 1, 0)))
    phone = css(("landscape", wide), ("portrait", tall), slots=("a", "b"))
    rules = phone.split("@media (max-width: 37.499rem)")[1]
    assert '[data-place="0"]{display:grid;grid-area:2/1/3/2;' in rules


@pytest.mark.parametrize(
    ("grids", "is_turned"),
    [
        (("landscape",), True),
        (("landscape", "phone_portrait"), False),
        (("landscape", "portrait"), False),
    ],
)
def test_only_a_picture_that_is_stacked_asks_for_turning(
    grids: tuple[str, ...], is_turned: bool
) -> None:
    """Who has drawn the phone upright needs no hint."""
    wide = Layout(1, 3, (Slot("a", 0, 0), Slot("b", 0, 1), Slot("c", 0, 2)))
    page = Tab(layouts=dict.fromkeys(grids, wide))
    assert needs_turning(page, ("a", "b", "c")) is is_turned


def test_values_at_the_top_are_packed_at_the_sides() -> None:
    """Wide widgets below them make no gap; a button ends the row; values further down stay."""
    slots = (
        Slot("a", 0, 0), Slot("b", 0, 1), Slot("go", 0, 2), Slot("c", 0, 4),
        Slot("move", 1, 0), Slot("d", 3, 1),
    )  # fmt: skip
    kinds: dict[str, Footprint] = {"move": "stick", "go": "button"}
    base = over(Layout(4, 5, slots), *(one.name for one in slots), **kinds, **VALUES)
    base = base.split("@media")[0]
    for place, side, shift in ((1, "start", 0), (2, "start", 1), (3, "start", 2), (4, "end", 0)):
        rule = base.split(f'[data-place="{place}"]{{')[1].split("}")[0]
        calc = f"calc({shift}*(var(--urc-width-tile) + var(--urc-gap)))"
        margins = f"{calc} 0" if side == "start" else f"0 {calc}"
        assert rule.endswith(f"grid-column:1/-1;--urc-across:{side};margin-inline:{margins}")
    for place in (5, 6):
        assert "1/-1" not in base.split(f'[data-place="{place}"]{{')[1].split("}")[0]


LOW = "@media (max-height: 29.999rem){"


def test_a_phone_in_landscape_shows_one_view() -> None:
    """The view is the first one of the wide layout; the button in the bar lists the other one."""
    slots = (
        Slot("a", 0, 0), Slot("map", 1, 0), Slot("laser", 1, 1),
        Slot("go", 3, 0), Slot("off", 3, 1), Slot("move", 0, 4, 4, 1),
    )  # fmt: skip
    wide = Layout(2, 5, (Slot("laser", 0, 3), Slot("map", 1, 3), *slots[3:5]))
    kinds: dict[str, Footprint] = {"laser": "view", "map": "view", "move": "stick", "a": "value"}
    kinds |= {"go": "button", "off": "button"}
    names = ("v", *(slot.name for slot in slots))
    layouts = {"landscape": wide, "phone_landscape": Layout(4, 5, slots)}
    text = grid_css(Interface("i", layouts=layouts, background="v"), names, kinds)
    low = text.split(LOW)[1].split("@media")[0]
    assert '[data-place="2"]{display:none' in low
    assert '[data-place="3"]{display:grid;grid-area:2/1/3/2;' in low
    assert "--urc-rest:2}" in text


REST = '.urc-grid[data-page="0-rest"]'


def test_widgets_that_a_screen_lacks_are_on_a_second_page_of_that_screen() -> None:
    wide = Layout(1, 3, (Slot("a", 0, 0), Slot("b", 0, 1), Slot("c", 0, 2)))
    low = Layout(1, 1, (Slot("b", 0, 0),))
    text = css(("landscape", wide), ("phone_landscape", low), slots=("a", "b", "c"))
    short = text.split(REST, 1)[1].split("@media (max-height: 29.999rem)", 1)[1].split("@media")[0]
    assert f'{REST} [data-place="0"]{{display:grid;grid-area:1/1/2/2;' in short
    assert f'{REST} [data-place="1"]{{display:none}}' in short
    assert f'{REST} [data-place="2"]{{display:grid;grid-area:1/2/2/3;' in short


def test_only_the_screens_that_lack_widgets_show_the_button_for_them() -> None:
    wide = Layout(1, 2, (Slot("a", 0, 0), Slot("b", 0, 1)))
    low = Layout(1, 1, (Slot("b", 0, 0),))
    text = css(("landscape", wide), ("phone_landscape", low), slots=("a", "b"))
    shown = [
        part.partition("{")[0].strip() for part in text.split("@media") if "inline-flex" in part
    ]
    assert set(shown) == {"(max-height: 29.999rem)"}
    assert "[data-rest]{display:inline-flex;--urc-rest:0}" in text
    assert "[data-rest]" not in css(("landscape", wide), slots=("a", "b"))


def test_the_button_has_the_numbers_of_the_missing_cells_in_reading_order() -> None:
    wide = Layout(1, 3, (Slot("a", 0, 2), Slot("b", 0, 1), Slot("c", 0, 0)))
    low = Layout(1, 1, (Slot("b", 0, 0),))
    text = css(("landscape", wide), ("phone_landscape", low), slots=("a", "b", "c"))
    assert "[data-rest]{display:inline-flex;--urc-rest:2 0}" in text


def test_a_complete_screen_stays_as_it_is_on_the_second_page() -> None:
    """The device may be turned meanwhile."""
    wide = Layout(1, 2, (Slot("a", 0, 0), Slot("b", 0, 1)))
    low = Layout(1, 1, (Slot("b", 0, 0),))
    text = css(("landscape", wide), ("phone_landscape", low), slots=("a", "b"))
    rules = [part.split("@media")[0] for part in text.split(f'{REST} [data-place="1"]')[1:]]
    assert "grid-area:1/2/2/3" in rules[0]


def test_a_grid_for_the_left_hand_may_lack_widgets_of_its_own() -> None:
    wide = Layout(1, 2, (Slot("a", 0, 0), Slot("b", 0, 1)))
    own = Layout(1, 1, (Slot("b", 0, 0),))
    drawn = Interface("i", layouts={"landscape": wide}, left_handed={"phone_landscape": own})
    left = grid_css(drawn, ("a", "b")).split(REST, 1)[1].split(LEFT_HAND)
    assert not any("inline-flex" in part for part in left if not part.startswith(" .urc-robot"))
    assert sum("inline-flex" in part for part in left) == 1


CROWDED = Layout(2, 3, (Slot("a", 0, 0), Slot("v", 0, 1), Slot("b", 1, 0), Slot("c", 1, 2)))
FOOTPRINTS: dict[str, Footprint] = {"a": "lever", "v": "view", "b": "button", "c": "stick"}
FILLED = ("g", "a", "v", "b", "c")


def crowded(low: Layout, **tabs: Tab) -> Interface:
    """Return an interface over a background, whose low screens show less."""
    layouts = {} if tabs else {"landscape": CROWDED, "phone_landscape": low}
    return Interface("i", layouts=layouts, tabs=tabs, background="g")


def test_over_a_background_a_low_screen_has_a_drawer_for_what_it_lacks() -> None:
    """But for views, which can be the background: they stay on the second page."""
    interface = crowded(Layout(1, 2, (Slot("c", 0, 1),)))
    assert drawer_slots(interface, FILLED, FOOTPRINTS) == {"a", "b"}
    text = grid_css(interface, FILLED, FOOTPRINTS)
    page, second = '.urc-grid[data-page="0"]', REST
    low = text.split("@media (max-height: 29.999rem){", 1)[1].split("@media")[0]
    assert f'{page} [data-place="1"]{{display:grid;grid-area:auto}}' in low
    assert f'{page} [data-place="3"]{{display:grid;grid-area:auto}}' in low
    assert f'{page} [data-place="2"]{{display:none}}' in low
    short = text.split(second, 1)[1].split("@media (max-height: 29.999rem){", 1)[1]
    assert f'{second} [data-place="1"]{{display:none}}' in short.split("@media")[0]
    shown = f".urc-robot:has(> .urc-stage > {page}) [data-drawer-handle]{{display:inline-flex}}"
    assert f"@media (max-height: 29.999rem) and (min-width: 37.5rem){{{shown}}}" in text
    assert "--urc-rest:2}" in text, "the button counts the view only"


def test_only_a_background_leaves_room_for_a_drawer() -> None:
    low = Layout(1, 2, (Slot("c", 0, 1),))
    plain = crowded(low)._replace(background="")
    assert drawer_slots(plain, FILLED, FOOTPRINTS) == frozenset()
    assert "drawer" not in grid_css(plain, FILLED, FOOTPRINTS)
    assert drawer_slots(crowded(low), ("a", "b", "c"), FOOTPRINTS) == frozenset(), "not filled"
    assert drawer_slots(crowded(CROWDED), FILLED, FOOTPRINTS) == frozenset(), "all have a place"
    assert drawer_slots(Interface("debug"), (), {}) == frozenset()
    assert grid_css(Interface("debug"), ()) == ""


def test_what_has_a_place_on_another_page_is_not_in_the_drawer() -> None:
    """The pages share their cells."""
    low = Layout(1, 2, (Slot("c", 0, 1),))
    other = Layout(1, 2, (Slot("b", 0, 0), Slot("c", 0, 1)))
    tabs = {
        "one": Tab(name="one", layouts={"landscape": CROWDED, "phone_landscape": low}),
        "two": Tab(name="two", layouts={"landscape": other}),
    }
    assert drawer_slots(crowded(low, **tabs), FILLED, FOOTPRINTS) == {"a"}


def test_what_a_left_handed_layout_has_is_not_in_the_drawer() -> None:
    low = Layout(1, 2, (Slot("c", 0, 1),))
    left = {"phone_landscape": Layout(1, 2, (Slot("c", 0, 0), Slot("b", 0, 1)))}
    interface = crowded(low)._replace(left_handed=left)
    assert drawer_slots(interface, FILLED, FOOTPRINTS) == {"a"}


def test_a_phone_in_landscape_shows_the_rows_with_sticks() -> None:
    """The other rows are on the second page; the stick also takes the empty cell above it."""
    slots = (Slot("a", 0, 0), Slot("b", 1, 0), Slot("c", 2, 0), Slot("move", 2, 1))
    feet: dict[str, Footprint] = {"a": "value", "b": "value", "c": "value", "move": "stick"}
    css = grid_css(Interface("i", layouts={"landscape": Layout(3, 2, slots)}), tuple(feet), feet)
    base = css.split("@media")[0]
    assert "grid-area:2/2/4/3;" in rules_of(base, 3)
    low = css.split("@media (max-height: 29.999rem)")[1]
    assert rules_of(low, 0) == "display:none"
    assert "grid-area:1/2/3/3;" in rules_of(low, 3)


def test_the_rows_of_a_stick_have_its_height() -> None:
    """Other rows of a plain grid shrink; a corner counts the height next to STOP."""
    slots = (Slot("a", 0, 0, 1, 2), Slot("b", 1, 0), Slot("move", 1, 1))
    feet: dict[str, Footprint] = {"a": "value", "b": "value", "move": "stick"}
    css = grid_css(Interface("i", layouts={"landscape": Layout(2, 2, slots)}), tuple(feet), feet)
    rows = css.split("@media")[0].split("grid-template-rows:")[1].split(";")[0]
    assert rows.startswith("minmax(3.625rem,1fr) minmax(max(")
    assert "var(--urc-stick-head) - var(--urc-dock)" in rows
