"""A repository behind HTTP: any web server that gives out the index and the archives."""

import asyncio
import ssl
from collections.abc import Container, Coroutine, Mapping
from functools import cache
from typing import Final, NamedTuple

import httpx2

from urc.packages.index import Entry
from urc.packages.names import PackageError
from urc.packages.package import sha256

__all__ = ["Answer", "ask", "fetch_archive", "put", "repository_url"]

_CONNECT_S: Final = 5.0
_READ_S: Final = 10.0
_TOTAL_S: Final = 120.0
"""For one file, however slowly it drips."""
_ANSWER_BYTES: Final = 65536
_CHECKED_S: Final = 90.0
"""In which a repository must have checked what was sent to it."""


class Answer(NamedTuple):
    """What a server gave."""

    status: int
    """200; 304: nothing has changed; 404: there is none, where that may be."""
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


def ask(
    url: str, most: int, etag: str = "", total_s: float = _TOTAL_S, *, may_lack: bool = False
) -> Answer:
    """Return what a server has under an address, at most `most` bytes.

    Args:
        url: the address; redirects are not followed.
        most: bytes that are taken.
        etag: of what is here already.
        total_s: for all of it.
        may_lack: any other answer means that there is none: not every server says 404.

    Raises:
        PackageError: it does not answer, stalls, sends too much, or something else.
    """
    headers = {"if-none-match": etag} if etag else {}
    accepted: Container[int] = {200, 304} if etag else {200}
    if may_lack:
        accepted = range(200, 600)
    return asyncio.run(_within(url, _exchange("GET", url, headers, b"", most, accepted), total_s))


def put(url: str, body: bytes, headers: Mapping[str, str], total_s: float = _TOTAL_S) -> Answer:
    """Send something to an address, and return what is answered, whatever that is.

    Raises:
        PackageError: it does not answer, or stalls.
    """
    sent = _exchange("PUT", url, headers, body, _ANSWER_BYTES, range(200, 600))
    return asyncio.run(_within(url, sent, total_s))


async def _within(url: str, exchange: Coroutine[None, None, Answer], total_s: float) -> Answer:
    try:
        async with asyncio.timeout(total_s):
            return await exchange
    except TimeoutError:
        raise PackageError(f"{url}: not all of it came within {total_s:g} s") from None
    except httpx2.ConnectTimeout:
        raise PackageError(f"{url}: no answer within {_CONNECT_S:g} s") from None
    except httpx2.TimeoutException:
        raise PackageError(f"{url}: the server fell silent") from None
    except (httpx2.HTTPError, httpx2.InvalidURL, OSError) as error:
        reason = str(error) or type(error).__name__
        raise PackageError(f"{url}: {reason}") from None


@cache
def _trust() -> ssl.SSLContext:
    """Return who is believed to speak for a host: read once, for an index asks many times."""
    return httpx2.create_ssl_context()


async def _exchange(
    method: str,
    url: str,
    headers: Mapping[str, str],
    body: bytes,
    most: int,
    accepted: Container[int],
) -> Answer:
    # Not compressed: what comes is then never more than what was sent.
    asked = {"accept-encoding": "identity", **headers}
    timeout = httpx2.Timeout(_CHECKED_S if body else _READ_S, connect=_CONNECT_S)
    async with (
        httpx2.AsyncClient(verify=_trust(), timeout=timeout, follow_redirects=False) as client,
        client.stream(method, url, headers=asked, content=body or None) as response,
    ):
        status = response.status_code
        if status not in accepted:
            raise PackageError(f"{url}: the server answers {status}, not 200")
        if method == "GET" and status != 200:
            return Answer(status if status == 304 else 404, "", b"")
        if response.headers.get("content-encoding", "identity") != "identity":
            raise PackageError(f"{url}: the server compresses, which it was not asked to")
        content = bytearray()
        async for piece in response.aiter_raw():
            content += piece
            if len(content) > most:
                raise PackageError(f"{url}: more than the {most} bytes that are expected")
        return Answer(status, response.headers.get("etag", ""), bytes(content))
