"""A robot that moves and has a camera: whatever the camera does, letting go stops the robot."""

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Final

import pytest

import urc
from tests.e2e.ports import free_port
from tests.e2e.transports.programs import program
from tests.e2e.transports.test_camera import FILM, H264, readers
from urc.client import ConnectedRobot, MotionEnded

pytestmark = [pytest.mark.anyio, pytest.mark.needs("ffmpeg")]

WAIT_S: Final = 30.0
PROFILE: Final = """\
urc: 1
kind: robot
name: cart
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: {wire}
    framing: {{ type: delimiter, tx: LF, rx: LF }}
  eye: {{ type: camera, url: "udp://127.0.0.1:{eye}" }}
signals:
  picture: {{ type: video, stale_after: 2s }}
messages:
  picture: {{ from: eye, raw: picture }}
commands:
  drive:
    to: wire
    args: {{ speed: {{ type: number, min: -1, max: 1 }} }}
    send: "V {{{{ speed }}}}"
    hold: {{ repeat: 50ms, release: {{ speed: 0 }} }}
"""


@pytest.fixture(autouse=True)
def data(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """STOP is latched in the data folder."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path / "data"))


class Cart:
    """Keeps what it is told, with the time."""

    def __init__(self) -> None:
        self.heard: list[tuple[float, str]] = []
        self.writers: list[asyncio.StreamWriter] = []

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Listen until the line ends."""
        self.writers.append(writer)
        with suppress(ConnectionError):
            while line := await reader.readline():
                self.heard.append((asyncio.get_running_loop().time(), line.decode().strip()))
        writer.close()

    async def close(self) -> None:
        """Close the lines, which the end of the test would leave open."""
        for writer in self.writers:
            writer.close()
            with suppress(ConnectionError):
                await writer.wait_closed()

    async def until(self, count: int, word: str) -> None:
        """Wait for a word after the first `count` ones."""
        async with asyncio.timeout(WAIT_S):
            while word not in [text for _, text in self.heard[count:]]:  # noqa: ASYNC110
                await asyncio.sleep(0.01)


class Scene:
    """A cart with a camera, connected."""

    def __init__(self, cart: Cart, robot: ConnectedRobot, film: asyncio.subprocess.Process) -> None:
        self.cart = cart
        self.robot = robot
        self.film = film

    async def moves_and_stops(self) -> None:
        """Drive for a moment and let go: the newest word is the stop, and nothing follows."""
        count = len(self.cart.heard)
        async with self.robot.drive() as stick:
            await stick.hold(0.3, speed=0.5)
            await self.cart.until(count, "V 0.5")
        await self.cart.until(count, "V 0")
        await asyncio.sleep(0.4)
        assert self.cart.heard[-1][1] == "V 0"
        last_s = max(at_s for at_s, text in self.cart.heard if text == "V 0.5")
        first_s = min(at_s for at_s, text in self.cart.heard[count:] if text == "V 0")
        assert first_s - last_s < 2.0  # the tests of motion measure the lease

    async def pictures(self) -> None:
        """Wait for a new picture."""
        old = self.robot.latest("picture")
        async with asyncio.timeout(WAIT_S):
            while self.robot.latest("picture") in (None, old):  # noqa: ASYNC110
                await asyncio.sleep(0.02)


@asynccontextmanager
async def scene(folder: Path) -> AsyncIterator[Scene]:
    cart, eye, file = Cart(), free_port(), folder / "cart.yaml"
    listener = await asyncio.start_server(cart.serve, "127.0.0.1", 0)
    wire = listener.sockets[0].getsockname()[1]
    file.write_text(PROFILE.format(wire=wire, eye=eye), "utf-8")
    target = f"udp://127.0.0.1:{eye}?pkt_size=1316"
    async with (
        listener,
        program("ffmpeg", "-v", "error", *FILM, *H264, "-f", "mpegts", target) as film,
        urc.connect(file) as robot,
    ):
        it = Scene(cart, robot, film)
        await it.pictures()
        yield it
    await cart.close()


async def test_the_guard_has_no_camera_and_the_robot_stops_beside_one(tmp_path: Path) -> None:
    """The process of the camera belongs to this one, not to the guard."""
    async with scene(tmp_path) as it:
        assert len(readers()) == 1
        await it.moves_and_stops()
        await it.pictures()
    assert readers() == []


@pytest.mark.parametrize("what", ["camera stops", "camera dies", "process stops", "process dies"])
async def test_letting_go_stops_the_robot_whatever_the_camera_does(
    what: str, tmp_path: Path
) -> None:
    async with scene(tmp_path) as it:
        who = [it.film.pid] if what.startswith("camera") else readers()
        for process in who:
            os.kill(process, signal.SIGSTOP if what.endswith("stops") else signal.SIGKILL)
        await it.moves_and_stops()
        count = len(it.cart.heard)
        with suppress(MotionEnded):
            async with it.robot.drive() as stick:
                stick(speed=0.5)
                await it.cart.until(count, "V 0.5")
                await it.robot.stop()
                await asyncio.sleep(0.5)
        assert it.cart.heard[-1][1] == "V 0"
        assert it.robot.latched_by


async def test_a_lost_line_to_the_wheels_is_not_resumed_by_a_living_camera(tmp_path: Path) -> None:
    """Pictures go on; the robot is stopped on its new line, and moves only when driven anew."""
    async with scene(tmp_path) as it:
        count = len(it.cart.heard)
        with suppress(MotionEnded):
            async with it.robot.drive() as stick:
                stick(speed=0.5)
                await it.cart.until(count, "V 0.5")
                it.cart.writers[-1].transport.abort()
                await it.pictures()
                stick(speed=0.5)
                await asyncio.sleep(1.0)
        async with asyncio.timeout(WAIT_S):
            while len(it.cart.writers) < 2 or it.robot.state("wire") != "live":  # noqa: ASYNC110
                await asyncio.sleep(0.05)
        await asyncio.sleep(0.5)
        assert it.cart.heard[-1][1] == "V 0"
        await it.moves_and_stops()
