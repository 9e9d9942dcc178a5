"""Merges a document with the documents under `extends` and `include`.

    extends: base.yaml                  # the whole base, changed by this document
    extends: generic-ros1               # the same, with a document that ships with URC
    include: [parts/battery.yaml]       # parts of documents, below the keys of this document

A document's keys override those of its included documents. The keys of included documents override
those of the extended document.
"""

import os
from functools import reduce
from typing import Any, Final, NamedTuple

from urc.config.compose.library import Library
from urc.config.compose.merge import Tree, children, count_nodes, merge
from urc.config.node import Node
from urc.config.schemas import fits, kind_of
from urc.source import Document, Path

__all__ = ["Composed", "compose", "override"]

_DEEPEST: Final = 16
"""Maximum number of documents in a chain of `extends` and `include`."""
_NODES_MOST: Final = 10_000
_OWN: Final = ("urc", "kind", "name", "extends", "include", "partial")
_HEADER: Final = (*_OWN, "title", "summary", "licence", "author", "tags")
_BUILDING: Final = ("extends", "include")
_SCHEMA: Final = "driver.schema.json#/$defs/{}"
_INCLUDED: Final = {
    "robot": ("robot", "driver"),
    "driver": ("driver",),
    "interface": ("interface",),
}
"""Kinds of documents that a document may include, by the including document's kind."""


class Composed(NamedTuple):
    """A merged document and its sources."""

    document: Document | None
    """The merged document; None if a required document is missing or invalid."""
    sources: tuple[Document, ...]
    """The documents before the merge; empty if the document has neither `extends` nor `include`."""


def compose(document: Document, library: Library) -> Composed:
    """Merge a document with the documents that it extends and includes.

    The library reads the documents, and collects the problems with references and with values that
    contradict each other. The shape pass reports all other problems in the sources and the result.
    """
    composer = _Composer(library)
    whole = composer.compose(document, ())
    return Composed(whole, tuple(composer.sources.values()))


def override(document: Document, overrides: Node) -> Document:
    """Return a driver with the changes under a robot's `overrides`."""
    mark = overrides.document.at(overrides.path)
    if mark is None:
        return document  # every part has a mark
    over = Tree(overrides.data, mark, overrides.document.source_of(overrides.path))
    merged = merge(Tree(document.data, document.mark, document), over)
    mark = document.mark.copy(dict(merged.mark.children))
    return Document(
        document.file, document.text, document.lines, merged.value, mark, document.problems
    )


class _Composer:
    """Merges one document with its sources."""

    def __init__(self, library: Library) -> None:
        self.sources: dict[str, Document] = {}
        """Documents before the merge, by file."""
        self._library = library
        self._problems = library.problems
        self._whole: dict[str, Document | None] = {}

    def compose(self, document: Document, chain: tuple[str, ...]) -> Document | None:
        """Return the document merged with its sources, or the document itself if it has no sources.

        `chain` lists the files from the first document to `document`.
        """
        data = document.data
        if not isinstance(data, dict) or not kind_of(document):
            return document
        if not any(key in data for key in _BUILDING):
            return document
        real = os.path.realpath(document.file)
        if real not in self._whole:
            self._whole[real] = self._merged(document, data, (*chain, real))
        return self._whole[real]

    def _merged(
        self, document: Document, data: dict[str, Any], chain: tuple[str, ...]
    ) -> Document | None:
        self.sources.setdefault(document.file, document)
        if not all(fits(_SCHEMA.format(key), data[key]) for key in _BUILDING if key in data):
            return None  # the shape pass reports it
        root = Node(document, (), data)
        base, includes = self._sources(root, chain)
        is_sound = None not in (*base, *includes)
        layers = [one for one in base if one is not None]
        layers += self._merged_includes([one for one in includes if one is not None], data)
        layers.append(_without(Tree(data, document.mark, document), _BUILDING))
        whole = reduce(merge, layers)
        if not is_sound:
            return None
        if count_nodes(whole.value) > _NODES_MOST:
            self._problems.error(
                root, "too-many-nodes", f"merging gives more than {_NODES_MOST} keys and values"
            )
            return None
        mark = whole.mark.copy()
        mark.origin, mark.span = None, document.mark.span
        return Document(
            document.file, document.text, document.lines, whole.value, mark, document.problems
        )

    def _sources(
        self, root: Node, chain: tuple[str, ...]
    ) -> tuple[list[Tree | None], list[Tree | None]]:
        """Return the extended and included documents; an invalid document becomes None."""
        kind = kind_of(root.document)
        base = root.get("extends")
        return (
            [] if base is None else [self._source(base, (kind,), chain, _OWN)],
            [
                self._source(reference, _INCLUDED.get(kind, ()), chain, _HEADER)
                for reference in root.listed("include")
            ],
        )

    def _source(
        self, reference: Node, kinds: tuple[str, ...], chain: tuple[str, ...], without: Path
    ) -> Tree | None:
        """Return the composed document that `reference` names, without the keys in `without`."""
        target = self._library.follow(reference, kinds)
        if target is None:
            return None
        real = os.path.realpath(target.file)
        if real in chain:
            names = [os.path.basename(name) for name in (*chain[chain.index(real) :], real)]
            self._problems.error(
                reference,
                "reference-loop",
                f"documents extend or include each other in a circle: {' → '.join(names)}",
            )
            return None
        if len(chain) >= _DEEPEST:
            self._problems.error(
                reference,
                "too-many-files",
                f"more than {_DEEPEST} documents extend or include each other",
            )
            return None
        self.sources.setdefault(target.file, target)
        if not isinstance(target.data, dict) or not kind_of(target):
            return None
        found = self.compose(target, chain)
        if found is None:
            return None
        return _without(Tree(found.data, found.mark, found), without)

    def _merged_includes(self, parts: list[Tree], settled: object) -> list[Tree]:
        """Merge any included documents into one tree; report keys with two different values."""
        if not parts:
            return []
        clashes = _Clashes(settled)
        merged = reduce(lambda below, above: merge(below, above, (), clashes), parts)
        for path, first, second in clashes.found:
            home = second.home
            place = f"{first.home.file}:{first.mark.span.line}"
            # The document contains only this value, so the problem points at the value itself.
            value = Document(home.file, home.text, home.lines, second.value, second.mark)
            found = value.problem(
                (),
                "include-clash",
                f"{place} sets this key to a different value",
                hint="set the key in the document that includes both",
            )
            self._problems.problems.append(found._replace(path=".".join(map(str, path))))
        return [merged]


class _Clashes:
    """Collects the keys that two included documents set to different values."""

    def __init__(self, settled: object) -> None:
        self._settled = settled
        self.found: list[tuple[Path, Tree, Tree]] = []

    def __call__(self, path: Path, base: Tree, over: Tree) -> None:
        value = self._settled
        for part in path:
            if not isinstance(value, dict):
                break
            if part not in value:
                self.found.append((path, base, over))
                return
            value = value[part]


def _without(tree: Tree, keys: tuple[str | int, ...]) -> Tree:
    inside = {key: inner for key, inner in children(tree).items() if key not in keys}
    value = {key: inner.value for key, inner in inside.items()}
    return Tree(
        value, tree.mark.copy({key: inner.mark for key, inner in inside.items()}), tree.home
    )
