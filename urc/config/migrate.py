"""Migrates documents: replaces old keys and values, and changes nothing else."""

import re
from collections.abc import Iterator
from typing import Final, NamedTuple

from urc._files import read_bytes
from urc.config.renames import KEYS, VALUES, Content
from urc.config.schemas import kind_of
from urc.problems import ProblemsError
from urc.source import Document, DocumentLimits, Path, Span, parse_document

__all__ = ["Change", "Migrated", "migrate"]

_CONTENTS: Final[dict[str, Content]] = {
    "driver": "driver",
    "interface": "interface",
    "widget": "widget",
}
_DEMO: Final = "demo.yaml"
"""File name of a widget's demo states, the only document without `kind`."""
_SCALAR: Final = re.compile(r"(?P<head>(?:[&!]\S*\s+)*)(?P<quote>['\"]?).*(?P=quote)", re.DOTALL)
_BOM: Final = "\ufeff".encode()


class Change(NamedTuple):
    """A renamed key or value."""

    line: int
    column: int
    old: str
    new: str


class Migrated(NamedTuple):
    """The migrated content of a document and the list of changes."""

    content: bytes
    changes: tuple[Change, ...]
    """Changes in document order; empty for a document without old names."""


def migrate(path: str) -> Migrated:
    """Return a file's content with the new names, without changing the file.

    Raises:
        ProblemsError: the file cannot be read, is not a document, or has a key under both names.
    """
    content = read_bytes(path, DocumentLimits().size_bytes)
    document = parse_document(content, path)
    found = {span: names for part in _parts(document) for span, names in _renames(document, *part)}
    edits = sorted(found.items())
    text = document.text
    starts = document.line_starts()
    pieces: list[str] = []
    done = 0
    changes = []
    for span, (old, new) in edits:
        start = starts[span.line - 1] + span.column - 1
        end = starts[span.end_line - 1] + span.end_column - 1
        pieces += [text[done:start], _replaced(text[start:end], new.rpartition(" ")[2])]
        done = end
        changes.append(Change(span.line, span.column, old, new))
    pieces.append(text[done:])
    mark = _BOM if content.startswith(_BOM) else b""
    return Migrated(mark + "".join(pieces).encode(), tuple(changes))


def _replaced(written: str, new: str) -> str:
    """Return a scalar's source with new text and the original anchor, tag and quotes."""
    return _SCALAR.sub(
        lambda found: f"{found['head']}{found['quote']}{new}{found['quote']}", written, count=1
    )


def _parts(document: Document) -> Iterator[tuple[Content, Path]]:
    """Yield each part of a document that can contain old names, as its kind and its path."""
    kind = kind_of(document)
    data = document.data
    if kind == "robot" and isinstance(data, dict):
        for path in ((), ("driver",), ("driver", "overrides")):
            yield "driver", path
        interfaces = data.get("interfaces")
        for name in interfaces if isinstance(interfaces, dict) else ():
            yield "interface", ("interfaces", name)
    elif kind:
        yield _CONTENTS[kind], ()
    elif re.split(r"[\\/]", document.file)[-1] == _DEMO:
        yield "demo", ()
    else:
        raise ProblemsError(
            [
                document.problem(
                    (),
                    "unknown-kind",
                    "this document has no known 'kind'",
                    hint="known kinds: robot, driver, interface, widget",
                )
            ]
        )


def _renames(
    document: Document, content: Content, root: Path
) -> Iterator[tuple[Span, tuple[str, str]]]:
    """Yield the position of each old name in one part, with the old and the new name."""
    keys = [one for one in KEYS if one.content == content]
    values = [one for one in VALUES if one.content == content]
    for path, mapping in _mappings(_at(document.data, root)):
        where = "/".join(str(one).replace("/", "\0") for one in path)
        for key in keys:
            if key.applies(mapping) and re.fullmatch(key.place, where):
                mark = document.at((*root, *path, key.old))
                if key.new in mapping:
                    raise _both(document, (*root, *path), key.old, key.new)
                if mark is not None and mark.key is not None:
                    yield mark.key, (key.old, key.new)
        for value in values:
            if mapping.get(value.key) == value.old and re.fullmatch(value.place, where):
                mark = document.at((*root, *path, value.key))
                if mark is not None and mark.style in ("", "'", '"'):
                    yield mark.span, (f"{value.key}: {value.old}", f"{value.key}: {value.new}")


def _mappings(data: object, path: Path = ()) -> Iterator[tuple[Path, dict[str, object]]]:
    """Yield the path and the value of `data` and of every nested mapping."""
    if isinstance(data, dict):
        yield path, data
        for key, inner in data.items():
            yield from _mappings(inner, (*path, key))
    elif isinstance(data, list):
        for place, inner in enumerate(data):
            yield from _mappings(inner, (*path, place))


def _at(data: object, path: Path) -> object:
    for part in path:
        data = data.get(part) if isinstance(data, dict) else None
    return data


def _both(document: Document, path: Path, old: str, new: str) -> ProblemsError:
    return ProblemsError(
        [
            document.problem(
                (*path, old),
                "duplicate-key",
                f"'{old}' is the old name of '{new}', and this mapping has both",
                hint="remove one of the two keys",
                key=True,
            )
        ]
    )
