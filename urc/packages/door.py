"""The door through which packages come into a repository: one at a time, each with a token."""

import asyncio
import base64
import re
from collections.abc import Callable
from pathlib import Path
from typing import Final, TypeVar

import msgspec
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response

from urc.packages.archive import PACKAGE
from urc.packages.head import Seal
from urc.packages.intake import Refused, Taken, take
from urc.packages.names import FOLDERS, Key, PackageError
from urc.packages.notes import PROVENANCE, Provenance
from urc.packages.package import sha256
from urc.packages.signature import SIGNATURE, Signature
from urc.packages.tokens import Tokens

__all__ = ["Door"]

_HEADER_LONGEST: Final = 2048
_FILE: Final = re.compile(r"archives/([a-z]+)/([a-z][a-z0-9-]{0,63})/([0-9A-Za-z.-]{1,64})\.zip")
_WAITING_MOST: Final = 8
_Told = TypeVar("_Told", Signature, Provenance)
_HEADERS: Final = {"cache-control": "no-store", "x-content-type-options": "nosniff"}


class Door:
    """Takes `PUT archives/drivers/puppet/1.0.0.zip`, with `authorization: Bearer TOKEN`."""

    def __init__(
        self,
        folder: Path,
        tokens: Tokens,
        examine: Callable[[Path], list[str]],
        seal: Seal | None = None,
    ) -> None:
        self._folder = folder
        self._tokens = tokens
        self._examine = examine
        self._seal = seal
        self._turn = asyncio.Lock()
        self._waiting = 0

    async def answer(self, request: Request) -> Response:
        """Answer one request; 201 when it is listed now, 200 when it was before."""
        refusal: Refused | None = None
        key = None
        try:
            key = await self._admitted(request)
        except Refused as error:
            refusal = error
        try:
            # Also of one that is refused: who is still sending would not hear the answer.
            body = await _body(request, is_kept=refusal is None)
            if refusal is not None or key is None:
                raise refusal or Refused(404, "there is no such place")
            taken = await self._taken(request, body)
        except Refused as error:
            headers = {"www-authenticate": "Bearer"} if error.status == 401 else {}
            return _told(error.status, {"error": str(error)}, headers)
        except ClientDisconnect:
            return Response(status_code=400)
        except PackageError as error:
            return _told(503, {"error": str(error)})
        except OSError as error:
            return _told(507, {"error": f"it cannot be kept: {error.strerror or error}"})
        said = {"listed": str(taken.entry), "sha256": taken.entry.sha256}
        return _told(201 if taken.is_new else 200, said)

    async def _admitted(self, request: Request) -> Key:
        """Return what somebody may publish who shows this token; raise `Refused`."""
        scheme, _, text = request.headers.get("authorization", "").partition(" ")
        token = None
        if scheme.lower() == "bearer":
            try:
                token = await asyncio.to_thread(self._tokens.find, text.strip())
            except PackageError:  # a stranger is not told which file of the keeper's is damaged
                raise Refused(503, "the tokens of this repository cannot be read") from None
        if token is None:
            raise Refused(401, "a token of this repository is needed; its keeper gives one")
        found = _FILE.fullmatch(request.path_params["path"])
        if found is None or found[1] not in FOLDERS:
            raise Refused(404, "archives/drivers/NAME/VERSION.zip is expected")
        key = Key(FOLDERS[found[1]], found[2])
        if not token.allows(key):
            may = ", ".join(token.may)
            raise Refused(403, f"the token {token.name!r} may publish {may}, and not {key}")
        return key

    async def _taken(self, request: Request, body: bytes) -> Taken:
        signature = _header(request, SIGNATURE, Signature, "no signature")
        provenance = _header(request, PROVENANCE, Provenance, "nothing of where it was made")
        try:
            if provenance is not None:
                provenance.check()
        except PackageError as error:
            raise Refused(400, f"the header {PROVENANCE}: {error}") from None
        if self._waiting >= _WAITING_MOST:
            raise Refused(503, "too many packages are being published; try again")
        self._waiting += 1
        try:
            async with self._turn:
                # In a thread that ends by itself: who goes away does not leave half of anything.
                return await asyncio.shield(
                    asyncio.to_thread(
                        take,
                        self._folder,
                        request.path_params["path"],
                        body,
                        signature,
                        self._examine,
                        provenance,
                        self._seal,
                    )
                )
        finally:
            self._waiting -= 1


async def _body(request: Request, *, is_kept: bool) -> bytes:
    """Return what is sent, or nothing of it; raise `Refused` when it is too much."""
    size = 0
    pieces = []
    async for piece in request.stream():
        size += len(piece)
        if size > PACKAGE.archive_bytes:
            raise Refused(413, f"an archive has at most {PACKAGE.archive_bytes >> 20} MiB")
        if is_kept:
            pieces.append(piece)
    wanted = request.headers.get("urc-sha256", "")
    body = b"".join(pieces)
    if is_kept and wanted and sha256(body) != wanted:
        raise Refused(400, "what came is not what was sent; try again")
    return body


def _header(request: Request, name: str, kind: type[_Told], lacks: str) -> _Told | None:
    """Return what a header says as JSON in base64, None where there is none; raise `Refused`."""
    text = request.headers.get(name, "")
    if not text:
        return None
    try:
        if len(text) > _HEADER_LONGEST:
            raise ValueError
        return msgspec.json.decode(base64.b64decode(text, validate=True), type=kind)
    except (ValueError, msgspec.DecodeError):
        raise Refused(400, f"the header {name} holds {lacks}") from None


def _told(status: int, said: dict[str, str], headers: dict[str, str] | None = None) -> Response:
    return JSONResponse(said, status, headers=_HEADERS | (headers or {}))
