"""Conversion of struct items from their raw form to a value, and back.

Pure. The closures and the slow paths of generated functions share the conversions in this module.
The raw form of an item is the number or the bytes in the frame. The value of an item is a field or
argument, such as a scaled number, an enum word, or text.
"""

import struct
from collections.abc import Callable
from typing import Any

from urc._number_codec import plain_writer
from urc.expressions import quoted
from urc.model.binary import Item, Number
from urc.protocol.values.convert import divisor_of
from urc.protocol.values.payload import BadItem, NotWritable

__all__ = [
    "bytes_of_text",
    "checked_raw",
    "fitting",
    "fixed_bytes",
    "meaning_of",
    "not_valid",
    "number_writer",
    "raw_of",
    "text_of_bytes",
]


def meaning_of(item: Item) -> Callable[[Any], Any]:
    """Return a function that converts the raw form to a value, or raises `BadItem`."""
    words, scale, offset, valid = dict(item.enum), item.scale, item.offset, item.valid
    divisor = divisor_of(scale)

    def meaning(raw: Any) -> Any:
        value = raw
        if divisor:
            value = value / divisor
        elif scale != 1:
            value = value * scale
        if offset:
            value = value + offset
        if valid is not None and not valid[0] <= value <= valid[1]:
            raise not_valid(item.id, value, valid)
        return words.get(value, value) if words else value

    return meaning


def not_valid(name: str, value: object, valid: tuple[float, float]) -> BadItem:
    """Return the error for a value outside the item's ``valid`` range."""
    return BadItem(f"{name}: expected {valid[0]:g} to {valid[1]:g}, found {quoted(value)}")


def raw_of(item: Item) -> Callable[[Any], Any]:
    """Return a function that converts the value to the raw form, or raises `NotWritable`.

    Values of integer items are rounded to the nearest whole number; halves are rounded to the
    nearest even number.
    """
    numbers = {word: number for number, word in item.enum}
    number, valid, scale, offset = item.number, item.valid, item.scale, item.offset
    divisor = divisor_of(scale)
    name = item.id or "a number"

    def raw(value: Any) -> Any:
        if isinstance(value, str):
            if value not in numbers:
                raise NotWritable(f"{name}: expected {_wanted(item)}, found {quoted(value)}")
            value = numbers[value]
        elif not isinstance(value, (int, float)):
            raise NotWritable(f"{name}: expected {_wanted(item)}, found {quoted(value)}")
        elif isinstance(value, int) and value.bit_length() > 1000:
            raise NotWritable(f"{name}: {quoted(value)} is too large")
        if valid is not None and not valid[0] <= value <= valid[1]:
            raise NotWritable(
                f"{name}: expected {valid[0]:g} to {valid[1]:g}, found {quoted(value)}"
            )
        if offset:
            value = value - offset
        if divisor:
            value = value * divisor
        elif scale != 1:
            value = value / scale
        return fitting(number, value, name)

    return raw


def fitting(number: Number, value: int | float, name: str) -> int | float | bool:
    """Return `value` converted to the type `number`; raise `NotWritable` if out of range."""
    if number.kind == "float":
        try:
            return float(value)
        except OverflowError:
            raise NotWritable(f"{name}: {quoted(value)} is too large") from None
    if number.kind == "boolean":
        if value in (0, 1):
            return bool(value)
        raise NotWritable(f"{name}: expected true or false, found {quoted(value)}")
    if isinstance(value, float):
        if not abs(value) < 1e30:  # not-a-number fails every comparison
            raise NotWritable(f"{name}: expected a whole number, found {quoted(value)}")
        value = round(value)
    if not number.least <= value <= number.most:
        sign = "signed " if number.is_signed else ""
        raise NotWritable(
            f"{name}: {value} does not fit into {number.bits} {sign}bits,"
            f" which hold {number.least} to {number.most}"
        )
    return int(value)


def _wanted(item: Item) -> str:
    if not item.enum:
        return "a number"
    words = [word for _, word in item.enum]
    return "one of " + ", ".join(words[:8]) + (" …" if len(words) > 8 else "")


def checked_raw(item: Item) -> Callable[[Any], tuple[Any, Any]]:
    """Return a function that converts a value to a raw number and that number's exact value."""
    raw_from, meaning = raw_of(item), meaning_of(item)

    def checked(value: Any) -> tuple[Any, Any]:
        raw = raw_from(value)
        try:
            return raw, meaning(raw)
        except BadItem as error:  # rounding has moved the value out of range
            raise NotWritable(str(error)) from None

    return checked


def number_writer(number: Number, name: str) -> Callable[[Any], bytes]:
    """Return a function that encodes a raw number within the range of the type."""
    pack = plain_writer(number)

    def write(raw: Any) -> bytes:
        try:
            return pack(raw)
        except (OverflowError, struct.error):  # the float is too large for 16 or 32 bits
            text = f"{name or 'a number'}: {quoted(raw)} does not fit into f{number.bits}"
            raise NotWritable(text) from None

    return write if number.kind == "float" else pack


def text_of_bytes(item: Item, encoding: str) -> Callable[[bytes], object]:
    """Return a function that converts the bytes of a text or bytes item to a value."""
    if item.kind == "bytes":
        return bytes
    codec, name = item.encoding or encoding, item.id
    pad = bytes((item.pad,))
    is_padded = item.size is not None and item.size.kind == "fixed"

    def text(raw: bytes) -> str:
        if is_padded:
            # After the first NUL in a C string, any bytes may follow.
            raw = raw.rstrip(pad) if item.pad else raw.partition(pad)[0]
        try:
            return raw.decode(codec)
        except UnicodeDecodeError as error:
            wrong = raw[error.start : error.end]
            raise BadItem(f"{name}: {quoted(wrong)} is not {codec} text") from None

    return text


def bytes_of_text(item: Item, encoding: str) -> Callable[[object], bytes]:
    """Return a function that converts a value to the unpadded bytes of a text or bytes item."""
    codec, name = item.encoding or encoding, item.id or item.kind

    def encode(value: object) -> bytes:
        if isinstance(value, bytes):
            raw = value
        elif not isinstance(value, str):
            raise NotWritable(f"{name}: expected text, found {quoted(value)}")
        elif item.kind == "bytes":
            raw = hex_bytes(value, name)
        else:
            try:
                raw = value.encode(codec)
            except UnicodeEncodeError as error:
                wrong = error.object[error.start]
                raise NotWritable(f"{name}: {quoted(wrong)} cannot be encoded in {codec}") from None
        if item.until and item.until in raw:
            raise NotWritable(f"{name}: {quoted(raw)} contains its terminator {quoted(item.until)}")
        return raw

    return encode


def fixed_bytes(item: Item) -> Callable[[bytes], bytes]:
    """Return a function that pads bytes to the fixed size of the item."""
    assert item.size is not None  # noqa: S101  # checked by the caller
    name, size, pad = item.id or item.kind, item.size.number, bytes((item.pad,))
    ends_at_nul = item.kind == "text" and not item.pad

    def padded(raw: bytes) -> bytes:
        if len(raw) > size:
            raise NotWritable(f"{name}: {len(raw)} bytes do not fit into {size}")
        if ends_at_nul and pad in raw:
            raise NotWritable(f"{name}: {quoted(raw)} contains a NUL, which ends the text")
        return raw.ljust(size, pad)

    return padded


def hex_bytes(text: str, name: str) -> bytes:
    """Convert a string of hex digits to bytes; raise `NotWritable` for any other value."""
    try:
        return bytes.fromhex(text)
    except ValueError:
        raise NotWritable(f"{name}: expected hex digits, found {quoted(text)}") from None
