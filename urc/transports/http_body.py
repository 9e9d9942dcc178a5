"""Functions to read response bodies within a size limit and to describe error responses."""

import zlib
from http import HTTPStatus
from typing import Final

import httpx2

from urc.transports._faults import one_line
from urc.transports.http_client import HttpFault

__all__ = ["body_of", "complaint", "fault_of", "read_body"]

_COMPLAINT_BYTES: Final = 65536
_FORMATS: Final = {"gzip": 31, "x-gzip": 31, "deflate": 47}
"""zlib window bits for each Content-Encoding; the values select gzip or automatic detection."""


async def read_body(response: httpx2.Response, max_bytes: int) -> bytes:
    """Return a response's complete, decompressed body.

    Raises:
        HttpFault: the body exceeds `max_bytes` before or after decompression, or has an unknown
            encoding.
    """
    too_long = f"the response is longer than {max_bytes} bytes"
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
        raise HttpFault(f"the response has the encoding {packing[:40]!r}, which was not requested")
    unpacker = zlib.decompressobj(_FORMATS[packing])
    try:
        # Requesting one byte more than the limit reveals a longer body and bounds the
        # decompression.
        plain = unpacker.decompress(body, max_bytes + 1)
    except zlib.error as fault:
        raise HttpFault(f"the response is not valid {packing} ({fault})") from fault
    if len(plain) > max_bytes:
        raise HttpFault(too_long)
    if not unpacker.eof:
        raise HttpFault("the response ended too early")
    return plain


async def body_of(response: httpx2.Response, max_bytes: int) -> bytes:
    """Return the body of any response; read at most 64 KiB of an error response.

    Raises:
        HttpFault: the body of a successful response cannot be read; see `read_body`.
    """
    if response.status_code < HTTPStatus.MULTIPLE_CHOICES:
        return await read_body(response, max_bytes)
    try:
        return await read_body(response, min(max_bytes, _COMPLAINT_BYTES))
    except HttpFault:
        return b""  # the status is informative enough


async def fault_of(response: httpx2.Response) -> str:
    """Return a stream request's error, or "" on success; the body is read only on failure."""
    if response.status_code < HTTPStatus.MULTIPLE_CHOICES:
        return ""
    return complaint(response, await body_of(response, _COMPLAINT_BYTES))


def complaint(response: httpx2.Response, body: bytes) -> str:
    """Return the error message for a response, or "" on success."""
    target = response.headers.get("location")
    if 300 <= response.status_code < 400 and target is not None:
        return f"the robot redirected to {one_line(target)}; redirects are not followed"
    if response.status_code < 400:
        return ""
    status = one_line(f"{response.status_code} {response.reason_phrase}")
    text = body.decode("utf-8", "replace")
    if "html" in response.headers.get("content-type", ""):
        return status  # an HTML page, whose first line is not informative
    first = next((line for line in text.splitlines() if line.strip()), "")
    return f"{status}: {one_line(first)}" if first else status
