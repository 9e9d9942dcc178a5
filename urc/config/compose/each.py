"""Expands `each`, the key that turns one declaration into many similar items.

    signals:
      "joint_{i}": { each: { i: [1, 2, 3] }, unit: rad }

An item with the same name as a copy changes that copy. For example, ``joint_2: { unit: deg }`` sets
the copy's unit, and ``joint_2: null`` removes the copy.
"""

import re
from collections.abc import Iterator, Mapping
from itertools import product
from math import prod
from typing import Any, Final, NamedTuple

from urc.config.compose.fill import (
    ExpansionBudget,
    ExpansionTooLarge,
    Names,
    fill,
    fill_key,
    report_unquoted,
)
from urc.config.compose.merge import Tree, children, count_nodes, item_name, mark_inside, merge
from urc.config.node import Node, Problems
from urc.config.schemas import fits
from urc.config.spelling_suggestions import did_you_mean
from urc.source import Document, Mark, Path

__all__ = ["expand"]


_RESERVED: Final = ("params", "settings")


class _Copy(NamedTuple):
    name: str | None
    tree: Tree


class Expander:
    """Expands all `each` keys in one document."""

    def __init__(self, document: Document, problems: Problems, budget: ExpansionBudget) -> None:
        self.document = document
        self.problems = problems
        self.budget = budget
        self.path: Path = ()
        """Path of the item that is being expanded."""

    def collection(self, tree: Tree, path: Path) -> Tree:
        """Return a mapping or list with every `each` in its items expanded."""
        if isinstance(tree.value, dict):
            return self._mapping(tree, path)
        return self._list(tree, path)

    def _mapping(self, tree: Tree, path: Path) -> Tree:
        made: dict[str, Tree] = {}
        given: dict[str, Tree] = {}
        order: dict[str, None] = {}
        for key, inner in children(tree).items():
            name = str(key)
            names = self._variables(inner, (*path, name), name)
            if names is None:
                given[name] = inner
                order[name] = None
                continue
            for copy in self._copies(inner, (*path, name), name, names):
                self._expand_copy(made, copy, (*path, name))
                order[str(copy.name)] = None
        result: dict[str | int, Tree] = {}
        for name in order:
            if name not in made:
                result[name] = given[name]
            elif name not in given:
                result[name] = made[name]
            elif given[name].value is not None:
                result[name] = merge(made[name], given[name], (*path, name))
        marks = {key: mark_inside(inner, tree) for key, inner in result.items()}
        value = {key: inner.value for key, inner in result.items()}
        return Tree(value, tree.mark.copy(marks), tree.home)

    def _list(self, tree: Tree, path: Path) -> Tree:
        items: list[_Copy] = []
        made: dict[str, Tree] = {}
        for place, inner in children(tree).items():
            names = self._variables(inner, (*path, place), item_name(inner.value))
            if names is None:
                items.append(_Copy(None, inner))
                continue
            for copy in self._copies(inner, (*path, place), item_name(inner.value), names):
                if copy.name is not None:
                    self._expand_copy(made, copy, (*path, place))
                items.append(copy)
        given = [copy for copy in items if copy.name is None and item_name(copy.tree.value) in made]
        for _, inner in given:
            name = str(item_name(inner.value))
            changed = None if is_removal(inner.value) else merge(made[name], inner, (*path, name))
            items = _changed(items, name, inner, changed)
        marks: dict[str | int, Mark] = {
            place: mark_inside(copy.tree, tree) for place, copy in enumerate(items)
        }
        return Tree([copy.tree.value for copy in items], tree.mark.copy(marks), tree.home)

    def _expand_copy(self, made: dict[str, Tree], copy: _Copy, path: Path) -> None:
        name = str(copy.name)
        if name in made:
            self.problems.error(
                Node(self.document, path, None),
                "duplicate-key",
                f"'each' creates {name!r} twice",
                at="each",
                key=True,
                hint="use every variable in the name, and list each value only once",
            )
        made.setdefault(name, copy.tree)

    def _copies(
        self, inner: Tree, path: Path, name: str | None, variables: Mapping[str, list[object]]
    ) -> Iterator[_Copy]:
        """Yield one copy of the item for every combination of values."""
        self.path = path
        template = _without(inner, "each")
        each = inner.value["each"]  # type: ignore[index]  # a mapping with variables
        nodes = count_nodes(template.value) + 1
        self.budget.spend((prod(map(len, variables.values())) - 1) * nodes - count_nodes(each))
        for values in product(*variables.values()):
            names: Names = dict(zip(variables, values, strict=True))
            listener = _First(self, path) if values == _first(variables) else _Rest()
            copy = fill(template, path, names, self.budget, listener)
            yield _Copy(None if name is None else fill_key(name, names, self.budget), copy)

    def _variables(
        self, inner: Tree, path: Path, name: str | None
    ) -> Mapping[str, list[object]] | None:
        """Return the variables of an item; None for an item without a valid `each`.

        An invalid `each` stays in the document, and the shape pass reports the error.
        """
        if not isinstance(inner.value, dict) or "each" not in inner.value:
            return None
        each: dict[str, list[object]] = inner.value["each"]
        if not fits("driver.schema.json#/$defs/each", each):
            return None
        part = Node(self.document, (*path, "each"), each)
        unlike = [variable for variable, values in each.items() if not _are_alike(values)]
        if unlike:
            self.problems.error(
                part,
                "incompatible-values",
                f"the values of {unlike[0]!r} have different types or keys",
                at=unlike[0],
                hint="use only plain values, or only mappings with the same keys",
            )
            return None
        self._check_variables(part)
        unused = [one for one in each if name is not None and not _uses(name, one)]
        if unused:
            self.problems.error(
                part,
                "same-name",
                f"{name!r} is the same for every {unused[0]!r}",
                at=unused[0],
                key=True,
                hint=f"write '{{{unused[0]}}}' in the name, such as \"{name}_{{{unused[0]}}}\"",
            )
            return None
        return each

    def _check_variables(self, part: Node) -> None:
        for variable in part.data:
            if variable in _RESERVED:
                self.problems.error(
                    part,
                    "bad-name",
                    f"a variable of 'each' cannot have the name {variable!r}",
                    at=variable,
                    key=True,
                )


class _First:
    """Reports problems in the first copy of an item."""

    def __init__(self, expander: Expander, path: Path) -> None:
        self._expander = expander
        self._each = item_at(expander.document.data, path)["each"]

    def unknown(self, path: Path, name: str, word: str, offset: int) -> None:
        """Report a key that is missing from the variable's mappings."""
        first: Any = self._each[name][0]
        is_mapping = isinstance(first, dict)
        plain = f"its values are not mappings: write {{{name}}}"
        self._expander.problems.error(
            Node(self._expander.document, path, None),
            "unknown-variable",
            f"{name!r} has no {word!r}" if word else f"{name!r} is a mapping; name one of its keys",
            offset=offset,
            length=len(name) + len(word) + bool(word),
            hint=did_you_mean(word, first, "keys") if is_mapping else plain,
        )

    def unquoted(self, path: Path, text: str) -> None:
        """Report a name in braces that YAML reads as a mapping."""
        report_unquoted(Node(self._expander.document, path, None), text, self._expander.problems)


class _Rest:
    """Ignores the problems in all copies after the first, which would be repetitions."""

    def unknown(self, path: Path, name: str, word: str, offset: int) -> None:
        """Report nothing."""

    def unquoted(self, path: Path, text: str) -> None:
        """Report nothing."""


def _are_alike(values: list[object]) -> bool:
    """Return whether all values are scalars, or all values are mappings with the same keys."""
    if isinstance(values[0], dict):
        words = values[0].keys()
        return all(isinstance(one, dict) and one.keys() == words for one in values)
    return not any(isinstance(one, dict) for one in values)


def _uses(name: str, variable: str) -> bool:
    return re.search(rf"(?<!\{{)\{{{variable}(?:\.\w+)?\}}(?!\}})", name) is not None


def _first(variables: Mapping[str, list[object]]) -> tuple[object, ...]:
    return tuple(values[0] for values in variables.values())


def _without(tree: Tree, key: str) -> Tree:
    value = {name: item for name, item in tree.value.items() if name != key}  # type: ignore[attr-defined]
    marks = {name: mark for name, mark in tree.mark.children.items() if name != key}
    return Tree(value, tree.mark.copy(marks), tree.home)


def _changed(items: list[_Copy], name: str, given: Tree, changed: Tree | None) -> list[_Copy]:
    """Return the items with the generated item `name` changed or removed."""
    result = []
    for copy in items:
        if copy.name == name:
            if changed is not None:
                result.append(_Copy(name, changed))
        elif copy.tree is not given:
            result.append(copy)
    return result


def is_removal(item: object) -> bool:
    """Return whether an item serves only to remove another item."""
    return isinstance(item, dict) and item.get("remove") is True


def item_at(data: Any, path: Path) -> Any:
    """Return the part of `data` at `path`, which must exist."""
    for part in path:
        data = data[part]
    return data


_NODES_MOST: Final = 10_000
_NAMED: Final = ("signals", "messages", "commands", "sequences", "widgets")
_LISTED: Final = ("polls", "tests")
_BY_NAME: Final = ("simulator", "rules")


def expand(document: Document, problems: Problems) -> Document:
    """Return the document with every `each` expanded."""
    everywhere = list(_places(document.data))
    _check_names(document, everywhere, problems)
    places = [path for path in everywhere if _has_each(_at(document.data, path))]
    if places:
        expander = Expander(
            document, problems, ExpansionBudget(_NODES_MOST - count_nodes(document.data))
        )
        tree = Tree(document.data, document.mark, document)
        try:
            for path in places:
                tree = _replaced(tree, path, expander.collection)
        except ExpansionTooLarge:
            problems.error(
                Node(document, expander.path, None),
                "too-many-nodes",
                f"expanding every 'each' gives more than {_NODES_MOST} keys and values",
                at="each",
            )
        else:
            document = _document(document, tree)
    return _without_removals(document, everywhere, problems)


def _without_removals(document: Document, places: list[Path], problems: Problems) -> Document:
    """Report and drop each removal of a nonexistent item."""
    tree = Tree(document.data, document.mark, document)
    for path in places:
        items = _at(document.data, path)
        idle = (
            [place for place, item in enumerate(items) if is_removal(item)]
            if isinstance(items, list)
            else []
        )
        for place in idle:
            problems.error(
                Node(document, (*path, place), None),
                "nothing-to-remove",
                f"there is no {item_name(item_at(document.data, (*path, place)))!r} to remove",
                at="remove",
                key=True,
                hint="an item to remove must come from 'extends' or 'include'",
            )
        if idle:
            tree = _replaced(tree, path, _without_idle)
    return document if tree.value is document.data else _document(document, tree)


def _without_idle(tree: Tree, path: Path) -> Tree:
    kept = [inner for inner in children(tree).values() if not is_removal(inner.value)]
    marks: dict[str | int, Mark] = {
        place: mark_inside(inner, tree) for place, inner in enumerate(kept)
    }
    return Tree([inner.value for inner in kept], tree.mark.copy(marks), tree.home)


def _document(document: Document, tree: Tree) -> Document:
    return Document(
        document.file, document.text, document.lines, tree.value, tree.mark, document.problems
    )


def _check_names(document: Document, places: list[Path], problems: Problems) -> None:
    """Report each name that still contains braces; the schemas accept such names for `each`."""
    for path in places:
        named = _at(document.data, path)
        for name, item in named.items() if isinstance(named, dict) else ():
            if "{" in name and not (isinstance(item, dict) and "each" in item):
                problems.error(
                    Node(document, (*path, name), item),
                    "bad-name",
                    f"{name!r} is not a valid name",
                    key=True,
                    hint="a name in braces needs an 'each' with this variable",
                )


def _places(data: object) -> Iterator[Path]:
    """Yield the paths of all mappings and lists whose items may have an `each`."""
    if not isinstance(data, dict):
        return
    for root in ((), ("driver",)):
        inner = data if not root else data.get("driver")
        if isinstance(inner, dict):
            yield from ((*root, key) for key in (*_NAMED, *_LISTED) if key in inner)
    for key, below in (("simulator", ()), ("interfaces", ("widgets",))):
        named = data.get(key)
        if isinstance(named, dict):
            yield from ((key, name, *below) for name in named if (key, name) != _BY_NAME)
            rules = named.get("rules") if key == "simulator" else None
            if isinstance(rules, dict):
                yield from ((*_BY_NAME, name) for name in rules)


def _at(data: object, path: Path) -> object:
    for part in path:
        if not isinstance(data, dict):
            return None
        data = data.get(part)
    return data


def _has_each(collection: object) -> bool:
    if isinstance(collection, dict):
        items = list(collection.values())
    else:
        items = collection if isinstance(collection, list) else []
    return any(isinstance(item, dict) and "each" in item for item in items)


def _replaced(tree: Tree, path: Path, change: Any, done: Path = ()) -> Tree:
    """Return `tree` with the part at `path` changed; the other parts are shared, not copied."""
    if not path:
        result: Tree = change(tree, done)
        return result
    value: dict[str, object] = dict(tree.value)  # type: ignore[call-overload]
    marks = dict(tree.mark.children)
    key = str(path[0])
    before = marks[key]
    home = before.origin or tree.home
    inner = _replaced(Tree(value[key], before, home), path[1:], change, (*done, key))
    value[key], marks[key] = inner.value, inner.mark
    return Tree(value, tree.mark.copy(marks), tree.home)
