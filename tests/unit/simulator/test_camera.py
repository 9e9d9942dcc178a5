"""Emulated cameras: when they send video, who gets which image, and how it is encoded."""

import io
from pathlib import Path
from typing import Any

import av
import pytest
from PIL import Image

from tests.unit.simulator.test_simulated_body import profile_of
from urc._h264 import info_of, nal_units
from urc._image_encoders import KEYFRAME_EVERY_S
from urc.model.driver import TransportSpec
from urc.simulator.emulated_robot import EmulatedRobot
from urc.simulator.servers.base import ServerContext
from urc.simulator.servers.camera_images import KEPT_S, RETRY_S, CameraImages
from urc.simulator.servers.coloured_picture import picture
from urc.simulator.servers.video_encoder import EncodedUnit, EncoderFault
from urc.simulator.servers.video_process import ImageEncoder
from urc.video import read_unit

pytestmark = pytest.mark.anyio

DRONE = r"""
urc: 1
kind: robot
name: drone
transports:
  wire: { type: udp, host: 127.0.0.1, port: 1, encoding: ascii }
  eye: { type: camera, url: "udp://0.0.0.0:11111" }
  rear: { type: camera, url: "udp://0.0.0.0:11112" }
signals:
  x: { unit: m }
  front: { type: video }
  back: { type: video }
messages:
  x: { from: wire, regex: '^X (?P<x>[-0-9.]+)$' }
  front: { from: eye, raw: front }
  back: { from: rear, raw: back }
simulator:
  state: { streams: false }
  world:
    body: { type: differential }
    camera: { width: 64, height: 48 }
    signals: { x: "{{ world.x }}", front: "{{ world.picture if streams else none }}" }
  wire:
    - { match: '^on$', set: { streams: true }, send: ok }
    - { match: '^off$', set: { streams: false }, send: ok }
"""


@pytest.fixture
def drone(tmp_path: Path) -> EmulatedRobot:
    return EmulatedRobot(profile_of(tmp_path, DRONE), {})


def size_of(image: bytes | None) -> tuple[int, int]:
    assert image
    return Image.open(io.BytesIO(image)).size


def test_a_rule_starts_and_ends_the_video_of_the_world(drone: EmulatedRobot) -> None:
    """The menu shows the camera's image meanwhile, and no longer."""
    line = drone.line("wire")
    assert (drone.video("eye", 1.0), drone.camera(1.0)) == (None, None)
    assert line.receive(b"on", 2.0) == [b"ok"]
    assert size_of(drone.video("eye", 2.0)) == size_of(drone.camera(2.0)) == (64, 48)
    assert line.receive(b"off", 3.0) == [b"ok"]
    assert (drone.video("eye", 3.0), drone.camera(3.0)) == (None, None)


def test_a_camera_without_an_image_of_the_world_has_no_condition(drone: EmulatedRobot) -> None:
    """b"" asks for the image of one colour; no transport but a camera has a video."""
    assert drone.video("rear", 1.0) == b""
    assert drone.video("wire", 1.0) is None
    assert drone.video("elsewhere", 1.0) is None


@pytest.mark.parametrize("fault", ["silent", "dropout=front"])
def test_a_fault_ends_the_video(drone: EmulatedRobot, fault: str) -> None:
    drone.line("wire").receive(b"on", 1.0)
    drone.inject(fault, 1.0)
    assert drone.video("eye", 1.0) is None
    assert drone.video("rear", 1.0) == (None if fault == "silent" else b"")
    drone.mend()
    assert drone.video("eye", 2.0)


def test_the_line_of_a_camera_says_access_units(drone: EmulatedRobot) -> None:
    """Where no server encodes, as in the playground: never the world's JPEG image."""
    drone.line("wire").receive(b"on", 1.0)
    line = drone.line("eye")
    (said,) = line.advance(1.0, 2.0)
    assert isinstance(said, bytes)
    unit = read_unit(said)
    assert unit is not None
    assert unit.is_key
    info = info_of(unit.data, is_hevc=False)
    assert info == (unit.codec, unit.width, unit.height)
    assert sizes_of(decoded(unit.data)) == [(16, 16)]


# Who gets which image


class Encoder:
    """Notes what it is told to encode; every image that must be one becomes a keyframe."""

    def __init__(self) -> None:
        self.asked: list[tuple[bytes, bool]] = []
        self.closed = 0
        self.fault = ""

    async def encode(self, image: bytes, *, is_key: bool = False) -> EncodedUnit:
        if self.fault:
            raise EncoderFault(self.fault)
        self.asked.append((image, is_key))
        return EncodedUnit(is_key, b"unit %d" % len(self.asked))

    async def close(self) -> None:
        self.closed += 1


class Receiver:
    def __init__(self) -> None:
        self.needs_key = True
        self.ready = True
        self.taken: list[EncodedUnit] = []

    def is_ready(self) -> bool:
        return self.ready

    def take(self, image: EncodedUnit) -> None:
        self.taken.append(image)


class Desk:
    """The images of one camera, with a clock that the test moves."""

    def __init__(self, drone: EmulatedRobot) -> None:
        self.now_s = 100.0
        self.encoder = Encoder()
        self.image: bytes | None = b"jpeg"
        spec = TransportSpec("eye", "camera")
        context = ServerContext(
            *("eye", spec, {}, "127.0.0.1", lambda: drone.line("eye"), lambda: self.now_s),
            video=lambda: self.image,
        )
        encoder: Any = self.encoder
        self.images = CameraImages(context, encoder, lambda: self.now_s)

    async def after(self, seconds: float) -> int:
        """Let time pass and take one step; return how many images have been encoded so far."""
        self.now_s += seconds
        await self.images.step()
        return len(self.encoder.asked)


@pytest.fixture
def desk(drone: EmulatedRobot) -> Desk:
    return Desk(drone)


async def test_nothing_is_encoded_for_nobody(desk: Desk) -> None:
    """Nor while the robot sends no video; the process ends a while after the last image."""
    assert await desk.after(0.1) == 0
    one = Receiver()
    desk.images.receivers.add(one)
    assert await desk.after(0.1) == 1
    one.ready = False
    assert await desk.after(0.1) == 1
    one.ready, desk.image = True, None
    assert await desk.after(0.1) == 1
    assert desk.encoder.closed == 0
    assert await desk.after(KEPT_S) == 1
    assert desk.encoder.closed == 1


async def test_every_receiver_begins_with_a_keyframe_and_shares_the_images(desk: Desk) -> None:
    first, second = Receiver(), Receiver()
    desk.images.receivers.add(first)
    await desk.after(0.1)
    await desk.after(0.1)
    desk.images.receivers.add(second)
    await desk.after(0.1)
    await desk.after(0.1)
    assert [is_key for _, is_key in desk.encoder.asked] == [True, False, True, False]
    assert [one.data for one in first.taken] == [b"unit 1", b"unit 2", b"unit 3", b"unit 4"]
    assert [one.data for one in second.taken] == [b"unit 3", b"unit 4"]


async def test_a_camera_without_a_world_shows_one_colour(desk: Desk) -> None:
    desk.images.receivers.add(Receiver())
    desk.image = b""
    await desk.after(0.1)
    assert desk.encoder.asked == [(picture(desk.now_s), True)]


async def test_a_failed_encoder_rests_and_begins_again(
    desk: Desk, caplog: pytest.LogCaptureFixture
) -> None:
    """One line in the log, and no attempt for each image."""
    desk.images.receivers.add(Receiver())
    desk.encoder.fault = "the process that encodes the video has failed"
    await desk.after(0.1)
    desk.encoder.fault = ""
    assert await desk.after(RETRY_S - 1.0) == 0
    assert [one.getMessage() for one in caplog.records] == [
        "transport eye: the process that encodes the video has failed"
    ]
    assert await desk.after(1.0) == 1


# What the encoder makes of the images


def jpeg(colour: tuple[int, int, int], size: tuple[int, int] = (64, 48)) -> bytes:
    out = io.BytesIO()
    Image.new("RGB", size, colour).save(out, "JPEG")
    return out.getvalue()


def decoded(*units: bytes) -> list[Any]:
    """Decode with the library's own decoder."""
    decoder = av.CodecContext.create("h264", "r")
    return [
        *(frame for unit in units for frame in decoder.decode(av.Packet(unit))),
        *decoder.decode(None),
    ]


def sizes_of(frames: list[Any]) -> list[tuple[int, int]]:
    return [(frame.width, frame.height) for frame in frames]


class Clock:
    def __init__(self) -> None:
        self.now_s = 7.0

    def __call__(self) -> float:
        return self.now_s


def test_each_image_is_one_access_unit_at_once_in_order_and_in_its_colour() -> None:
    """No delay and no B-frames: otherwise the first calls would return nothing."""
    clock, colours = Clock(), [(200, 30, 30), (30, 200, 30), (30, 30, 200)]
    encoder = ImageEncoder(clock)
    units = []
    for colour in colours:
        is_key, unit = encoder.encode(jpeg(colour))
        assert is_key == (not units)
        units.append(unit)
        clock.now_s += 0.1
    frames = decoded(*units)
    assert sizes_of(frames) == [(64, 48)] * 3
    for frame, colour in zip(frames, colours, strict=True):
        seen = frame.to_ndarray(format="rgb24").mean(axis=(0, 1))
        assert abs(seen - colour).max() < 12


def test_a_keyframe_comes_each_second_or_when_it_is_asked_for() -> None:
    """With its parameter sets, so that a decoder can begin with it."""
    clock = Clock()
    encoder, keys = ImageEncoder(clock), []
    for number in range(25):
        is_key, unit = encoder.encode(jpeg((number, 99, 99)), is_key=number == 5)
        if is_key:
            keys.append(number)
            assert [nal[0] & 0x1F for nal in nal_units(unit) if nal[0] & 0x1F != 6] == [7, 8, 5]
            assert sizes_of(decoded(unit)) == [(64, 48)]
        clock.now_s += 0.125
    assert keys == [0, 5, 13, 21]
    assert KEYFRAME_EVERY_S == 1.0


def test_odd_and_changing_sizes_become_even_ones_from_a_keyframe_on() -> None:
    """A PNG image too, and whatever the clock does."""
    clock = Clock()
    encoder = ImageEncoder(clock)
    assert sizes_of(decoded(encoder.encode(jpeg((9, 9, 9), (65, 49)))[1])) == [(64, 48)]
    clock.now_s -= 3.0
    out = io.BytesIO()
    Image.new("RGB", (33, 21)).save(out, "PNG")
    is_key, unit = encoder.encode(out.getvalue())
    assert is_key
    assert sizes_of(decoded(unit)) == [(32, 20)]


def test_browsers_know_the_codec() -> None:
    """Constrained baseline, at a level that every decoder has."""
    info = info_of(ImageEncoder().encode(jpeg((9, 9, 9), (320, 240)))[1], is_hevc=False)
    assert info == ("avc1.42C00D", 320, 240)


def test_a_damaged_image_is_an_error_of_the_library() -> None:
    with pytest.raises(av.error.FFmpegError):
        ImageEncoder().encode(b"\xff\xd8no image")
