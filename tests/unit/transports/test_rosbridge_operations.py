"""Frames of rosbridge: the protocol's own samples, the packed forms, and what is none."""

import base64
import json
import struct
import zlib

import pytest
from cbor2 import CBORTag, dumps
from hypothesis import given
from hypothesis import strategies as st

from urc.transports.ros.rosbridge_operations import (
    MAX_BYTES,
    MAX_FRAGMENTS,
    BadOperation,
    OperationReader,
    encode_operation,
)
from urc.transports.ros.types import spelled

# Made by Pillow, which chooses the filter of each row; as the bridge does, padded with newlines.
SCAN_PNG = (
    "iVBORw0KGgoAAAANSUhEUgAAAA0AAAAPCAIAAACwQdIgAAAB3UlEQVR4nAXBy2oUQRQG4NN/9XTN5YxMJ9PdM9"
    "usRVBE0JXZCYoBgwufwKUP4DMJkpWDiA+QlYssBHFpkrlVU6Qz1VXdp/y+5PPJp4Yuv9Kz9y+7u7xbrb7Rq7O3"
    "zd3Frx/UnJ8+CT8vL+j0PPl48mL14ebdvzdNOvh+9eX54cFVsAlyEkM4SmQfcQzZJY8fPYVsBQVkIygTWUdUwX"
    "pUWm5bLJTc9FgGGOWzIRvVZhM2yukpm/SQskkPjogoSYmIaAQ2qhkM2KgmGbNRTSSKpDPeKxnPg3X3oyJY12JY"
    "But6XQbbuqwItkWu5DZiBll3WCayCViQYOtRBdu7MRt0RBRJ9USRVCQiakFE1GoCEfmMa7i06mzALJVtxCyRnW"
    "DWWfEp1+hdBq7Ry5BrSMtcQ3rNNYSmXEOysrOEYyW1AHNI3aGA1A4lxPSoIOaAhZK9xzKVnWA2gGwj8kw2EUda"
    "1hHHWm4j5lpuBIWW6x7lQOoOqJSYgAXJ3mORyc5jmcjWYzmQjcdSy7rDLMAGn7JR98MpG3WPCRvVaM1GNZiyUQ"
    "1p3iuZoPQ2QTmUa4cyWHcY5cG6MMyDbRudB9uGjI06wE/ZwBGzgeMq2NBPymC7flwE2/ej4uHZ67/r33/+A644"
    "FIx7HPHpAAAAAElFTkSuQmCC"
)


def read(frame: bytes | str) -> object:
    return OperationReader().read(frame.encode() if isinstance(frame, str) else frame)


@pytest.mark.parametrize(
    "frame",
    [
        '{"op":"publish","topic":"/battery_state","msg":{"percentage":0.81,"voltage":12.1}}',
        '{"op":"service_response","id":"c1","service":"/rosapi/topics",'
        '"values":{"topics":[],"types":[]},"result":true}',
        '{"op":"publish","topic":"\\/imu","msg":{"x":null}}',
    ],
)
def test_frames_of_the_specification_are_read(frame: str) -> None:
    """As any JSON, whether its slashes are escaped or not."""
    assert read(frame) == json.loads(frame)


@given(st.text(min_size=1), st.integers(1, 7))
def test_fragments_are_joined_in_any_order(text: str, size: int) -> None:
    """The whole comes with the last piece, whichever that is."""
    whole = json.dumps({"op": "publish", "topic": "/a", "msg": {"data": text}})
    pieces = [whole[start : start + size] for start in range(0, len(whole), size)]
    reader = OperationReader()
    told = [
        reader.read(json.dumps({"op": "fragment", "id": "7", "data": piece, "num": number,
                                "total": len(pieces)}).encode())
        for number, piece in reversed(list(enumerate(pieces)))
    ]  # fmt: skip
    assert told[:-1] == [None] * (len(pieces) - 1)
    assert told[-1] == json.loads(whole)


def test_half_operations_are_bounded() -> None:
    """Those that never come to an end are given up, the oldest first."""
    reader = OperationReader()
    for name in range(1000):
        piece = {"op": "fragment", "id": name, "data": "x", "num": 0, "total": 2}
        assert reader.read(json.dumps(piece).encode()) is None
    assert len(reader._halves) <= 8


def test_halves_are_bounded_by_their_size_all_together(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight large ones are not kept because each alone may be."""
    most = 100_000
    monkeypatch.setattr("urc.transports.ros.rosbridge_operations.MAX_BYTES", most)
    reader = OperationReader()
    for name in range(8):
        piece = {"op": "fragment", "id": name, "data": "x" * (most // 2), "num": 0, "total": 2}
        assert reader.read(json.dumps(piece).encode()) is None
    assert 0 < sum(len(part) for half in reader._halves.values() for part in half.values()) <= most


def laughs(depth: int) -> bytes:
    """Return CBOR of `depth` lists, each of ten times the one before, in a few bytes."""
    inner: object = [0]
    for _ in range(depth):
        inner = [inner] * 10
    return dumps({"op": "publish", "topic": "/a", "msg": inner}, value_sharing=True)


def test_cbor_that_stands_for_more_than_memory_holds_is_refused() -> None:
    """Values that are said once and named a thousand million times."""
    frame = laughs(30)
    assert len(frame) < 2000
    with pytest.raises(BadOperation, match="more than"):
        read(frame)
    long = "x" * 1_000_000
    with pytest.raises(BadOperation, match="more than"):
        read(dumps({"op": "publish", "msg": [long] * 100}, string_referencing=True))


def test_json_of_more_values_than_memory_holds_is_refused() -> None:
    """An empty list takes three bytes on the line, and twenty times that here."""
    inner = "[]," * (MAX_BYTES // 3 - 100)
    with pytest.raises(BadOperation, match="values"):
        read(f'{{"op":"publish","msg":[{inner}0]}}')


def test_image_that_takes_long_to_unpack_is_refused() -> None:
    """A few thousand bytes of an image may stand for sixteen million."""
    rows = (b"\x04" + bytes(3 * 2000)) * 2700

    def chunk(kind: bytes, data: bytes) -> bytes:
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 2000, 2700, 8, 2, 0, 0, 0))
    image = b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    with pytest.raises(BadOperation, match="is too large"):
        read(json.dumps({"op": "png", "data": base64.b64encode(image).decode()}))


def test_png_is_read_with_every_filter() -> None:
    """Its pixels are the operation."""
    operation = read(json.dumps({"op": "png", "data": SCAN_PNG}))
    assert isinstance(operation, dict)
    assert operation["topic"] == "/scan"
    assert operation["msg"]["ranges"][:3] == [1.0, 1.11, 1.22]
    assert len(operation["msg"]["ranges"]) == 90


def test_cbor_is_read_as_json_would_be() -> None:
    """Arrays of numbers become lists, bytes stay, not-a-number is null."""
    ranges = CBORTag(85, struct.pack("<3f", 0.5, float("nan"), float("inf")))
    message = {"ranges": ranges, "data": b"\xff\xd8", "x": float("nan"), "n": 3}
    assert read(dumps({"op": "publish", "topic": "/scan", "msg": message})) == {
        "op": "publish",
        "topic": "/scan",
        "msg": {"ranges": [0.5, None, None], "data": b"\xff\xd8", "x": None, "n": 3},
    }


@pytest.mark.parametrize(
    ("frame", "why"),
    [
        (b"", "not JSON"),
        (b"[1]", "has no operation"),
        (b'{"msg":1}', "has no operation"),
        (b"\xa1", "not CBOR"),
        (dumps({"op": "publish", "msg": CBORTag(9999, b"")}), "not CBOR"),
        (b'{"op":"fragment","id":"1","num":5,"total":2,"data":""}', "fragment 5 of 2"),
        (
            b'{"op":"fragment","id":"1","num":0,"total":%d,"data":""}' % (MAX_FRAGMENTS + 1),
            "invalid",
        ),
        (b'{"op":"png","data":"%%"}', "not base64"),
        (b'{"op":"png","data":"%s"}' % base64.b64encode(b"GIF89a"), "not a PNG"),
        (b'{"op":"png","data":"%s"}' % SCAN_PNG[:200].encode(), "png"),
    ],
)
def test_frame_that_is_none_is_refused_in_one_line(frame: bytes, why: str) -> None:
    """Whatever the bridge sends, nothing else is raised."""
    with pytest.raises(BadOperation) as told:
        read(frame)
    assert why in str(told.value)


@given(st.binary(max_size=200))
def test_no_bytes_raise_anything_else(frame: bytes) -> None:
    """A frame is an operation or a `BadOperation`."""
    try:
        operation = read(frame)
    except BadOperation:
        return
    assert operation is None or isinstance(operation, dict)


def test_operations_are_written_as_json() -> None:
    """Bytes in base64 as ROS wants its arrays of bytes, not-a-number as null."""
    said = json.loads(encode_operation({"data": b"\xff\xd8", "x": float("nan")}))
    assert said == {"data": "/9g=", "x": None}
    with pytest.raises(BadOperation, match="cannot be sent as JSON"):
        encode_operation({"x": object()})


@pytest.mark.parametrize(
    ("name", "ros", "as_sent"),
    [
        ("geometry_msgs/Twist", None, "geometry_msgs/Twist"),
        ("geometry_msgs/Twist", 2, "geometry_msgs/msg/Twist"),
        ("geometry_msgs/msg/Twist", 1, "geometry_msgs/Twist"),
        ("geometry_msgs/msg/Twist", 2, "geometry_msgs/msg/Twist"),
        ("", 2, ""),
        ("Twist", 2, "Twist"),
    ],
)
def test_types_are_spelled_as_the_version_of_ros_does(
    name: str, ros: int | None, as_sent: str
) -> None:
    """One driver serves both."""
    assert spelled(name, "msg", ros) == as_sent
