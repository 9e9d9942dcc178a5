"""Videos on a slow line, in a real browser: the quality falls and rises, and the badge tells it.

The cameras are programs of others. The link between the page and the server has a rate.
"""

import asyncio
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.async_api import Page

from bench.rig.programs import Program, Relay
from tests.e2e.slow_line import SlowLine, page_on, slow_line
from tests.e2e.transports.test_camera import SERVER as RTSP_SERVER
from urc._h264 import info_of
from urc.runtime.recording.reader import open_recording
from urc.runtime.recording.videos import recorded_unit

pytestmark = [
    pytest.mark.anyio,
    pytest.mark.needs("chromium"),
    pytest.mark.skipif("sys.platform != 'linux'", reason="the rig is for Linux"),
]

SLOW_KBIT: Final = 900
READY_S: Final = 30.0
WAIT_S: Final = 60.0
HIGH_PORT, LOW_PORT = 8554, 8555
"""In a namespace of their own, so no other program has them."""
PROFILE: Final = """\
urc: 1
kind: robot
name: eye
title: Eye
transports:
  eye:
    type: camera
    {source}
signals:
  picture: {{ type: video, stale_after: 3s }}
messages:
  picture: {{ raw: picture }}
widgets:
  camera: {{ use: camera, title: Front, bind: {{ image: picture }} }}
interfaces:
  default:
    grid: |
      camera
"""
HIGH, LOW = (f"rtsp://127.0.0.1:{port}/cam" for port in (HIGH_PORT, LOW_PORT))
STREAMS: Final = f'streams: {{ high: "{HIGH}", low: "{LOW}" }}'
SEEN: Final = """
() => {
  const root = document.querySelector(".camera");
  return {
    width: root.querySelector("canvas").width,
    quality: root.dataset.quality ?? "",
    state: root.dataset.state,
    badge: root.querySelector(".camera-age").textContent,
  };
}
"""


def noise(port: int) -> list[str]:
    """Return ffmpeg's command for a film of 640 by 480 pixels that needs about 3 Mbit/s."""
    source = "testsrc2=size=640x480:rate=30,noise=alls=20:allf=t"
    codec = ["-c:v", "libx264", "-preset", "ultrafast", "-tune", "zerolatency", "-g", "30"]
    rate = ["-b:v", "3M", "-maxrate", "3M", "-bufsize", "1M", "-pix_fmt", "yuv420p"]
    target = ["-f", "mpegts", f"udp://127.0.0.1:{port}?pkt_size=1316"]
    return ["ffmpeg", "-v", "error", "-re", "-f", "lavfi", "-i", source, *codec, *rate, *target]


def rtsp_camera(port: int, size: str, kbit: int) -> list[str]:
    return ["/usr/bin/python3", RTSP_SERVER, str(port), size, "30", f"rate={kbit}"]


async def seen(page: Page, is_one: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Wait until the camera on the page is as wanted."""
    until_s = asyncio.get_running_loop().time() + WAIT_S
    found: dict[str, Any] = await page.evaluate(SEEN)
    while not is_one(found):
        assert asyncio.get_running_loop().time() < until_s, found
        await asyncio.sleep(0.05)
        found = await page.evaluate(SEEN)
    return found


def listening(relay: Relay, *ports: int) -> None:
    """Wait until programs listen on ports of the far side."""
    calls = "for port in sys.argv[1:]: socket.create_connection(('127.0.0.1', int(port)))"
    script = f"import socket, sys\n{calls}"
    until_s = time.monotonic() + READY_S
    while True:
        command = ["/usr/bin/python3", "-c", f"{script}\nprint('ready')", *map(str, ports)]
        with Program(command, inside=relay.inside("b")) as probe:
            probe.wait_until(lambda: not probe.is_running or bool(probe.lines), READY_S, "a probe")
            if "ready" in probe.lines:
                return
        assert time.monotonic() < until_s
        time.sleep(0.2)


@pytest.fixture
def one_stream(tmp_path: Path) -> Iterator[SlowLine]:
    file = tmp_path / "eye.yaml"
    file.write_text(PROFILE.format(source='url: "udp://127.0.0.1:5600"'), "utf-8")
    with slow_line(tmp_path, file, [noise(5600)], lambda _: None) as line:
        yield line


@pytest.fixture
def two_streams(tmp_path: Path) -> Iterator[SlowLine]:
    file = tmp_path / "eye.yaml"
    file.write_text(PROFILE.format(source=STREAMS), "utf-8")
    cameras = [
        rtsp_camera(HIGH_PORT, "640x480", 3000),
        rtsp_camera(LOW_PORT, "320x240", 250),
    ]
    ready = lambda relay: listening(relay, HIGH_PORT, LOW_PORT)  # noqa: E731
    with slow_line(tmp_path, file, cameras, ready) as line:
        yield line


def recorded(line: SlowLine) -> Path:
    """Record beside the page for some seconds."""
    target = line.folder / "eye.mcap"
    command = [sys.executable, "-m", "urc.cli.main", "record", str(line.folder / "eye.yaml")]
    command += ["--for", "4s", "-o", str(target)]
    with Program(command, inside=line.relay.inside("b")) as recorder:
        # The program may still be ending when its last line has arrived.
        recorder.wait_until(
            lambda: any("readings of" in one for one in recorder.lines), READY_S, "the recording"
        )
    return target


def sizes_of(file: Path) -> set[tuple[int, int]]:
    """Return the sizes of the images of a recorded video."""
    messages = (one for one in open_recording(file).messages(0) if one.topic == "/signals/picture")
    units = (recorded_unit(one.data) for one in messages)
    found = (info_of(one.data, is_hevc=False) for one in units if one is not None)
    return {(one.width, one.height) for one in found if one is not None}


@pytest.mark.needs("ffmpeg")
async def test_one_stream_becomes_keyframes_and_whole_again(one_stream: SlowLine) -> None:
    line = one_stream
    async with page_on(line) as page:
        await page.goto(f"{line.address}robots/eye/")
        await seen(page, lambda one: one["state"] == "live" and one["quality"] == "")
        line.set_rate(SLOW_KBIT)
        await seen(page, lambda one: one["quality"] == "keyframes")
        told = await seen(page, lambda one: "1 of 30 images" in one["badge"])
        assert told["state"] == "live"
        line.set_rate(0)
        await seen(page, lambda one: one["quality"] == "")
        await seen(page, lambda one: "images" not in one["badge"])


@pytest.mark.needs("rtsp-server")
async def test_the_low_stream_is_shown_on_a_slow_line_only(two_streams: SlowLine) -> None:
    """The badge names it, and a recording has the high one meanwhile."""
    line = two_streams
    async with page_on(line) as page:
        await page.goto(f"{line.address}robots/eye/")
        await seen(page, lambda one: one["width"] == 640 and one["quality"] == "")
        line.set_rate(SLOW_KBIT)
        told = await seen(page, lambda one: one["width"] == 320 and one["quality"] == "low")
        assert "Low stream" in told["badge"]
        assert sizes_of(await asyncio.to_thread(recorded, line)) == {(640, 480)}
        line.set_rate(0)
        await seen(page, lambda one: one["width"] == 640 and one["quality"] == "")
