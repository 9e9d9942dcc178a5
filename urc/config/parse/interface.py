"""Parser for interfaces: grid → rectangular slots."""

import re
from typing import Final

from urc.config.node import Node, Problems
from urc.config.parse.driver import spoken_name
from urc.model.interface import DEBUG, SCREENS, Interface, Layout, Slot, Tab

__all__ = ["check_names", "parse_interface"]

_MOST: Final = 48
"""Maximum number of rows or columns in one grid."""
_NAME = re.compile(r"[a-z][a-z0-9_-]{0,63}")
_EMPTY = re.compile(r"\.+")
_Cell = tuple[str, int]
"""The slot name in a cell and the name's offset in the grid's text."""


def parse_interface(part: Node, name: str, problems: Problems) -> Interface:
    """Return the interface at `part`, without the widgets in its slots."""
    title = part.text("title", spoken_name(name))
    pages = part.named("tabs")
    tabs = {key: _tab(inner, problems, part) for key, inner in pages.items()}
    only = Tab()
    if pages:
        _check_beside_tabs(part, problems)
    else:
        only = _tab(part, problems)
    background = part.text("background")
    interface = Interface(
        name=name,
        title=title,
        layouts=only.layouts,
        summary=part.text("summary"),
        licence=part.text("licence"),
        author=part.text("author"),
        left_handed=only.left_handed,
        is_mirrored=only.is_mirrored,
        tabs=tabs,
        drawer=part.text("drawer"),
    )
    if background in interface.shown:
        problems.error(
            part,
            "misplaced-key",
            f"{background!r} is also in the grid",
            at="background",
            hint="the background slot is behind the grid, so it must not be in the grid",
        )
    return interface._replace(background=background)


def check_names(root: Node, problems: Problems) -> None:
    """Report an interface with the reserved name of the built-in interface."""
    if DEBUG in root.named("interfaces"):
        problems.error(
            root.must("interfaces"),
            "bad-name",
            f"{DEBUG!r} is the name of the built-in interface of every robot",
            at=DEBUG,
            key=True,
            hint="give your interface another name",
        )


def _check_beside_tabs(part: Node, problems: Problems) -> None:
    for key in ("grid", "layouts", "left_handed"):
        if part.get(key) is not None:
            problems.error(
                part,
                "misplaced-key",
                f"'{key}' and 'tabs' cannot be used together",
                at=key,
                key=True,
                hint="give each tab its own grid",
            )


def _tab(part: Node, problems: Problems, around: Node | None = None) -> Tab:
    """Return one page; a tab inherits ``mirror`` from `around`, the surrounding interface."""
    is_mirrored = around.flag("mirror", default=True) if around is not None else True
    left = part.get("left_handed")
    return Tab(
        name=part.name if around is not None else "",
        title=part.text("title", spoken_name(part.name)) if around is not None else "",
        layouts=_pictures(part, problems, is_tab=around is not None),
        left_handed=_by_screen(left, problems) if left is not None else {},
        is_mirrored=part.flag("mirror", default=is_mirrored),
    )


def _pictures(part: Node, problems: Problems, *, is_tab: bool) -> dict[str, Layout]:
    one, several = part.get("grid"), part.get("layouts")
    if one is None and several is None:
        problems.error(
            part,
            "missing-key",
            f"{'a tab' if is_tab else 'an interface'} lacks 'grid'",
            key=True,
            hint="draw the grid: a line for each row, a name for each cell, '.' for an empty cell",
        )
    if one is not None and several is not None:
        problems.error(
            several,
            "misplaced-key",
            "'grid' and 'layouts' cannot be used together",
            key=True,
            hint="move 'grid' into 'layouts' as 'landscape'",
        )
    found = {"landscape": _grid(one, problems)} if one is not None else {}
    return found | (_by_screen(several, problems) if several is not None else {})


def _by_screen(several: Node, problems: Problems) -> dict[str, Layout]:
    pictures = {screen: several.get(screen) for screen in SCREENS}
    return {
        screen: _grid(picture, problems)
        for screen, picture in pictures.items()
        if picture is not None
    }


def _grid(part: Node, problems: Problems) -> Layout:
    rows = _rows(part.data)
    if not rows:
        problems.error(part, "empty-grid", "the grid has no rows")
        return Layout(1, 1, ())
    if len(rows) > _MOST or len(rows[0]) > _MOST:
        problems.error(part, "wrong-size", f"a grid may have at most {_MOST} rows and columns")
        return Layout(1, 1, ())
    width = len(rows[0])
    is_sound = True
    for number, row in enumerate(rows, 1):
        if len(row) != width:
            is_sound = False
            problems.error(
                part,
                "uneven-rows",
                f"row {number} has {_cells(len(row))}, but the first row has {width}",
                offset=row[0][1],
                length=row[-1][1] + len(row[-1][0]) - row[0][1],
                hint="every row needs the same number of cells; '.' is an empty cell",
            )
        for text, offset in row:
            if not _NAME.fullmatch(text) and not _EMPTY.fullmatch(text):
                is_sound = False
                problems.error(
                    part,
                    "bad-name",
                    f"{text!r} is not a valid slot name",
                    offset=offset,
                    length=len(text),
                    hint="use lower-case letters, digits, '-' and '_'; '.' is an empty cell",
                )
    if not is_sound:
        return Layout(1, 1, ())
    slots = _slots(part, rows, problems)
    return Layout(len(rows), width, tuple(slots))


def _cells(count: int) -> str:
    return "1 cell" if count == 1 else f"{count} cells"


def _rows(text: str) -> list[list[_Cell]]:
    rows = []
    position = 0
    for line in text.split("\n"):
        row = [(found[0], position + found.start()) for found in re.finditer(r"\S+", line)]
        if row:
            rows.append(row)
        position += len(line) + 1
    return rows


def _slots(part: Node, rows: list[list[_Cell]], problems: Problems) -> list[Slot]:
    places: dict[str, list[tuple[int, int]]] = {}
    for row_number, row in enumerate(rows):
        for column, (text, _) in enumerate(row):
            if not _EMPTY.fullmatch(text):
                places.setdefault(text, []).append((row_number, column))
    slots = []
    for name, cells in places.items():
        top, bottom = cells[0][0], cells[-1][0]
        columns = [column for _, column in cells]
        left, right = min(columns), max(columns)
        slot = Slot(name, top, left, bottom - top + 1, right - left + 1)
        _check_rectangle(slot, part, rows, problems)
        slots.append(slot)
    return slots


def _check_rectangle(slot: Slot, part: Node, rows: list[list[_Cell]], problems: Problems) -> None:
    bottom, right = slot.row + slot.row_span, slot.column + slot.column_span
    wrong = [
        (row, column)
        for row in range(slot.row, bottom)
        for column in range(slot.column, right)
        if rows[row][column][0] != slot.name
    ]
    if not wrong:
        return
    told = [
        f"row {row + 1} column {column + 1} "
        + ("is empty" if _EMPTY.fullmatch(rows[row][column][0]) else f"is {rows[row][column][0]!r}")
        for row, column in wrong[:4]
    ]
    more = f" and {len(wrong) - 4} more" if len(wrong) > 4 else ""
    text, offset = rows[wrong[0][0]][wrong[0][1]]
    problems.error(
        part,
        "not-a-rectangle",
        f"slot {slot.name!r} is not a rectangle: it extends from row {slot.row + 1} column"
        f" {slot.column + 1} to row {bottom} column {right}, but {', '.join(told)}{more}",
        offset=offset,
        length=len(text),
        hint="give the separate cells another name, or fill the gap between them",
    )
