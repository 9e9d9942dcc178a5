"""Tables that map words in documents to implementations.

Each row contains the import path of a factory. Factories are imported on first use: a robot with
only a TCP transport never loads the SSH code. The top layer passes all tables as one `Registries`
to lower layers. Because the tables are passed down, modules in one layer need not import each
other. Third-party packages add rows through the entry-point groups ``urc.transports`` and
``urc.framings``.
"""

from collections.abc import Iterator, Mapping
from importlib import import_module
from operator import attrgetter
from typing import Any, NamedTuple

__all__ = ["Registries", "RegistryEntry", "Table"]


class RegistryEntry:
    """A row of a table: a word in documents, and the import path of the factory."""

    __slots__ = ("factory", "name")

    def __init__(self, name: str, factory: str) -> None:
        self.name = name
        self.factory = factory
        """Import path ``module:attribute.path`` of the factory, imported by `load`."""

    def load(self) -> Any:
        """Import the factory's module, and return the factory."""
        module, _, path = self.factory.partition(":")
        return attrgetter(path)(import_module(module))


class Table:
    """A table of built-in rows and of rows from installed packages (entry points)."""

    def __init__(self, group: str, rows: Mapping[str, str]) -> None:
        self.group = group
        self._rows = {name: RegistryEntry(name, factory) for name, factory in rows.items()}
        self._is_complete = False

    def __iter__(self) -> Iterator[str]:
        self._read_entry_points()
        return iter(self._rows)

    def get(self, name: str) -> RegistryEntry | None:
        """Return the row with this name; None for an unknown name.

        Entry points are not read if the name is a built-in row.
        """
        if name not in self._rows:
            self._read_entry_points()
        return self._rows.get(name)

    def __getitem__(self, name: str) -> RegistryEntry:
        row = self.get(name)
        if row is None:
            raise KeyError(f"{self.group} has no {name!r}; it has {', '.join(sorted(self._rows))}")
        return row

    def _read_entry_points(self) -> None:
        if self._is_complete:
            return
        self._is_complete = True
        from importlib.metadata import entry_points  # 20 ms, so only for unknown names

        for point in entry_points(group=self.group):
            self._rows.setdefault(point.name, RegistryEntry(point.name, point.value))


class Registries(NamedTuple):
    """The tables of transports and framings of one URC process."""

    transports: Table
    framings: Table
