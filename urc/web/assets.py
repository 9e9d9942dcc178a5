"""Files a page may load: known before the first request, never a path made from a URL.

Floor 5. Every table below is filled from folders that ship with URC, or from widget manifests; a
request is a look-up in it. Files are read again when they change, so that an edit shows at once.
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

__all__ = ["Assets", "folder_assets", "import_map", "widget_assets"]

STATIC = Path(__file__).resolve().parent / "static"
WIDGET_FILES = ("widget.js", "widget.css")
MEDIA_TYPES = {
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mjs": "text/javascript; charset=utf-8",
    ".json": "application/json",
    ".map": "application/json",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".woff2": "font/woff2",
    ".wasm": "application/wasm",
}


@dataclass(slots=True)
class _File:
    path: Path
    stamp: tuple[int, int] = (0, 0)
    body: bytes = b""
    tag: str = ""

    def refresh(self) -> None:
        """Read the file when it is not the one in memory; raises OSError when it is gone."""
        found = self.path.stat()
        stamp = (found.st_mtime_ns, found.st_size)
        if stamp != self.stamp:
            self.body = self.path.read_bytes()
            self.tag = f'"{hashlib.blake2b(self.body, digest_size=12).hexdigest()}"'
            self.stamp = stamp


@dataclass(slots=True)
class Assets:
    """Name in the URL → file."""

    files: dict[str, _File] = field(default_factory=dict)

    def respond(self, name: str, request: Request) -> Response:
        """Return the file, or 304 when the browser has it already; raise 404."""
        file = self.files.get(name)
        if file is None:
            raise HTTPException(404)
        try:
            file.refresh()
        except OSError as error:
            raise HTTPException(404) from error
        headers = {"etag": file.tag, "cache-control": "no-cache"}
        if file.tag in request.headers.get("if-none-match", ""):
            return Response(status_code=304, headers=headers)
        media_type = MEDIA_TYPES[file.path.suffix]
        return Response(file.body, media_type=media_type, headers=headers)


def folder_assets(folder: Path) -> Assets:
    """Return every file of `folder` whose type a page can use, by its name relative to it."""
    root = folder.resolve()
    found = Assets()
    for path in sorted(root.rglob("*")):
        is_ours = path.is_file() and path.resolve().is_relative_to(root)
        if is_ours and path.suffix in MEDIA_TYPES:
            found.files[path.relative_to(root).as_posix()] = _File(path)
    return found


def widget_assets(widgets: Iterable[Widget]) -> Assets:
    """Return the module and the style sheet of each widget, as ``<id>/<file>``.

    Raises:
        UrcError: two widgets of one name come from different folders.
    """
    found = Assets()
    folders: dict[str, Path] = {}
    for widget in widgets:
        folder = folders.setdefault(widget.name, widget.folder)
        if folder != widget.folder:
            raise UrcError(
                f"two robots bring different widgets named {widget.name!r}: "
                f"{folder} and {widget.folder}"
            )
        for name in WIDGET_FILES:
            found.files[f"{widget.name}/{name}"] = _File(widget.folder / name)
    return found


def import_map(vendor: Path | None) -> Mapping[str, object]:
    """Return the import map of the third-party modules, empty when the build brought none."""
    place = vendor / "importmap.json" if vendor else None
    if place is None or not place.is_file():
        return {"imports": {}}
    written: dict[str, str] = json.loads(place.read_text(encoding="utf-8"))["imports"]
    # The build writes them relative to its folder, which pages see as /vendor/.
    imports = {name: f"/vendor/{url.removeprefix('./')}" for name, url in written.items()}
    return {"imports": imports}
