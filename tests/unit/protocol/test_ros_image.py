"""Images in ROS messages: raw pixels of all formats, depths, and messages that lie."""

import io
import math
import struct
import sys
from base64 import b64encode
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from bench.rig.ros_messages import ROS2
from urc.config.load import load_profile
from urc.images import media_type
from urc.model.payload import Envelope
from urc.model.values import Signal
from urc.protocol.engine import Engine
from urc.protocol.events import Samples
from urc.protocol.framing.table import build_framing
from urc.protocol.values.convert import BadValue
from urc.protocol.values.decode import build_converter
from urc.protocol.values.ros_image import ENCODINGS, MAX_16_BIT_PIXELS, MAX_RAW_PIXELS
from urc.runtime.registries import built_in_catalog
from urc.simulator.auto import DefaultResponder
from urc.simulator.values import Values

WIDTH, HEIGHT = 128, 64
CLOSE = 6
"""Largest difference of a colour after JPEG."""


def message(encoding: str, data: Any, width: int = WIDTH, height: int = HEIGHT, **more: Any) -> Any:
    step = more.pop("step", len(data) // height)
    return {
        "header": {"frame_id": "camera"},
        "height": height,
        "width": width,
        "encoding": encoding,
        "is_bigendian": 0,
        "step": step,
        "data": data,
        **more,
    }


def converted(raw: object, **options: Any) -> bytes:
    found = build_converter(Signal("picture", "image", **options))(raw)
    assert isinstance(found, bytes)
    return found


def pixels(file: bytes) -> NDArray[Any]:
    return np.asarray(Image.open(io.BytesIO(file)))


def scene() -> NDArray[np.uint8]:
    """Return four fields of colours: red, green, blue and light grey."""
    made = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    made[: HEIGHT // 2, : WIDTH // 2] = 200, 30, 40
    made[: HEIGHT // 2, WIDTH // 2 :] = 20, 180, 60
    made[HEIGHT // 2 :, : WIDTH // 2] = 40, 50, 210
    made[HEIGHT // 2 :, WIDTH // 2 :] = 220, 220, 220
    return made


def middles(found: NDArray[Any]) -> list[list[int]]:
    """Return the colours in the middle of the four fields, far from the edges."""
    rows, columns = found.shape[:2]
    places = [(row * rows // 4, column * columns // 4) for row in (1, 3) for column in (1, 3)]
    return [np.atleast_1d(found[place]).astype(int).tolist() for place in places]


def near(found: NDArray[Any], wanted: NDArray[Any], by: int = CLOSE) -> bool:
    return bool(np.abs(np.array(middles(found)) - np.array(middles(wanted))).max() <= by)


@pytest.mark.parametrize("pad", [0, 7])
@pytest.mark.parametrize(
    ("encoding", "order"),
    [("rgb8", "rgb"), ("bgr8", "bgr"), ("8UC3", "bgr"), ("rgba8", "rgba"), ("bgra8", "bgra"),
     ("8UC4", "bgra")],
)  # fmt: skip
def test_colours_become_a_jpeg_with_the_same_colours(encoding: str, order: str, pad: int) -> None:
    planes = {**dict(zip("rgb", np.moveaxis(scene(), 2, 0), strict=True)), "a": scene()[..., 0]}
    packed = np.stack([planes[letter] for letter in order], axis=-1).reshape(HEIGHT, -1)
    padded = np.pad(packed, ((0, 0), (0, pad)), constant_values=255).tobytes()
    file = converted(message(encoding, padded))
    assert media_type(file) == "image/jpeg"
    assert pixels(file).shape == (HEIGHT, WIDTH, 3)
    assert near(pixels(file), scene())
    if pad:  # the last row need not be padded
        assert converted(message(encoding, padded[:-pad], step=packed.shape[1] + pad)) == file


@pytest.mark.parametrize("encoding", ["mono8", "8UC1"])
def test_grey_becomes_a_grey_jpeg(encoding: str) -> None:
    file = converted(message(encoding, scene()[..., 0].tobytes()))
    assert media_type(file) == "image/jpeg"
    assert near(pixels(file), scene()[..., 0])


@pytest.mark.parametrize("encoding", ["mono16", "16UC1"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_16_bits_stay_16_bits(encoding: str, order: str) -> None:
    values = np.random.default_rng(1).integers(0, 65536, (HEIGHT, WIDTH), dtype=np.uint16)
    data = values.astype(order + "u2").tobytes()
    file = converted(message(encoding, data, is_bigendian=int(order == ">")))
    assert media_type(file) == "image/png"
    assert (pixels(file) == values).all()


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("pad", [0, 4])
def test_metres_become_millimetres(order: str, pad: int) -> None:
    metres = np.random.default_rng(2).uniform(0, 65, (HEIGHT, WIDTH)).astype(np.float32)
    odd = [
        math.nan,
        math.inf,
        -math.inf,
        -1.0,
        0.0,
        65.535,
        70.0,
        3e38,
        -3e38,
        1e-30,
        0.0004,
        0.0006,
    ]
    metres[0, : len(odd)] = odd
    data = np.pad(metres.astype(order + "f4").view(np.uint8), ((0, 0), (0, pad))).tobytes()
    found = pixels(converted(message("32FC1", data, is_bigendian=int(order == ">"))))
    assert found[0, : len(odd)].tolist() == [0, 0, 0, 0, 0, 65535, 65535, 0, 0, 0, 0, 1]
    rest = np.floor(metres[1:].astype(np.float64) * 1000 + 0.5)
    assert np.abs(found[1:].astype(int) - rest).max() <= 1


def yuv(colours: NDArray[np.uint8]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Return Y, U and V by ITU-R BT.601 with the range of video (16 to 235 and 16 to 240)."""
    red, green, blue = np.moveaxis(colours.astype(float) / 255, 2, 0)
    luma = 0.299 * red + 0.587 * green + 0.114 * blue
    u = 128 + 224 * 0.5 * (blue - luma) / (1 - 0.114)
    v = 128 + 224 * 0.5 * (red - luma) / (1 - 0.299)
    return 16 + 219 * luma, u[:, ::2], v[:, ::2]


@pytest.mark.parametrize("pad", [0, 6])
@pytest.mark.parametrize(
    ("encoding", "places"),
    [("yuv422", (1, 0, 2)), ("uyvy", (1, 0, 2)), ("yuv422_yuy2", (0, 1, 3)), ("yuyv", (0, 1, 3))],
)
def test_yuv_is_that_of_video(encoding: str, places: tuple[int, int, int], pad: int) -> None:
    luma, u, v = yuv(scene())
    packed = np.zeros((HEIGHT, 2 * WIDTH + pad), np.uint8)
    packed[:, places[0] : 2 * WIDTH : 2] = luma.round()
    packed[:, places[1] : 2 * WIDTH : 4] = u.round()
    packed[:, places[2] : 2 * WIDTH : 4] = v.round()
    assert near(pixels(converted(message(encoding, packed.tobytes()))), scene())


@pytest.mark.parametrize("pad", [0, 5])
@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_a_bayer_pattern_becomes_colours_at_half_the_size(pattern: str, pad: int) -> None:
    made = np.zeros((HEIGHT, WIDTH + pad), np.uint8)
    for place, letter in enumerate(pattern):
        row, column = divmod(place, 2)
        made[row::2, column:WIDTH:2] = scene()[row::2, column::2, "rgb".index(letter)]
    found = pixels(converted(message(f"bayer_{pattern}8", made.tobytes())))
    assert found.shape == (HEIGHT // 2, WIDTH // 2, 3)
    assert near(found, scene())


def test_a_compressed_image_is_its_data() -> None:
    jpeg = b"\xff\xd8\xff\xe0 rest"
    for data in (jpeg, b64encode(jpeg).decode(), list(jpeg)):
        assert converted({"format": "rgb8; jpeg compressed bgr8", "data": data}) == jpeg


def test_a_compressed_depth_image_is_a_png_or_keeps_what_computes_its_depths() -> None:
    """16UC1 in millimetres needs no header; in 32FC1, the header has the two numbers."""
    png = b"\x89PNG\r\n\x1a\n rest"
    whole = struct.pack("<iff", 0, 100.0, 0.5) + png
    assert converted({"format": "16UC1; compressedDepth png", "data": whole}) == png
    assert converted({"format": "16UC1; compressedDepth", "data": png}) == png
    assert converted({"format": "32FC1; compressedDepth png", "data": whole}) == whole
    with pytest.raises(BadValue, match="a depth image compressed with RVL is not supported"):
        converted({"format": "16UC1; compressedDepth rvl", "data": whole})


RGB = message("rgb8", bytes(3 * WIDTH * HEIGHT))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"data": bytes(3 * WIDTH * HEIGHT - 1)},
         "an image of 128 by 64 pixels in rgb8, with rows of 384 bytes, needs 24576 bytes,"
         " found 24575"),
        ({"step": 383}, "an image of 128 by 64 pixels in rgb8, with rows of 383 bytes, needs 2457"),
        ({"step": 2**31}, "an image of 128 by 64 pixels in rgb8, with rows of 2147483648 "),
        ({"encoding": "rgba8"}, "an image of 128 by 64 pixels in rgba8, with rows of 384 bytes,"
         " needs 32768 bytes, found 24576"),
        ({"encoding": "bgr16"}, "the encoding 'bgr16' of an image is not supported"),
        ({"encoding": ["rgb8"]}, "the encoding .* of an image is not supported"),
        ({"width": 0}, "an image without pixels"),
        ({"width": 2**32 - 1, "height": 2**32 - 1},
         f"an image of 4294967295 by 4294967295 pixels in rgb8; the limit is {MAX_RAW_PIXELS}"),
        ({"width": 2000, "height": 2000, "encoding": "16UC1"},
         f"an image of 2000 by 2000 pixels in 16UC1; the limit is {MAX_16_BIT_PIXELS}"),
        ({"width": -1}, "width of the image: -1 is not a whole number"),
        ({"height": True}, "height of the image: true is not a whole number"),
        ({"encoding": "bayer_rggb8", "height": 63, "step": 128},
         "an image in bayer_rggb8 cannot have 128 by 63 pixels"),
        ({"encoding": "yuyv", "width": 127}, "an image in yuyv cannot have 127 by 64 pixels"),
        ({"data": "§"}, "'§' is not base64"),
    ],
)  # fmt: skip
def test_a_message_that_lies_is_one_clear_fault(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(BadValue, match=f"^{text}"):
        converted({**RGB, **changes})


@pytest.mark.parametrize("raw", [{}, {"data": "AAAA"}, {"format": "jpeg"}, 5])
def test_other_values_are_no_images(raw: object) -> None:
    with pytest.raises(BadValue, match="is neither bytes nor"):
        converted(raw)


def test_a_blob_is_no_message() -> None:
    with pytest.raises(BadValue, match="is neither bytes nor base64"):
        build_converter(Signal("dump", "blob"))(RGB)


def test_without_pillow_the_fault_names_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "PIL", None)
    with pytest.raises(BadValue, match=r"^raw images need the package pillow: .*install"):
        converted(RGB)


SIZES = st.integers(0, 9)


@given(
    st.sampled_from(sorted(ENCODINGS)), SIZES, SIZES, st.integers(0, 40), st.binary(max_size=300),
    st.sampled_from([0, 1, None, "x"]),
)  # fmt: skip
def test_any_message_is_an_image_or_one_fault(
    encoding: str, width: int, height: int, step: int, data: bytes, is_big: Any
) -> None:
    try:
        file = converted(
            message(encoding, data, width, height or 1, step=step, is_bigendian=is_big)
        )
    except BadValue:
        return
    assert pixels(file).size


def test_a_message_of_rosbags_arrives_over_foxglove(tmp_path: Path) -> None:
    file = tmp_path / "viewer.yaml"
    file.write_text(PROFILE, encoding="utf-8")
    engine = Engine(load_profile(file, built_in_catalog()).driver, {})
    engine.start("ros", 0.0)
    name, data = "sensor_msgs/msg/Image", np.frombuffer(scene().tobytes(), np.uint8)
    stamp = ROS2.types["builtin_interfaces/msg/Time"](1, 2)
    header = ROS2.types["std_msgs/msg/Header"](stamp, "camera")
    made = ROS2.types[name](header, HEIGHT, WIDTH, "rgb8", 0, 3 * WIDTH, data)
    said = {"topic": "/image", "encoding": "cdr"}
    text, _ = ROS2.generate_msgdef(name, ros_version=2)
    envelopes = [
        Envelope("definition", {**said, "type": name, "notation": "ros2msg"}, text),
        Envelope("message", said, bytes(ROS2.serialize_cdr(made, name))),
    ]
    events = [event for one in envelopes for event in engine.receive("ros", one, 1.0)]
    (sample,) = [one for event in events if isinstance(event, Samples) for one in event.samples]
    assert isinstance(sample.value, bytes)
    assert near(pixels(sample.value), scene())


def test_an_emulated_robot_sends_whole_messages(tmp_path: Path) -> None:
    """Without a world, a plausible image and a plausible cloud."""
    file = tmp_path / "viewer.yaml"
    file.write_text(PROFILE + CLOUD, encoding="utf-8")
    driver = load_profile(file, built_in_catalog()).driver
    values = Values(driver, {})
    framing = build_framing(driver.transports["ros"].framing)
    line = DefaultResponder(driver, {}, values).line("ros", framing, talks=True)
    engine = Engine(driver, {})
    engine.start("ros", 0.0)
    found = {}
    for name in ("image", "points"):
        for envelope in line.render(line.message(name), 1.0):
            for event in engine.receive("ros", envelope, 1.0):
                assert isinstance(event, Samples)
                found |= {one.signal: one.value for one in event.samples}
    assert found == {name: values.of(name, 1.0) for name in ("picture", "cloud")}


CLOUD = """\
  points:
    subscribe: { topic: /points, type: sensor_msgs/PointCloud2 }
    json: { cloud: "@" }
"""
PROFILE = """
urc: 1
kind: robot
name: viewer
transports: { ros: { type: ros, via: auto, host: 127.0.0.1, version: 2 } }
signals: { picture: { type: image }, cloud: { type: point_cloud } }
messages:
  image:
    subscribe: { topic: /image, type: sensor_msgs/Image }
    json: { picture: "@" }
"""
