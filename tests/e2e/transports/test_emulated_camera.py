"""Emulated cameras, seen by programs of others: FFmpeg's reader of UDP, and Debian's ffprobe."""

import asyncio
import json
import logging
import os
import signal
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

import av
import pytest

from tests.e2e.ports import free_port
from tests.e2e.robots.emulated import told
from tests.e2e.transports.encoders import WAIT_S, encoders, until_encoders
from urc.config.load import load_profile
from urc.runtime.registries import built_in_catalog
from urc.simulator.emulated_robot import EmulatedRobot
from urc.simulator.server import serve
from urc.simulator.servers import camera, camera_images
from urc.simulator.servers.base import ServerContext
from urc.simulator.servers.camera_datagrams import PROBE, DatagramReceiver
from urc.simulator.servers.video_encoder import EncodedUnit
from urc.transports.base import TransportSetup
from urc.transports.camera import from_setup
from urc.video import read_unit

pytestmark = pytest.mark.anyio

ROBOTS: Final = Path(__file__).parents[3] / "robots"


class Drone(NamedTuple):
    """The emulated Tello, and a socket that commands it."""

    robot: EmulatedRobot
    port: int
    """Port to which the drone sends its video."""
    line: socket.socket

    async def ask(self, word: str) -> str:
        """Send a command and return the reply."""
        loop = asyncio.get_running_loop()
        await loop.sock_sendall(self.line, word.encode())
        async with asyncio.timeout(WAIT_S):
            return (await loop.sock_recv(self.line, 1000)).decode()


@asynccontextmanager
async def drone() -> AsyncIterator[Drone]:
    """Emulate the Tello on free ports, but its video on a port that the test knows."""
    profile = load_profile(str(ROBOTS / "tello.yaml"), built_in_catalog())
    video_port = free_port()
    settings = {name: one.default for name, one in profile.settings.items()}
    settings |= {"command_port": 0, "state_port": free_port(), "video_port": video_port}
    robot = EmulatedRobot(profile, settings)
    async with serve(profile, settings, emulated_robot=robot) as places:
        assert places["camera"].port == video_port
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            line.setblocking(False)
            line.connect(("127.0.0.1", places["control"].port))
            yield Drone(robot, video_port, line)
    assert encoders() == []


@asynccontextmanager
async def bound(port: int) -> AsyncIterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", port))
        listener.setblocking(False)
        yield listener


async def datagram(listener: socket.socket) -> bytes:
    async with asyncio.timeout(WAIT_S):
        return await asyncio.get_running_loop().sock_recv(listener, 65_536)


def filmed(port: int, count: int) -> list[Any]:
    """Read images with the library's own reader of UDP and its own decoder."""
    limits = {"probesize": "50000", "analyzeduration": "300000"}
    with av.open(
        f"udp://127.0.0.1:{port}", format="h264", options=limits, timeout=WAIT_S
    ) as container:
        found = []
        for frame in container.decode(video=0):
            found.append(frame)
            if len(found) == count:
                break
        return found


def brightness(frame: Any) -> Any:
    return frame.to_ndarray(format="gray").astype(float)


async def test_the_library_reads_the_video_of_the_drone_and_sees_it_turn() -> None:
    """The present image each time, of the size in the profile."""
    async with drone() as one:
        assert await one.ask("command") == "ok"
        assert await one.ask("streamon") == "ok"
        before = await asyncio.to_thread(filmed, one.port, 15)
        assert {(frame.width, frame.height) for frame in before} == {(320, 240)}
        assert await one.ask("takeoff") == "ok"
        assert await one.ask("cw 90") == "ok"
        async with asyncio.timeout(WAIT_S):
            body = one.robot.body
            assert body is not None
            while abs(body.world.motion.yaw) < 1.0:  # noqa: ASYNC110 - the world has no event
                await asyncio.sleep(0.05)
        after = await asyncio.to_thread(filmed, one.port, 15)
        still = abs(brightness(before[-1]) - brightness(before[-5])).mean()
        turned = abs(brightness(after[-1]) - brightness(before[-1])).mean()
        assert turned > 10 * max(still, 0.5)


@pytest.mark.needs("ffmpeg")
async def test_ffprobe_reads_it() -> None:
    async with drone() as one:
        await one.ask("streamon")
        shown = "stream=codec_name,profile,width,height,has_b_frames:packet=flags"
        found = json.loads(
            await told(
                *("ffprobe", "-v", "error", "-of", "json", "-show_entries", shown),
                *("-read_intervals", "%+#25"),
                *("-f", "h264", f"udp://127.0.0.1:{one.port}"),
            )
        )
    (stream,) = found["streams"]
    assert stream["codec_name"] == "h264"
    assert stream["profile"] == "Constrained Baseline"
    assert (stream["width"], stream["height"], stream["has_b_frames"]) == (320, 240, 0)
    flags = [packet["flags"][0] for packet in found["packets"]]
    keys = [place for place, flag in enumerate(flags) if flag == "K"]
    assert len(flags) == 25
    assert len(keys) >= 2
    assert max(later - early for early, later in pairwise(keys)) <= 22


async def test_video_comes_only_between_streamon_and_streamoff() -> None:
    """No process encodes before; the datagrams are as long as those of the drone."""
    async with drone() as one, bound(one.port) as listener:
        await one.ask("command")
        assert await datagram(listener) == PROBE
        for _ in range(5):  # the drone lives
            await one.ask("battery?")
        assert encoders() == []
        await one.ask("streamon")
        sizes = [len(await datagram(listener)) for _ in range(60)]
        assert 1000 < max(sizes) <= 1460
        await until_encoders(1)
        await one.ask("streamoff")
        await until_encoders(0)
        with suppress(BlockingIOError):
            while listener.recv(65_536):
                pass
        await one.ask("battery?")
        with pytest.raises(BlockingIOError):
            listener.recv(65_536)


async def test_nothing_is_encoded_while_nobody_listens() -> None:
    """The first image for a new listener is a keyframe."""
    async with drone() as one:
        await one.ask("streamon")
        for _ in range(10):
            await one.ask("battery?")
            await asyncio.sleep(camera_images.IMAGE_EVERY_S)
        assert encoders() == []
        for _ in range(2):
            async with bound(one.port) as listener:
                pieces = [await datagram(listener) for _ in range(4)]
                assert pieces[0] == PROBE
                first = next(piece for piece in pieces if piece != PROBE)
                assert first[:5] == b"\0\0\0\1\x67"
            await until_encoders(0)


async def test_an_encoder_that_dies_is_replaced_and_delays_no_answer(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(camera_images, "RETRY_S", 0.5)
    async with drone() as one, bound(one.port) as listener:
        await one.ask("streamon")
        while await datagram(listener) == PROBE:
            pass
        (before,) = await until_encoders(1)
        with caplog.at_level(logging.WARNING):
            os.kill(before, signal.SIGKILL)
            async with asyncio.timeout(WAIT_S):
                while encoders() in ([], [before]):
                    assert await one.ask("battery?")
                    await asyncio.sleep(0.05)
        # asyncio may also tell that the system forgot the process meanwhile (CPython issue 87744).
        told_by_us = [one.getMessage() for one in caplog.records if one.name.startswith("urc.")]
        assert told_by_us == ["transport camera: the process that encodes the video has failed"]
        with suppress(BlockingIOError):
            while listener.recv(65_536):
                pass
        assert await datagram(listener)


async def test_urc_reads_it() -> None:
    """Each access unit with its size; a new connection begins with a keyframe."""
    async with drone() as one:
        await one.ask("streamon")
        options = {"url": f"udp://127.0.0.1:{one.port}", "host": "127.0.0.1"}
        transport = from_setup(TransportSetup("camera", options))
        for _ in range(2):
            await transport.open(10.0)
            try:
                async with asyncio.timeout(WAIT_S):
                    values = [await transport.receive() for _ in range(12)]
            finally:
                await transport.close()
            units = [read_unit(value) for value in values if isinstance(value, bytes)]
            assert units[0] is not None
            assert units[0].is_key
            assert {unit and unit[2:4] for unit in units} == {(320, 240)}


async def test_without_the_package_the_drone_flies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(camera, "has_encoder", lambda: False)
    profile = load_profile(str(ROBOTS / "tello.yaml"), built_in_catalog())
    settings = {name: one.default for name, one in profile.settings.items()}
    async with serve(profile, settings, is_anywhere=True) as places:
        assert places["camera"].text == "camera, without video: the package av is missing"
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            line.setblocking(False)
            line.connect(("127.0.0.1", places["control"].port))
            one = Drone(EmulatedRobot(profile, settings), 0, line)
            assert [await one.ask(word) for word in ("command", "streamon")] == ["ok", "ok"]


async def test_two_emulated_drones_send_to_ports_of_their_own() -> None:
    """Neither to the port of the real drone, as two demos on one computer."""
    profile = load_profile(str(ROBOTS / "tello.yaml"), built_in_catalog())
    settings = {name: one.default for name, one in profile.settings.items()}
    async with (
        serve(profile, settings, is_anywhere=True) as first,
        serve(profile, settings, is_anywhere=True) as second,
    ):
        ports = {first["camera"].port, second["camera"].port}
    assert len(ports) == 2
    assert 11111 not in ports


def received(listener: socket.socket) -> list[bytes]:
    """Return the datagrams that are there already; on one computer, they arrive at once."""
    found = []
    with suppress(BlockingIOError):
        while True:
            found.append(listener.recv(65_536))
    return found


@asynccontextmanager
async def receiver(fault: str) -> AsyncIterator[tuple[DatagramReceiver, socket.socket]]:
    """A port that listens, and what sends the images of a drone with a fault to it."""
    profile = load_profile(str(ROBOTS / "tello.yaml"), built_in_catalog())
    robot = EmulatedRobot(profile, {name: one.default for name, one in profile.settings.items()})
    if fault:
        robot.inject(fault, 0.0)
    port, spec = free_port(), profile.driver.transports["camera"]
    context = ServerContext(
        *("camera", spec, {}, "127.0.0.1", lambda: robot.line("camera"), lambda: 0.0)
    )
    sender = DatagramReceiver(context, port)
    try:
        async with bound(port) as listener:
            assert not sender.is_ready()
            assert received(listener) == [PROBE]
            assert sender.is_ready()
            yield sender, listener
    finally:
        sender.close()


@pytest.mark.parametrize(("size", "lengths"), [(3000, [1460, 1460, 80]), (2920, [1460, 1460, 1])])
async def test_the_last_datagram_of_an_image_is_shorter(size: int, lengths: list[int]) -> None:
    """By which programs for this drone know the end of an image."""
    data = b"\0\0\0\1\x41" + b"\x9a" * (size - 5)
    async with receiver("") as (sender, listener):
        sender.take(EncodedUnit(is_key=False, data=data))
        pieces = received(listener)
    assert [len(one) for one in pieces] == lengths
    assert b"".join(pieces).rstrip(b"\0") == data


async def test_a_loss_drops_datagrams_and_a_delay_keeps_their_order() -> None:
    data = [b"\0\0\0\1\x41" + bytes((number,)) * 29_000 for number in (1, 2)]
    async with receiver("loss=50%") as (sender, listener):
        sender.take(EncodedUnit(is_key=False, data=data[0]))
        assert 0 < len(received(listener)) < 20
    async with receiver("delay=50ms") as (sender, listener):
        for one in data:
            sender.take(EncodedUnit(is_key=False, data=one))
        assert received(listener) == []
        pieces = [await datagram(listener) for _ in range(40)]
    assert b"".join(pieces) == b"".join(data)


async def test_without_a_listener_probes_ask_again_and_again() -> None:
    async with receiver("") as (sender, listener):
        port = listener.getsockname()[1]
        listener.close()
        sender.take(EncodedUnit(is_key=False, data=b"\0\0\0\1\x41\x9a"))
        sender.needs_key = False
        assert not sender.is_ready()
        assert not sender.is_ready()
        assert sender.needs_key
        async with bound(port) as again:
            assert not sender.is_ready()
            assert received(again) == [PROBE]
            assert sender.is_ready()
