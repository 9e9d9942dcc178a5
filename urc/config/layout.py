"""A sensible look for a profile that says nothing about it: where everything stands."""

import math
from collections.abc import Mapping
from typing import Final

from urc.model.interface import Grid, Interface, Slot, WidgetUse

__all__ = ["default_interface"]

_COLUMNS: Final = {"wide": 4, "phone": 2, "low": 7}
"""Most columns of a made grid."""
_LOW_ROWS: Final = 2
"""So many are seen on a phone that lies."""
_BIG: Final = frozenset(
    (
        *("attitude", "camera", "depth", "dpad", "image", "joystick", "log", "map", "pano360"),
        *("path-pad", "plot", "scan", "scene3d", "table", "terminal", "vector-pad"),
    )
)
"""Widgets that get two rows and two columns."""


def default_interface(slots: Mapping[str, WidgetUse], title: str) -> Interface:
    """Return an interface named ``default`` that shows every slot.

    What is looked at stands on top, the large before the small; what is steered with is at the
    bottom right, where the thumb is, and other controls take the places that are left. On a phone
    that lies what steers comes first, at the right and at the left: the rest may be scrolled to.
    """
    return Interface(
        name="default",
        title=title,
        grids={screen: _grid(slots, screen) for screen in _COLUMNS},
    )


def _grid(slots: Mapping[str, WidgetUse], screen: str) -> Grid:
    is_low = screen == "low"
    sizes = {name: 2 if use.widget in _BIG else 1 for name, use in slots.items()}
    area = sum(size * size for size in sizes.values())
    wanted = math.ceil(area / _LOW_ROWS if is_low else math.sqrt(area))
    columns = max(1, min(_COLUMNS[screen], wanted), *sizes.values())
    taken: set[tuple[int, int]] = set()
    placed: dict[str, Slot] = {}
    ranks = {name: _rank(use) for name, use in slots.items()}
    # Where nothing fits beside what steers, that comes last: at the bottom, and nothing below it.
    steered = -1 if is_low else _STEERED if columns > 2 else 4
    order = {name: steered if rank == _STEERED else rank for name, rank in ranks.items()}
    for number, name in enumerate(sorted(slots, key=lambda name: order[name])):
        is_steered = ranks[name] == _STEERED
        is_last = is_steered and not is_low
        first = max((row for row, _ in taken), default=-1) + 1 if is_last else 0
        is_right = is_steered and not (is_low and number % 2)
        row, column = _free(taken, columns, sizes[name], first, is_from_right=is_right)
        taken |= _cells(row, column, sizes[name])
        placed[name] = Slot(name, row, column, sizes[name], sizes[name])
    rows = max((row for row, _ in taken), default=0) + 1
    return Grid(rows, columns, tuple(placed.values()))


_STEERED: Final = 2


def _rank(use: WidgetUse) -> int:
    """Return which comes first: large views, small ones, what steers, small controls."""
    if use.widget in _BIG:
        return _STEERED if use.outputs and not use.inputs else 0
    return 3 if use.outputs else 1


def _free(
    taken: set[tuple[int, int]], columns: int, size: int, first: int, *, is_from_right: bool
) -> tuple[int, int]:
    """Return the first place at or below the row `first` where a square has room."""
    places = range(columns - size + 1)
    row = first
    while True:
        for column in reversed(places) if is_from_right else places:
            if not taken & _cells(row, column, size):
                return row, column
        row += 1


def _cells(row: int, column: int, size: int) -> set[tuple[int, int]]:
    return {(row + down, column + right) for down in range(size) for right in range(size)}
