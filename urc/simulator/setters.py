"""Which line lets time change the robot: one of its clients, however many there are.

Pure.
"""

import weakref
from typing import Protocol

from urc.model.profile import SimulatorRule

__all__ = ["Setters"]


class _Line(Protocol):
    is_over: bool


class Setters:
    """Rule → the line that does what it sets, while that line is there."""

    def __init__(self) -> None:
        """Begin without any line."""
        self._lines: dict[int, weakref.ref[_Line]] = {}

    def sets(self, rule: SimulatorRule, line: _Line) -> bool:
        """Return whether `line` is the one that does what `rule` sets; the first to ask is."""
        known = self._lines.get(id(rule))
        before = known() if known is not None else None
        if before is None or before.is_over:
            self._lines[id(rule)] = weakref.ref(line)
            return True
        return before is line
