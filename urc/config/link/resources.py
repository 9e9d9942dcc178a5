"""Checks files and web pages in a widget's options.

The dashboard serves only the files that a document names for its widgets. Served files must be in
the folder of the document that names them, so packages cannot publish other files on the server. In
a document that extends another, inherited names refer to the folder of the extended document.

A page's content security policy contains the host of every embedded web page. The URLs of embedded
web pages must therefore be unambiguous to all browsers.
"""

import ipaddress
import re
from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath
from pathlib import PurePosixPath
from typing import Final

from urc.config.node import Node, Problems
from urc.model.widget import Widget

__all__ = [
    *("FILE_TYPES", "LONGEST_URL", "MOST_BYTES", "MOST_PICTURE_BYTES", "PICTURE_TYPES"),
    *("file_fault", "find_picture", "link_files", "link_pages", "named_texts"),
]

FILE_TYPES: Final = (
    *(".urdf", ".stl", ".dae", ".glb", ".obj", ".mtl", ".md", ".txt", ".json", ".csv"),
    *(".png", ".jpg", ".jpeg", ".webp", ".gif", ".svg", ".wav", ".mp3", ".ogg"),
)
"""File types that URC serves to pages; executable types are excluded."""

PICTURE_TYPES: Final = (".svg", ".png", ".jpg", ".jpeg", ".webp", ".gif")
"""File types of a robot's picture, in order of preference."""

MOST_PICTURE_BYTES: Final = 4 << 20
"""Maximum size of a robot's picture, in bytes: large enough for a photo from a phone."""

MOST_BYTES: Final = 64 << 20
"""Maximum size of one file, in bytes."""

LONGEST_URL: Final = 2000
"""Maximum length of a URL, in characters."""

_URL: Final = re.compile(
    r"(?P<scheme>[A-Za-z][A-Za-z0-9+.-]*):(?://(?P<authority>[^/?#\\]*))?(?P<rest>.*)", re.DOTALL
)
_HOST: Final = re.compile(r"(?P<host>[A-Za-z0-9._-]{1,253})(?::(?P<port>[0-9]{1,5}))?", re.ASCII)
_REST: Final = re.compile(r"[!#-;=?-\[\]_a-z~]*", re.ASCII)
_NUMBER: Final = re.compile(r"[0-9]+|0[xX][0-9A-Fa-f]*", re.ASCII)
_LAST_PORT: Final = 65535


def link_files(options: Node, widget: Widget, problems: Problems) -> dict[str, str]:
    """Return a mapping from the file names in the options to their paths.

    The caller must already have checked the options against their schema. The widget's manifest
    marks the options that name files.
    """
    found = {}
    for _, part in named_texts(options, widget.options, "file"):
        fault = file_fault(part.data)
        home = FilePath(part.document.source_of(part.path).file).absolute().parent
        place = home / part.data
        if fault:
            hint = "specify a file in this document's folder or a subfolder"
            problems.error(part, "file-not-served", f"{part.data!r} {fault}", hint=hint)
        elif not place.is_file():
            problems.error(part, "no-such-file", f"there is no file {part.data!r}")
        elif not _is_below(place, home):
            problems.error(
                part, "file-not-served", f"{part.data!r} is outside this document's folder"
            )
        elif place.stat().st_size > MOST_BYTES:
            text = f"{part.data!r} is larger than {MOST_BYTES >> 20} MiB"
            problems.error(part, "file-not-served", text)
        else:
            found[str(part.data)] = str(place.resolve())
    return found


def find_picture(document: str) -> str:
    """Return the path of the robot's picture; "" without a picture.

    The picture has the document's name, and is in the document's folder or its subfolder
    ``pictures``. A missing picture is not an error, so that a document can be copied without its
    picture.
    """
    place = FilePath(document).absolute()
    for folder in (place.parent, place.parent / "pictures"):
        for suffix in PICTURE_TYPES:
            found = folder / f"{place.stem}{suffix}"
            if (
                found.is_file()
                and _is_below(found, place.parent)
                and found.stat().st_size <= MOST_PICTURE_BYTES
            ):
                return str(found.resolve())
    return ""


def named_texts(
    options: Node, schemas: Mapping[str, object], keyword: str
) -> Iterator[tuple[str, Node]]:
    """Yield the name and the text of each option with `keyword: true` in its schema."""
    for name, part in options.entries().items():
        schema = schemas.get(name)
        if not isinstance(schema, Mapping):
            continue
        items = schema.get("items")
        if schema.get(keyword) and isinstance(part.data, str):
            yield name, part
        elif isinstance(items, Mapping) and items.get(keyword) and isinstance(part.data, list):
            yield from ((name, each) for each in part.items() if isinstance(each.data, str))


def file_fault(name: str) -> str:
    """Return the reason why a widget's file cannot have this name; "" for an allowed name."""
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name or ":" in name or "\0" in name:
        return "is not a path inside this document's folder"
    if path.suffix.lower() not in FILE_TYPES:
        return f"has a file type that is not served; allowed types are {', '.join(FILE_TYPES)}"
    return ""


def _is_below(place: FilePath, folder: FilePath) -> bool:
    return place.resolve().is_relative_to(folder.resolve())


def link_pages(options: Node, widget: Widget, problems: Problems) -> dict[str, tuple[str, ...]]:
    """Return the URLs of web pages in the options, by option.

    The options must already fit their schema. The widget's manifest marks the options that name
    pages. An empty string is valid and means no page.
    """
    found: dict[str, tuple[str, ...]] = {}
    for name, part in named_texts(options, widget.options, "page"):
        url = str(part.data)
        fault = _page_fault(url) if url else ""
        if fault:
            hint = "write a URL such as http://robot.local:8080/status"
            problems.error(part, "page-not-shown", f"{url[:80]!r} {fault}", hint=hint)
        found[name] = (*found.get(name, ()), *((url,) if url and not fault else ()))
    return found


def _page_fault(url: str) -> str:
    parts = _URL.fullmatch(url)
    if parts is None or parts["scheme"].lower() not in ("http", "https"):
        return "is not an http or https URL"
    if len(url) > LONGEST_URL:
        return f"is longer than {LONGEST_URL} characters"
    authority = parts["authority"] or ""
    if "@" in authority:
        return "contains a user name or password, which everyone who opens the page could read"
    if authority.startswith("["):
        return "has an IPv6 address, which a page's security policy cannot contain; use a host name"
    host = _HOST.fullmatch(authority)
    if host is None or not _is_host(host["host"]):
        return "has an ambiguous or missing host"
    if host["port"] is not None and not 0 < int(host["port"]) <= _LAST_PORT:
        return f"has a port outside the range 1 to {_LAST_PORT}"
    if not _REST.fullmatch(parts["rest"]):
        return "has a character that must be written as %XX"
    return ""


def _is_host(host: str) -> bool:
    labels = host.removesuffix(".").split(".")
    if not all(labels):
        return False
    # Browsers also interpret `127.1` and `0x7f000001` as addresses. Only the usual notation is
    # allowed.
    if _NUMBER.fullmatch(labels[-1]):
        try:
            ipaddress.IPv4Address(host)
        except ValueError:
            return False
    return True
