"""Finds any widget by its name: those of the robots, those beside their documents, and URC's own.

Floor 5. Also one whose manifest is broken: its author wants to know why it is not shown.
"""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

from urc.config.parse.widget import Shelf
from urc.model.profile import Profile
from urc.model.widget import Widget
from urc.problems import Problem
from urc.runtime.shelves import shelf_of
from urc.shipped import shipped

__all__ = ["Found", "Lookup"]


class Found(NamedTuple):
    """A widget that there is."""

    folder: Path
    widget: Widget | None
    """None: its manifest is broken."""
    problems: tuple[Problem, ...] = ()
    """Why."""


class Lookup:
    """The widgets there are now.

    Args:
        profiles: returns the robots' profiles.
        is_fresh: manifests are read anew each time; else those of the robots are as the robots'
            pages show them.
    """

    def __init__(self, profiles: Callable[[], Iterable[Profile]], *, is_fresh: bool) -> None:
        self._profiles = profiles
        self._is_fresh = is_fresh

    def names(self) -> list[str]:
        """Return the names of all widgets, broken ones too."""
        profiles = list(self._profiles())
        names = {name for shelf in self._shelves(profiles) for name in shelf.names()}
        return sorted(names.union(*(profile.widgets for profile in profiles)))

    def find(self, name: str) -> Found | None:
        """Return a widget, or None when there is none of that name."""
        profiles = list(self._profiles())
        mine = next((one.widgets[name] for one in profiles if name in one.widgets), None)
        if mine is not None:
            shelf = Shelf(mine.folder.parent)
            is_read = self._is_fresh and shelf.has(name)
            return _on(shelf, name) if is_read else Found(mine.folder, mine)
        shelves = self._shelves(profiles)
        return next((_on(shelf, name) for shelf in shelves if shelf.has(name)), None)

    def folder(self, name: str) -> Path | None:
        """Return the folder of a widget, whose manifest is not read; None when there is none."""
        profiles = list(self._profiles())
        mine = [one.widgets[name].folder for one in profiles if name in one.widgets]
        shelves = self._shelves(profiles)
        on_shelf = (shelf.place(name) for shelf in shelves if shelf.has(name))
        return next(iter(mine), None) or next(on_shelf, None)

    def _shelves(self, profiles: Iterable[Profile]) -> list[Shelf]:
        """Return where widgets are looked up: what ships with URC is replaced by nothing there."""
        files = dict.fromkeys(one.file for one in profiles)
        return [Shelf(shipped("widgets")), *(shelf_of(file) for file in files)]


def _on(shelf: Shelf, name: str) -> Found:
    widget = shelf.get(name)
    return Found(shelf.place(name), widget, tuple(shelf.problems))
