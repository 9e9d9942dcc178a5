"""Which widgets a document may use: those of URC, and those that were installed with it."""

from os import PathLike
from pathlib import Path

from urc.config.load import Shelf
from urc.model.widget import Widget
from urc.packages.store import ecosystem_of
from urc.shipped import shipped

__all__ = ["TwoShelves", "shelf_of"]


def shelf_of(document: str | PathLike[str]) -> Shelf:
    """Return the widgets for a document; an installed package sees its own ecosystem, no other."""
    home = ecosystem_of(Path(document))
    ours = shipped("widgets")
    return Shelf(ours) if home is None else TwoShelves(ours, home / "widgets")


class TwoShelves(Shelf):
    """What ships with URC, and beside it what was installed: that never replaces the other."""

    def __init__(self, folder: Path, brought: Path) -> None:
        super().__init__(folder)
        self._brought = Shelf(brought)
        self._brought.problems = self.problems

    @property
    def files(self) -> tuple[str, ...]:
        """Every manifest that was asked for."""
        return (*super().files, *self._brought.files)

    def names(self) -> list[str]:
        """Return the names of all widgets there are."""
        return sorted({*super().names(), *self._brought.names()})

    def get(self, name: str) -> Widget | None:
        """Return a widget, or None."""
        return super().get(name) if super().has(name) else self._brought.get(name)

    def has(self, name: str) -> bool:
        """Return whether there is a widget of that name."""
        return super().has(name) or self._brought.has(name)
