"""Replaces names in single braces, such as ``{i}`` from an `each`, or ``{params.id}``.

URC replaces these names in all keys and strings while it loads a document. Templates have double
braces and stay unchanged. If a string consists of a single name, the name's value replaces the
whole string, so ``"{i}"`` may become a number.
"""

import re
from collections.abc import Mapping
from typing import Final, Protocol

from urc.config.compose.merge import Tree, mark_inside, merge
from urc.config.node import Node, Problems
from urc.source import Mark, Path, UnfilledText

__all__ = [
    "ExpansionBudget",
    "PlaceholderReporter",
    "Names",
    "ExpansionTooLarge",
    "fill",
    "fill_key",
    "report_unquoted",
]

Names = Mapping[str, object]
"""Values by name; each value is a scalar or a mapping of scalars."""


class PlaceholderReporter(Protocol):
    """Reports names in single braces that have no value."""

    def unknown(self, path: Path, name: str, word: str, offset: int) -> None:
        """Report an unknown word that follows a known `name` and a dot."""

    def unquoted(self, path: Path, text: str) -> None:
        """Report an unquoted name such as ``max: {i}``, which YAML reads as a mapping."""


_NAME: Final = re.compile(
    # Double braces belong to a template, but {{n}:number} is a field with a placeholder for its
    # name.
    r"(?:(?<!\{)|(?<=\{)(?=\{[a-z0-9_.]+\}:[a-z]))"
    r"\{([a-z][a-z0-9_]*)(?:\.([a-z0-9_]+))?\}(?!\})"
)
_CHARACTERS_MOST: Final = 4 << 20


class ExpansionTooLarge(Exception):
    """The expansion of a document exceeds the limit on its nodes or characters."""


class ExpansionBudget:
    """The number of nodes and characters that an expansion may still add."""

    def __init__(self, nodes: int) -> None:
        self._nodes = nodes
        self._characters = _CHARACTERS_MOST

    def spend(self, nodes: int, characters: int = 0) -> None:
        """Subtract new nodes and characters; raise `ExpansionTooLarge` if too few are left."""
        self._nodes -= nodes
        self._characters -= characters
        if self._nodes < 0 or self._characters < 0:
            raise ExpansionTooLarge


class _TemplateFiller:
    def __init__(
        self, names: Names, budget: ExpansionBudget, listener: PlaceholderReporter | None
    ) -> None:
        self.names = names
        self.budget = budget
        self.listener = listener

    def tree(self, tree: Tree, path: Path) -> Tree:
        value = tree.value
        if isinstance(value, str):
            filled, written = self.text(value, path)
            if written is None:
                return tree
            mark = tree.mark.copy()
            mark.written = written
            return Tree(filled, mark, tree.home)
        if isinstance(value, dict):
            return self._mapping(value, tree, path)
        if isinstance(value, list):
            return self._list(value, tree, path)
        return tree

    def _mapping(self, value: dict[str, object], tree: Tree, path: Path) -> Tree:
        if len(value) == 1 and self.listener is not None:
            ((word, nothing),) = value.items()
            text = f"{{{word}}}"
            filled, written = self.text(text, path) if nothing is None else (None, None)
            if written is not None:
                self.listener.unquoted(path, text)
                return Tree(filled, tree.mark, tree.home)
        made: dict[str, Tree] = {}
        is_same = True
        for key, item in value.items():
            name = str(self.text(key, (*path, key))[0])
            inner = self.tree(_item(tree, key, item), (*path, key))
            is_same = is_same and name == key and inner.value is item
            if name not in made:
                made[name] = inner
            elif name not in value:
                made[key] = inner  # Two keys have the same new name, so this key stays unchanged.
            else:
                # A literal key takes precedence over a key with replaced names.
                below, above = (made[name], inner) if name == key else (inner, made[name])
                if above.value is None:
                    del made[name]
                else:
                    made[name] = merge(below, above, (*path, name))
        if is_same:
            return tree
        marks: dict[str | int, Mark] = {
            name: mark_inside(inner, tree) for name, inner in made.items()
        }
        data = {name: inner.value for name, inner in made.items()}
        return Tree(data, tree.mark.copy(marks), tree.home)

    def _list(self, value: list[object], tree: Tree, path: Path) -> Tree:
        items = [
            self.tree(_item(tree, place, item), (*path, place)) for place, item in enumerate(value)
        ]
        if all(inner.value is item for inner, item in zip(items, value, strict=True)):
            return tree
        marks: dict[str | int, Mark] = {
            place: mark_inside(item, tree) for place, item in enumerate(items)
        }
        return Tree([item.value for item in items], tree.mark.copy(marks), tree.home)

    def text(self, text: str, path: Path) -> tuple[object, UnfilledText | None]:
        """Return the text with its names replaced, and the original text if it contained a name."""
        if "{" not in text:
            return text, None
        edits: list[tuple[int, int, int]] = []
        pieces: list[str] = []
        end = 0
        for found in _NAME.finditer(text):
            is_known, value = self._value(found, path)
            if not is_known:
                continue
            if found.span() == (0, len(text)):
                return value, UnfilledText(text, ((0, len(text), len(_written(value))),))
            piece = _written(value)
            self.budget.spend(0, len(piece))
            edits.append((found.start(), len(found[0]), len(piece)))
            pieces += (text[end : found.start()], piece)
            end = found.end()
        if not edits:
            return text, None
        self.budget.spend(0, len(text))
        return "".join((*pieces, text[end:])), UnfilledText(text, tuple(edits))

    def _value(self, found: re.Match[str], path: Path) -> tuple[bool, object]:
        name, word = found[1], found[2]
        if name not in self.names:
            return False, None
        value = self.names[name]
        if isinstance(value, Mapping):
            if word in value:
                return True, value[word]
        elif word is None:
            return True, value
        if self.listener is not None:
            self.listener.unknown(path, name, word or "", found.start() + 1)
        return False, None


def _item(tree: Tree, key: str | int, item: object) -> Tree:
    mark = tree.mark.children[key]
    return Tree(item, mark, mark.origin or tree.home)


def fill(
    tree: Tree, path: Path, names: Names, budget: ExpansionBudget, listener: PlaceholderReporter
) -> Tree:
    """Return `tree` with every name replaced; parts without names are not copied."""
    return _TemplateFiller(names, budget, listener).tree(tree, path)


def fill_key(key: str, names: Names, budget: ExpansionBudget) -> str:
    """Return a key with every name replaced."""
    return str(_TemplateFiller(names, budget, None).text(key, ())[0])


def report_unquoted(part: Node, text: str, problems: Problems) -> None:
    """Report a name in braces that YAML reads as a mapping."""
    problems.error(
        part,
        "unquoted-name",
        "YAML reads a value that starts with '{' as a mapping",
        hint=f'quote it: "{text}"',
    )


def _written(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return "" if value is None else str(value)
