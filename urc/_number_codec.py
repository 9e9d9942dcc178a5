"""Converts between numbers and bytes, for every type in `urc._number_types`.

``varint`` is LEB128 as in Protocol Buffers, and ``zigzag`` is its signed form. ``bcd`` has two
decimal digits per byte. ``f32cdab`` has swapped 16-bit words, and ``u14by7le`` has seven bits per
byte.
"""

import struct
from collections.abc import Callable
from typing import Any, Final

from urc._number_types import Number

__all__ = [
    "format_of",
    "order_of",
    "plain_reader",
    "plain_writer",
    "reader_of",
    "words_turned",
    "writer_of",
]

_MOST_BYTES: Final = 10
"""Maximum size of a 64-bit varint, in bytes."""
_CODES = {
    ("integer", 8): "B",
    ("integer", 16): "H",
    ("integer", 32): "I",
    ("integer", 64): "Q",
    ("float", 16): "e",
    ("float", 32): "f",
    ("float", 64): "d",
    ("boolean", 8): "?",
}


def format_of(number: Number) -> str:
    """Return the `struct` format character for a number; "" for 24, 40, 48 and 56 bits."""
    code = _CODES.get((number.kind, number.bits), "")
    return code.lower() if number.is_signed and number.kind == "integer" else code


def order_of(number: Number) -> str:
    """Return the `struct` character for the byte order of a number."""
    return "<" if number.endian == "little" else ">"


def plain_reader(number: Number) -> Callable[[bytes, int], Any]:
    """Return a function that reads a raw number from bytes at an offset."""
    code = format_of(number)
    if code:
        unpack = struct.Struct(order_of(number) + code).unpack_from
        return lambda data, at: unpack(data, at)[0]
    size, endian, is_signed = number.size, number.endian, number.is_signed
    return lambda data, at: int.from_bytes(data[at : at + size], endian, signed=is_signed)


def plain_writer(number: Number) -> Callable[[Any], bytes]:
    """Return a function that encodes a raw number within the range of the type.

    The returned function raises `OverflowError` or `struct.error` if a float is too large for 16 or
    32 bits.
    """
    code = format_of(number)
    if not code:
        size, endian, is_signed = number.size, number.endian, number.is_signed
        return lambda raw: int(raw).to_bytes(size, endian, signed=is_signed)
    return struct.Struct(order_of(number) + code).pack


def reader_of(
    number: Number, fault: type[Exception]
) -> Callable[[bytes, int, int], tuple[Any, int]]:
    """Return a function that reads a number from data between two offsets.

    The returned function raises `fault` for an invalid number.
    """
    if number.is_variable:
        return _varint_reader(fault, is_zigzag=number.kind == "zigzag")
    if number.is_by_seven:
        return _septets_reader(number, fault)
    if number.kind == "bcd":
        return _bcd_reader(number, fault)
    read, size = plain_reader(number), number.size
    if number.are_words_swapped:
        straight, read = read, lambda data, at: straight(words_turned(data[at : at + size]), 0)

    def fixed(data: bytes, at: int, end: int) -> tuple[Any, int]:
        if at + size > end:
            raise fault
        return read(data, at), at + size

    return fixed


def writer_of(number: Number) -> Callable[[Any], bytes]:
    """Return a function that encodes a raw number within the range of the type."""
    if number.kind == "varint":
        return _written_varint
    if number.kind == "zigzag":
        return lambda raw: _written_varint(raw << 1 if raw >= 0 else ~(raw << 1))
    if number.is_by_seven:
        return lambda raw: _septets(number, raw)
    if number.kind == "bcd":
        size, step = number.size, -1 if number.endian == "little" else 1
        return lambda raw: bytes.fromhex(f"{raw:0{2 * size}d}")[::step]
    write = plain_writer(number)
    return (lambda raw: words_turned(write(raw))) if number.are_words_swapped else write


def words_turned(data: bytes) -> bytes:
    """Return the 16-bit words of `data` in reverse order."""
    return b"".join(data[place : place + 2] for place in range(len(data) - 2, -1, -2))


def _varint_reader(
    fault: type[Exception], *, is_zigzag: bool
) -> Callable[[bytes, int, int], tuple[int, int]]:
    def read(data: bytes, at: int, end: int) -> tuple[int, int]:
        value = shift = 0
        for place in range(at, min(end, at + _MOST_BYTES)):
            byte = data[place]
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                if value >> 64:
                    break
                return (value >> 1 ^ -(value & 1) if is_zigzag else value), place + 1
            shift += 7
        raise fault

    return read


def _septets_reader(
    number: Number, fault: type[Exception]
) -> Callable[[bytes, int, int], tuple[int, int]]:
    size, step = number.size, -1 if number.endian == "little" else 1
    sign = 1 << number.bits - 1 if number.is_signed else 0

    def read(data: bytes, at: int, end: int) -> tuple[int, int]:
        after = at + size
        if after > end:
            raise fault
        value = 0
        for byte in data[at:after][::step]:
            if byte > 0x7F:
                raise fault
            value = value << 7 | byte
        return (value ^ sign) - sign, after

    return read


def _septets(number: Number, raw: int) -> bytes:
    data = bytes(raw >> shift & 0x7F for shift in range(0, number.bits, 7))
    return data if number.endian == "little" else data[::-1]


def _bcd_reader(
    number: Number, fault: type[Exception]
) -> Callable[[bytes, int, int], tuple[int, int]]:
    size, step = number.size, -1 if number.endian == "little" else 1

    def read(data: bytes, at: int, end: int) -> tuple[int, int]:
        after = at + size
        if after > end:
            raise fault
        digits = data[at:after][::step].hex()
        if not digits.isdecimal():
            raise fault
        return int(digits), after

    return read


def _written_varint(raw: int) -> bytes:
    written = bytearray()
    while raw > 0x7F:
        written.append(raw & 0x7F | 0x80)
        raw >>= 7
    written.append(raw)
    return bytes(written)
