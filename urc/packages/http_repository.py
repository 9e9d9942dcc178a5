"""HTTP access to a repository on any web server."""

import asyncio
import ssl
from collections.abc import Container, Coroutine, Mapping
from functools import cache
from typing import Final, NamedTuple

import httpx2

from urc.packages.index import IndexEntry
from urc.packages.names import PackageError
from urc.packages.package import sha256

__all__ = ["HttpResponse", "ask", "fetch_archive", "put", "repository_url"]

_CONNECT_S: Final = 5.0
_READ_S: Final = 10.0
_TOTAL_S: Final = 120.0
"""Timeout for the whole transfer of a file, in seconds."""
_ANSWER_BYTES: Final = 65536
_CHECKED_S: Final = 90.0
"""Timeout while the repository checks an upload, in seconds."""


class HttpResponse(NamedTuple):
    """A web server's response to a download or an upload."""

    status: int
    """Status code; a download returns only 200, 304 (unchanged file) or 404 (missing file)."""
    etag: str
    body: bytes


def repository_url(text: str) -> str:
    """Return a repository's normalized URL; raise `PackageError` if the URL is invalid."""
    try:
        url = httpx2.URL(text)
    except httpx2.InvalidURL:
        url = httpx2.URL("")
    if url.scheme not in ("http", "https") or not url.host or url.userinfo or url.query:
        raise PackageError(
            f"{text!r} is not the URL of a repository, such as http://192.168.1.5:8090/"
        )
    return str(url.copy_with(fragment=None)).rstrip("/") + "/"


def fetch_archive(url: str, entry: IndexEntry) -> bytes:
    """Return an archive after checking its digest; raise `PackageError` on failure."""
    address = url + entry.file
    data = ask(address, entry.size).body
    if len(data) != entry.size or sha256(data) != entry.sha256:
        raise PackageError(
            f"{address}: the archive does not match its digest in the index;"
            f" received {len(data)} of {entry.size} bytes"
        )
    return data


def ask(
    url: str, most: int, etag: str = "", total_s: float = _TOTAL_S, *, may_lack: bool = False
) -> HttpResponse:
    """Return the file at a URL; the file may have at most `most` bytes.

    Args:
        url: the file's URL; redirects are not followed.
        most: maximum size of the file, in bytes.
        etag: ETag of the local copy.
        total_s: timeout for the whole transfer, in seconds.
        may_lack: whether statuses other than 200 and 304 count as 404, because some servers never
            send 404.

    Raises:
        PackageError: the server is unreachable or slow, or its response is too large or invalid.
    """
    headers = {"if-none-match": etag} if etag else {}
    accepted: Container[int] = {200, 304} if etag else {200}
    if may_lack:
        accepted = range(200, 600)
    return asyncio.run(_within(url, _exchange("GET", url, headers, b"", most, accepted), total_s))


def put(
    url: str, body: bytes, headers: Mapping[str, str], total_s: float = _TOTAL_S
) -> HttpResponse:
    """Upload a file to a URL and return the response, regardless of its status.

    Raises:
        PackageError: the server is unreachable or slow.
    """
    sent = _exchange("PUT", url, headers, body, _ANSWER_BYTES, range(200, 600))
    return asyncio.run(_within(url, sent, total_s))


async def _within(
    url: str, exchange: Coroutine[None, None, HttpResponse], total_s: float
) -> HttpResponse:
    try:
        async with asyncio.timeout(total_s):
            return await exchange
    except TimeoutError:
        raise PackageError(f"{url}: the transfer was incomplete after {total_s:g} s") from None
    except httpx2.ConnectTimeout:
        raise PackageError(f"{url}: no response within {_CONNECT_S:g} s") from None
    except httpx2.TimeoutException:
        raise PackageError(f"{url}: the server stopped sending") from None
    except (httpx2.HTTPError, httpx2.InvalidURL, OSError) as error:
        reason = str(error) or type(error).__name__
        raise PackageError(f"{url}: {reason}") from None


@cache
def _trust() -> ssl.SSLContext:
    """Return a TLS context for all requests, which trusts the system's certificate authorities."""
    return httpx2.create_ssl_context()


async def _exchange(
    method: str,
    url: str,
    headers: Mapping[str, str],
    body: bytes,
    most: int,
    accepted: Container[int],
) -> HttpResponse:
    # Request no compression, so that the response cannot grow after the transfer.
    asked = {"accept-encoding": "identity", **headers}
    timeout = httpx2.Timeout(_CHECKED_S if body else _READ_S, connect=_CONNECT_S)
    async with (
        httpx2.AsyncClient(verify=_trust(), timeout=timeout, follow_redirects=False) as client,
        client.stream(method, url, headers=asked, content=body or None) as response,
    ):
        status = response.status_code
        if status not in accepted:
            raise PackageError(f"{url}: the server replied with status {status}, not 200")
        if method == "GET" and status != 200:
            return HttpResponse(status if status == 304 else 404, "", b"")
        if response.headers.get("content-encoding", "identity") != "identity":
            raise PackageError(f"{url}: the server compressed its response without being asked")
        content = bytearray()
        async for piece in response.aiter_raw():
            content += piece
            if len(content) > most:
                raise PackageError(f"{url}: the response is larger than the limit of {most} bytes")
        return HttpResponse(status, response.headers.get("etag", ""), bytes(content))
