"""A repository over HTTP: the files of its folder, and the lists of the thesis's figure B.3.

Only what is in the index is given out. The index is read anew when it has changed, so listing a new
package needs no restart.
"""

import asyncio
import mimetypes
import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Final

import msgspec
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from urc.packages.archive import PACKAGE
from urc.packages.index import INDEX, INDEX_BYTES, Entry, Index, read_index, search
from urc.packages.keeper import urcpm
from urc.packages.manifest import MANIFEST, parse_manifest
from urc.packages.names import FOLDERS, PackageError
from urc.packages.package import open_package, sha256

__all__ = ["repository_app"]

_HEADERS: Final = {
    "x-content-type-options": "nosniff",
    # What is in a package is for dashboards; opened as a page here, it may do nothing.
    "content-security-policy": "default-src 'none'; sandbox",
    "cache-control": "no-cache",
}
_THESIS: Final = ("drivers", "widgets", "interfaces")


def repository_app(folder: Path) -> Starlette:
    """Return the application that gives out the repository in a folder."""
    shop = _Shop(folder)
    return Starlette(routes=[Route("/{path:path}", shop.answer, methods=["GET", "HEAD"])])


class _Shop:
    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._seen: tuple[int, ...] = ()
        self._index = Index(1, "", ())
        self._files: Mapping[str, Entry] = {}
        self._newest: Mapping[str, Entry] = {}
        self._lists: Mapping[str, bytes] = {}

    async def answer(self, request: Request) -> Response:
        """Answer any request."""
        path = request.path_params["path"].rstrip("/")
        try:
            body, kind = await asyncio.to_thread(self._content, path)
        except (PackageError, OSError):
            return _respond(request, b'{"error":"the repository cannot be read"}', "json", 503)
        if body is None:
            return _respond(request, b'{"error":"there is no such thing here"}', "json", 404)
        return _respond(request, body, kind, 200)

    def _content(self, path: str) -> tuple[bytes | None, str]:
        self._refresh()
        if path in self._lists:
            return self._lists[path], "json"
        if path in self._files:
            return self._archive(self._files[path]), "zip"
        folder, _, rest = path.partition("/")
        name, _, file = rest.partition("/")
        entry = self._newest.get(f"{folder}/{name}")
        if entry is None:
            return None, ""
        files = _files(self._archive(entry), str(entry))
        if file == "urcpm.json" and folder in _THESIS:
            return urcpm(parse_manifest(files[MANIFEST], file), files), "json"
        return files.get(file), file.rpartition(".")[2]

    def _archive(self, entry: Entry) -> bytes:
        with open(self._folder / entry.file, "rb") as file:
            data = file.read(PACKAGE.archive_bytes + 1)
        if sha256(data) != entry.sha256:
            raise PackageError(f"{entry.file}: it has changed since it was listed")
        return data

    def _refresh(self) -> None:
        """Read the index when its file is another one than before."""
        file = self._folder / INDEX
        status = os.stat(file)
        seen = status.st_mtime_ns, status.st_size, status.st_ino
        if seen == self._seen:
            return
        with open(file, "rb") as opened:
            data = opened.read(INDEX_BYTES + 1)
        index = read_index(data, str(file))
        newest = {str(entry.key): entry for entry in search(index.packages, ())}
        self._index, self._newest = index, newest
        self._files = {entry.file: entry for entry in index.packages}
        self._lists = {**_lists(index.name, newest), INDEX: data}
        self._seen = seen


def _lists(name: str, newest: Mapping[str, Entry]) -> dict[str, bytes]:
    """Return the answers to the paths of the thesis's figure B.3."""
    paths = {
        folder: [f"/{key}/" for key, entry in sorted(newest.items()) if entry.kind == kind]
        for folder, kind in FOLDERS.items()
    }
    lists = {folder: msgspec.json.encode(found) for folder, found in paths.items()}
    return lists | {"": msgspec.json.encode({"name": name, **paths})}


@lru_cache(maxsize=2)
def _files(archive: bytes, name: str) -> Mapping[str, bytes]:
    return open_package(archive, name).files


def _respond(request: Request, body: bytes, ending: str, status: int) -> Response:
    guessed = mimetypes.types_map.get(f".{ending}", "text/plain")
    media_type = "application/json" if ending == "json" else guessed
    headers = _HEADERS | {"etag": f'"{sha256(body)[:32]}"'} if status == 200 else dict(_HEADERS)
    known = request.headers.get("if-none-match", "")
    if status == 200 and headers["etag"] in [one.strip() for one in known.split(",")]:
        return Response(status_code=304, headers=headers)
    return Response(body, status, headers, media_type)
