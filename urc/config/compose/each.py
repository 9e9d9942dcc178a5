"""`each`: one declaration for many like things, written out before the shape pass.

    signals:
      "joint_{i}": { each: { i: [1, 2, 3] }, unit: rad }

Items declared by name change the copies: ``joint_2: { unit: deg }`` changes one copy, and
``joint_2: null`` removes it.
"""

from collections.abc import Iterator
from typing import Any, Final

from urc.config.compose.copies import Expander, is_removal, item_at
from urc.config.compose.fill import Budget, TooMuch
from urc.config.compose.merge import Tree, children, count_nodes, item_name, mark_inside
from urc.config.part import Findings, Part
from urc.source import Document, Mark, Path

__all__ = ["expand"]

_NODES_MOST: Final = 10_000
_NAMED: Final = ("signals", "messages", "commands", "sequences", "widgets")
_LISTED: Final = ("polls", "tests")
_BY_NAME: Final = ("simulator", "rules")


def expand(document: Document, findings: Findings) -> Document:
    """Return the document with every `each` written out."""
    everywhere = list(_places(document.data))
    _check_names(document, everywhere, findings)
    places = [path for path in everywhere if _has_each(_at(document.data, path))]
    if places:
        expander = Expander(document, findings, Budget(_NODES_MOST - count_nodes(document.data)))
        tree = Tree(document.data, document.mark, document)
        try:
            for path in places:
                tree = _replaced(tree, path, expander.collection)
        except TooMuch:
            findings.error(
                Part(document, expander.path, None),
                "too-many-nodes",
                f"more than {_NODES_MOST} keys and values once every 'each' is written out",
                at="each",
            )
        else:
            document = _document(document, tree)
    return _without_removals(document, everywhere, findings)


def _without_removals(document: Document, places: list[Path], findings: Findings) -> Document:
    """Report removals of missing items, and drop them; the merge has applied the others."""
    tree = Tree(document.data, document.mark, document)
    for path in places:
        items = _at(document.data, path)
        idle = (
            [place for place, item in enumerate(items) if is_removal(item)]
            if isinstance(items, list)
            else []
        )
        for place in idle:
            findings.error(
                Part(document, (*path, place), None),
                "nothing-to-remove",
                f"there is no {item_name(item_at(document.data, (*path, place)))!r} to take away",
                at="remove",
                key=True,
                hint="only what this document extends or includes can be taken away",
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
        document.file, document.text, document.lines, tree.value, tree.mark, document.findings
    )


def _check_names(document: Document, places: list[Path], findings: Findings) -> None:
    """Report names with braces that nothing fills in; the schemas let braces pass."""
    for path in places:
        named = _at(document.data, path)
        for name, item in named.items() if isinstance(named, dict) else ():
            if "{" in name and not (isinstance(item, dict) and "each" in item):
                findings.error(
                    Part(document, (*path, name), item),
                    "bad-name",
                    f"{name!r} cannot be a name here",
                    key=True,
                    hint="a name in braces is a variable of 'each', and there is none here",
                )


def _places(data: object) -> Iterator[Path]:
    """Yield the places of the mappings and lists whose items may have an `each`."""
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
    """Return `tree` with its part at `path` changed; the rest is shared."""
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
