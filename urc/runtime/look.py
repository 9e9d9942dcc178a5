"""What can be seen of a package before it is installed or updated, by its documents alone."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from urc.config.load import check
from urc.config.resolve import resolve
from urc.runtime.catalog import built_in_catalog
from urc.runtime.permissions import permissions
from urc.runtime.risks import risks_of
from urc.runtime.shelves import shelf_of
from urc.source import parse_document

__all__ = ["Look", "look"]

_NOT_WIRE: Final = (
    *("urc", "kind", "name", "title", "summary", "licence", "author"),
    *("widgets", "interfaces", "tests", "simulator"),
)


class Look(NamedTuple):
    """What is seen."""

    permissions: list[str]
    """What it may do, one line each."""
    wire: Mapping[str, str]
    """``commands.beep.send`` → what stands there: all that decides what goes to the robot, and what
    is made of its answers."""
    risks: list[str]
    """What of this machine it uses by itself; see `urc.runtime.risks`."""


def look(document: Path, folder: Path, widgets: Sequence[str]) -> Look:
    """Return what is seen of a package.

    Args:
        document: the package's own.
        folder: with all that the package needs; nothing outside may be named.
        widgets: names of the widgets that come along.

    Raises:
        ProblemsError: the document is broken.
        UrcError: it refers to a file outside.
    """
    allowed = permissions(document, folder, widgets)
    shelf = shelf_of(document)
    checked = check(document, built_in_catalog(), shelf)
    if checked.profile is None:
        return Look(allowed, {}, [])
    risks = risks_of(checked.profile)
    text = resolve(str(document), shelf, checked.profile).text
    data = parse_document(text.encode(), "resolved").data
    assert isinstance(data, dict)  # noqa: S101 (a document that was loaded is a mapping)
    wire = {key: value for key, value in data.items() if key not in _NOT_WIRE}
    return Look(allowed, dict(_flat(wire, "")), risks)


def _flat(value: object, path: str) -> Iterator[tuple[str, str]]:
    """Yield the path and text of every value that holds no others."""
    if isinstance(value, dict) and value:
        for key, inner in value.items():
            yield from _flat(inner, f"{path}.{key}" if path else str(key))
    elif isinstance(value, list) and value:
        for place, inner in enumerate(value):
            yield from _flat(inner, f"{path}.{place}")
    else:
        yield path, f'"{value}"' if isinstance(value, str) else str(value)
