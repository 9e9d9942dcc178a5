"""Point clouds: messages as PCD files, thinning, and messages that lie."""

import math
import random
import struct
from base64 import b64encode
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.rig.ros_messages import ROS2
from urc.config.load import load_profile
from urc.model.payload import Envelope
from urc.model.values import Signal
from urc.protocol.engine import Engine
from urc.protocol.events import Samples, Violation
from urc.protocol.values.convert import BadValue
from urc.protocol.values.decode import build_converter, build_raw
from urc.protocol.values.point_cloud import Cloud, read_cloud
from urc.runtime.registries import built_in_catalog

PROFILE = """
urc: 1
kind: robot
name: seer
settings: { host: { type: host, default: 127.0.0.1 } }
transports: { ros: { type: ros, via: auto, host: "{{ settings.host }}", version: 2 } }
signals:
  cloud: { type: point_cloud, size: 50 }
messages:
  points:
    subscribe: { topic: /points, type: sensor_msgs/PointCloud2 }
    json: { cloud: "@" }
widgets:
  scene: { use: scene3d, bind: { cloud: cloud } }
"""
KINDS = {"b": 1, "B": 2, "h": 3, "H": 4, "i": 5, "I": 6, "f": 7, "d": 8}
PLACES = [("x", 0, "f"), ("y", 4, "f"), ("z", 8, "f")]
WITH_INTENSITY = [*PLACES, ("intensity", 12, "f")]


def cloud(
    points: list[tuple[Any, ...]],
    fields: list[tuple[str, int, str]] = WITH_INTENSITY,
    *,
    step: int = 16,
    height: int = 1,
    pad: int = 0,
    order: str = "<",
    **more: Any,
) -> dict[str, Any]:
    """Return a message, packed by a declaration that is independent of URC's."""
    width = len(points) // height
    rows = []
    for row in range(height):
        data = bytearray(width * step + pad)
        for column in range(width):
            for (_, offset, code), value in zip(fields, points[row * width + column], strict=True):
                struct.pack_into(order + code, data, column * step + offset, value)
        rows.append(bytes(data))
    return {
        "header": {"frame_id": "lidar"},
        "height": height,
        "width": width,
        "fields": [
            {"name": name, "offset": offset, "datatype": KINDS[code], "count": 1}
            for name, offset, code in fields
        ],
        "is_bigendian": order == ">",
        "point_step": step,
        "row_step": width * step + pad,
        "data": b"".join(rows),
        "is_dense": True,
        **more,
    }


def converted(message: object, **options: Any) -> Cloud:
    value = build_converter(Signal("cloud", "point_cloud", **options))(message)
    assert isinstance(value, bytes)
    return read_cloud(value)


def rows_of(found: Cloud) -> list[list[float]]:
    return np.frombuffer(found.points, "<f4").reshape(-1, found.stride // 4).tolist()


POINTS = [(1.0, 2.0, 3.0, 0.5), (-1.0, 0.25, 0.0, 7.0)]


def test_the_value_is_a_pcd_file() -> None:
    """The header is that of the Point Cloud Library; the values begin at a multiple of 4 bytes."""
    value: Any = build_converter(Signal("cloud", "point_cloud"))(cloud(POINTS))
    head, _, data = value.partition(b"DATA binary\n")
    assert head.decode().splitlines()[1:] == [
        "VERSION 0.7",
        "FIELDS x y z intensity",
        "SIZE 4 4 4 4",
        "TYPE F F F F",
        "COUNT 1 1 1 1",
        "WIDTH 2",
        "HEIGHT 1",
        "VIEWPOINT 0 0 0 1 0 0 0",
        "POINTS 2",
    ]
    assert (len(value) - len(data)) % 4 == 0
    assert data == struct.pack("<8f", *POINTS[0], *POINTS[1])


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("pad", [0, 5])
@pytest.mark.parametrize("height", [1, 2])
@pytest.mark.parametrize("form", [bytes, list, b64encode])
def test_both_byte_orders_padding_and_all_forms_of_bytes(
    order: str, pad: int, height: int, form: Any
) -> None:
    message = cloud(POINTS, step=29, height=height, pad=pad, order=order)
    data = form(message["data"])
    message["data"] = data.decode() if form is b64encode else data
    assert rows_of(converted(message)) == [list(one) for one in POINTS]


@pytest.mark.parametrize("code", list(KINDS))
def test_every_datatype_in_any_order(code: str) -> None:
    fields = [("y", 1, code), ("ring", 10, "H"), ("z", 12, "d"), ("x", 24, code)]
    found = converted(cloud([(3, 9, 2.5, 5)], fields, step=40), colour="ring")
    assert rows_of(found) == [[5.0, 3.0, 2.5, 9.0]]
    assert found.colour == "ring"


@pytest.mark.parametrize("code", ["f", "I", "i"])
def test_the_bits_of_a_colour_survive_as_a_number_of_any_kind(code: str) -> None:
    bits = struct.pack("<I", 0x00FF8001)
    (value,) = struct.unpack("<" + code, bits)
    found = converted(cloud([(1.0, 2.0, 3.0, value)], [*PLACES, ("rgb", 12, code)]))
    assert found.colour == "rgb"
    assert found.points[12:] == bits


def test_the_colour_comes_before_the_intensity_unless_declared() -> None:
    fields = [*WITH_INTENSITY, ("rgb", 16, "I"), ("t", 20, "I")]
    message = cloud([(1.0, 2.0, 3.0, 4.0, 5, 6)], fields, step=24)
    assert converted(message).colour == "rgb"
    assert rows_of(converted(message, colour="intensity"))[0][3] == 4.0
    assert rows_of(converted(message, colour="t"))[0][3] == 6.0
    assert converted(message, colour="z").colour == ""


def test_a_cloud_without_height_lies_on_the_ground() -> None:
    assert rows_of(converted(cloud([(1.0, 2.0)], PLACES[:2], step=8))) == [[1.0, 2.0, 0.0]]


def test_points_without_a_place_are_left_out() -> None:
    lost = [math.nan, math.inf, -math.inf, 1e7]
    points = [(1.0, 2.0, 3.0, 4.0), *[(one, 0.0, 0.0, 1.0) for one in lost]]
    points += [(0.0, one, 0.0, 1.0) for one in lost] + [(0.0, 0.0, one, 1.0) for one in lost]
    found = converted(cloud(points))
    assert rows_of(found) == [[1.0, 2.0, 3.0, 4.0]]
    assert found.total == len(points)
    assert rows_of(converted(cloud(points[1:]))) == []


def test_the_channel_may_be_unknown() -> None:
    assert math.isnan(rows_of(converted(cloud([(1.0, 2.0, 3.0, math.nan)])))[0][3])


def test_a_cloud_without_points_is_a_value() -> None:
    found = converted(cloud([], width=0, row_step=0))
    assert (found.total, found.points) == (0, b"")


@pytest.mark.parametrize("rings", [16, 20, 64])
def test_a_thinned_cloud_has_points_of_all_rings_and_directions(rings: int) -> None:
    """A scanner sends the rings in turn; a regular selection would leave most rings out."""
    count = 50 * rings
    message = cloud([(one // rings, one % rings, 0.0, 1.0) for one in range(count)])
    found = converted(message, size=count // rings)
    rows = rows_of(found)
    assert len(rows) == count // rings
    assert [row[0] for row in rows] == sorted(row[0] for row in rows)
    assert len({row[1] for row in rows}) > 0.4 * min(rings, len(rows))
    assert found.total == count


def test_the_declared_number_of_points_is_kept_in_full() -> None:
    message = cloud([(one, 0.0, 0.0, 1.0) for one in range(1000)])
    for size in (1, 7, 333, 999, 1000, 2000):
        assert len(rows_of(converted(message, size=size))) == min(size, 1000)


def test_the_value_becomes_the_message_again() -> None:
    """An emulated robot sends the message of the declared value."""
    signal = Signal("cloud", "point_cloud")
    for fields in (WITH_INTENSITY, [*PLACES, ("rgb", 12, "I")]):
        points = [(1.0, 2.0, 3.0, 5), (4.0, 5.0, 6.0, 7)]
        value = build_converter(signal)(cloud(points, fields))
        message = build_raw(signal)(value)
        assert isinstance(message, dict)
        assert build_converter(signal)(message) == value
        assert build_converter(signal)(value) == value


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"data": b"\0" * 31},
         "a point cloud of 2 by 1 points of 16 bytes, with rows of 32 bytes, needs 32 bytes,"
         " found 31"),
        ({"height": 2, "row_step": 31, "data": b"\0" * 64},
         "a point cloud of 2 by 2 points of 16 bytes, with rows of 31 bytes, needs 64 bytes,"
         " found 64"),
        ({"width": 2**32 - 1, "height": 2**32 - 1},
         "a point cloud of 4294967295 by 4294967295 points"),
        ({"point_step": 15}, "the fields of a point take 16 bytes, but its point_step is 15"),
        ({"point_step": 0}, "the fields of a point take 16 bytes, but its point_step is 0"),
        ({"width": -1}, "width of the point cloud: -1 is not a whole number"),
        ({"row_step": None}, "row_step of the point cloud: “not available” is not a whole number"),
        ({"data": "§"}, "'§' is not base64"),
        ({"data": [1, 256]}, ".* is not a list of bytes"),
        ({"data": 5}, "5 is neither bytes nor base64"),
        ({"fields": None}, "“not available” is not a list of up to 64 fields of a point cloud"),
        ({"fields": [{}] * 65}, ".* is not a list of up to 64 fields of a point cloud"),
        ({"fields": [{"name": 3}]}, ".* is not a field of a point cloud"),
        ({"fields": [{"name": "x", "offset": 0, "datatype": 9}]},
         "the field 'x' of a point cloud has the datatype 9 and the offset 0"),
        ({"fields": [{"name": "x", "offset": 2**31, "datatype": 7}]},
         "the field 'x' of a point cloud has the datatype 7 and the offset 2147483648"),
        ({"fields": [{"name": "x", "offset": 0, "datatype": 7}]},
         "a point cloud without the field 'y'; its fields are: x"),
        ({"fields": []}, "a point cloud without the field 'x'; its fields are: none"),
        ({"fields": [{"name": "x", "offset": 0, "datatype": 8},
                     {"name": "y", "offset": 4, "datatype": 7}]},
         "the field 'y' of a point cloud overlaps another field"),
        ({"fields": [{"name": "x", "offset": 0, "datatype": 7},
                     {"name": "y", "offset": 4, "datatype": 7},
                     {"name": "rgb", "offset": 8, "datatype": 8}]},
         "the field 'rgb' of a point cloud must have 4 bytes"),
    ],
)  # fmt: skip
def test_a_message_that_lies_is_one_clear_fault(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(BadValue, match=f"^({text})"):
        converted({**cloud(POINTS), **changes})


@pytest.mark.parametrize("raw", [3, "cloud", [1], b"", b"# .PCD v0.7", b"\x89PNG", {}])
def test_other_values_are_no_clouds(raw: object) -> None:
    with pytest.raises(BadValue):
        build_converter(Signal("cloud", "point_cloud"))(raw)


def test_a_declared_channel_must_be_there() -> None:
    with pytest.raises(BadValue, match="without the field 'ring'; its fields are: x, y, z, inten"):
        converted(cloud(POINTS), colour="ring")


@given(st.data())
def test_no_message_raises_anything_else(data: st.DataObject) -> None:
    """Any value in any place of the message is a cloud or one fault."""
    message = cloud(POINTS)
    odd = st.one_of(
        st.none(), st.integers(-1, 2**33), st.text(max_size=5), st.binary(max_size=70),
        st.booleans(),
        st.lists(st.dictionaries(st.sampled_from(["name", "offset", "datatype"]),
                                 st.one_of(st.integers(0, 70), st.sampled_from(["x", "y", "z"])))),
    )  # fmt: skip
    for name in data.draw(st.sets(st.sampled_from(sorted(message)), max_size=3)):
        message[name] = data.draw(odd)
    try:
        found = converted(message)
    except BadValue:
        return
    assert len(found.points) <= 16 * 20_000


def test_clouds_of_rosbags_arrive_by_all_kinds_of_bridge(tmp_path: Path) -> None:
    """The message in CDR, written by rosbags, gives the same file as in JSON with base64.

    Over Zenoh, the hash of the type takes the place of its definition.
    """
    dice = random.Random(5)  # noqa: S311 - the same points in every run
    points = [tuple(dice.uniform(-9, 9) for _ in range(4)) for _ in range(120)]
    message = cloud(points, height=4, step=20, pad=3)
    file = tmp_path / "seer.yaml"
    file.write_text(PROFILE, encoding="utf-8")
    driver, name = load_profile(file, built_in_catalog()).driver, "sensor_msgs/msg/PointCloud2"
    text = b64encode(message["data"]).decode()
    said = {"topic": "/points", "encoding": "cdr"}
    described, _ = ROS2.generate_msgdef(name, ros_version=2)
    written = bytes(ROS2.serialize_cdr(rosbags_cloud(message), name))
    digest = ROS2.hash_rihs01(name)
    found = []
    for envelopes in (
        [Envelope("message", {"topic": "/points"}, {**message, "data": text})],
        [
            Envelope("definition", {**said, "type": name, "notation": "ros2msg"}, described),
            Envelope("message", said, written),
        ],
        [
            Envelope("definition", {**said, "type": name, "notation": "known", "hash": digest}, ""),
            Envelope("message", said, written),
        ],
    ):
        engine = Engine(driver, {"host": "127.0.0.1"})
        engine.start("ros", 0.0)
        events = [event for each in envelopes for event in engine.receive("ros", each, 1.0)]
        assert not [event for event in events if isinstance(event, Violation)]
        found += [event.samples[0].value for event in events if isinstance(event, Samples)]
    assert len(found) == 3
    assert len(set(found)) == 1
    assert isinstance(found[0], bytes)
    assert len(rows_of(read_cloud(found[0]))) == 50


def rosbags_cloud(message: Mapping[str, Any]) -> Any:
    def made(kind: str, **fields: Any) -> Any:
        return ROS2.types[kind](**fields)

    stamp = made("builtin_interfaces/msg/Time", sec=1, nanosec=2)
    header = made("std_msgs/msg/Header", stamp=stamp, frame_id="lidar")
    fields = [made("sensor_msgs/msg/PointField", **one) for one in message["fields"]]
    data = np.frombuffer(message["data"], np.uint8)
    return made(
        "sensor_msgs/msg/PointCloud2",
        **{**message, "header": header, "fields": fields, "data": data},
    )
