"""Tags in any order, longer windows, and numbers that are no plain bytes."""

from typing import Any

import pytest

from tests.dialogue import Dialogue
from urc.protocol.values.payload import NotWritable
from urc.testing.struct import frame, reader, writer

TLV = """
types:
  battery: [u16be volts]
  label: [{ id: name, type: text, size: rest }]
  field:
    - u8 _tag
    - u8 _length
    - switch:
        by: _tag
        cases: { "1": [{ type: battery, size: _length }], "2": [{ type: label, size: _length }] }
        else: [{ size: _length }]
struct: [u8 0x55, { type: field, count: rest }]
"""


def test_fields_with_tags_come_in_any_order_and_unknown_ones_are_skipped() -> None:
    """Writing gives those that have a value, each with its length."""
    form = reader(TLV)
    found = form.read(frame("55 02 03 616263 09 02 0000 01 02 000C"))
    assert found == {"_tag": 1, "_length": 2, "name": "abc", "volts": 12}
    assert form.write({"volts": 12, "name": "ab"}) == bytes.fromhex("550102000C02026162")
    assert form.read(frame("55 02 04 616263")) is None


def test_a_window_may_be_longer_than_its_type_and_trimmed_as_well() -> None:
    """So a robot of a later version is understood."""
    form = reader(
        "types: { v: [f32le x, { size: rest }] }\n"
        "struct: [u8 _size_of_v, { type: v, size: _size_of_v, trim: 0 }]"
    )
    for data in ("06 0000803F 0102", "04 0000803F"):
        found = form.read(frame(data))
        assert found is not None
        assert found["x"] == 1.0
    assert form.read(frame("01 00")) == {"_size_of_v": 1, "x": 0.0}
    assert form.write({"x": 1.0}) == bytes.fromhex("04 0000803F")


@pytest.mark.parametrize(
    ("source", "data"),
    [
        ("struct: [varint a]", "FFFFFFFFFFFFFFFFFF7F"),
        ("struct: [varint a]", "80808080808080808080 01"),
        ("struct: [varint a]", "80"),
        ("struct: [bcd8 a]", "1F"),
        ("struct: [bcd16be a]", "12"),
        ("struct: [{ id: a, type: u4, count: 4 }]", "12"),
    ],
)
def test_what_is_no_such_number_is_another_frame(source: str, data: str) -> None:
    """Too long, cut short, or no digits."""
    assert reader(source).read(frame(data)) is None


@pytest.mark.parametrize(
    ("source", "arguments", "words"),
    [
        ("struct: [bcd8 a]", {"a": 100}, "hold 0 to 99"),
        ("struct: [varint a]", {"a": -1}, "does not fit"),
        ("struct: [{ id: a, type: u4, count: 2 }]", {"a": [1]}, "expected 2 items, found 1"),
        ("struct: [{ id: a, type: u4, count: 2 }]", {"a": [1, 16]}, "hold 0 to 15"),
        ("struct: [{ id: a, type: u4, count: 2 }]", {}, "has no value"),
        ("struct: [{ id: a, type: u4, count: 2 }]", {"a": 1}, "expected a list"),
    ],
)
def test_what_does_not_fit_is_not_sent(source: str, arguments: dict[str, Any], words: str) -> None:
    """Nothing is cut."""
    with pytest.raises(NotWritable, match=words):
        writer(source).write(arguments)


def test_elements_of_arrays_set_signals_by_name() -> None:
    """Channels, and flags that come several times."""
    talk = Dialogue(
        """
transports:
  wire: { type: tcp, host: 127.0.0.1, port: 1, framing: { type: fixed, size: 3 } }
types:
  flags: [{ type: u8, bits: [hot, { width: 7 }] }]
signals:
  roll: {}
  left_is_hot: { type: boolean }
  others: { type: integer }
messages:
  state:
    struct:
      - { id: _channels, type: u4, count: 2, order: lsb }
      - { id: _motors, type: flags, count: 2 }
    set: { roll: "_channels[0]", left_is_hot: "_motors[0].hot", others: "_motors[1:] | length" }
"""
    ).connect()
    talk.raw(bytes.fromhex("218000"))
    assert (talk.values, talk.faults) == ({"roll": 1, "left_is_hot": True, "others": 1}, [])
