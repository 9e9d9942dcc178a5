"""A camera that sends its images over RTSP and then is silent: the newest image does not wait."""

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Final

import pytest

from tests.unit.transports.rtp_packets import film, payloads_of, with_start_codes
from tests.unit.transports.test_rtsp_delimiters import SDP, framed, rtp
from urc.transports.base import TransportSetup
from urc.transports.camera import from_setup
from urc.video import read_unit

pytestmark = pytest.mark.anyio

WAIT_S: Final = 30.0
COUNT: Final = 60
"""Images in all; the marks of the first 30 must prove right."""
EVERY_S: Final = 0.02


@asynccontextmanager
async def camera(units: list[bytes], codec: bytes) -> AsyncIterator[int]:
    """Send each image once, at a steady rate, and keep the connection; give the port."""
    ended, left = asyncio.Event(), asyncio.Event()

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(ConnectionError, asyncio.IncompleteReadError):
            while True:
                asked = (await reader.readuntil(b"\r\n\r\n")).decode()
                writer.write(_reply(asked, codec))
                if asked.startswith("PLAY "):
                    await _play(writer, units, is_hevc=codec == b"H265")
                    await ended.wait()
                    break
        writer.transport.abort()
        left.set()

    async with await asyncio.start_server(talk, "127.0.0.1", 0) as server:
        try:
            yield server.sockets[0].getsockname()[1]
        finally:
            ended.set()
            await left.wait()


def _reply(asked: str, codec: bytes) -> bytes:
    number = re.search(r"CSeq: (\d+)", asked)
    assert number is not None
    head, body = f"RTSP/1.0 200 OK\r\nCSeq: {number[1]}\r\nSession: 7\r\n", b""
    if asked.startswith("DESCRIBE "):
        body = SDP % codec
        head += f"Content-Type: application/sdp\r\nContent-Length: {len(body)}\r\n"
    elif asked.startswith("SETUP "):
        head += "Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\n"
    return f"{head}\r\n".encode() + body


async def _play(writer: asyncio.StreamWriter, units: list[bytes], *, is_hevc: bool) -> None:
    number = 0
    for place, unit in enumerate(units):
        parts = payloads_of(unit, is_hevc=is_hevc)
        for index, part in enumerate(parts):
            is_last = index == len(parts) - 1
            writer.write(framed(rtp(number, 3000 * place, part, is_last=is_last)))
            number += 1
        await writer.drain()
        await asyncio.sleep(EVERY_S)


@pytest.mark.parametrize("codec", [b"H264", b"H265"])
async def test_the_newest_image_does_not_wait_for_the_next_one(codec: bytes) -> None:
    """All images arrive, byte for byte, although no packet follows the last one."""
    units = film(COUNT, is_hevc=codec == b"H265")
    async with camera(units, codec) as port:
        options = {"url": f"rtsp://127.0.0.1:{port}/eye"}
        transport = from_setup(TransportSetup("eye", options))
        await transport.open(10.0)
        try:
            async with asyncio.timeout(WAIT_S):
                values = [await transport.receive() for _ in units]
        finally:
            await transport.close()
    found = [read_unit(value) for value in values if isinstance(value, bytes)]
    assert [unit and unit.data for unit in found] == [with_start_codes(one) for one in units]
