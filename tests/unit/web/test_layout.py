"""The picture of an interface as CSS."""

from urc.model.interface import Grid, Interface, Slot
from urc.web.layout import grid_css

MARGIN = "minmax(0,.12fr)"
ROW = "minmax(8rem,1fr)"
COLUMN = "minmax(0,1fr)"


def css(*grids: tuple[str, Grid], slots: tuple[str, ...]) -> str:
    """Return the rules for an interface of those grids."""
    return grid_css(Interface("i", grids=dict(grids)), slots)


def test_the_picture_keeps_its_margins_on_a_wide_screen() -> None:
    """Rows and columns without a slot stay where they are, and are small."""
    text = css(("wide", Grid(2, 3, (Slot("battery", 1, 2),))), slots=("battery",))
    wide = text.split("@media")[0]
    assert f"grid-template-rows:{MARGIN} {ROW};" in wide
    assert f"grid-template-columns:{MARGIN} {MARGIN} {COLUMN}}}" in wide
    assert '[data-cell="0"]{display:grid;grid-area:2/3/3/4}' in wide


def test_a_phone_gets_no_margins() -> None:
    """The one cell fills the phone."""
    text = css(("wide", Grid(2, 3, (Slot("battery", 1, 2),))), slots=("battery",))
    phone = text.split("@media (max-width: 599.98px)")[1]
    assert f"grid-template-rows:{ROW};grid-template-columns:{COLUMN}}}" in phone
    assert "grid-area:1/1/2/2" in phone


def test_more_than_two_columns_are_stacked_on_a_phone_in_reading_order() -> None:
    """Unless the author drew a phone grid."""
    slots = (Slot("c", 1, 0, 1, 3), Slot("a", 0, 0), Slot("b", 0, 2), Slot("m", 0, 1))
    text = css(("wide", Grid(2, 3, slots)), slots=("a", "m", "b", "c"))
    phone = text.split("@media (max-width: 599.98px)")[1]
    for index, row in enumerate((1, 2, 3, 4)):
        assert f'[data-cell="{index}"]{{display:grid;grid-area:{row}/1/{row + 1}/2}}' in phone


def test_a_drawn_phone_grid_is_kept_and_hides_what_it_leaves_out() -> None:
    """A slot that the phone grid does not have is not shown on a phone."""
    wide = Grid(1, 3, (Slot("a", 0, 0), Slot("b", 0, 1), Slot("c", 0, 2)))
    phone = Grid(1, 3, (Slot("c", 0, 0), Slot("a", 0, 1, 1, 2)))
    text = css(("wide", wide), ("phone", phone), slots=("a", "b", "c"))
    rules = text.split("@media (max-width: 599.98px)")[1]
    assert '[data-cell="0"]{display:grid;grid-area:1/2/2/4}' in rules
    assert '[data-cell="1"]{display:none}' in rules


def test_slots_that_nobody_fills_take_no_room() -> None:
    """One interface serves many drivers."""
    wide = Grid(1, 2, (Slot("a", 0, 0), Slot("camera", 0, 1)))
    text = css(("wide", wide), slots=("a",))
    assert f"grid-template-columns:{COLUMN} {MARGIN}}}" in text


def test_the_rules_hold_nothing_out_of_a_document() -> None:
    """A slot's name cannot end the style element."""
    text = css(("wide", Grid(1, 1, (Slot("</style><b>", 0, 0),))), slots=("</style><b>",))
    assert "<" not in text.replace("minmax", "")
