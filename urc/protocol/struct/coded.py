"""Struct numbers with special encodings: variable length, decimal digits or unusual widths.

Pure. ``varint`` is LEB128 as in Protocol Buffers, and ``zigzag`` is its signed form. ``bcd`` has
two decimal digits per byte. ``f32cdab`` has swapped 16-bit words, and ``u14by7le`` has seven bits
per byte. A packed array contains consecutive numbers of any width, without byte alignment. No
number has more than 64 bits.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final

from urc._number_codec import reader_of, words_turned, writer_of
from urc.expressions import quoted
from urc.model.binary import Extent, Item, Number, packed_size
from urc.protocol.struct.value import checked_raw, meaning_of, number_writer
from urc.protocol.values.payload import BadItem, NotWritable

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
"""Key in `out` under which the first invalid item's error is stored; no item has this name."""


class OtherFrame(Exception):
    """The received bytes are not the declared frame, so another declaration may match."""


def note(out: Out, name: str, meaning: Callable[[Any], Any], raw: Any) -> None:
    """Store the decoded value of `raw` in `out`; on failure, store the first error."""
    try:
        out[name] = meaning(raw)
    except BadItem as error:
        out.setdefault(FAULT, error)


def coded_reader(number: Number) -> Callable[[bytes, int, int], tuple[Any, int]]:
    """Return a function that reads a raw number from data between two offsets.

    The returned function raises `OtherFrame` for an invalid number.
    """
    return reader_of(number, OtherFrame)


def coded_writer(number: Number, name: str) -> Callable[[Any], bytes]:
    """Return a function that encodes a raw number within the range of the type."""
    if number.kind == "float" and number.are_words_swapped:
        write = number_writer(number._replace(are_words_swapped=False), name)
        return lambda raw: words_turned(write(raw))
    return writer_of(number)


def coded_step(item: Item) -> Step:
    """Return the step that reads a number with a special encoding into its field."""
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
    """Return the step that reads a packed array of numbers."""
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
    """Return a function ``(scope, is_lenient)`` that encodes a packed array as bytes."""
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
            raise NotWritable(f"{name}: expected a list, found {quoted(values)}")
        if len(values) != count.number:
            text = f"{name}: expected {count.number} items, found {len(values)}"
            raise NotWritable(text)
        whole = 0
        for shift, value in zip(shifts, values, strict=True):
            whole |= (checked(value)[0] & mask) << shift
        return whole.to_bytes(size, "little" if item.is_lsb_first else "big")

    return write
