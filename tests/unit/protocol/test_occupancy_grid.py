"""Occupancy grids: messages as images, updates, and messages that lie."""

import io
import json
import math
import struct
import zlib
from array import array
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from bench.rig.ros_messages import ROS1, ROS2
from urc.config.load import load_profile
from urc.model.payload import Envelope
from urc.model.values import Signal
from urc.protocol.engine import Engine
from urc.protocol.events import Samples, Violation
from urc.protocol.forms.topics import listened
from urc.protocol.values.convert import BadValue
from urc.protocol.values.decode import build_converter, build_raw
from urc.protocol.values.occupancy_grid import KEYWORD, MAX_CELLS, MAX_SIDE, GridConverter
from urc.runtime.registries import built_in_catalog

PROFILE = """
urc: 1
kind: robot
name: mapper
settings: { host: { type: host, default: 127.0.0.1 } }
transports: { ros: { type: ros, via: auto, host: "{{ settings.host }}", version: 2 } }
signals:
  floor: { type: occupancy_grid }
messages:
  map:
    subscribe: { topic: /map, type: nav_msgs/OccupancyGrid }
    json: { floor: "@" }
  changes:
    subscribe: { topic: /map_updates, type: map_msgs/OccupancyGridUpdate }
    json: { floor: "@" }
widgets:
  place: { use: map, bind: { grids: [floor] } }
"""


def grid(width: int, height: int, data: list[int] | bytes, /, **info: Any) -> dict[str, Any]:
    origin = {"position": {"x": -1.5, "y": 2.0, "z": 0.0}, "orientation": {"z": 0.0, "w": 1.0}}
    return {
        "header": {"frame_id": "map"},
        "info": {"resolution": 0.05, "width": width, "height": height, "origin": origin, **info},
        "data": data,
    }


def picture(value: object) -> Image.Image:
    assert isinstance(value, bytes)
    found = Image.open(io.BytesIO(value))
    found.load()
    return found


def test_a_grid_is_an_upright_image_that_every_viewer_shows() -> None:
    """The first row of the message lies at the origin, at the bottom of the image."""
    found = picture(GridConverter()(grid(3, 2, [0, 100, -1, 50, 99, 1])))
    assert found.size == (3, 2)
    assert list(found.tobytes()) == [50, 99, 1, 0, 100, 255]
    grey = found.convert("L")
    assert [grey.getpixel(at) for at in ((0, 1), (1, 1), (2, 1), (0, 0))] == [254, 0, 205, 127]
    assert json.loads(found.info[KEYWORD]) == {
        "frame": "map", "resolution": 0.05, "x": -1.5, "y": 2.0, "yaw": 0.0,
    }  # fmt: skip


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5, math.pi / 2])
def test_the_origin_is_rotated(yaw: float) -> None:
    origin = {
        "position": {"x": 1, "y": 2},
        "orientation": {"x": 0, "y": 0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)},
    }
    found = picture(GridConverter()(grid(1, 1, [0], origin=origin)))
    assert json.loads(found.info[KEYWORD])["yaw"] == pytest.approx(yaw)


def test_cells_arrive_as_numbers_or_as_bytes_with_the_same_result() -> None:
    cells = [-1, 0, 7, 100, 99, -128]
    packed = array("b", cells).tobytes()
    assert GridConverter()(grid(2, 3, cells)) == GridConverter()(grid(2, 3, packed))


def test_the_value_becomes_the_message_again() -> None:
    """An emulated robot sends the message of the declared value."""
    signal = Signal("floor", "occupancy_grid")
    value = build_converter(signal)(grid(3, 2, [0, 100, -1, 50, 99, 1]))
    message = build_raw(signal)(value)
    assert isinstance(message, dict)
    assert message["data"] == [0, 100, -1, 50, 99, 1]
    assert message["info"]["origin"]["position"] == {"x": -1.5, "y": 2.0, "z": 0.0}
    assert build_converter(signal)(message) == value
    assert build_converter(signal)(value) == value


def test_a_repeated_grid_that_is_not_encoded_is_the_same_value() -> None:
    """A debounced signal compares values."""
    convert = GridConverter()
    convert.is_deferring = True
    first, again = convert(grid(1, 1, [0])), convert(grid(1, 1, [0]))
    assert first == again
    assert len({first, again}) == 1  # type: ignore[arg-type]
    assert convert(grid(1, 1, [1])) != first


def test_an_update_replaces_a_rectangle() -> None:
    convert = GridConverter()
    convert(grid(4, 3, [0] * 12))
    update = {"header": {}, "x": 1, "y": 2, "width": 2, "height": 1, "data": [100, -1]}
    rows = np.asarray(picture(convert(update)))
    assert rows.tolist() == [[0, 100, 255, 0], [0] * 4, [0] * 4]


@pytest.mark.parametrize(
    ("update", "text"),
    [
        ({"x": 3, "y": 0, "width": 2, "height": 1, "data": [0, 0]},
         "an update of 2 by 1 cells at 3, 0 is outside the grid of 4 by 3 cells"),
        ({"x": 0, "y": 0, "width": 2, "height": 2, "data": [0]},
         "a grid of 2 by 2 cells needs 4 values, found 1"),
        ({"x": -1, "y": 0, "width": 1, "height": 1, "data": [0]},
         "x of the grid: -1 is not a number of cells"),
        ({"x": 0}, "y of the grid: “not available” is not a number of cells"),
    ],
)  # fmt: skip
def test_a_bad_update_leaves_the_grid_as_it_was(update: dict[str, Any], text: str) -> None:
    convert = GridConverter()
    before = convert(grid(4, 3, [0] * 12))
    with pytest.raises(BadValue, match=f"^{text}"):
        convert(update)
    nothing = {"x": 0, "y": 0, "width": 0, "height": 0, "data": []}
    assert convert(nothing) == before


def test_an_update_waits_for_a_complete_grid_of_the_same_connection() -> None:
    convert = GridConverter()
    update = {"x": 0, "y": 0, "width": 1, "height": 1, "data": [100]}
    with pytest.raises(BadValue, match="an update of an occupancy grid arrived before the grid"):
        convert(update)
    convert(grid(2, 2, [0] * 4))
    convert(update)
    convert.forget()
    with pytest.raises(BadValue, match="arrived before the grid"):
        convert(update)


@pytest.mark.parametrize(
    ("message", "text"),
    [
        (grid(100_000, 9, [0]), f"a grid of 100000 by 9 cells; the limits are {MAX_CELLS}"),
        (grid(MAX_SIDE + 1, 1, [0]), f"a grid of {MAX_SIDE + 1} by 1 cells; the limits are"),
        (grid(2, 2, [0] * 5), "a grid of 2 by 2 cells needs 4 values, found 5"),
        (grid(2, 2, b"\\0" * 3), "a grid of 2 by 2 cells needs 4 values, found 6"),
        (grid(0, 5, [1]), "a grid of 0 by 5 cells cannot have data"),
        (grid(1, 1, [0], resolution=0), "a resolution of 0 m; expected a length above 0"),
        (grid(1, 1, [0], resolution=-0.1), "a resolution of -0.1 m"),
        (grid(1, 1, [0], resolution="5"), "resolution of the grid: '5' is not a number"),
        (grid(1, 1, [0], resolution=math.inf), "resolution of the grid: inf is not a number"),
        (grid(1, 1, [0], resolution=10**400), "resolution of the grid: "),
        (grid(1, 1, [0], width=True), "width of the grid: true is not a number of cells"),
        (grid(1, 1, [0], width=1.0), "width of the grid: 1 is not a number of cells"),
        (grid(1, 1, [0], width=2**32), "width of the grid: 4294967296 is not a number of cells"),
        (grid(1, 1, [300]), "the data of the grid are not numbers from -128 to 127"),
        (grid(1, 1, ["a"]), "the data of the grid are not numbers from -128 to 127"),  # type: ignore[list-item]
        (grid(1, 1, [0], origin=None), "origin x of the grid: “not available” is not a number"),
        (grid(1, 1, [0], origin={"position": {"x": 1e9, "y": 0}}), "an origin at 1e+09, 0 m"),
        ({"info": 5}, "5 is not the info of an occupancy grid"),
        ({**grid(1, 1, [0]), "data": "AA=="}, "'AA==' is not the data of an occupancy grid"),
        ([1, 2], "[1, 2] is not an occupancy grid"),
        (b"\x89PNG", "the image is not an occupancy grid (no PNG signature)"),
    ],
)  # fmt: skip
def test_a_message_that_lies_is_refused_with_one_line(message: object, text: str) -> None:
    with pytest.raises(BadValue) as caught:
        GridConverter()(message)
    assert str(caught.value).startswith(text)
    assert "\n" not in str(caught.value)


def test_a_grid_without_cells_is_not_available_yet() -> None:
    """SLAM nodes publish such a grid before the first scan."""
    convert = GridConverter()
    convert(grid(1, 1, [0]))
    assert convert(grid(0, 0, [])) is None
    assert convert(None) is None
    with pytest.raises(BadValue, match="before the grid"):
        convert({"x": 0, "y": 0, "width": 1, "height": 1, "data": [0]})


def test_an_image_that_unpacks_to_gigabytes_is_refused() -> None:
    """A recording is untrusted as well."""
    image = GridConverter()(grid(2, 2, [0] * 4))
    assert isinstance(image, bytes)
    packed = zlib.compress(bytes(10**6))
    at = image.index(b"IDAT")
    (length,) = struct.unpack_from(">I", image, at - 4)
    crc = struct.pack(">I", zlib.crc32(b"IDAT" + packed))
    end = image[at + 4 + length + 4 :]
    bomb = image[: at - 4] + struct.pack(">I", len(packed)) + b"IDAT" + packed + crc + end
    assert GridConverter()(bomb) == bomb  # only the declared size is unpacked
    header = image.index(b"IHDR") + 4
    large = image[:header] + struct.pack(">II", 60_000, 60_000) + image[header + 8 :]
    with pytest.raises(BadValue, match="an image of 60000 by 60000 cells"):
        GridConverter()(large)


SCALARS = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5)


@given(st.recursive(
    SCALARS | st.binary(max_size=9),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(
        st.sampled_from(
            ("info", "data", "width", "height", "resolution", "origin", "position", "x", "y")
        ), inner, max_size=6),
    max_leaves=12,
))  # fmt: skip
def test_no_message_raises_another_error(message: object) -> None:
    with suppress(BadValue):
        GridConverter()(message)


def test_a_message_with_an_empty_topic_is_switched_off(tmp_path: Path) -> None:
    """A setting can so decide whether a robot has a map."""
    path = tmp_path / "mapper.yaml"
    path.write_text(
        PROFILE.replace(
            "default: 127.0.0.1 } }", "default: 127.0.0.1 }, map: { type: string, default: /map } }"
        ).replace("topic: /map,", 'topic: "{{ settings.map }}",')
    )
    driver = load_profile(path, built_in_catalog()).driver
    assert list(listened(driver, "ros", {"map": "/floor"})) == ["/floor", "/map_updates"]
    assert list(listened(driver, "ros", {"map": ""})) == ["/map_updates"]
    engine = Engine(driver, {"host": "127.0.0.1", "map": ""})
    engine.start("ros", 0.0)
    assert feed(engine, "", grid(1, 1, [0]))[0] is None


# -- through the engine, with messages of rosbags


@pytest.fixture(name="engine")
def the_engine(tmp_path: Path) -> Engine:
    path = tmp_path / "mapper.yaml"
    path.write_text(PROFILE)
    made = Engine(load_profile(path, built_in_catalog()).driver, {"host": "127.0.0.1"})
    made.start("ros", 0.0)
    return made


def a_map(store: Any, cells: list[int], width: int, **more: Any) -> Any:
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](1, 2)
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="map", **more)
    position = types["geometry_msgs/msg/Point"](-1.5, 2.0, 0.0)
    turn = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    pose = types["geometry_msgs/msg/Pose"](position, turn)
    info = types["nav_msgs/msg/MapMetaData"](stamp, 0.05, width, len(cells) // width, pose)
    return types["nav_msgs/msg/OccupancyGrid"](header, info, np.array(cells, dtype=np.int8))


def feed(engine: Engine, topic: str, body: object, **said: object) -> tuple[Any, list[str]]:
    """Return the value of the signal and the faults after a message."""
    verb = "definition" if "notation" in said else "message"
    events = engine.receive("ros", Envelope(verb, {"topic": topic, **said}, body), 1.0)
    samples = [one for event in events if isinstance(event, Samples) for one in event.samples]
    faults = [event.message for event in events if isinstance(event, Violation)]
    return (samples[-1].value if samples else None), faults


@pytest.mark.parametrize(("store", "encoding"), [(ROS2, "cdr"), (ROS1, "ros1")])
def test_binary_messages_and_json_give_the_same_image(
    engine: Engine, store: Any, encoding: str
) -> None:
    """rosbags writes the message, as foxglove_bridge and a bag would contain it."""
    name = "nav_msgs/msg/OccupancyGrid"
    is_ros1 = encoding == "ros1"
    cells = [0, 100, -1, 50, 99, 1]
    made = a_map(store, cells, 3, **({"seq": 7} if is_ros1 else {}))
    text = store.generate_msgdef(name, ros_version=1 if is_ros1 else 2)[0]
    notation = "ros1msg" if is_ros1 else "ros2msg"
    feed(engine, "/map", text, type=name, encoding=encoding, notation=notation)
    data = bytes((store.serialize_ros1 if is_ros1 else store.serialize_cdr)(made, name))
    value, faults = feed(engine, "/map", data, encoding=encoding)
    assert not faults
    single = struct.unpack("<f", struct.pack("<f", 0.05))[0]  # resolution is a float32
    assert value == GridConverter()(grid(3, 2, cells, resolution=single))


def test_an_update_in_cdr_changes_the_map_of_json(engine: Engine) -> None:
    feed(engine, "/map", grid(4, 3, [0] * 12))
    text = (
        "std_msgs/Header header\nint32 x\nint32 y\nuint32 width\nuint32 height\nint8[] data\n"
        "================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id"
    )
    said = {"type": "map_msgs/msg/OccupancyGridUpdate", "encoding": "cdr", "notation": "ros2msg"}
    feed(engine, "/map_updates", text, **said)
    head = struct.pack("<4xIII", 1, 2, 4) + b"map\0"
    data = b"\0\1\0\0" + head[4:] + struct.pack("<iiIII", 1, 2, 2, 1, 2) + b"\x64\xff"
    value, faults = feed(engine, "/map_updates", data, encoding="cdr")
    assert not faults
    assert np.asarray(picture(value)).tolist()[0] == [0, 100, 255, 0]


def test_a_lie_is_one_counted_fault_and_the_last_map_stays(engine: Engine) -> None:
    value, faults = feed(engine, "/map", grid(2, 2, [0] * 4))
    assert value is not None
    value, faults = feed(engine, "/map", grid(9000, 9000, [0] * 4))
    assert value is None
    (fault,) = faults
    assert "floor: a grid of 9000 by 9000 cells; the limits are 4000000 cells" in fault
    value, faults = feed(
        engine, "/map_updates", {"x": 0, "y": 0, "width": 1, "height": 1, "data": [9]}
    )
    assert np.asarray(picture(value)).tolist() == [[0, 0], [9, 0]]


def test_after_a_reconnection_an_update_waits_for_the_map(engine: Engine) -> None:
    update = {"x": 0, "y": 0, "width": 1, "height": 1, "data": [9]}
    feed(engine, "/map", grid(2, 2, [0] * 4))
    engine.closed("ros", "", 2.0)
    engine.start("ros", 3.0)
    assert "arrived before the grid" in feed(engine, "/map_updates", update)[1][0]


def test_a_map_that_is_sent_once_stays_live_for_a_day(engine: Engine) -> None:
    assert engine.readings.signals["floor"].stale_after_s == 86400
