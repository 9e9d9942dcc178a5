"""Map tiles and the files that a robot's documents list in widget options.

Layer 5. A URL contains either a key of a table in the loaded profile, or the three numbers of a
tile. Text from a browser never becomes part of a path. Third-party pages are looked up in the same
way; ``external_pages.py`` builds the documents around them.
"""

import hashlib
from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path
from urllib.parse import quote

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, Response

from urc.model.interface import WidgetUse
from urc.model.profile import Profile

__all__ = ["TILE_TYPES", "linked_options", "page_key", "picture", "robot_file", "tile"]

MEDIA_TYPES = {
    ".urdf": "application/xml",
    ".dae": "application/xml",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".webp": "image/webp",
    ".gif": "image/gif",
    ".json": "application/json",
    ".wav": "audio/wav",
    ".mp3": "audio/mpeg",
    ".ogg": "audio/ogg",
    **dict.fromkeys((".md", ".txt", ".csv"), "text/plain; charset=utf-8"),
}
"""Media types, keyed by file suffix; files with other suffixes are sent as plain bytes."""

TILE_TYPES = {"png": "image/png", "jpg": "image/jpeg", "jpeg": "image/jpeg", "webp": "image/webp"}
DEEPEST_ZOOM = 25

EMPTY_TILE = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010804000000b51c0c020000"
    "000b49444154789c636060000000030001b8ad3a630000000049454e44ae426082"
)
"""A transparent pixel in place of missing tiles, so that lower layers remain visible."""


def linked_options(use: WidgetUse, robot: str) -> dict[str, object]:
    """Return a widget's options for the page, with URLs in place of file names.

    A third-party page's URL is replaced by the URL of the document that frames the page.
    """
    files = {name: _url(robot, name, place) for name, place in use.files.items()}
    options = {name: _linked(value, files) for name, value in use.options.items()}
    for name, pages in use.pages.items():
        options[name] = _linked(use.options[name], {url: _framed(robot, url) for url in pages})
    return options


def _linked(value: object, urls: Mapping[str, str]) -> object:
    if isinstance(value, str):
        return urls.get(value, value)
    return [_linked(each, urls) for each in value] if isinstance(value, (list, tuple)) else value


def _url(robot: str, name: str, place: str) -> str:
    return f"/robots/{quote(robot, safe='')}/files/{quote(_key(name, place))}"


def _framed(robot: str, url: str) -> str:
    return f"/robots/{quote(robot, safe='')}/framed/{page_key(url)}"


def page_key(url: str) -> str:
    """Return a third-party page's key, used in the URL of its frame document."""
    return hashlib.blake2b(url.encode(), digest_size=8).hexdigest()


def _key(name: str, place: str) -> str:
    # The digest distinguishes files with the same name. The path follows the digest, because models
    # refer to their parts by path.
    return f"{hashlib.blake2b(place.encode(), digest_size=6).hexdigest()}/{name}"


def robot_file(profile: Profile, key: str, request: Request) -> Response:
    """Return a file that the profile lists for a widget; raise status 404 for any other key."""
    uses = profile.uses()
    table = {_key(name, place): place for use in uses for name, place in use.files.items()}
    if key not in table:
        raise HTTPException(404)
    place = Path(table[key])
    return _served(
        place, MEDIA_TYPES.get(place.suffix.lower(), "application/octet-stream"), request
    )


def picture(profile: Profile, request: Request) -> Response:
    """Return the robot's picture; raise status 404 if the file is missing."""
    place = Path(profile.picture)
    return _served(place, MEDIA_TYPES[place.suffix.lower()], request)


def tile(folder: Path, z: int, x: int, y: int, kind: str, request: Request) -> Response:
    """Return a map tile from ``folder/z/x/y.kind``; for a missing file, a transparent tile.

    Raises:
        HTTPException: 404 if a number is out of range or the media type is unknown.
    """
    if kind not in TILE_TYPES or not 0 <= z <= DEEPEST_ZOOM or not (0 <= x < 2**z > y >= 0):
        raise HTTPException(404)
    place = folder / str(z) / str(x) / f"{y}.{kind}"
    if not place.is_file():
        return Response(EMPTY_TILE, media_type="image/png", headers={"cache-control": "no-cache"})
    return _served(place, TILE_TYPES[kind], request)


def _served(place: Path, media_type: str, request: Request) -> Response:
    try:
        found = place.stat()
    except OSError as error:
        raise HTTPException(404) from error
    request.state.is_file = True
    tag = f'"{found.st_mtime_ns:x}-{found.st_size:x}"'
    headers = {"etag": tag, "cache-control": "no-cache"}
    if tag in request.headers.get("if-none-match", ""):
        return Response(status_code=HTTPStatus.NOT_MODIFIED, headers=headers)
    return FileResponse(place, media_type=media_type, headers=headers, stat_result=found)
