"""HTTP server for a repository's listed files and for the lists in figure B.3 of the URC thesis.

The server sends only the files that the index lists. The server reads the index again after each
change, so new packages need no restart.
"""

import asyncio
import base64
import mimetypes
import os
import re
from collections.abc import Callable, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Final, TypeVar

import msgspec
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from urc.packages.archive import PACKAGE
from urc.packages.index import INDEX, INDEX_BYTES, IndexEntry, read_index, search
from urc.packages.index_builder import urcpm
from urc.packages.index_head import HEAD, HEAD_BYTES, IndexHead, IndexSigner, read_head
from urc.packages.manifest import MANIFEST, parse_manifest
from urc.packages.names import FOLDERS, PackageError, PackageId
from urc.packages.package import open_package, sha256
from urc.packages.signature import SIGNATURE, Signature
from urc.packages.submission import SubmissionRefused, SubmissionResult, take
from urc.packages.tokens import UploadTokens
from urc.packages.version_notes import PROVENANCE, Provenance

__all__ = ["repository_app"]


_HEADER_LONGEST: Final = 2048
_FILE: Final = re.compile(r"archives/([a-z]+)/([a-z][a-z0-9-]{0,63})/([0-9A-Za-z.-]{1,64})\.zip")
_WAITING_MOST: Final = 8
_Told = TypeVar("_Told", Signature, Provenance)
_HEADERS: Final = {"cache-control": "no-store", "x-content-type-options": "nosniff"}


class UploadService:
    """Accepts package uploads with `PUT`.

    Clients send `PUT archives/drivers/puppet/1.0.0.zip` with the header `authorization: Bearer
    TOKEN`.
    """

    def __init__(
        self,
        folder: Path,
        tokens: UploadTokens,
        examine: Callable[[Path], list[str]],
        index_signer: IndexSigner | None = None,
    ) -> None:
        self._folder = folder
        self._tokens = tokens
        self._examine = examine
        self._index_signer = index_signer
        self._turn = asyncio.Lock()
        self._waiting = 0

    async def answer(self, request: Request) -> Response:
        """Process one upload: reply 201 for a new version, or 200 for an already listed version."""
        refusal: SubmissionRefused | None = None
        key = None
        try:
            key = await self._admitted(request)
        except SubmissionRefused as error:
            refusal = error
        try:
            # Also read the body of refused requests; otherwise, the client may miss the response.
            body = await _body(request, is_kept=refusal is None)
            if refusal is not None or key is None:
                raise refusal or SubmissionRefused(404, "unknown path")
            taken = await self._taken(request, body)
        except SubmissionRefused as error:
            headers = {"www-authenticate": "Bearer"} if error.status == 401 else {}
            return _told(error.status, {"error": str(error)}, headers)
        except ClientDisconnect:
            return Response(status_code=400)
        except PackageError as error:
            return _told(503, {"error": str(error)})
        except OSError as error:
            return _told(507, {"error": f"the package cannot be stored: {error.strerror or error}"})
        said = {"listed": str(taken.entry), "sha256": taken.entry.sha256}
        return _told(201 if taken.is_new else 200, said)

    async def _admitted(self, request: Request) -> PackageId:
        """Return the package that the token may publish; raise `SubmissionRefused` on failure."""
        scheme, _, text = request.headers.get("authorization", "").partition(" ")
        token = None
        if scheme.lower() == "bearer":
            try:
                token = await asyncio.to_thread(self._tokens.find, text.strip())
            except PackageError:  # clients must not learn about damaged files
                raise SubmissionRefused(
                    503, "the tokens of this repository cannot be read"
                ) from None
        if token is None:
            raise SubmissionRefused(
                401, "this repository needs a token; ask its maintainer for one"
            )
        found = _FILE.fullmatch(request.path_params["path"])
        if found is None or found[1] not in FOLDERS:
            raise SubmissionRefused(404, "expected the path archives/drivers/NAME/VERSION.zip")
        key = PackageId(FOLDERS[found[1]], found[2])
        if not token.allows(key):
            may = ", ".join(token.may)
            raise SubmissionRefused(
                403, f"the token {token.name!r} may publish only {may}, not {key}"
            )
        return key

    async def _taken(self, request: Request, body: bytes) -> SubmissionResult:
        signature = _header(request, SIGNATURE, Signature, "no signature")
        provenance = _header(request, PROVENANCE, Provenance, "no origin")
        try:
            if provenance is not None:
                provenance.check()
        except PackageError as error:
            raise SubmissionRefused(400, f"the header {PROVENANCE}: {error}") from None
        if self._waiting >= _WAITING_MOST:
            raise SubmissionRefused(503, "too many packages are being published; try again")
        self._waiting += 1
        try:
            async with self._turn:
                # Run in a thread, so that a disconnecting client cannot interrupt a change.
                return await asyncio.shield(
                    asyncio.to_thread(
                        take,
                        self._folder,
                        request.path_params["path"],
                        body,
                        signature,
                        self._examine,
                        provenance,
                        self._index_signer,
                    )
                )
        finally:
            self._waiting -= 1


async def _body(request: Request, *, is_kept: bool) -> bytes:
    """Return the body if `is_kept`, otherwise b""; raise `SubmissionRefused` if it is too large."""
    size = 0
    pieces = []
    async for piece in request.stream():
        size += len(piece)
        if size > PACKAGE.archive_bytes:
            raise SubmissionRefused(
                413, f"the archive is larger than {PACKAGE.archive_bytes >> 20} MiB"
            )
        if is_kept:
            pieces.append(piece)
    wanted = request.headers.get("urc-sha256", "")
    body = b"".join(pieces)
    if is_kept and wanted and sha256(body) != wanted:
        raise SubmissionRefused(400, "the upload was damaged in transit; try again")
    return body


def _header(request: Request, name: str, kind: type[_Told], lacks: str) -> _Told | None:
    """Return a header's decoded base64 JSON, or None; raise `SubmissionRefused` if invalid."""
    text = request.headers.get(name, "")
    if not text:
        return None
    try:
        if len(text) > _HEADER_LONGEST:
            raise ValueError
        return msgspec.json.decode(base64.b64decode(text, validate=True), type=kind)
    except (ValueError, msgspec.DecodeError):
        raise SubmissionRefused(400, f"the header {name} contains {lacks}") from None


def _told(status: int, said: dict[str, str], headers: dict[str, str] | None = None) -> Response:
    return JSONResponse(said, status, headers=_HEADERS | (headers or {}))


_ANSWER_HEADERS: Final = {
    "x-content-type-options": "nosniff",
    # Archives are for dashboards. A browser must not run an archive's content.
    "content-security-policy": "default-src 'none'; sandbox",
    "cache-control": "no-cache",
}
_THESIS: Final = ("drivers", "widgets", "interfaces")
_LASTING: Final = "public, max-age=31536000, immutable"
"""Value of the header ``cache-control`` for archives, which never change."""


def repository_app(
    folder: Path,
    tokens: UploadTokens | None = None,
    examine: Callable[[Path], list[str]] | None = None,
    index_signer: IndexSigner | None = None,
) -> Starlette:
    """Return the web application that serves the repository in a folder.

    Args:
        folder: the repository's folder.
        tokens: upload tokens; None to refuse uploads.
        examine: function that checks uploads, as in `urc.packages.submission.take`.
        index_signer: signer of the index after uploads, with the maintainer's key.
    """
    shop = _Shop(folder)
    routes = [Route("/{path:path}", shop.answer, methods=["GET", "HEAD"])]
    if tokens is not None and examine is not None:
        door = UploadService(folder, tokens, examine, index_signer)
        routes.append(Route("/{path:path}", door.answer, methods=["PUT"]))
    return Starlette(routes=routes)


class _Shop:
    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._seen: tuple[int, ...] = ()
        self._files: Mapping[str, IndexEntry] = {}
        self._newest: Mapping[str, IndexEntry] = {}
        self._lists: Mapping[str, bytes] = {}
        self._known: IndexHead | None = None

    async def answer(self, request: Request) -> Response:
        """Answer any request."""
        path = request.path_params["path"].rstrip("/")
        try:
            body, kind = await asyncio.to_thread(self._content, path)
        except (PackageError, OSError):
            return _respond(request, b'{"error":"the repository cannot be read"}', "json", 503)
        if body is None:
            return _respond(request, b'{"error":"this repository has no such file"}', "json", 404)
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

    def _archive(self, entry: IndexEntry) -> bytes:
        with open(self._folder / entry.file, "rb") as file:
            data = file.read(PACKAGE.archive_bytes + 1)
        if sha256(data) != entry.sha256:
            raise PackageError(f"{entry.file}: the file has changed since it was listed")
        return data

    def _refresh(self) -> None:
        """Read the index if its file or its head has changed."""
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
                return  # a change is in progress: until the new signature, serve the old index
            head = None
        index = read_index(data, str(file))
        newest = {str(entry.key): entry for entry in search(index.packages, ())}
        self._newest = newest
        self._files = {entry.file: entry for entry in index.packages}
        head = head or IndexHead(1, index.number, digest)
        self._lists = {**_lists(index.name, newest), INDEX: data, HEAD: head.to_bytes()}
        self._seen = seen

    def _head(self) -> tuple[IndexHead | None, tuple[int, ...]]:
        """Return the stored head, and a tuple that changes whenever the head's file changes."""
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
    """Return a tuple that changes whenever the file changes."""
    return status.st_mtime_ns, status.st_size, status.st_ino


def _lists(name: str, newest: Mapping[str, IndexEntry]) -> dict[str, bytes]:
    """Return the responses for the paths in figure B.3 of the URC thesis."""
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
    headers = dict(_ANSWER_HEADERS)
    if status == 200:
        headers["etag"] = f'"{sha256(body)[:32]}"'
        if request.path_params["path"].startswith("archives/"):
            headers["cache-control"] = _LASTING
    known = request.headers.get("if-none-match", "")
    if status == 200 and headers["etag"] in [one.strip() for one in known.split(",")]:
        return Response(status_code=304, headers=headers)
    return Response(body, status, headers, media_type)
