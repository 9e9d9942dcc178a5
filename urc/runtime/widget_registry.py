"""The widgets available to a document: built-in widgets, and widgets from its package."""

from os import PathLike
from pathlib import Path

from urc.config.load import WidgetFolder
from urc.model.widget import Widget
from urc.packages.manifest import MANIFEST
from urc.packages.names import FOLDERS
from urc.packages.store import ecosystem_of
from urc.problems import Problem
from urc.shipped import shipped

__all__ = ["WidgetRegistry", "hidden_beside", "hidden_widget", "widget_folder_of"]


def widget_folder_of(document: str | PathLike[str]) -> WidgetFolder:
    """Return the widgets for a document.

    An installed package uses the installed widgets. A package in development uses the widget
    packages in neighbouring folders. Any other document uses the folder ``widgets`` next to the
    document.
    """
    home = ecosystem_of(Path(document)) or _packages_folder_of(Path(document))
    ours = shipped("widgets")
    brought = (home or Path(document).parent) / "widgets"
    if home is None and (not brought.is_dir() or brought.resolve() == ours.resolve()):
        return WidgetFolder(ours)
    return WidgetRegistry(ours, brought)


def hidden_beside(document: str | PathLike[str]) -> list[Path]:
    """Return the widget folders of a document that built-in widgets of the same name hide."""
    registry = widget_folder_of(document)
    return registry.hidden() if isinstance(registry, WidgetRegistry) else []


def hidden_widget(manifest: str, name: str) -> Problem:
    """Return the warning about a widget that has the same name as a built-in widget."""
    return Problem(
        "shipped-name",
        f"this widget is never used: the built-in widget {name!r} takes precedence",
        manifest,
        hint="rename the widget and its folder",
        severity="warning",
    )


def _packages_folder_of(document: Path) -> Path | None:
    """Return the top folder of packages that contains a document, or None."""
    home = document.resolve().parent
    is_package = home.parent.name in FOLDERS and (home / MANIFEST).is_file()
    return home.parent.parent if is_package else None


class WidgetRegistry(WidgetFolder):
    """Built-in and installed widgets; built-in widgets take precedence."""

    def __init__(self, folder: Path, brought: Path) -> None:
        super().__init__(folder)
        self._brought = WidgetFolder(brought)
        self._brought.problems = self.problems
        self._hidden: set[str] = set()
        """Requested names of built-in widgets that hide an installed widget of the same name."""

    @property
    def files(self) -> tuple[str, ...]:
        """Every requested manifest."""
        return (*super().files, *self._brought.files)

    def names(self) -> list[str]:
        """Return the names of all widgets."""
        return sorted({*super().names(), *self._brought.names()})

    def get(self, name: str) -> Widget | None:
        """Return a widget by name, or None."""
        if not super().has(name):
            return self._brought.get(name)
        if name not in self._hidden and self._hides(name):
            self._hidden.add(name)
            manifest = str(self._brought.place(name) / "widget.yaml")
            self.problems.append(hidden_widget(manifest, name))
        return super().get(name)

    def hidden(self) -> list[Path]:
        """Return the folders of installed widgets hidden by built-in widgets."""
        return [self._brought.place(name) for name in self._brought.names() if self._hides(name)]

    def _hides(self, name: str) -> bool:
        """Return whether a built-in widget hides an installed widget with this name."""
        if not (super().has(name) and self._brought.has(name)):
            return False
        return super().place(name).resolve() != self._brought.place(name).resolve()

    def has(self, name: str) -> bool:
        """Return whether a widget with this name exists."""
        return super().has(name) or self._brought.has(name)

    def place(self, name: str) -> Path:
        """Return the folder of the widget with this name."""
        return super().place(name) if super().has(name) else self._brought.place(name)
