"""A repository behind HTTP: any web server that gives out `index.json` and the archives."""

import asyncio
from typing import Final, NamedTuple

import httpx2

from urc.packages.index import INDEX, INDEX_BYTES, Entry
from urc.packages.names import PackageError
from urc.packages.package import sha256

__all__ = ["Answer", "ask", "fetch_archive", "fetch_index", "repository_url"]

_CONNECT_S: Final = 5.0
_READ_S: Final = 10.0
_TOTAL_S: Final = 120.0
"""For one file, however slowly it drips."""


class Answer(NamedTuple):
    """What a server gave."""

    status: int
    """200, or 304: nothing has changed."""
    etag: str
    body: bytes


def repository_url(text: str) -> str:
    """Return the address of a repository as it is remembered; raise `PackageError`."""
    try:
        url = httpx2.URL(text)
    except httpx2.InvalidURL:
        url = httpx2.URL("")
    if url.scheme not in ("http", "https") or not url.host or url.userinfo or url.query:
        raise PackageError(f"{text!r} is no address of a repository, as http://192.168.1.5:8090/")
    return str(url.copy_with(fragment=None)).rstrip("/") + "/"


def fetch_index(url: str, etag: str = "") -> Answer:
    """Return a repository's index, or that it is still the one with `etag`."""
    return ask(url + INDEX, INDEX_BYTES, etag)


def fetch_archive(url: str, entry: Entry) -> bytes:
    """Return an archive with the bytes that the index promised; raise `PackageError`."""
    address = url + entry.file
    data = ask(address, entry.size).body
    if len(data) != entry.size or sha256(data) != entry.sha256:
        raise PackageError(
            f"{address}: these are not the bytes that the index names;"
            f" {len(data)} of {entry.size} came"
        )
    return data


def ask(url: str, most: int, etag: str = "", total_s: float = _TOTAL_S) -> Answer:
    """Return what a server has under an address, at most `most` bytes.

    Raises:
        PackageError: it does not answer, stalls, sends too much, or something else.
    """
    return asyncio.run(_within(url, most, etag, total_s))


async def _within(url: str, most: int, etag: str, total_s: float) -> Answer:
    try:
        async with asyncio.timeout(total_s):
            return await _ask(url, most, etag)
    except TimeoutError:
        raise PackageError(f"{url}: not all of it came within {total_s:g} s") from None
    except httpx2.ConnectTimeout:
        raise PackageError(f"{url}: no answer within {_CONNECT_S:g} s") from None
    except httpx2.TimeoutException:
        raise PackageError(f"{url}: the server fell silent for {_READ_S:g} s") from None
    except (httpx2.HTTPError, httpx2.InvalidURL, OSError) as error:
        reason = str(error) or type(error).__name__
        raise PackageError(f"{url}: {reason}") from None


async def _ask(url: str, most: int, etag: str) -> Answer:
    # Not compressed: what comes is then never more than what was sent.
    headers = {"accept-encoding": "identity"} | ({"if-none-match": etag} if etag else {})
    timeout = httpx2.Timeout(_READ_S, connect=_CONNECT_S)
    async with (
        httpx2.AsyncClient(timeout=timeout, follow_redirects=False) as client,
        client.stream("GET", url, headers=headers) as response,
    ):
        if etag and response.status_code == 304:
            return Answer(304, etag, b"")
        if response.status_code != 200:
            raise PackageError(f"{url}: the server answers {response.status_code}, not 200")
        if response.headers.get("content-encoding", "identity") != "identity":
            raise PackageError(f"{url}: the server compresses, which it was not asked to")
        body = bytearray()
        async for piece in response.aiter_raw():
            body += piece
            if len(body) > most:
                raise PackageError(f"{url}: more than the {most} bytes that are expected")
        return Answer(200, response.headers.get("etag", ""), bytes(body))
