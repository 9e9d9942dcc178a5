"""The documents of one check, each put together from what it extends and includes.

    extends: base.yaml                  # all of the base, changed by what stands here
    extends: generic-ros1               # the same, of a document that ships with URC
    include: [parts/battery.yaml]       # parts of documents, put under what stands here

A path is relative to the document that names it. What a document says itself goes before
what it includes, and that before what it extends.
"""

import os
import re
from typing import Any, Final

from urc.config.compose.merge import Tree, children, count_nodes, merge
from urc.config.part import Findings, Part
from urc.config.shape.check import check_source, kind_of
from urc.config.suggest import did_you_mean
from urc.problems import Problem, ProblemsError
from urc.shipped import shipped
from urc.source import Document, Path, read_document, similar_file

__all__ = ["Library"]

_DEEPEST: Final = 16
"""Documents that build on each other."""
_FILES_MOST: Final = 64
_NODES_MOST: Final = 10_000
_OWN: Final = ("urc", "kind", "name", "extends", "include", "partial")
_HEADER: Final = (*_OWN, "title", "summary", "licence", "author")
_FILE_CODES: Final = (
    "no-such-file", "is-directory", "not-a-file", "not-readable", "too-large",
)  # fmt: skip
_NAME: Final = re.compile("[a-z][a-z0-9-]*")
_SHIPPED: Final = {"robot": ".", "driver": "drivers", "interface": "interfaces"}
"""Kind of a document → where such documents ship, below the folder of robots."""
_ARTICLES: Final = {"interface": "an interface"}
_INCLUDED: Final = {
    "robot": ("robot", "driver"),
    "driver": ("driver",),
    "interface": ("interface",),
}
"""Kind of a document → kinds of which parts may be included."""


class Library:
    """Reads documents and puts them together; remembers every file that it looked at."""

    def __init__(self) -> None:
        self.files: dict[str, None] = {}
        """Every file that was looked at, whether there is one or not."""
        self.findings = Findings()
        self._documents: dict[str, Document | None] = {}
        self._whole: dict[str, Document | None] = {}
        self._faults: dict[str, list[Problem]] = {}

    def read(self, path: str) -> Document:
        """Return one document as it stands in its file.

        Raises:
            ProblemsError: it cannot be read.
        """
        self.files[path] = None
        return read_document(path)

    def follow(self, reference: Part, kinds: tuple[str, ...]) -> Document | None:
        """Return the document that a reference names.

        A path is relative to the document in which it stands; a name is of what ships with URC.
        """
        here = reference.document.source_of(reference.path).file
        if _NAME.fullmatch(reference.data):
            named = _shipped(reference.data, kinds)
            if named is None:
                self._report_name(reference, kinds)
                return None
            target = named
        else:
            target = os.path.normpath(os.path.join(os.path.dirname(here), reference.data))
        real = os.path.realpath(target)
        if real == os.path.realpath(here):
            self.findings.error(reference, "refers-to-itself", "this document refers to itself")
            return None
        if real not in self._documents:
            if len(self._documents) >= _FILES_MOST:
                self.findings.error(
                    reference, "too-many-files", f"more than {_FILES_MOST} documents are needed"
                )
                return None
            self._documents[real] = self._open(reference, target)
        document = self._documents[real]
        found = kind_of(document) if document is not None else ""
        if document is None or not found or found in kinds:
            return document
        wanted = " or ".join(_ARTICLES.get(kind, f"a {kind}") for kind in kinds)
        self.findings.error(
            reference,
            "wrong-kind",
            f"{target} is {_ARTICLES.get(found, f'a {found}')}, {wanted} is expected here",
        )
        return None

    def _report_name(self, reference: Part, kinds: tuple[str, ...]) -> None:
        known = [name for kind in kinds for name in _names(kind)]
        hint = did_you_mean(reference.data, known, f"{kinds[0]}s that ship")
        if not hint.startswith("did"):
            hint = f"the path of a document ends in .yaml; {hint}"
        self.findings.error(
            reference,
            "no-such-file",
            f"no {' or '.join(kinds)} named {reference.data!r} ships with URC",
            hint=hint,
        )

    def _open(self, reference: Part, target: str) -> Document | None:
        try:
            document = self.read(target)
        except ProblemsError as error:
            first = error.problems[0]
            if first.code not in _FILE_CODES:
                self.findings.problems += error.problems
                return None
            near = similar_file(target) if first.code == "no-such-file" else ""
            hint = os.path.join(os.path.dirname(reference.data), near) if near else ""
            self.findings.error(
                reference,
                first.code,
                f"{target}: {first.message}",
                hint=f"did you mean '{hint}'?" if hint else "",
            )
            return None
        self.findings.problems += document.findings
        return document

    def whole(self, document: Document) -> Document | None:
        """Return a document with all that it extends and includes, or None with findings."""
        return self._put_together(document, ())

    def _put_together(self, document: Document, chain: tuple[str, ...]) -> Document | None:
        data = document.data
        if not isinstance(data, dict) or not kind_of(document):
            return document  # the shape pass tells
        if not {"extends", "include"} & data.keys():
            return document
        real = os.path.realpath(document.file)
        if real not in self._whole:
            self._whole[real] = self._merged(document, data, (*chain, real))
        return self._whole[real]

    def _merged(
        self, document: Document, data: dict[str, Any], chain: tuple[str, ...]
    ) -> Document | None:
        faults = self._check(document)
        if any(fault.path.partition(".")[0] in ("extends", "include") for fault in faults):
            return None
        kind = kind_of(document)
        root = Part(document, (), data)
        is_sound = True
        below: Tree | None = None
        base = root.get("extends")
        if base is not None:
            below = self._taken(base, (kind,), chain, _OWN)
            is_sound = below is not None
        clashes = _Clashes(data)
        parts: Tree | None = None
        for reference in root.listed("include"):
            part = self._taken(reference, _INCLUDED.get(kind, ()), chain, _HEADER)
            is_sound = is_sound and part is not None
            if part is not None:
                parts = part if parts is None else merge(parts, part, (), clashes)
        self._report(clashes)
        own = _without(Tree(data, document.mark, document), ("extends", "include"))
        for above in (parts, own):
            if above is not None:
                below = above if below is None else merge(below, above)
        if not is_sound or below is None:
            return None
        if count_nodes(below.value) > _NODES_MOST:
            self.findings.error(
                root, "too-many-nodes", f"more than {_NODES_MOST} keys and values put together"
            )
            return None
        mark = below.mark.copy()
        mark.origin, mark.span = None, document.mark.span
        return Document(
            document.file, document.text, document.lines, below.value, mark, document.findings
        )

    def _taken(
        self, reference: Part, kinds: tuple[str, ...], chain: tuple[str, ...], without: Path
    ) -> Tree | None:
        """Return what is taken out of the document that `reference` names."""
        target = self.follow(reference, kinds)
        if target is None:
            return None
        real = os.path.realpath(target.file)
        if real in chain:
            names = [os.path.basename(name) for name in (*chain[chain.index(real) :], real)]
            self.findings.error(
                reference, "reference-loop", f"documents build on each other: {' → '.join(names)}"
            )
            return None
        if len(chain) >= _DEEPEST:
            self.findings.error(
                reference,
                "too-many-files",
                f"more than {_DEEPEST} documents build on each other",
            )
            return None
        self._check(target)
        if not isinstance(target.data, dict) or not kind_of(target):
            return None
        found = self._put_together(target, chain)
        if found is None:
            return None
        return _without(Tree(found.data, found.mark, found), without)

    def _check(self, document: Document) -> list[Problem]:
        """Return what is wrong with one of the documents that are put together; tell it once."""
        if document.file not in self._faults:
            self._faults[document.file] = _source_faults(document)
            self.findings.problems += self._faults[document.file]
        return self._faults[document.file]

    def _report(self, clashes: "_Clashes") -> None:
        for path, first, second in clashes.found:
            home = second.home
            place = f"{first.home.file}:{first.mark.span.line}"
            # A document of one value, so that the finding points at it whatever is around it.
            value = Document(home.file, home.text, home.lines, second.value, second.mark)
            found = value.problem(
                (),
                "include-clash",
                f"{place} says something else about it",
                hint="say it in the document that includes both",
            )
            self.findings.problems.append(found._replace(path=".".join(map(str, path))))


def _shipped(name: str, kinds: tuple[str, ...]) -> str | None:
    """Return the file of the document of that name that ships with URC, or None."""
    files = (shipped("robots") / _SHIPPED[kind] / f"{name}.yaml" for kind in kinds)
    return next((os.path.normpath(file) for file in files if file.is_file()), None)


def _names(kind: str) -> list[str]:
    return sorted(file.stem for file in (shipped("robots") / _SHIPPED[kind]).glob("*.yaml"))


class _Clashes:
    """What two included documents say differently, unless the one that includes them settles it."""

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


def _source_faults(document: Document) -> list[Problem]:
    from urc.config.shape.check import check_shape

    return check_source(document) if kind_of(document) else check_shape(document)


def _without(tree: Tree, keys: tuple[str | int, ...]) -> Tree:
    inside = {key: inner for key, inner in children(tree).items() if key not in keys}
    value = {key: inner.value for key, inner in inside.items()}
    return Tree(
        value, tree.mark.copy({key: inner.mark for key, inner in inside.items()}), tree.home
    )
