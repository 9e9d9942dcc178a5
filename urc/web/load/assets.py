"""Tables of the files that pages may load; no request can reach a path outside these tables.

Layer 5. The tables contain files from URC's own folders and from widget folders. The URL of a
request is only a key in a table, never a path. Changed files are read again, so edits are visible
immediately.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from urc.model.widget import Widget
from urc.problems import UrcError

__all__ = ["Assets", "folder_assets", "import_map", "script", "widget_assets"]

STATIC = Path(__file__).resolve().parents[1] / "static"
KIT = (
    "response_curve",
    "command_kit",
    "kit",
    "meter",
    "motion",
    "gamepad_map",
    "colour_map",
    "axis_ticks",
    "height_tape",
    "offscreen_canvas",
    "path_simplify",
)
"""URC's modules that widgets can import as ``urc/…``."""
WIDGET_FILES = ("widget.js", "widget.css")
MOST_FILES = 200
"""Maximum number of files that pages may load from one widget."""
MEDIA_TYPES = {
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mjs": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".webmanifest": "application/manifest+json",
    ".map": "application/json",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".webp": "image/webp",
    ".urdf": "application/xml",
    ".stl": "model/stl",
    ".dae": "application/xml",
    ".woff2": "font/woff2",
    ".wasm": "application/wasm",
}


@dataclass(slots=True)
class _CachedFile:
    path: Path
    stamp: tuple[int, int] = (0, 0)
    body: bytes = b""
    tag: str = ""

    def refresh(self) -> None:
        """Read the file again if it has changed; raise OSError if the file no longer exists."""
        found = self.path.stat()
        stamp = (found.st_mtime_ns, found.st_size)
        if stamp != self.stamp:
            self.body = self.path.read_bytes()
            self.tag = _tag(self.body)
            self.stamp = stamp


@dataclass(slots=True)
class Assets:
    """A table of files, keyed by relative URL."""

    files: dict[str, _CachedFile] = field(default_factory=dict)

    def respond(self, name: str, request: Request) -> Response:
        """Return the file, or status 304 if the browser's copy is current; raise 404 if missing."""
        file = self.files.get(name)
        if file is None:
            raise HTTPException(404)
        try:
            file.refresh()
        except OSError as error:
            raise HTTPException(404) from error
        return _kept(file.body, file.tag, MEDIA_TYPES[file.path.suffix], request)


def script(source: str, request: Request) -> Response:
    """Return a generated module, or status 304 if the browser's copy is current."""
    body = source.encode()
    return _kept(body, _tag(body), MEDIA_TYPES[".js"], request)


def _kept(body: bytes, tag: str, media_type: str, request: Request) -> Response:
    headers = {"etag": tag, "cache-control": "no-cache"}
    if tag in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    return Response(body, media_type=media_type, headers=headers)


def _tag(body: bytes) -> str:
    return f'"{hashlib.blake2b(body, digest_size=12).hexdigest()}"'


def folder_assets(folder: Path) -> Assets:
    """Return all files with a web media type in `folder`, keyed by relative path."""
    root = folder.resolve()
    found = Assets()
    for path in sorted(root.rglob("*")):
        is_ours = path.is_file() and path.resolve().is_relative_to(root)
        if is_ours and path.suffix in MEDIA_TYPES:
            found.files[path.relative_to(root).as_posix()] = _CachedFile(path)
    return found


def widget_assets(widgets: Iterable[Widget]) -> Assets:
    """Return the widget files for pages: modules, style sheets and small assets.

    Each file is listed as ``<widget>/<path in its folder>``. Hidden files and links out of the
    folder are omitted.

    Raises:
        UrcError: widgets with the same name are in different folders, or a widget has too many
            files.
    """
    found = Assets()
    folders: dict[str, Path] = {}
    for widget in widgets:
        folder = folders.setdefault(widget.name, widget.folder)
        if folder != widget.folder:
            raise UrcError(
                f"two robots use different widgets named {widget.name!r}: "
                f"{folder} and {widget.folder}"
            )
        # List missing files too: an author may write the widget while the page is open.
        for name in WIDGET_FILES:
            found.files[f"{widget.name}/{name}"] = _CachedFile(widget.folder / name)
        for name, file in _more_files(widget):
            found.files[f"{widget.name}/{name}"] = file
    return found


def _more_files(widget: Widget) -> Iterable[tuple[str, _CachedFile]]:
    more = folder_assets(widget.folder).files
    mine = {name: file for name, file in more.items() if not any(map(_is_hidden, name.split("/")))}
    if len(mine) > MOST_FILES:
        raise UrcError(
            f"widget {widget.name!r} has {len(mine)} files; at most {MOST_FILES} are allowed"
        )
    return mine.items()


def _is_hidden(part: str) -> bool:
    return part.startswith((".", "_"))


def import_map(vendor: Path | None) -> Mapping[str, object]:
    """Return the pages' import map, with URC's modules and the build's third-party modules."""
    imports = {f"urc/{name}": f"/static/widgets/{name}.js" for name in KIT}
    imports["urc/words"] = "/words/en.js"
    place = vendor / "importmap.json" if vendor else None
    if place is not None and place.is_file():
        written: dict[str, str] = json.loads(place.read_text(encoding="utf-8"))["imports"]
        # The build writes paths relative to its folder, which is /vendor/ for pages.
        imports |= {name: f"/vendor/{url.removeprefix('./')}" for name, url in written.items()}
    return {"imports": imports}
