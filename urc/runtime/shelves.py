"""Which widgets a document may use: those of URC, and those that came with it."""

from os import PathLike
from pathlib import Path

from urc.config.load import Shelf
from urc.model.widget import Widget
from urc.packages.manifest import MANIFEST
from urc.packages.names import FOLDERS
from urc.packages.store import ecosystem_of
from urc.problems import Problem
from urc.shipped import shipped

__all__ = ["TwoShelves", "hidden_beside", "hidden_widget", "shelf_of"]


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


def hidden_beside(document: str | PathLike[str]) -> list[Path]:
    """Return the folders of widgets that came with a document and are never used."""
    shelf = shelf_of(document)
    return shelf.hidden() if isinstance(shelf, TwoShelves) else []


def hidden_widget(manifest: str, name: str) -> Problem:
    """Return the warning about a widget that has a name of ours."""
    return Problem(
        "shipped-name",
        f"this widget is never used: one called {name!r} ships with URC, and goes before it",
        manifest,
        hint="give it, and its folder, another name",
        severity="warning",
    )


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
        self._hidden: set[str] = set()
        """Names of ours that were asked for, and are brought as well."""

    @property
    def files(self) -> tuple[str, ...]:
        """Every manifest that was asked for."""
        return (*super().files, *self._brought.files)

    def names(self) -> list[str]:
        """Return the names of all widgets there are."""
        return sorted({*super().names(), *self._brought.names()})

    def get(self, name: str) -> Widget | None:
        """Return a widget, or None."""
        if not super().has(name):
            return self._brought.get(name)
        if name not in self._hidden and self._hides(name):
            self._hidden.add(name)
            manifest = str(self._brought.place(name) / "widget.yaml")
            self.problems.append(hidden_widget(manifest, name))
        return super().get(name)

    def hidden(self) -> list[Path]:
        """Return the folders that were brought and are never used: ours go before them."""
        return [self._brought.place(name) for name in self._brought.names() if self._hides(name)]

    def _hides(self, name: str) -> bool:
        """Return whether one of ours goes before another one of that name."""
        if not (super().has(name) and self._brought.has(name)):
            return False
        return super().place(name).resolve() != self._brought.place(name).resolve()

    def has(self, name: str) -> bool:
        """Return whether there is a widget of that name."""
        return super().has(name) or self._brought.has(name)

    def place(self, name: str) -> Path:
        """Return the folder of the widget of that name."""
        return super().place(name) if super().has(name) else self._brought.place(name)
