"""Reads the body of an answer with a bound, and says in one line what a bad answer is about."""

import zlib
from http import HTTPStatus
from typing import Final

import httpx2

from urc.transports._faults import one_line
from urc.transports.http_client import HttpFault

__all__ = ["body_of", "complaint", "fault_of", "read_body"]

_COMPLAINT_BYTES: Final = 65536
_FORMATS: Final = {"gzip": 31, "x-gzip": 31, "deflate": 47}
"""Content-Encoding → what zlib calls it: gzip, or whichever of the two it is."""


async def read_body(response: httpx2.Response, max_bytes: int) -> bytes:
    """Return the whole body, unpacked.

    Raises:
        HttpFault: it is longer than `max_bytes`, packed or not, or packed in an unknown way.
    """
    too_long = f"the answer is longer than {max_bytes} bytes"
    if int(response.headers.get("content-length") or 0) > max_bytes:
        raise HttpFault(too_long)
    body = bytearray()
    async for piece in response.aiter_raw():
        body += piece
        if len(body) > max_bytes:
            raise HttpFault(too_long)
    packing = response.headers.get("content-encoding", "identity").strip().lower()
    if packing in ("identity", "") or not body:
        return bytes(body)
    if packing not in _FORMATS:
        raise HttpFault(f"the answer is packed as {packing[:40]!r}, which was not asked for")
    unpacker = zlib.decompressobj(_FORMATS[packing])
    try:
        # One byte more than is taken tells a longer one, and nothing is unpacked beyond it.
        plain = unpacker.decompress(body, max_bytes + 1)
    except zlib.error as fault:
        raise HttpFault(f"the answer is not {packing} as it says ({fault})") from fault
    if len(plain) > max_bytes:
        raise HttpFault(too_long)
    if not unpacker.eof:
        raise HttpFault("the answer was cut short")
    return plain


async def body_of(response: httpx2.Response, max_bytes: int) -> bytes:
    """Return the body of any answer; of a bad one what there is of it, and not more than 64 KiB.

    Raises:
        HttpFault: as `read_body`, of a good answer.
    """
    if response.status_code < HTTPStatus.MULTIPLE_CHOICES:
        return await read_body(response, max_bytes)
    try:
        return await read_body(response, min(max_bytes, _COMPLAINT_BYTES))
    except HttpFault:
        return b""  # its status says enough


async def fault_of(response: httpx2.Response) -> str:
    """Return why a stream does not begin, "" when it does; the body of a good one is not read."""
    if response.status_code < HTTPStatus.MULTIPLE_CHOICES:
        return ""
    return complaint(response, await body_of(response, _COMPLAINT_BYTES))


def complaint(response: httpx2.Response, body: bytes) -> str:
    """Return why an answer is none that can be used, "" when it can: status, and what it says."""
    target = response.headers.get("location")
    if 300 <= response.status_code < 400 and target is not None:
        return f"robot redirected to {one_line(target)}; redirects are not followed"
    if response.status_code < 400:
        return ""
    status = one_line(f"{response.status_code} {response.reason_phrase}")
    text = body.decode("utf-8", "replace")
    if "html" in response.headers.get("content-type", ""):
        return status  # a page for people, whose first line says nothing
    first = next((line for line in text.splitlines() if line.strip()), "")
    return f"{status}: {one_line(first)}" if first else status
