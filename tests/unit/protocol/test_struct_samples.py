"""Sample bytes of public documents, read and written from one declaration."""

import struct
from typing import Any, NamedTuple

import pytest

from urc.testing.struct import frame, reader, struct_read, writer


class Sample(NamedTuple):
    name: str
    source: str
    """YAML: ``struct:``, with ``types:`` and ``enums:``."""
    data: str
    """Hex digits."""
    fields: dict[str, Any]


CREATE_2 = [
    Sample(
        "drive direct, right then left",
        "struct: [u8 145, i16be right, i16be left]",
        "91 00C8 00C8",
        {"right": 200, "left": 200},
    ),
    Sample(
        "drive, backwards on a curve",
        "struct: [u8 137, i16be velocity, i16be radius]",
        "89 FF38 01F4",
        {"velocity": -200, "radius": 500},
    ),
    Sample(
        "query of a list of packets",
        "struct: [u8 149, { id: packets, type: u8, count: u8 }]",
        "95 02 16 23",
        {"packets": [22, 35]},
    ),
    Sample(
        "bumps and wheel drops",
        "struct: [{ type: u8, bits: [{ width: 4 }, wheel_left, wheel_right, left, right] }]",
        "06",
        {"wheel_left": 0, "wheel_right": 1, "left": 1, "right": 0},
    ),
    Sample(
        "the same, from the least significant bit",
        "struct: [{ type: u8, order: lsb,"
        " bits: [right, left, wheel_right, wheel_left, { width: 4 }] }]",
        "06",
        {"wheel_left": 0, "wheel_right": 1, "left": 1, "right": 0},
    ),
    Sample(
        "stream of packets, each of which sets its own signal",
        """
        types:
          packet:
            - u8 _id
            - switch:
                by: _id
                cases: { "22": [u16be volts], "25": [u16be charge], "26": [u16be capacity] }
          packets: [{ type: packet, count: rest }]
        struct: [u8 0x13, u8 _length, { type: packets, size: _length }]
        """,
        "13 06 16 3AA4 19 0898",
        {"_length": 6, "_id": 25, "volts": 15012, "charge": 2200},
    ),
]
REMREGS = [
    Sample(
        "write 16 bits to register 7",
        "struct: [{ type: u8, bits: [{ width: 4 }, { width: 2, const: 1 },"
        " { id: high, width: 2 }] }, u8 low, u16le value]",
        "04 07 4908",
        {"high": 0, "low": 7, "value": 2121},
    ),
    Sample(
        "float to 32-bit register 0x110",
        "struct: [{ type: u16be, bits: [{ id: op, width: 6 }, { id: register, width: 10 }] },"
        " f32le value]",
        "1910 0000803F",
        {"op": 6, "register": 0x110, "value": 1.0},
    ),
    Sample(
        "bytes of a multibyte register",
        "struct: [u8 6, { id: bytes_read, type: bytes, size: u8 }]",
        "06 04 64656667",
        {"bytes_read": b"defg"},
    ),
    Sample(
        "the LED as 24 bits",
        "struct: [u16be 0x1800, { id: colour, type: u24le }, u8 0]",
        "1800 004000 00",
        {"colour": 64 << 8},
    ),
]
ATTITUDE = """
types:
  attitude:
    - u32le time_ms
    - { id: roll, type: f32le }
    - f32le pitch
    - f32le yaw
    - f32le roll_rate
    - f32le pitch_rate
    - f32le yaw_rate
struct:
  - u8 0xFD
  - u8 _length
  - { size: 2 }
  - u8 _seq
  - u8 _system
  - u8 _component
  - u24le 30
  - { type: attitude, size: _length, trim: 0 }
"""
MAVLINK = [
    Sample(
        "heartbeat of a ground station, without its checksum",
        """
        enums: { kind: { "0": generic, "6": gcs, "10": rover } }
        struct:
          - u8 0xFD
          - u8 9
          - { size: 2 }
          - u8 _seq
          - u8 _system
          - u8 _component
          - u24le 0
          - u32le custom_mode
          - { id: kind, type: u8, enum: kind }
          - u8 autopilot
          - { type: u8, bits: [armed, { id: _base_mode, width: 7 }] }
          - u8 status
          - u8 _version
        """,
        "fd 09 00 00 00 ff be 00 00 00 00 00 00 00 06 08 00 04 03",
        {
            "_seq": 0, "_system": 255, "_component": 190, "custom_mode": 0, "kind": "gcs",
            "autopilot": 8, "armed": 0, "_base_mode": 0, "status": 4, "_version": 3,
        },
    ),
    Sample(
        "manual control",
        "struct: [u8 0xFD, u8 11, { size: 2 }, u8 seq, u8 0xFF, u8 0xBE, u24le 69,"
        " i16le x, i16le y, i16le z, i16le r, u16le buttons, u8 target]",
        "fd 0b 00 00 00 ff be 45 00 00 f401 0000 f401 0000 0000 01",
        {"seq": 0, "x": 500, "y": 0, "z": 500, "r": 0, "buttons": 0, "target": 1},
    ),
    Sample(
        "attitude whose zeros at the end are cut",
        ATTITUDE,
        "fd 0c 00 00 07 01 01 1e 00 00 e8030000 0000003f 000080be",
        {
            "_length": 12, "_seq": 7, "_system": 1, "_component": 1, "time_ms": 1000,
            "roll": 0.5, "pitch": -0.25, "yaw": 0.0, "roll_rate": 0.0, "pitch_rate": 0.0,
            "yaw_rate": 0.0,
        },
    ),
]  # fmt: skip
OTHERS = [
    Sample(
        "motor controller's values",
        """
        struct:
          - { id: packet, type: u8, const: 4 }
          - { id: temp_fet, type: i16be, scale: 0.1 }
          - { id: temp_motor, type: i16be, scale: 0.1 }
          - { id: currents, type: i32be, count: 2, scale: 0.01 }
          - { id: duty, type: i16be, scale: 0.001 }
          - { id: erpm, type: i32be }
          - { id: v_in, type: i16be, scale: 0.1 }
          - { size: 4 }
          - { id: fault, type: u8, enum: { "0": none, "1": over_voltage } }
        """,
        "04 00FB FFE0 00000069 FFFFFF9C 01F4 000003E8 00F1 00000000 01",
        {
            "temp_fet": 25.1, "temp_motor": -3.2, "currents": [1.05, -1.0], "duty": 0.5,
            "erpm": 1000, "v_in": 24.1, "fault": "over_voltage",
        },
    ),
    Sample(
        "Foxglove client publish of {} on channel 7",
        "struct: [u8 1, u32le channel, { id: data, type: text, size: rest }]",
        "01 07000000 7B7D",
        {"channel": 7, "data": "{}"},
    ),
    Sample(
        "Foxglove service request",
        "struct: [u8 2, u32le service, u32le call, { id: encoding, type: text, size: u32le },"
        " { id: payload, type: bytes, size: rest }]",
        "02 01000000 02000000 04000000 6A736F6E 7B7D",
        {"service": 1, "call": 2, "encoding": "json", "payload": b"{}"},
    ),
    Sample(
        "RTDE protocol version, its size computed",
        "struct: [{ type: u16be, value: _size }, u8 0x56, u16be version]",
        "0005 56 0002",
        {"version": 2},
    ),
    Sample(
        "Niryo Ned: JSON behind its length",
        "struct: [{ id: command, type: text, size: u16le }]",
        "1600 7B22636F6D6D616E64223A224745545F504F5345227D",
        {"command": '{"command":"GET_POSE"}'},
    ),
    Sample(
        "a list of tracked lights",
        "types: { light: [i32le id, f32le x, f32le y] }\n"
        "struct: [u32le time, { id: lights, type: light, count: u8 }]",
        "0A000000 02 01000000 0000803F 00000040 02000000 00000000 000080BF",
        {"time": 10, "lights": [{"id": 1, "x": 1.0, "y": 2.0}, {"id": 2, "x": 0.0, "y": -1.0}]},
    ),
]  # fmt: skip
CODED = [
    Sample(
        "channels of eleven bits, the lowest first",
        "struct: [u8 0x0F, { id: channels, type: u11, count: 16, order: lsb }, u8 flags, u8 0]",
        "0F E0031FF8C0073EF0810F7CE0031FF8C0073EF0810F7C 00 00",
        {"channels": [992] * 16, "flags": 0},
    ),
    Sample(
        "numbers of twelve bits, with signs, the highest first",
        "struct: [{ id: axes, type: i12, count: 2, scale: 1/16 }]",
        "FFF010",
        {"axes": [-1 / 16, 1.0]},
    ),
    Sample(
        "Protocol Buffers' varints: 150 and 300",
        "struct: [varint a, { id: b, type: varint, valid: { max: 300 } }, varint 1]",
        "9601 AC02 01",
        {"a": 150, "b": 300},
    ),
    Sample(
        "Protocol Buffers' zigzag: the smallest and the largest",
        "struct: [{ id: a, type: zigzag, count: 2 }]",
        "FFFFFFFFFFFFFFFFFF01 FEFFFFFFFFFFFFFFFF01",
        {"a": [-(1 << 63), (1 << 63) - 1]},
    ),
    Sample(
        "decimal digits",
        "struct: [bcd16be a, { id: b, type: bcd24le, scale: 0.01 }, bcd8 59]",
        "1234 563412 59",
        {"a": 1234, "b": 1234.56},
    ),
    Sample(
        "words of 16 bits the other way round, as registers of Modbus have them",
        "struct: [f32cdab a, u32badc b, i64ghefcdab c, { id: d, type: f32cdab, count: 2 }]",
        "0000 3FC0 3412 7856 FFFE FFFF FFFF FFFF 0000 3F80 0000 4000",
        {"a": 1.5, "b": 0x12345678, "c": -2, "d": [1.0, 2.0]},
    ),
    Sample(
        "seven bits in each byte, as MIDI and Firmata have them",
        "struct: [u14by7le a, i21by7be b, u8 c]",
        "7F07 7F7F7E 01",
        {"a": 1023, "b": -2, "c": 1},
    ),
    Sample(
        "a text and a window with a varint in front",
        "types: { point: [zigzag x, u16be y] }\n"
        "struct: [{ id: name, type: text, size: varint },"
        " { id: at, type: point, size: varint }, u8 z]",
        "02 6869 03 03 0001 07",
        {"name": "hi", "at_x": -2, "at_y": 1, "z": 7},
    ),
    Sample(
        "a fixed-point number, and words for a float",
        "struct: [{ id: q, type: i32be, scale: 1/65536 },"
        " { id: mode, type: f64be, enum: { '7': running } }]",
        "FFFE8000 401C000000000000",
        {"q": -1.5, "mode": "running"},
    ),
    Sample(
        "half a float, three bytes, seconds since 1970",
        "struct: [f16be a, u24le b, u64le time, { id: name, type: text, until: NUL }]",
        "3C00 010203 00CA9A3B00000000 616200",
        {"a": 1.0, "b": 0x030201, "time": 1_000_000_000, "name": "ab"},
    ),
]
SAMPLES = [*CREATE_2, *REMREGS, *MAVLINK, *OTHERS, *CODED]


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda one: one.name)
def test_sample_is_read(sample: Sample) -> None:
    """The fields, those of the document alone included."""
    assert reader(sample.source).read(frame(sample.data)) == sample.fields


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda one: one.name)
def test_sample_is_written(sample: Sample) -> None:
    """The emulated robot says the same bytes for the same fields."""
    assert reader(sample.source).write(sample.fields) == bytes.fromhex(sample.data)


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda one: one.name)
def test_sample_is_a_command(sample: Sample) -> None:
    """The same items send their arguments, and read them back; sizes are nobody's arguments."""
    sender = writer(sample.source)
    given = {"settings": {}, **sample.fields}
    assert sender.write(given) == bytes.fromhex(sample.data)
    found = sender.read(frame(sample.data))
    assert found == {name: sample.fields[name] for name in found or {}}


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda one: one.name)
def test_other_lengths_are_other_frames(sample: Sample) -> None:
    """No shorter frame is taken for this one, nor one with another byte behind it."""
    data = bytes.fromhex(sample.data)
    takes_any_rest = "rest" in sample.source
    reads = reader(sample.source).read
    fixed = [size for size in range(len(data)) if not takes_any_rest and reads(frame(data[:size]))]
    assert fixed == []
    if not takes_any_rest:
        assert reads(frame(data + b"\0")) is None


def test_realtime_interface_of_universal_robots() -> None:
    """A frame of 1060 bytes: the offsets of the manual, arrays, and a tail that is not declared."""
    source = """
    struct:
      - u32be _size_in_bytes
      - f64be time
      - { size: 240 }
      - { id: q, type: f64be, count: 6 }
      - { size: 144 }
      - { id: pose, type: f64be, count: 6 }
      - { size: 264 }
      - f64be robot_mode
      - { size: rest }
    """
    values = [0.0] * 132
    values[0], values[94] = 12.5, 7.0  # at the offsets 4 and 756
    for joint in range(6):
        values[31 + joint] = joint / 10  # at the offset 252
        values[55 + joint] = joint / 100  # at the offset 444
    data = struct.pack(">i132d", 1060, *values)
    found = reader(source).read(frame(data))
    assert found == {
        "_size_in_bytes": 1060,
        "time": 12.5,
        "q": [0.0, 0.1, 0.2, 0.3, 0.4, 0.5],
        "pose": [0.0, 0.01, 0.02, 0.03, 0.04, 0.05],
        "robot_mode": 7.0,
    }
    assert struct_read(source).fields == ("_size_in_bytes", "time", "q", "pose", "robot_mode")
