"""Numbers of a struct that are no plain bytes: variable lengths, decimal digits, odd widths.

Floor 3, pure. ``varint`` is LEB128 as Protocol Buffers have it, ``zigzag`` their signed form;
``bcd`` has a decimal digit in each half of a byte; ``f32cdab`` has its words of 16 bits swapped,
and ``u14by7le`` seven bits in each byte; packed arrays have numbers of any width one behind the
other without regard to bytes. All are bounded to 64 bits.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final

from urc.model.binary import Extent, Item, Number, packed_size
from urc.protocol.codec import BadItem, NotWritable
from urc.protocol.struct_value import (
    checked_raw,
    meaning_of,
    number_reader,
    number_writer,
)

__all__ = [
    "FAULT",
    "OtherFrame",
    "coded_reader",
    "coded_step",
    "coded_writer",
    "note",
    "packed_step",
    "packed_writer",
]

Out = dict[str, Any]
Step = Callable[[bytes, int, int, Out], int]

FAULT: Final = ""
"""No item is called that: `out` keeps the first fault there."""
_MOST_BYTES: Final = 10
"""Of a varint of 64 bits."""


class OtherFrame(Exception):
    """These bytes are another frame."""


def note(out: Out, name: str, meaning: Callable[[Any], Any], raw: Any) -> None:
    """Put the value that `raw` means into `out`, or its fault."""
    try:
        out[name] = meaning(raw)
    except BadItem as error:
        out.setdefault(FAULT, error)


def coded_reader(number: Number) -> Callable[[bytes, int, int], tuple[int, int]]:
    """Return the function from data, begin and end to the raw number, and where it ends.

    It raises `OtherFrame` when there is no such number.
    """
    if number.kind in ("varint", "zigzag"):
        return _read_zigzag if number.kind == "zigzag" else _read_varint
    if number.is_by_seven:
        return _septets_reader(number)
    read, size = number_reader(number), number.size
    if number.are_words_swapped:
        straight, read = read, lambda data, at: straight(_turned(data[at : at + size]), 0)

    def fixed(data: bytes, at: int, end: int) -> tuple[int, int]:
        if at + size > end:
            raise OtherFrame
        return read(data, at), at + size

    return _bcd_reader(number) if number.kind == "bcd" else fixed


def _read_varint(data: bytes, at: int, end: int) -> tuple[int, int]:
    value = shift = 0
    for place in range(at, min(end, at + _MOST_BYTES)):
        byte = data[place]
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            if value >> 64:
                break
            return value, place + 1
        shift += 7
    raise OtherFrame


def _read_zigzag(data: bytes, at: int, end: int) -> tuple[int, int]:
    value, after = _read_varint(data, at, end)
    return value >> 1 ^ -(value & 1), after


def _turned(data: bytes) -> bytes:
    """Return the words of 16 bits in the other order."""
    return b"".join(data[place : place + 2] for place in range(len(data) - 2, -1, -2))


def _septets_reader(number: Number) -> Callable[[bytes, int, int], tuple[int, int]]:
    size, step = number.size, -1 if number.endian == "little" else 1
    sign = 1 << number.bits - 1 if number.is_signed else 0

    def read(data: bytes, at: int, end: int) -> tuple[int, int]:
        after = at + size
        if after > end:
            raise OtherFrame
        value = 0
        for byte in data[at:after][::step]:
            if byte > 0x7F:
                raise OtherFrame
            value = value << 7 | byte
        return (value ^ sign) - sign, after

    return read


def _septets(number: Number, raw: int) -> bytes:
    data = bytes(raw >> shift & 0x7F for shift in range(0, number.bits, 7))
    return data if number.endian == "little" else data[::-1]


def _bcd_reader(number: Number) -> Callable[[bytes, int, int], tuple[int, int]]:
    size, step = number.size, -1 if number.endian == "little" else 1

    def read(data: bytes, at: int, end: int) -> tuple[int, int]:
        after = at + size
        if after > end:
            raise OtherFrame
        digits = data[at:after][::step].hex()
        if not digits.isdecimal():
            raise OtherFrame
        return int(digits), after

    return read


def coded_writer(number: Number, name: str) -> Callable[[int], bytes]:
    """Return the function from a raw number, which fits, to its bytes."""
    if number.kind == "varint":
        return _written_varint
    if number.kind == "zigzag":
        return lambda raw: _written_varint(raw << 1 if raw >= 0 else ~(raw << 1))
    if number.is_by_seven:
        return lambda raw: _septets(number, raw)
    if number.kind != "bcd":
        write = number_writer(number, name)
        return (lambda raw: _turned(write(raw))) if number.are_words_swapped else write
    size, step = number.size, -1 if number.endian == "little" else 1
    return lambda raw: bytes.fromhex(f"{raw:0{2 * size}d}")[::step]


def _written_varint(raw: int) -> bytes:
    written = bytearray()
    while raw > 0x7F:
        written.append(raw & 0x7F | 0x80)
        raw >>= 7
    written.append(raw)
    return bytes(written)


def coded_step(item: Item) -> Step:
    """Return what reads such a number."""
    read, meaning, const, name = coded_reader(item.number), meaning_of(item), item.const, item.id

    def step(data: bytes, at: int, end: int, out: Out) -> int:
        raw, after = read(data, at, end)
        if const is not None:
            if raw != const:
                raise OtherFrame
        elif name:
            note(out, name, meaning, raw)
        return after

    return step


def packed_step(item: Item, count: Extent) -> Step:
    """Return what reads an array of numbers of any width."""
    size, shifts = packed_size(item.number, count), _shifts(item, count)
    order = "little" if item.is_lsb_first else "big"
    mask = (1 << item.number.bits) - 1
    sign = 1 << item.number.bits - 1 if item.number.is_signed else 0
    meaning, name = meaning_of(item), item.id

    def step(data: bytes, at: int, end: int, out: Out) -> int:
        after = at + size
        if after > end:
            raise OtherFrame
        whole = int.from_bytes(data[at:after], "little" if order == "little" else "big")
        if name:
            raws = [((whole >> shift & mask) ^ sign) - sign for shift in shifts]
            note(out, name, lambda values: [meaning(raw) for raw in values], raws)
        return after

    return step


def _shifts(item: Item, count: Extent) -> list[int]:
    places = range(0, item.number.bits * count.number, item.number.bits)
    return list(places) if item.is_lsb_first else list(reversed(places))


def packed_writer(item: Item, count: Extent) -> Callable[[Mapping[str, Any], bool], bytes]:
    """Return the function from a scope, and whether what is missing is zero, to the array."""
    size, shifts = packed_size(item.number, count), _shifts(item, count)
    checked, mask, name = checked_raw(item), (1 << item.number.bits) - 1, item.id
    zero = (
        item.offset if item.valid is None else min(max(item.offset, item.valid[0]), item.valid[1])
    )

    def write(scope: Mapping[str, Any], is_lenient: bool) -> bytes:
        values = scope.get(name) if name else None
        if values is None:
            if name and not is_lenient:
                raise NotWritable(f"{name!r} has no value here")
            values = [zero] * count.number
        if not isinstance(values, (list, tuple)):
            raise NotWritable(f"{name}: a list is expected, found {values!r}"[:200])
        if len(values) != count.number:
            text = f"{name}: expected {count.number} items, found {len(values)}"
            raise NotWritable(text)
        whole = 0
        for shift, value in zip(shifts, values, strict=True):
            whole |= (checked(value)[0] & mask) << shift
        return whole.to_bytes(size, "little" if item.is_lsb_first else "big")

    return write
