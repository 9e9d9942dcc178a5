"""Merges two data trees with source positions; the upper tree overrides the lower tree.

Mappings are merged by key, and lists of named items are merged by name. For all other values, the
upper tree's value replaces the lower tree's value. A simulator's rules are merged by name, and
unnamed rules are kept. The value ``null`` removes a key, and ``remove: true`` removes a list item.
Every mark in the result refers to its document, so every problem is reported at its original
position.
"""

from collections.abc import Callable
from typing import Final, NamedTuple

from urc.config.form_table import READ_FORMS, WRITE_FORMS
from urc.source import Document, Mark, Path

__all__ = ["Tree", "children", "count_nodes", "item_name", "mark_inside", "merge"]

_NAMES: Final = ("name", "id")
_EXCLUSIVE: Final = (frozenset(("grid", "layouts", "tabs")),)
"""Groups of mutually exclusive keys, in addition to the frame forms."""
_OF_USED_DRIVER: Final = frozenset(("use", "params", "overrides"))
"""Keys under ``driver`` when a robot refers to a driver's document."""


class Tree(NamedTuple):
    """A part of a document: its data, and the marks with its position."""

    value: object
    mark: Mark
    home: Document
    """Document that contains the data; marks inside the data may refer to another document."""


_Clash = Callable[[Path, Tree, Tree], None]
"""Function that is called with the path of each replaced value, the value and its replacement."""


def _pinned(tree: Tree) -> Mark:
    if tree.mark.origin is not None:
        return tree.mark
    mark = tree.mark.copy()
    mark.origin = tree.home
    return mark


def mark_inside(inner: Tree, around: Tree) -> Mark:
    """Return the mark of `inner`; add its document if `around` is in another document."""
    return _pinned(inner) if inner.home is not around.home else inner.mark


def children(tree: Tree) -> dict[str | int, Tree]:
    """Return the children of a mapping or list, by key or index."""
    home = tree.mark.origin or tree.home
    if isinstance(tree.value, dict):
        inside = tree.value.items()
    elif isinstance(tree.value, list):
        inside = dict(enumerate(tree.value)).items()
    else:
        return {}
    return {
        key: Tree(item, tree.mark.children[key], tree.mark.children[key].origin or home)
        for key, item in inside
    }


def item_name(value: object) -> str | None:
    """Return the name of a list item; None for an item without a name."""
    if isinstance(value, dict):
        for key in _NAMES:
            name = value.get(key)
            if isinstance(name, str):
                return name
    return None


def count_nodes(value: object) -> int:
    """Return the number of keys, scalars, mappings and lists in a value."""
    if isinstance(value, dict):
        return 1 + len(value) + sum(map(count_nodes, value.values()))
    if isinstance(value, list):
        return 1 + sum(map(count_nodes, value))
    return 1


def merge(base: Tree, over: Tree, path: Path = (), clash: _Clash | None = None) -> Tree:
    """Return `base` with the values of `over` merged into it.

    Neither tree is modified. `path` is the position of both trees in their documents. The callback
    `clash` receives each replaced value and its replacement.
    """
    if path == ("driver",) and isinstance(over.value, dict):
        base = _driver_in_full(base, over.value)
    if isinstance(base.value, dict) and isinstance(over.value, dict):
        if path[-1:] == ("framing",) and _has_other_type(base.value, over.value):
            return over  # other framing types have other keys
        return _mappings(base, over, path, clash)
    if isinstance(base.value, list) and isinstance(over.value, list):
        old, new = _by_name(base), _by_name(over)
        is_rules = path[:1] == ("simulator",)
        if old is not None and new is not None and not is_rules:
            return _lists(old, new, over, path, clash)
        if new and is_rules:
            return _rules(base, new, over, path, clash)
    if clash is not None and base.value != over.value:
        clash(path, base, over)
    return over


def _driver_in_full(base: Tree, over: dict[str, object]) -> Tree:
    """Convert a driver's name to a mapping if `over` adds `params` or `overrides`."""
    if not isinstance(base.value, str) or not over.keys() <= _OF_USED_DRIVER:
        return base
    mark = base.mark.copy({"use": _pinned(base)})
    return Tree({"use": base.value}, mark, base.home)


def _mappings(base: Tree, over: Tree, path: Path, clash: _Clash | None) -> Tree:
    result = children(base)
    above = children(over)
    for group in _exclusive(path):
        if group & above.keys():
            for other in group - above.keys():
                result.pop(other, None)
    for key, inner in above.items():
        if key not in result:
            result[key] = inner
        elif inner.value is None:
            del result[key]
        else:
            result[key] = merge(result[key], inner, (*path, key), clash)
    return _built({key: tree.value for key, tree in result.items()}, result, over)


def _exclusive(path: Path) -> tuple[frozenset[str], ...]:
    """Return the groups of mutually exclusive keys in the mapping at `path`."""
    if path[-1:] == ("send",):
        return (frozenset(WRITE_FORMS),)
    if path[-1:] == ("reply",) or path[-2:-1] == ("messages",):
        return (frozenset(READ_FORMS),)
    return _EXCLUSIVE


def _has_other_type(base: dict[str, object], over: dict[str, object]) -> bool:
    return "type" in base and "type" in over and base["type"] != over["type"]


def _by_name(tree: Tree) -> dict[str, Tree] | None:
    """Return the items of a list by name, or None if a name is missing or not unique."""
    found: dict[str, Tree] = {}
    for inner in children(tree).values():
        name = item_name(inner.value)
        if name is None or name in found:
            return None
        found[name] = inner
    return found


def _lists(
    old: dict[str, Tree], new: dict[str, Tree], over: Tree, path: Path, clash: _Clash | None
) -> Tree:
    result = dict(old)
    for name, inner in new.items():
        if name in old and isinstance(inner.value, dict) and inner.value.get("remove") is True:
            del result[name]
        elif name in old:
            result[name] = merge(old[name], inner, (*path, name), clash)
        else:
            result[name] = inner
    items = list(result.values())
    return _built([tree.value for tree in items], dict(enumerate(items)), over)


def _rules(base: Tree, new: dict[str, Tree], over: Tree, path: Path, clash: _Clash | None) -> Tree:
    """Merge rules by name; rules that exist only in `new` come first in the result."""
    left, items = dict(new), []
    for inner in children(base).values():
        name = item_name(inner.value)
        changed = None if name is None else left.pop(name, None)
        if changed is None:
            items.append(inner)
        elif not (isinstance(changed.value, dict) and changed.value.get("remove") is True):
            items.append(merge(inner, changed, (*path, str(name)), clash))
    items = [*left.values(), *items]
    return _built([tree.value for tree in items], dict(enumerate(items)), over)


def _built(value: object, inside: dict[str | int, Tree] | dict[int, Tree], over: Tree) -> Tree:
    mark = over.mark.copy({key: _pinned(tree) for key, tree in inside.items()})
    mark.origin = over.mark.origin or over.home
    return Tree(value, mark, mark.origin)
