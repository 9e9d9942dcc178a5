"""Files that a widget's options name: which they are, and whether a page may have them.

A page is served exactly the files that a document names, so a name must lie beside the document:
nobody who writes a package can make a dashboard hand out what else is on its disk.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath
from pathlib import PurePosixPath
from typing import Final

from urc.config.part import Findings, Part
from urc.model.widget import Widget

__all__ = ["FILE_TYPES", "MOST_BYTES", "link_files", "named_texts"]

FILE_TYPES: Final = (
    *(".urdf", ".stl", ".dae", ".glb", ".obj", ".mtl", ".md", ".txt", ".json", ".csv"),
    *(".png", ".jpg", ".jpeg", ".webp", ".gif", ".svg", ".wav", ".mp3", ".ogg"),
)
"""What a widget can do something with; none of them runs."""

MOST_BYTES: Final = 64 << 20
"""Of one file."""


def link_files(options: Part, widget: Widget, findings: Findings) -> dict[str, str]:
    """Return each file as the options name it → where it is.

    Args:
        options: of one slot, of a shape that is known to be right.
        widget: whose manifest says which of them are files.
        findings: takes what is wrong.
    """
    found = {}
    for _, part in named_texts(options, widget.options, "file"):
        fault = _fault(part.data)
        place = FilePath(part.document.file).absolute().parent / part.data
        if fault:
            hint = "name a file in the folder of this document, or below it"
            findings.error(part, "file-not-served", f"{part.data!r} {fault}", hint=hint)
        elif not place.is_file():
            findings.error(part, "no-such-file", f"there is no file {part.data!r}")
        elif not _is_below(place, FilePath(part.document.file).absolute().parent):
            findings.error(part, "file-not-served", f"{part.data!r} leads out of this folder")
        elif place.stat().st_size > MOST_BYTES:
            text = f"{part.data!r} is larger than {MOST_BYTES >> 20} MiB"
            findings.error(part, "file-not-served", text)
        else:
            found[str(part.data)] = str(place.resolve())
    return found


def named_texts(
    options: Part, schemas: Mapping[str, object], keyword: str
) -> Iterator[tuple[str, Part]]:
    """Yield the texts whose schema says `keyword: true`, each with the name of its option."""
    for name, part in options.entries().items():
        schema = schemas.get(name)
        if not isinstance(schema, Mapping):
            continue
        items = schema.get("items")
        if schema.get(keyword) and isinstance(part.data, str):
            yield name, part
        elif isinstance(items, Mapping) and items.get(keyword) and isinstance(part.data, list):
            yield from ((name, each) for each in part.items() if isinstance(each.data, str))


def _fault(name: str) -> str:
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name or ":" in name or "\0" in name:
        return "is no path within this folder"
    if path.suffix.lower() not in FILE_TYPES:
        return f"is of a type that no page is given; types are {', '.join(FILE_TYPES)}"
    return ""


def _is_below(place: FilePath, folder: FilePath) -> bool:
    return place.resolve().is_relative_to(folder.resolve())
