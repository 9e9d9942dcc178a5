"""Reads all documents that one document refers to.

A path in a reference is relative to the referring document. A name without a suffix refers to a
document that ships with URC.
"""

import os
import re
from typing import Final

from urc.config.node import Node, Problems
from urc.config.schemas import kind_of
from urc.config.spelling_suggestions import did_you_mean
from urc.problems import ProblemsError
from urc.shipped import shipped
from urc.source import Document, read_document, similar_file

__all__ = ["Library"]

_FILES_MOST: Final = 64
_FILE_CODES: Final = (
    "no-such-file", "is-directory", "not-a-file", "not-readable", "too-large",
)  # fmt: skip
_NAME: Final = re.compile("[a-z][a-z0-9-]*")
_SHIPPED: Final = {"robot": ".", "driver": "drivers", "interface": "interfaces"}
"""Folders of the shipped documents below `robots`, by document kind."""
_ARTICLES: Final = {"interface": "an interface"}


class Library:
    """Reads each document only once, and records the paths of all requested documents."""

    def __init__(self) -> None:
        self.files: dict[str, None] = {}
        """Paths of all requested files, including missing files."""
        self.problems = Problems()
        self._documents: dict[str, Document | None] = {}

    def read(self, path: str) -> Document:
        """Return one document before any merge.

        Raises:
            ProblemsError: the document cannot be read.
        """
        self.files[path] = None
        return read_document(path)

    def follow(self, reference: Node, kinds: tuple[str, ...]) -> Document | None:
        """Return the document that a reference names; None if a problem was reported."""
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
            self.problems.error(reference, "refers-to-itself", "this document refers to itself")
            return None
        if real not in self._documents:
            if len(self._documents) >= _FILES_MOST:
                self.problems.error(
                    reference,
                    "too-many-files",
                    f"this document needs more than {_FILES_MOST} other documents",
                )
                return None
            self._documents[real] = self._open(reference, target)
        document = self._documents[real]
        found = kind_of(document) if document is not None else ""
        if document is None or not found or found in kinds:
            return document
        wanted = " or ".join(_ARTICLES.get(kind, f"a {kind}") for kind in kinds)
        self.problems.error(
            reference,
            "wrong-kind",
            f"{target} is {_ARTICLES.get(found, f'a {found}')}, expected {wanted} here",
        )
        return None

    def _report_name(self, reference: Node, kinds: tuple[str, ...]) -> None:
        known = [name for kind in kinds for name in _names(kind)]
        hint = did_you_mean(reference.data, known, f"shipped {kinds[0]}s")
        if not hint.startswith("did"):
            hint = f"the path of a document must end with .yaml; {hint}"
        self.problems.error(
            reference,
            "no-such-file",
            f"no {' or '.join(kinds)} named {reference.data!r} ships with URC",
            hint=hint,
        )

    def _open(self, reference: Node, target: str) -> Document | None:
        try:
            document = self.read(target)
        except ProblemsError as error:
            first = error.problems[0]
            if first.code not in _FILE_CODES:
                self.problems.problems += error.problems
                return None
            near = similar_file(target) if first.code == "no-such-file" else ""
            hint = os.path.join(os.path.dirname(reference.data), near) if near else ""
            self.problems.error(
                reference,
                first.code,
                f"{target}: {first.message}",
                hint=f"did you mean '{hint}'?" if hint else "",
            )
            return None
        self.problems.problems += document.problems
        return document


def _shipped(name: str, kinds: tuple[str, ...]) -> str | None:
    """Return the path of a document that ships with URC; None for an unknown name."""
    files = (shipped("robots") / _SHIPPED[kind] / f"{name}.yaml" for kind in kinds)
    return next((os.path.normpath(file) for file in files if file.is_file()), None)


def _names(kind: str) -> list[str]:
    return sorted(file.stem for file in (shipped("robots") / _SHIPPED[kind]).glob("*.yaml"))
