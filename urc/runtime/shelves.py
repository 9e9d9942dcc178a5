"""Which widgets a document may use: those of URC, and those that came with it."""

from os import PathLike
from pathlib import Path

from urc.config.load import Shelf
from urc.model.widget import Widget
from urc.packages.manifest import MANIFEST
from urc.packages.names import FOLDERS
from urc.packages.store import ecosystem_of
from urc.shipped import shipped

__all__ = ["TwoShelves", "shelf_of"]


def shelf_of(document: str | PathLike[str]) -> Shelf:
    """Return the widgets for a document.

    An installed package sees its own ecosystem, no other; one that is still being written sees the
    packages that stand beside it; any other document sees the folder ``widgets`` beside it.
    """
    home = ecosystem_of(Path(document)) or _workshop_of(Path(document))
    ours = shipped("widgets")
    brought = (home or Path(document).parent) / "widgets"
    if home is None and (not brought.is_dir() or brought.resolve() == ours.resolve()):
        return Shelf(ours)
    return TwoShelves(ours, brought)


def _workshop_of(document: Path) -> Path | None:
    """Return the folder of packages that a package's own document stands in, or None."""
    home = document.resolve().parent
    is_package = home.parent.name in FOLDERS and (home / MANIFEST).is_file()
    return home.parent.parent if is_package else None


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

    def place(self, name: str) -> Path:
        """Return the folder of the widget of that name."""
        return super().place(name) if super().has(name) else self._brought.place(name)
