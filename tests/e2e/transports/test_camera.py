"""Cameras that others wrote: GStreamer's RTSP server, and ffmpeg over UDP and HTTP."""

import asyncio
import os
import signal
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from itertools import pairwise
from pathlib import Path
from typing import Final

import pytest

from tests.e2e.ports import free_port
from tests.e2e.transports.programs import listens, program
from tests.unit.test_video import baseline_sps
from urc.model.payload import Envelope
from urc.transports.base import ConnectFailed, PeerClosed, Transport, TransportSetup
from urc.transports.camera import from_setup
from urc.video import VideoUnit, read_unit

WAIT_S: Final = 30.0
PASSWORD: Final = "s3cret:x@"  # noqa: S105 - of the test's camera
SERVER: Final = str(Path(__file__).with_name("rtsp_server.py"))

pytestmark = [pytest.mark.anyio]
RTSP = pytest.mark.needs("rtsp-server")
FFMPEG = pytest.mark.needs("ffmpeg")


@asynccontextmanager
async def rtsp_camera(*login: str, size: str = "640x480", group: int = 15) -> AsyncIterator[int]:
    port = free_port()
    command = ["/usr/bin/python3", SERVER, str(port), size, str(group), *login]
    async with program(*command):
        await listens(port)
        yield port


@asynccontextmanager
async def line(**options: object) -> AsyncIterator[Transport]:
    """Open a line to a camera, and see to it that its process is gone afterwards."""
    transport = from_setup(TransportSetup("eye", options))
    try:
        await transport.open(10.0)
        yield transport
    finally:
        await transport.close()
        assert await left_readers() == []


async def left_readers() -> list[str]:
    """Return what the system says of the processes that a closed transport has left.

    A killed process ends when a busy machine gives it a turn, which may be after `close`.
    """
    for _ in range(250):
        if not readers():
            return []
        await asyncio.sleep(0.02)
    folders = [Path("/proc") / str(process) for process in readers()]
    return [_text(folder / "status").decode() for folder in folders]


def readers() -> list[int]:
    """Return the processes of cameras that this test has started."""
    return [
        int(folder.name)
        for folder in Path("/proc").iterdir()
        if folder.name.isdigit()
        if b"camera_process" in _text(folder / "cmdline") and _parent(folder) == os.getpid()
    ]


def _text(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError:
        return b""


def _parent(folder: Path) -> int:
    rest = _text(folder / "stat").rpartition(b")")[2].split()
    return int(rest[1]) if len(rest) > 1 and rest[0] != b"Z" else 0


async def unit(transport: Transport) -> VideoUnit:
    async with asyncio.timeout(WAIT_S):
        value = await transport.receive()
    assert isinstance(value, bytes)
    found = read_unit(value)
    assert found is not None
    return found


async def assert_streams(transport: Transport, width: int, height: int) -> None:
    """Groups of pictures arrive, each from its keyframe with parameter sets."""
    units = [await unit(transport) for _ in range(45)]
    assert units[0].is_key
    assert sum(one.is_key for one in units) >= 2
    assert {one[2:4] for one in units} == {(width, height)}
    assert {one.codec[:5] for one in units} == {"avc1."}
    assert all(b"\0\0\1\x67" in one.data for one in units if one.is_key)
    times = [one.time_s for one in units]
    assert_in_order(times)
    assert abs(times[-1] - asyncio.get_running_loop().time()) < 2.0


def assert_in_order(times: list[float]) -> None:
    """The times grow, as far as the microseconds of stated times of capture allow."""
    assert all(later > earlier - 1e-3 for earlier, later in pairwise(times))


async def reason(transport: Transport) -> str:
    """Return why the connection ends."""
    words = ""
    async with asyncio.timeout(WAIT_S):
        while not words:
            try:
                await transport.receive()
            except PeerClosed as told:
                words = str(told)
    assert "\n" not in words
    return words


@RTSP
@pytest.mark.parametrize("rtp", ["tcp", "udp"])
async def test_rtsp(rtp: str) -> None:
    async with rtsp_camera() as port, line(url=f"rtsp://127.0.0.1:{port}/cam", rtp=rtp) as eye:
        await assert_streams(eye, 640, 480)


@RTSP
@pytest.mark.parametrize("scheme", ["digest", "basic"])
async def test_rtsp_with_a_password(scheme: str) -> None:
    auth = {"type": scheme, "user": "viewer", "password": PASSWORD}
    async with rtsp_camera("viewer", PASSWORD, scheme) as port:
        async with line(url=f"rtsp://127.0.0.1:{port}/cam", auth=auth) as eye:
            await assert_streams(eye, 640, 480)
        wrong = {**auth, "password": "guess"}
        async with line(url=f"rtsp://127.0.0.1:{port}/cam", auth=wrong) as eye:
            assert await reason(eye) == "the camera refuses the user name or the password"


@RTSP
async def test_a_password_never_leaves_as_plain_text_if_the_document_says_digest() -> None:
    auth = {"type": "digest", "user": "viewer", "password": PASSWORD}
    async with (
        rtsp_camera("viewer", PASSWORD, "basic") as port,
        line(url=f"rtsp://127.0.0.1:{port}/cam", auth=auth) as eye,
    ):
        told = await reason(eye)
    assert told.startswith("the camera asks for the password as plain text")


class SlowLine:
    """A line to a server that delivers the server's bytes after a delay, which can grow."""

    def __init__(self, port: int) -> None:
        self._port = port
        self.delay_s = 0.0

    @asynccontextmanager
    async def opened(self) -> AsyncIterator[int]:
        server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        async with server:
            yield server.sockets[0].getsockname()[1]

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._port)
        loop = asyncio.get_running_loop()
        waiting: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue()

        async def forward() -> None:
            while data := await reader.read(65536):
                far_writer.write(data)

        async def back() -> None:
            while data := await far_reader.read(65536):
                waiting.put_nowait((loop.time(), data))

        async def deliver() -> None:
            while True:
                came_s, data = await waiting.get()
                await asyncio.sleep(came_s + self.delay_s - loop.time())
                writer.write(data)

        tasks = [asyncio.create_task(one()) for one in (forward, back, deliver)]
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        far_writer.close()
        writer.close()


@RTSP
async def test_images_that_wait_in_the_network_are_older_than_their_arrival() -> None:
    """By the sender reports of the server, of which the first comes after some seconds."""
    loop = asyncio.get_running_loop()

    async def oldest_s(eye: Transport, for_s: float) -> float:
        found, end_s = 0.0, loop.time() + for_s
        while (now_s := loop.time()) < end_s:
            found = max(found, now_s - (await unit(eye)).time_s)
        return found

    async with rtsp_camera() as port:
        slow = SlowLine(port)
        async with slow.opened() as via, line(url=f"rtsp://127.0.0.1:{via}/cam") as eye:
            await oldest_s(eye, 9.0)
            assert await oldest_s(eye, 2.0) < 0.6
            slow.delay_s = 1.5
            await oldest_s(eye, 2.5)
            assert 1.0 < await oldest_s(eye, 2.0) < 2.1


@RTSP
async def test_an_unknown_path() -> None:
    async with rtsp_camera() as port, line(url=f"rtsp://127.0.0.1:{port}/none") as eye:
        assert await reason(eye) == "the camera has no stream at this path of the url"


@RTSP
async def test_a_pause_ends_the_connection_and_a_viewer_opens_it_again() -> None:
    """A camera that nobody looks at costs nothing."""
    async with rtsp_camera() as port, line(url=f"rtsp://127.0.0.1:{port}/cam") as eye:
        await unit(eye)
        waiting = asyncio.create_task(eye.receive())
        await eye.send(Envelope("unsubscribe", {"topic": ""}))
        assert await left_readers() == []
        done, _ = await asyncio.wait((waiting,), timeout=1.0)
        assert not done or waiting.result()  # the unit that was on its way
        if done:
            waiting = asyncio.create_task(eye.receive())
        await eye.send(Envelope("subscribe", {"topic": ""}))
        async with asyncio.timeout(WAIT_S):
            value = await waiting
        assert isinstance(value, bytes)
        first = read_unit(value)
        assert first is not None
        assert first.is_key
        assert any([(await unit(eye)).is_key for _ in range(30)])


@RTSP
async def test_a_killed_process_ends_the_connection() -> None:
    """Whatever a stream does to the library, it happens in a process of its own."""
    async with rtsp_camera() as port, line(url=f"rtsp://127.0.0.1:{port}/cam") as eye:
        await unit(eye)
        for process in readers():
            os.kill(process, signal.SIGSEGV)
        assert await reason(eye) == "the process that reads the camera's stream has ended"
        await eye.open(10.0)
        await assert_streams(eye, 640, 480)


@RTSP
async def test_a_camera_that_stops_sending() -> None:
    async with rtsp_camera() as port, line(url=f"rtsp://127.0.0.1:{port}/cam") as eye:
        await unit(eye)
        for folder in Path("/proc").iterdir():
            if folder.name.isdigit() and f"rtsp_server.py\0{port}".encode() in _text(
                folder / "cmdline"
            ):
                os.kill(int(folder.name), signal.SIGSTOP)
        told = await reason(eye)
    assert told == f"camera rtsp://127.0.0.1:{port}/cam sent no image for 5 s"


async def test_a_redirect_to_another_host_is_not_followed() -> None:
    calls: list[str] = []

    async def serve(name: str, answer: bytes, port: int) -> asyncio.Server:
        async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            calls.append(name)
            with suppress(asyncio.IncompleteReadError):
                while await reader.readuntil(b"\r\n\r\n"):
                    writer.write(answer)
            writer.close()

        return await asyncio.start_server(talk, "127.0.0.1", port)

    here, other = free_port(), free_port()
    where = f"rtsp://127.0.0.1:{other}/cam"
    answer = f"RTSP/1.0 302 Found\r\nCSeq: 1\r\nLocation: {where}\r\n\r\n".encode()
    async with (
        await serve("first", answer, here),
        await serve("second", answer, other),
        line(url=f"rtsp://127.0.0.1:{here}/cam") as eye,
    ):
        told = await reason(eye)
    assert told.startswith(f"the camera redirects to {where}; URC follows no redirects")
    assert calls == ["first"]


async def test_nobody_there() -> None:
    port = free_port()
    with pytest.raises(ConnectFailed, match=r"nothing listens on 127\.0\.0\.1"):
        async with line(url=f"rtsp://127.0.0.1:{port}/cam"):
            pass


FILM: Final = ["-re", "-f", "lavfi", "-i", "testsrc2=s=320x240:r=30"]
H264: Final = ["-c:v", "libx264", "-preset", "ultrafast", "-tune", "zerolatency", "-g", "15"]
MP4: Final = ["-movflags", "frag_every_frame+empty_moov+default_base_moof", "-f", "mp4"]


@FFMPEG
@pytest.mark.parametrize("container", ["mpegts", "h264"])
async def test_udp(container: str) -> None:
    """MPEG-TS, and bare H.264 in datagrams of any size, as a Tello sends it."""
    port = free_port()
    target = f"udp://127.0.0.1:{port}?pkt_size={1316 if container == 'mpegts' else 1460}"
    async with (
        program("ffmpeg", "-v", "error", *FILM, *H264, "-f", container, target),
        line(url=f"udp://127.0.0.1:{port}") as eye,
    ):
        await assert_streams(eye, 320, 240)


@FFMPEG
async def test_udp_after_a_new_connection() -> None:
    """The port is free again as soon as the process has ended."""
    port = free_port()
    target = f"udp://127.0.0.1:{port}?pkt_size=1316"
    async with (
        program("ffmpeg", "-v", "error", *FILM, *H264, "-f", "mpegts", target),
        line(url=f"udp://127.0.0.1:{port}") as eye,
    ):
        await unit(eye)
        os.kill(readers()[0], signal.SIGKILL)
        assert await reason(eye) == "the process that reads the camera's stream has ended"
        await eye.open(10.0)
        await assert_streams(eye, 320, 240)


@FFMPEG
async def test_udp_from_another_host_is_ignored() -> None:
    port = free_port()
    here, there = "localaddr=127.0.0.1", "localaddr=127.0.0.2"
    target = f"udp://127.0.0.1:{port}?pkt_size=1316"
    film = [*FILM, *H264, "-f", "mpegts"]
    large = ["-re", "-f", "lavfi", "-i", "testsrc2=s=640x480:r=30", *H264, "-f", "mpegts"]
    async with (
        program("ffmpeg", "-v", "error", *large, f"{target}&{there}"),
        program("ffmpeg", "-v", "error", *film, f"{target}&{here}"),
        line(url=f"udp://127.0.0.1:{port}", host="localhost") as eye,
    ):
        await assert_streams(eye, 320, 240)


async def test_udp_at_a_port_of_another_program() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        with pytest.raises(ConnectFailed, match=rf"cannot listen on udp 127\.0\.0\.1:{port} "):
            async with line(url=f"udp://127.0.0.1:{port}"):
                pass


@FFMPEG
@pytest.mark.parametrize("container", [MP4, ["-f", "mpegts"]], ids=["mp4", "mpegts"])
async def test_http(container: list[str]) -> None:
    port = free_port()
    url = f"http://127.0.0.1:{port}/film"
    async with program("ffmpeg", "-v", "error", *FILM, *H264, *container, "-listen", "1", url):
        await listens(port)
        async with line(url=url) as eye:
            await assert_streams(eye, 320, 240)


@FFMPEG
async def test_a_codec_that_urc_does_not_know() -> None:
    port = free_port()
    film = [*FILM, "-c:v", "mpeg2video", "-f", "mpegts", f"udp://127.0.0.1:{port}?pkt_size=1316"]
    async with program("ffmpeg", "-v", "error", *film), line(url=f"udp://127.0.0.1:{port}") as eye:
        assert await reason(eye) == (
            "the camera sends mpeg2video; URC passes on H.264 and H.265: select one of them in the"
            " camera's settings, or write transcode: h264"
        )


async def test_a_gigantic_size_and_a_process_with_bounded_memory() -> None:
    """A hostile stream of 30,000 by 30,000 pixels."""
    port = free_port()
    image = (
        baseline_sps(30_000, 30_000) + b"\0\0\0\1\x68\xce\x38\x80" + b"\0\0\0\1\x65" + bytes(999)
    )
    async with line(url=f"udp://127.0.0.1:{port}", host="127.0.0.1") as eye:
        loop = asyncio.get_running_loop()
        sender, _ = await loop.create_datagram_endpoint(
            asyncio.DatagramProtocol, remote_addr=("127.0.0.1", port)
        )

        async def flood() -> None:
            while True:
                sender.sendto(image.replace(b"\0" * 9, b"\1" * 9))
                await asyncio.sleep(0.002)

        flooding = asyncio.create_task(flood())
        try:
            told = await reason(eye)
        finally:
            flooding.cancel()
            sender.close()
    assert told.startswith("the camera sends images of 30000 by 30000 pixels; the limit is")
