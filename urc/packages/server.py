"""A repository over HTTP: the files of its folder, and the lists of the thesis's figure B.3.

Only what is in the index is given out. The index is read anew when it has changed, so listing a new
package needs no restart.
"""

import asyncio
import mimetypes
import os
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Final

import msgspec
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route

from urc.packages.archive import PACKAGE
from urc.packages.door import Door
from urc.packages.head import HEAD, HEAD_BYTES, Head, Seal, read_head
from urc.packages.index import INDEX, INDEX_BYTES, Entry, read_index, search
from urc.packages.keeper import urcpm
from urc.packages.manifest import MANIFEST, parse_manifest
from urc.packages.names import FOLDERS, PackageError
from urc.packages.package import open_package, sha256
from urc.packages.tokens import Tokens

__all__ = ["repository_app"]

_HEADERS: Final = {
    "x-content-type-options": "nosniff",
    # What is in a package is for dashboards; opened as a page here, it may do nothing.
    "content-security-policy": "default-src 'none'; sandbox",
    "cache-control": "no-cache",
}
_THESIS: Final = ("drivers", "widgets", "interfaces")
_LASTING: Final = "public, max-age=31536000, immutable"
"""Of archives, which never change under their address."""


def repository_app(
    folder: Path,
    tokens: Tokens | None = None,
    examine: Callable[[Path], list[str]] | None = None,
    seal: Seal | None = None,
) -> Starlette:
    """Return the application that gives out the repository in a folder.

    Args:
        folder: the repository.
        tokens: who may publish into it; None: nobody.
        examine: looks at what is published, see `urc.packages.intake.take`.
        seal: the keeper's, which signs what is published into the index.
    """
    shop = _Shop(folder)
    routes = [Route("/{path:path}", shop.answer, methods=["GET", "HEAD"])]
    if tokens is not None and examine is not None:
        door = Door(folder, tokens, examine, seal)
        routes.append(Route("/{path:path}", door.answer, methods=["PUT"]))
    return Starlette(routes=routes)


class _Shop:
    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._seen: tuple[int, ...] = ()
        self._files: Mapping[str, Entry] = {}
        self._newest: Mapping[str, Entry] = {}
        self._lists: Mapping[str, bytes] = {}
        self._known: Head | None = None

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
        """Read the index when its file is another one than before, or its head is."""
        file = self._folder / INDEX
        head, stamp = self._head()
        seen = (*_stamp(os.stat(file)), *stamp)
        if seen == self._seen:
            return
        with open(file, "rb") as opened:
            data = opened.read(INDEX_BYTES + 1)
        digest = sha256(data)
        if head is None or head.sha256 != digest:
            if head is not None and head.signed and self._seen:
                return  # it is being changed: until it is signed anew, the old one is given out
            head = None
        index = read_index(data, str(file))
        newest = {str(entry.key): entry for entry in search(index.packages, ())}
        self._newest = newest
        self._files = {entry.file: entry for entry in index.packages}
        head = head or Head(1, index.number, digest)
        self._lists = {**_lists(index.name, newest), INDEX: data, HEAD: head.to_bytes()}
        self._seen = seen

    def _head(self) -> tuple[Head | None, tuple[int, ...]]:
        """Return the head as the keeper wrote it, and what tells its file from others."""
        try:
            with open(self._folder / HEAD, "rb") as opened:
                stamp = _stamp(os.fstat(opened.fileno()))
                if stamp == self._seen[-len(stamp) :]:
                    return self._known, stamp
                self._known = read_head(opened.read(HEAD_BYTES), HEAD)
                return self._known, stamp
        except (FileNotFoundError, PackageError):
            return None, ()


def _stamp(status: os.stat_result) -> tuple[int, ...]:
    """Return what tells a file from what was there before it."""
    return status.st_mtime_ns, status.st_size, status.st_ino


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
    headers = dict(_HEADERS)
    if status == 200:
        headers["etag"] = f'"{sha256(body)[:32]}"'
        if request.path_params["path"].startswith("archives/"):
            headers["cache-control"] = _LASTING
    known = request.headers.get("if-none-match", "")
    if status == 200 and headers["etag"] in [one.strip() for one in known.split(",")]:
        return Response(status_code=304, headers=headers)
    return Response(body, status, headers, media_type)
