"""Transcoded videos, and a camera of this computer, on a page in Chromium.

No V4L2 device is needed: ffmpeg writes the test card into a pipe that the library reads in its
place, with the same code from the process to the page.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Final

import pytest

from tests.e2e.conftest import PageMaker
from tests.e2e.motion.carts import served
from tests.e2e.processes import UrcProcess
from tests.e2e.test_video_page import (
    H264,
    H265,
    RATE,
    assert_colours,
    assert_moves,
    card,
    filmed,
    is_live,
    kinds_of_frames,
    test_card,
)
from tests.e2e.transports.programs import program
from urc.transports import camera_options, camera_transport
from urc.wire.picture import PICTURE, VIDEO

pytestmark = [pytest.mark.anyio, pytest.mark.needs("ffmpeg")]

MPEG4: Final = ["-c:v", "mpeg4", "-q:v", "3"]
WEBCAM: Final = """\
  eye: { type: camera, url: "v4l2://DEVICE", FORMAT }
signals:
  picture: { type: KIND, stale_after: 2s }
messages:
  picture: { from: eye, raw: picture }
widgets:
  camera: { use: camera, title: Front, bind: { image: picture } }
interfaces:
  default:
    grid: |
      camera
"""


@pytest.mark.parametrize("codec", [H265, MPEG4], ids=["H.265", "MPEG-4"])
async def test_a_codec_that_the_browser_lacks_is_shown_as_h264(
    codec: list[str],
    tmp_path: Path,
    urc_process: Callable[..., UrcProcess],
    new_page: PageMaker,
) -> None:
    """The page decodes H.264 by itself; the badge says that the video is transcoded."""
    more = ", transcode: h264"
    async with filmed(tmp_path, urc_process, *codec, more=more) as (address, _):
        page = await new_page()
        kinds = kinds_of_frames(page)
        await page.goto(address)
        await assert_moves(page)
        assert VIDEO in kinds
        assert PICTURE not in kinds
        text = await page.locator("body").text_content()
        assert "transcoded to H.264" in str(text)


@pytest.mark.parametrize(
    ("kind", "form", "codec", "demuxer"),
    [
        ("image", "rate: 30", ["-c:v", "mjpeg", "-q:v", "3", "-f", "mjpeg"], "mjpeg"),
        ("video", "format: h264", [*H264, "-f", "h264"], "h264"),
    ],
    ids=["mjpeg", "h264"],
)
async def test_a_camera_of_this_computer(
    kind: str,
    form: str,
    codec: list[str],
    demuxer: str,
    tmp_path: Path,
    new_page: PageMaker,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The right picture, and live: each image leaves the process at once."""
    pipe = tmp_path / "video0"
    os.mkfifo(pipe)
    monkeypatch.setattr(camera_options, "_DEVICE", camera_options.re.compile(".+"))
    monkeypatch.setattr(camera_transport, "DEVICE_FORMAT", demuxer)
    film = test_card(0)
    source = film[: film.index("-pix_fmt") + 2]
    text = WEBCAM.replace("DEVICE", str(pipe)).replace("FORMAT", form).replace("KIND", kind)
    async with (
        program(*source, *codec, "-g", "15", "-flush_packets", "1", "-y", str(pipe)),
        served(tmp_path, text) as (_, address),
    ):
        page = await new_page()
        await page.goto(address)
        first = await card(page, is_live)
        assert_colours(first)
        await card(page, lambda seen: is_live(seen) and seen["number"] > first["number"] + RATE)
