"""Videos in messages of the Foxglove SDK's server, on the page in a real browser.

The film is a test card with a stamp: the number of the image. A stamp that grows with the time
proves that the page shows the present.
"""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import av
import numpy as np
import pytest
from foxglove.channels import CompressedVideoChannel
from foxglove.messages import CompressedVideo, Timestamp
from numpy.typing import NDArray

from tests.e2e.conftest import PageMaker
from tests.e2e.processes import UrcProcess
from tests.e2e.test_video_page import BITS, assert_moves, card
from tests.e2e.transports.peers.foxglove import FoxgloveRobot
from tests.films import HEIGHT, RATE, WIDTH, encoder

pytestmark = pytest.mark.anyio

PROFILE = """\
urc: 1
kind: robot
name: filmer
title: Filmer
transports:
  ros: { type: ros, via: auto, host: 127.0.0.1, port: PORT }
signals:
  picture: { type: video, stale_after: 2s }
messages:
  film: { subscribe: { topic: /film, type: foxglove.CompressedVideo }, json: { picture: "@" } }
widgets:
  camera: { use: camera, title: Front, bind: { image: picture } }
interfaces:
  default: { grid: camera }
"""


def stamped_card(number: int) -> NDArray[np.uint8]:
    """Return the card that `tests.e2e.test_video_page` reads: stamp, red, green, blue."""
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    for place in range(3):
        image[80:, 106 * place : 106 * place + 107, place] = 255
    for bit in range(BITS):
        if number >> bit & 1:
            image[:80, 32 * bit : 32 * bit + 32] = 255
    return image


class Filmer:
    """A robot that films, and whose server can be restarted."""

    def __init__(self) -> None:
        self._open(0)
        self.port = self.robot.port
        self._encoder = encoder()
        self._began_s = time.monotonic()
        self._last = -1

    def _open(self, port: int) -> None:
        self.robot = FoxgloveRobot(port=port, encodings=("protobuf",))
        self._channel = CompressedVideoChannel("/film", context=self.robot.context)

    def restart(self) -> None:
        """Open a new server at the same port, after the end of the old one."""
        self._open(self.port)

    async def film(self) -> None:
        """Send the card of each moment until cancelled."""
        while True:
            number = int((time.monotonic() - self._began_s) * RATE)
            if number > self._last:
                self._last = number
                self._send(number)
            await asyncio.sleep(0.5 / RATE)

    def _send(self, number: int) -> None:
        frame = av.VideoFrame.from_ndarray(stamped_card(number), "rgb24")
        frame.pts = number
        at_s = time.time()
        stamp = Timestamp(sec=int(at_s), nsec=int(at_s % 1 * 1e9))
        for packet in self._encoder.encode(frame):
            self._channel.log(
                CompressedVideo(timestamp=stamp, frame_id="eye", data=bytes(packet), format="h264")
            )


@asynccontextmanager
async def filming() -> AsyncIterator[Filmer]:
    """Film for the length of the context."""
    filmer = Filmer()
    task = asyncio.create_task(filmer.film())
    try:
        yield filmer
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
        filmer.robot.close()


async def test_the_page_shows_the_film_of_messages_also_after_a_restart(
    tmp_path: Path, urc_process: Callable[..., UrcProcess], new_page: PageMaker
) -> None:
    file = tmp_path / "filmer.yaml"
    async with filming() as filmer:
        file.write_text(PROFILE.replace("PORT", str(filmer.port)), "utf-8")
        data = str(tmp_path / "data")
        server = urc_process("serve", str(file), "--port", "0", "--data-dir", data)
        address = (await server.wait_for_async(r"(http://\S+)"))[1]
        page = await new_page()
        await page.goto(f"{address}robots/filmer/")
        await assert_moves(page)
        filmer.robot.close()
        await card(page, lambda seen: seen["isFrozen"])
        filmer.restart()
        await assert_moves(page)
