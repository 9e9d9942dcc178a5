"""Support for several versions of one widget: each robot keeps its installed version.

Layer 5. Pages identify widgets only by name. If two different widgets have the same name, the
second widget is renamed.
"""

import filecmp
import hashlib
from collections.abc import Iterable, Mapping
from pathlib import Path

from urc.model.interface import Interface, WidgetUse
from urc.model.profile import Profile
from urc.model.widget import Widget

__all__ = ["apart", "is_same", "unified"]


def apart(profile: Profile, others: Iterable[Profile]) -> Profile:
    """Return the profile with new names for widgets that conflict with other profiles' widgets."""
    taken: dict[str, Path] = {}
    for other in others:
        for widget in other.widgets.values():
            taken.setdefault(widget.name, widget.folder)
    names = {
        name: f"{name}.{_digest(widget.folder)}"
        for name, widget in profile.widgets.items()
        if widget.name in taken and not is_same(taken[widget.name], widget.folder)
    }
    return _renamed(profile, names) if names else profile


def unified(widgets: Iterable[Widget]) -> list[Widget]:
    """Return the widgets, with identical copies in several folders merged into one widget."""
    found: dict[str, Widget] = {}
    every = []
    for widget in widgets:
        first = found.setdefault(widget.name, widget)
        every.append(first if is_same(first.folder, widget.folder) else widget)
    return every


def is_same(one: Path, other: Path) -> bool:
    """Return whether two folders contain the same files."""
    if one == other:
        return True
    mine, theirs = _files(one), _files(other)
    return mine.keys() == theirs.keys() and all(
        filecmp.cmp(mine[name], theirs[name], shallow=False) for name in mine
    )


def _renamed(profile: Profile, names: Mapping[str, str]) -> Profile:
    widgets = {
        names.get(name, name): widget._replace(name=names.get(name, widget.name))
        for name, widget in profile.widgets.items()
    }
    interfaces = {
        name: _interface(interface, names) for name, interface in profile.interfaces.items()
    }
    return profile._replace(
        slots=_uses(profile.slots, names), interfaces=interfaces, widgets=widgets
    )


def _interface(interface: Interface, names: Mapping[str, str]) -> Interface:
    return interface._replace(widgets=_uses(interface.widgets, names))


def _uses(uses: Mapping[str, WidgetUse], names: Mapping[str, str]) -> dict[str, WidgetUse]:
    return {
        slot: use._replace(widget=names.get(use.widget, use.widget)) for slot, use in uses.items()
    }


def _digest(folder: Path) -> str:
    """Return a short hash of all files in a folder."""
    digest = hashlib.blake2b(digest_size=5)
    for name, file in sorted(_files(folder).items()):
        data = file.read_bytes()
        digest.update(f"{name}\0{len(data)}\0".encode() + data)
    return digest.hexdigest()


def _files(folder: Path) -> dict[str, Path]:
    return {str(file.relative_to(folder)): file for file in folder.rglob("*") if file.is_file()}
