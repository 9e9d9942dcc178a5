"""Emulated cameras with RTSP, seen by ffprobe and URC, and asked by odd clients."""

import asyncio
import json
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final

import pytest

from tests.e2e.ports import free_port
from tests.e2e.robots.emulated import told
from tests.e2e.transports.encoders import WAIT_S, encoders, until_encoders
from urc.config.load import load_profile
from urc.problems import UrcError
from urc.runtime.registries import built_in_catalog
from urc.simulator.server import serve
from urc.transports.base import TransportSetup
from urc.transports.camera import from_setup
from urc.video import read_unit

pytestmark = pytest.mark.anyio

EYE: Final = """
urc: 1
kind: robot
name: eye
settings: {{ password: {{ type: string, secret: true, required: false }} }}
transports:
  eye:
    type: camera
    url: "rtsp://127.0.0.1:{port}/stream1"
    auth: {{ type: digest, user: viewer, password: "{{{{ settings.password }}}}" }}
  wire: {{ type: udp, host: 127.0.0.1, port: 9, encoding: ascii }}
signals:
  picture: {{ type: video }}
messages:
  picture: {{ from: eye, raw: picture }}
simulator:
  world:
    body: {{ type: differential }}
    camera: {{ width: 640, height: 480 }}
    signals: {{ picture: "{{{{ world.picture }}}}" }}
"""
PASSWORD: Final = "s3cret:x@"  # noqa: S105 - of the test's camera
LOGIN: Final = "viewer:s3cret%3Ax%40@"


@asynccontextmanager
async def rtsp_camera(folder: Path, *, has_login: bool = True) -> AsyncIterator[int]:
    """Emulate a camera with RTSP; give its port."""
    file, text = folder / "eye.yaml", EYE.format(port=free_port())
    lines = [one for one in text.splitlines(True) if has_login or "auth:" not in one]
    file.write_text("".join(lines), "utf-8")
    profile = load_profile(str(file), built_in_catalog())
    settings = {"password": PASSWORD}
    async with serve(profile, settings, is_anywhere=True) as places:
        yield places["eye"].port
    assert encoders() == []


@pytest.mark.needs("ffmpeg")
@pytest.mark.parametrize("over", ["tcp", "udp"])
async def test_ffprobe_reads_rtsp(over: str, tmp_path: Path) -> None:
    """With a password, in packets smaller than a keyframe."""
    async with rtsp_camera(tmp_path) as port:
        shown = "stream=codec_name,width,height:packet=flags,size"
        found = json.loads(
            await told(
                *("ffprobe", "-v", "error", "-of", "json", "-show_entries", shown),
                *("-read_intervals", "%+#15", "-rtsp_transport", over),
                f"rtsp://{LOGIN}127.0.0.1:{port}/stream1",
            )
        )
        assert found["streams"] == [{"codec_name": "h264", "width": 640, "height": 480}]
        keys = [int(one["size"]) for one in found["packets"] if one["flags"].startswith("K")]
        assert max(keys) > 2000
        await until_encoders(0)  # nobody plays the stream any longer


@pytest.mark.needs("ffmpeg")
@pytest.mark.parametrize(
    ("place", "words"),
    [("stream1", "401 Unauthorized"), ("elsewhere", "404 Not Found")],
)
async def test_a_wrong_password_or_path_is_refused(place: str, words: str, tmp_path: Path) -> None:
    async with rtsp_camera(tmp_path) as port:
        login = "viewer:guess@" if place == "stream1" else LOGIN
        url = f"rtsp://{login}127.0.0.1:{port}/{place}"
        process = await asyncio.create_subprocess_exec(
            *("ffprobe", "-v", "error", url), stderr=asyncio.subprocess.PIPE
        )
        async with asyncio.timeout(WAIT_S):
            _, said = await process.communicate()
        assert words in said.decode()
        assert encoders() == []


@pytest.mark.parametrize("rtp", ["tcp", "udp"])
async def test_urc_reads_rtsp_with_its_time_of_capture(rtp: str, tmp_path: Path) -> None:
    auth = {"type": "digest", "user": "viewer", "password": PASSWORD}
    async with rtsp_camera(tmp_path) as port:
        options = {"url": f"rtsp://127.0.0.1:{port}/stream1", "rtp": rtp, "auth": auth}
        transport = from_setup(TransportSetup("eye", options))
        await transport.open(10.0)
        try:
            async with asyncio.timeout(WAIT_S):
                values = [await transport.receive() for _ in range(25)]
        finally:
            await transport.close()
        units = [read_unit(value) for value in values if isinstance(value, bytes)]
        assert units[0] is not None
        assert units[0].is_key
        assert {unit and unit[2:4] for unit in units} == {(640, 480)}
        times = [unit.time_s for unit in units if unit is not None]
        assert times == sorted(times)


async def rtsp_says(port: int, *requests: bytes) -> bytes:
    """Send bytes to the camera; return all that it says until it or the client closes."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(b"".join(requests))
    writer.write_eof()
    async with asyncio.timeout(WAIT_S):
        said = await reader.read()
    writer.close()
    await writer.wait_closed()
    return said


async def test_odd_requests_are_answered_or_refused_and_harm_nobody(tmp_path: Path) -> None:
    """Reports between requests are skipped; what is no request ends the connection."""
    ask = b"OPTIONS rtsp://c/stream1 RTSP/1.0\r\nCSeq: 7\r\n\r\n"
    async with rtsp_camera(tmp_path) as port:
        said = await rtsp_says(port, b"$\x01\x00\x04abcd", ask, b"\r\n", ask)
        assert said.count(b"RTSP/1.0 200 OK\r\nCSeq: 7\r\nPublic: OPTIONS, DESCRIBE") == 2
        asked = b"DESCRIBE rtsp://c/stream1 RTSP/1.0\r\nCSeq: 1\r\n\r\n"
        assert (await rtsp_says(port, asked)).startswith(b"RTSP/1.0 401 Unauthorized\r\nCSeq: 1")
        odd = b"DESCRIBE rtsp://[::1/ RTSP/1.0\r\n\r\n"
        for bad in (
            b"GET / HTTP/1.1\r\n\r\n",
            odd,
            b"x" * 100_000,
            b"A: b\r\n" * 5000,
            b"\0\r\n\r\n",
        ):
            assert (await rtsp_says(port, bad)).startswith(b"RTSP/1.0 400 Bad Request")
        for cut in (b"OPT", b"$\x01\xff\xff", b""):
            assert await rtsp_says(port, cut) == b""
        assert encoders() == []
        assert (await rtsp_says(port, ask)).startswith(b"RTSP/1.0 200 OK")


def asked(method: str, *headers: str) -> bytes:
    head = [f"{method} rtsp://c/stream1 RTSP/1.0", "CSeq: 1", *headers, "", ""]
    return "\r\n".join(head).encode()


TCP: Final = "Transport: RTP/AVP/TCP;unicast;interleaved=2-3"
ORDERS: Final = [
    ([asked("PLAY")], [455]),
    ([asked("SETUP", "Transport: RTP/AVP;multicast;client_port=5000-5001")], [461]),
    ([asked("SETUP", "Transport: RTP/AVP;unicast;client_port=0-99999")], [461]),
    ([asked("SETUP", "Transport: RTP/AVP/TCP;interleaved=255-256")], [461]),
    ([asked("SETUP")], [461]),
    ([asked("SETUP", TCP), asked("SETUP", TCP)], [200, 455]),
    ([asked("SETUP", "Transport: RAW,RTP/AVP/TCP"), asked("PLAY", "Session: 1")], [200, 454]),
    ([asked("RECORD")], [501]),
    ([asked("DESCRIBE", "Content-Length: 4") + b"body", asked("OPTIONS")], [200, 200]),
    ([asked("TEARDOWN"), asked("OPTIONS")], [200]),
]


@pytest.mark.parametrize(("requests", "statuses"), ORDERS)
async def test_each_request_has_its_status(
    requests: list[bytes], statuses: list[int], tmp_path: Path
) -> None:
    """RFC 2326, 7.1.1 and A.1. A connection is closed after TEARDOWN."""
    async with rtsp_camera(tmp_path, has_login=False) as port:
        said = await rtsp_says(port, *requests)
    lines = [line for line in said.decode().split("\r\n") if line.startswith("RTSP/1.0 ")]
    assert [int(line.split()[1]) for line in lines] == statuses


async def test_a_client_on_its_own_channels_gets_a_report_and_then_a_keyframe(
    tmp_path: Path,
) -> None:
    """The stream begins with the parameter sets; after the client, nothing is encoded."""
    async with rtsp_camera(tmp_path, has_login=False) as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(asked("SETUP", TCP) + asked("PLAY"))
        async with asyncio.timeout(WAIT_S):
            head = await reader.readuntil(b"$\x03")  # the first report
            assert head.count(b"RTSP/1.0 200 OK") == 2
            assert b"Transport: RTP/AVP/TCP;unicast;interleaved=2-3" in head
            size = int.from_bytes(await reader.readexactly(2), "big")
            report = await reader.readexactly(size)
            assert report[:2] == b"\x80\xc8"
            channel, length = struct.unpack(">xBH", await reader.readexactly(4))
            first = await reader.readexactly(length)
            assert (channel, first[12] & 0x1F) == (2, 7)
        writer.close()
        await writer.wait_closed()
        await until_encoders(0)


async def test_a_camera_over_http_is_emulated_only_on_a_free_port(tmp_path: Path) -> None:
    """Without its password, which datagrams do not have."""
    file, text = tmp_path / "eye.yaml", EYE.format(port=554)
    text = text.replace("rtsp://127.0.0.1:554/stream1", "http://10.0.0.2/live.ts")
    file.write_text(text, "utf-8")
    profile = load_profile(str(file), built_in_catalog())
    settings = {"password": PASSWORD}
    with pytest.raises(UrcError) as refused:
        async with serve(profile, settings):
            pytest.fail("it is emulated")
    assert str(refused.value) == (
        "transports.eye.url: a camera is emulated at an rtsp:// or udp:// URL with a port, not at"
        " 'http://10.0.0.2/live.ts'"
    )
    async with serve(profile, settings, is_anywhere=True) as places:
        options = {**profile.driver.transports["eye"].options, **places["eye"].options}
        transport = from_setup(TransportSetup("eye", options))
        await transport.open(10.0)
        try:
            async with asyncio.timeout(WAIT_S):
                value = await transport.receive()
        finally:
            await transport.close()
    assert isinstance(value, bytes)
    assert read_unit(value) is not None
