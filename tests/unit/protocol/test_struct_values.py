"""Items one by one: what is another frame, what is a fault, and what cannot be sent."""

from typing import Any

import pytest

from urc.protocol.values.payload import BadItem, NotWritable
from urc.testing.struct import frame, reader, struct_write, writer

READ: list[tuple[str, str, dict[str, Any] | None]] = [
    # constants and sizes
    ("[u8 4, u8 a]", "04 07", {"a": 7}),
    ("[u8 4, u8 a]", "05 07", None),
    ("[{ type: bytes, const: [STX, '0xFFFE'] }, u8 a]", "02 FF FE 07", {"a": 7}),
    ("[{ type: text, const: GET }, u8 a]", "474554 07", {"a": 7}),
    ("[{ type: f32le, const: 0.1 }]", "CDCCCC3D", {}),
    ("[{ type: bool, const: true }]", "00", None),
    ("[u8 a, { size: rest }]", "07 010203", {"a": 7}),
    ("[u8 a, { size: rest }]", "", None),
    # widths and signs
    ("[i24be a, u24le b, i40le c]", "FFFFFE 010000 FFFFFFFFFF", {"a": -2, "b": 1, "c": -1}),
    ("[f16be a, bool b]", "3C00 02", {"a": 1.0, "b": True}),
    ("[{ type: u16le, bits: [{ id: a, width: 4, signed: true }, { id: b, width: 12 }] }]",
     "01F0", {"a": -1, "b": 1}),
    ("[{ id: flags, type: u8, bits: [up, { width: 7 }] }]", "80", {"flags_up": 1}),
    # scale, words, ranges
    ("[{ id: a, type: u8, scale: 0.1, offset: -40 }]", "03", {"a": -39.7}),
    ("[{ id: a, type: u8, enum: { '0x10': on_line } }]", "10", {"a": "on_line"}),
    ("[{ id: a, type: u8, enum: { '0x10': on_line } }]", "11", {"a": 17}),
    # text and bytes
    ("[{ id: a, type: text, size: 6 }]", "6162 00 FF FF FF", {"a": "ab"}),
    ("[{ id: a, type: text, size: 4, pad: 32 }]", "61206220", {"a": "a b"}),
    ("[{ id: a, type: text, until: NUL }, u8 b]", "6162 00 01", {"a": "ab", "b": 1}),
    ("[{ id: a, type: text, until: NUL }, u8 b]", "6162", None),
    ("[{ id: a, type: text, size: u8, encoding: utf-16-le }]", "04 61006200", {"a": "ab"}),
    ("[{ id: a, type: bytes, size: u16le }]", "0300 0102", None),
    ("[u8 _n, { id: a, type: bytes, size: _n - 1 }]", "03 0102", {"_n": 3, "a": b"\1\2"}),
    # arrays
    ("[{ id: a, type: u16be, count: rest }]", "0001 0002", {"a": [1, 2]}),
    ("[{ id: a, type: u16be, count: rest }]", "0001 00", None),
    ("[{ id: a, type: u8, count: 2, scale: 0.5 }]", "01 02", {"a": [0.5, 1.0]}),
    ("[{ id: a, type: i24le, count: u8 }]", "02 010000 FFFFFF", {"a": [1, -1]}),
    ("[{ id: a, type: text, size: 2, count: 2 }]", "6162 6300", {"a": ["ab", "c"]}),
    # conditions and cases
    ("[u8 _f, { id: a, type: u8, if: _f > 0 }]", "00", {"_f": 0}),
    ("[u8 _f, { id: a, type: u8, if: _f > 0 }]", "01 07", {"_f": 1, "a": 7}),
    ("[u8 a, { id: b, type: u8, if: _left > 0 }]", "01", {"a": 1}),
    ("[u8 _k, { switch: { by: _k, cases: { '1': [u8 a] }, else: [] } }]", "02", {"_k": 2}),
    ("[u8 _k, { switch: { by: _k, cases: { '1': [u8 a] } } }]", "02 01", None),
    ("[u8 _k, { switch: { by: _k % 2, cases: { '1': [u8 a] } } }]", "03 01", {"_k": 3, "a": 1}),
]  # fmt: skip


@pytest.mark.parametrize(("items", "data", "fields"), READ)
def test_items_are_read(items: str, data: str, fields: dict[str, Any] | None) -> None:
    """None means: another frame."""
    assert reader(f"struct: {items}").read(frame(data)) == fields


FAULTS = [
    ("[{ id: a, type: u8, valid: { max: 100 } }]", "65", "a: expected -1e+308 to 100, found 101"),
    ("[{ id: a, type: text, size: 2 }]", "FFFF", "a: hex ff is not utf-8 text"),
    ("[i8 _n, { id: a, type: bytes, size: _n }]", "FF 01", "a: -1 is not a valid size"),
    ("[u8 _n, { id: a, type: u8, if: 1 / _n > 2 }]", "00 01", "division by zero"),
]


@pytest.mark.parametrize(("items", "data", "message"), FAULTS)
def test_frame_with_a_wrong_value_is_a_fault(items: str, data: str, message: str) -> None:
    """Nothing of it is a reading."""
    with pytest.raises(BadItem) as told:
        reader(f"struct: {items}").read(frame(data))
    assert message in str(told.value)


def test_another_frame_is_no_fault_of_this_one() -> None:
    """A wrong value before a constant that does not fit says nothing."""
    items = "[{ id: a, type: u8, valid: { max: 100 } }, u8 4, { id: b, type: u8, if: a > 0 }]"
    assert reader(f"struct: {items}").read(frame("FF 05 01")) is None


SENT: list[tuple[str, dict[str, Any], str]] = [
    ("[i8 a]", {"a": 1.5}, "02"),
    ("[i8 a]", {"a": 2.5}, "02"),
    ("[i8 a]", {"a": True}, "01"),
    ("[{ id: a, type: i16be, scale: 0.1, offset: 1 }]", {"a": 2.26}, "000D"),
    ("[{ id: a, type: u8, enum: { '3': go } }]", {"a": "go"}, "03"),
    ("[{ id: a, type: u8, enum: { '3': go } }]", {"a": 4}, "04"),
    ("[{ type: u8, value: _left - 1 }, u8 a, { size: 2 }]", {"a": 7}, "03 07 0000"),
    ("[u8 a, { type: u16le, value: _size }]", {"a": 7}, "07 0300"),
    ("[u8 a, { type: u8, value: a * 2 }]", {"a": 7}, "07 0E"),
    ("[{ type: u8, value: 5 }]", {}, "05"),
    ("[{ id: _n, type: u8 }, { id: a, type: text, size: _n }]", {"a": "abc"}, "03 616263"),
    ("[{ id: _n, type: u8 }, { id: a, type: text, size: _n - 1 }]", {"a": "abc"}, "04 616263"),
    ("[{ type: u8, bits: [{ width: 2, value: 3 }, { id: a, width: 6 }] }]", {"a": 1}, "C1"),
    ("[{ type: u8, bits: [{ id: _n, width: 4 }, { width: 4 }] },"
     " { id: a, type: bytes, size: _n }]", {"a": "0102"}, "20 0102"),
    ("[{ id: a, type: text, size: 4, pad: 32 }]", {"a": "ab"}, "61622020"),
    ("[{ size: 2, pad: 255 }, u8 a]", {"a": 1}, "FFFF 01"),
    ("[u8 mode, { id: a, type: u8, if: mode == 1 }]", {"mode": 0, "a": 5}, "00"),
    ("[u8 k, { switch: { by: k, cases: { '1': [u8 a], '2': [i16be a] } } }]", {"k": 2, "a": 1},
     "02 0001"),
    ("[{ id: a, type: u8, count: u8, value: '[1, 2, b]' }]", {"b": 3}, "03 010203"),
]  # fmt: skip


@pytest.mark.parametrize(("items", "values", "data"), SENT)
def test_arguments_are_sent(items: str, values: dict[str, Any], data: str) -> None:
    """Rounded to the nearest whole number, halves to the even one."""
    assert writer(f"struct: {items}").write(values) == bytes.fromhex(data)


REFUSED: list[tuple[str, dict[str, Any], str]] = [
    ("[u8 a]", {}, "'a' has no value here"),
    ("[u8 a]", {"a": None}, "'a' has no value here"),
    ("[u8 a]", {"a": 256}, "a: 256 does not fit into 8 bits, which hold 0 to 255"),
    ("[i8 a]", {"a": -129}, "a: -129 does not fit into 8 signed bits, which hold -128 to 127"),
    ("[u8 a]", {"a": "x"}, "a: expected a number, found 'x'"),
    ("[u8 a]", {"a": float("nan")}, "a: expected a whole number, found nan"),
    ("[f32be a]", {"a": 1e39}, "a: 1e+39 does not fit into f32"),
    ("[bool a]", {"a": 2}, "a: expected true or false, found 2"),
    ("[{ id: a, type: u8, valid: { min: 1, max: 9 } }]", {"a": 0},
     "a: expected 1 to 9, found 0"),
    ("[{ id: a, type: u8, enum: { '0': idle, '1': go } }]", {"a": "fly"},
     "a: expected one of idle, go, found 'fly'"),
    ("[{ id: a, type: text, size: 2 }]", {"a": "abc"}, "a: 3 bytes do not fit into 2"),
    ("[{ id: a, type: text, size: 4 }]", {"a": "a\0b"}, "contains a NUL"),
    ("[{ id: a, type: text, size: u8 }]", {"a": "x" * 256}, "a: 256 does not fit into 8 bits"),
    ("[{ id: a, type: text, until: ETX }]", {"a": "a\3"}, "contains its terminator"),
    ("[{ id: a, type: text, size: 4, encoding: ascii }]", {"a": "é"}, "cannot be encoded in ascii"),
    ("[{ id: a, type: bytes, size: 2 }]", {"a": "xy"}, "a: expected hex digits, found 'xy'"),
    ("[u8 k, { switch: { by: k, cases: { '1': [u8 a] } } }]", {"k": 3}, "no case for k = 3"),
    ("[{ id: a, type: u8, count: 2, value: '[1, 2, 3]' }]", {}, "expected 2 items, found 3"),
    ("[{ type: u8, value: 300 }]", {}, "300 does not fit into 8 bits"),
]  # fmt: skip


@pytest.mark.parametrize(("items", "values", "message"), REFUSED)
def test_what_does_not_fit_is_not_sent(items: str, values: dict[str, Any], message: str) -> None:
    """Never cut, wrapped round or clamped: one line that names the item."""
    with pytest.raises(NotWritable) as told:
        writer(f"struct: {items}").write(values)
    assert message in str(told.value)


def test_arguments_are_what_nobody_computes() -> None:
    """Constants, values and sizes are no arguments; settings of expressions are."""
    spec = struct_write(
        "struct: [u8 4, { type: u8, value: _left }, u8 _n, { id: name, type: text, size: _n },"
        " { id: unit, type: u8, value: settings.unit + level }]"
    )
    assert spec.names == {"name", "level", "settings"}
    assert spec.settings == {"unit"}


def test_counter_of_a_request_can_be_read_back() -> None:
    """The emulated robot repeats it in its answer; what is computed otherwise is skipped."""
    made = writer(
        "struct: [{ type: u16be, value: \"seq('id', 1, 99)\" }, { type: u8, value: _size }, u8 a]"
    )
    assert made.read(frame("00 07 04 05")) == {"seq.id": 7, "a": 5}
