"""Videos on the page: ffmpeg films a stamped test card, and the stamp is read back from the page.

The stamp is the number of the image in ten black or white blocks. A number that grows proves that
the page shows the present, and its age must say so when it does not.
"""

import asyncio
import os
import signal
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.async_api import Page

from tests.e2e.conftest import PageMaker
from tests.e2e.drawn import PIXELS_OF
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess
from tests.e2e.transports.programs import program
from urc.web.feed.picture_line import LAST
from urc.wire.picture import PICTURE, VIDEO

pytestmark = [pytest.mark.anyio, pytest.mark.needs("ffmpeg")]

BITS: Final = 10
RATE: Final = 30
WAIT_S: Final = 40.0
PROFILE: Final = """\
urc: 1
kind: robot
name: eye
title: Eye
transports:
  eye: {{ type: camera, url: "udp://127.0.0.1:{port}"{more} }}
signals:
  picture: {{ type: video, stale_after: 2s }}
messages:
  picture: {{ raw: picture }}
widgets:
  camera: {{ use: camera, title: Front, bind: {{ image: picture }} }}
interfaces:
  default:
    grid: |
      camera
"""
READ: Final = f"""
() => {{
  const root = document.querySelector(".camera");
  const canvas = root.querySelector("canvas");
  if (canvas.width < 320) return null;
  const {{ width, height, data }} = ({PIXELS_OF})(canvas);
  const at = (x, y) => [...data.slice(4 * (y * width + x), 4 * (y * width + x) + 3)];
  let number = 0;
  for (let bit = 0; bit < {BITS}; bit += 1) number += at(16 + 32 * bit, 40)[1] > 128 ? 2 ** bit : 0;
  return {{
    number, width, height,
    colours: [0, 1, 2].map((place) => at(53 + 106 * place, 160)),
    state: root.dataset.state,
    isFrozen: root.dataset.frozen === "yes",
    age: root.querySelector(".camera-age").textContent,
  }};
}}
"""


def test_card(port: int, *codec: str) -> list[str]:
    """Return ffmpeg's command for a film of 320 by 240 pixels: stamp, red, green, blue."""
    bars = [
        f"drawbox=x={106 * place}:y=80:w=107:h=160:color={colour}:t=fill"
        for place, colour in enumerate(("red", "lime", "blue"))
    ]
    stamp = [
        f"drawbox=x={32 * bit}:y=0:w=32:h=80:color=white:t=fill"
        f":enable='gte(mod(n,{2 ** (bit + 1)}),{2**bit})'"
        for bit in range(BITS)
    ]
    film = f"color=black:s=320x240:r={RATE},{','.join([*bars, *stamp])}"
    target = f"udp://127.0.0.1:{port}?pkt_size=1316"
    source = ["-re", "-f", "lavfi", "-i", film, "-pix_fmt", "yuv420p"]
    return ["ffmpeg", "-v", "error", *source, *codec, "-g", "15", "-f", "mpegts", target]


test_card.__test__ = False  # type: ignore[attr-defined]  # no test, but a card for tests
H264: Final = ["-c:v", "libx264", "-preset", "ultrafast", "-tune", "zerolatency"]
H265: Final = ["-c:v", "libx265", "-preset", "ultrafast", "-x265-params", "log-level=none"]


@asynccontextmanager
async def filmed(
    folder: Path, urc_process: Callable[..., UrcProcess], *codec: str, more: str = ""
) -> AsyncIterator[tuple[str, asyncio.subprocess.Process]]:
    """Film the card and serve it; give the page's address, and ffmpeg.

    `more` contains further keys of the camera, such as ``, transcode: h264``.
    """
    port, file = free_port(), folder / "eye.yaml"
    file.write_text(PROFILE.format(port=port, more=more), "utf-8")
    data = str(folder / "data")
    async with program(*test_card(port, *(codec or H264))) as ffmpeg:
        server = urc_process("serve", str(file), "--port", "0", "--data-dir", data)
        found = await server.wait_for_async(r"(http://\S+)")
        yield f"{found[1]}robots/eye/", ffmpeg


async def card(page: Page, is_one: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Wait for a card on the page; return it."""
    seen: dict[str, Any] | None = None
    async with asyncio.timeout(WAIT_S):
        while seen is None or not is_one(seen):
            await asyncio.sleep(0.05)
            seen = await page.evaluate(READ)
    return seen


def kinds_of_frames(page: Page) -> list[int]:
    """Return the kinds of the binary messages that the page will receive."""
    kinds: list[int] = []
    begins = [True]

    def note(data: str | bytes) -> None:
        if isinstance(data, bytes):
            if begins[0]:
                kinds.append(data[1])
            begins[0] = bool(data[0] & LAST)

    page.on("websocket", lambda line: line.on("framereceived", note))
    return kinds


def is_live(seen: dict[str, Any]) -> bool:
    return seen["state"] == "live" and not seen["isFrozen"]


def assert_colours(seen: dict[str, Any]) -> None:
    """Red, green and blue, in this order and hardly changed."""
    for place, colour in enumerate(seen["colours"]):
        assert colour[place] > 200, seen
        assert sum(colour) - colour[place] < 120, seen


async def assert_moves(page: Page) -> None:
    """The stamp grows with the time: nothing is repeated, and nothing queued up."""
    await card(page, is_live)
    await asyncio.sleep(2.0)  # what waited meanwhile, in ffmpeg or in the decoder, comes in a burst
    first = await card(page, is_live)
    assert_colours(first)
    began_s = asyncio.get_running_loop().time()
    await asyncio.sleep(2.0)
    second = await card(page, is_live)
    passed_s = asyncio.get_running_loop().time() - began_s
    shown = (second["number"] - first["number"]) % 2**BITS
    assert abs(shown - RATE * passed_s) <= RATE / 2


async def test_the_stamp_is_read_back_and_a_frozen_camera_is_marked(
    tmp_path: Path, urc_process: Callable[..., UrcProcess], new_page: PageMaker
) -> None:
    """As for a JPEG: frozen after a second, stale after two, and live again by itself."""
    async with filmed(tmp_path, urc_process) as (address, ffmpeg):
        page = await new_page()
        await page.goto(address)
        await assert_moves(page)
        os.kill(ffmpeg.pid, signal.SIGSTOP)
        frozen = await card(page, lambda seen: bool(seen["isFrozen"]))
        assert "s old" in frozen["age"]
        await card(page, lambda seen: seen["state"] == "stale")
        os.kill(ffmpeg.pid, signal.SIGCONT)
        await assert_moves(page)


STUCK: Final = """
const Real = globalThis.Worker;
globalThis.Worker = class extends Real {
  kept = [];
  postMessage(...args) {
    if (globalThis.isStuck) this.kept.push(args);
    else for (const each of [...this.kept.splice(0), args]) super.postMessage(...each);
  }
};
"""


async def test_a_decoder_that_stands_still_is_marked(
    tmp_path: Path, urc_process: Callable[..., UrcProcess], new_page: PageMaker
) -> None:
    """Although the camera and the network go on."""
    async with filmed(tmp_path, urc_process) as (address, _):
        page = await new_page()
        await page.add_init_script(STUCK)
        await page.goto(address)
        await assert_moves(page)
        await page.evaluate("globalThis.isStuck = true")
        await card(page, lambda seen: seen["isFrozen"] and seen["state"] == "stale")
        await page.evaluate("globalThis.isStuck = false")
        await assert_moves(page)


async def test_two_pages_share_one_connection(
    tmp_path: Path, urc_process: Callable[..., UrcProcess], new_page: PageMaker
) -> None:
    """The second page begins with the last keyframe, long before the next one."""
    async with filmed(tmp_path, urc_process) as (address, _):
        pages = [await new_page(), await new_page()]
        for page in pages:
            await page.goto(address)
            await card(page, is_live)
        for page in pages:
            await assert_moves(page)


@pytest.mark.parametrize("lack", ["no decoder", "no H.265"])
async def test_a_page_that_cannot_decode_gets_jpeg_images(
    lack: str, tmp_path: Path, urc_process: Callable[..., UrcProcess], new_page: PageMaker
) -> None:
    """As on a page without HTTPS. Debian's Chromium has no decoder for H.265."""
    codec = H265 if lack == "no H.265" else H264
    async with filmed(tmp_path, urc_process, *codec) as (address, _):
        page = await new_page()
        if lack == "no decoder":
            await page.add_init_script("delete globalThis.VideoDecoder")
        kinds = kinds_of_frames(page)
        await page.goto(address)
        await assert_moves(page)
        assert kinds[-1] == PICTURE
        assert (VIDEO in kinds) == (lack == "no H.265")
