"""Closures that read struct items from bytes into fields.

Pure. The closures are a readable version of the code that `urc.protocol.struct.read_source`
generates. Generated functions are faster for runs of fixed items. Tests compare the results of the
closures and the generated functions. Theory of operation: every item becomes a step ``(data, at,
end, out) -> after``. A step reads bytes from `at` to at most `end` and stores the value in `out`.
A step raises `OtherFrame` if the frame does not match. The first invalid value's error is stored
under the key `FAULT`, and reading continues. The error is reported only if the whole frame matches.
"""

from collections.abc import Callable, Mapping
from struct import unpack_from
from typing import Any

from urc._number_codec import format_of, order_of, plain_reader
from urc.expressions import ExpressionError, Template, quoted
from urc.model.binary import FRAME_NAMES, Extent, Item, Switch, joined_name, least_size
from urc.protocol.struct.coded import (
    FAULT,
    OtherFrame,
    coded_reader,
    coded_step,
    note,
    packed_step,
)
from urc.protocol.struct.value import (
    meaning_of,
    number_writer,
    text_of_bytes,
)
from urc.protocol.values.payload import BadItem

__all__ = [
    "FAULT",
    "BitPart",
    "OtherFrame",
    "Step",
    "bit_parts",
    "build_step",
    "build_steps",
    "const_of",
    "read_frame",
]

Out = dict[str, Any]
Step = Callable[[bytes, int, int, Out], int]
Amount = Callable[[bytes, int, int, Out], tuple[int, int]]
"""Function that returns a size or count (-1: up to the end) and the offset at which the data
starts."""

BitPart = tuple[Item, int, int, int, Callable[[Any], Any]]
"""One number inside a ``bits`` item: item, shift, mask, sign bit (0 if unsigned) and decoder."""


def read_frame(steps: tuple[Step, ...], data: object) -> Mapping[str, object] | None:
    """Return the fields of `data`; None if the frame does not match.

    Raises:
        BadItem: the frame matches but contains an invalid value.
    """
    if not isinstance(data, bytes):
        return None
    out: Out = {}
    at = 0
    try:
        for step in steps:
            at = step(data, at, len(data), out)
    except OtherFrame:
        return None
    if at != len(data):
        return None
    if FAULT in out:
        raise out[FAULT]
    return out


def build_steps(items: tuple[Item, ...], encoding: str) -> tuple[Step, ...]:
    """Return one step for each item of a frame or of an inner struct."""
    return tuple(build_step(item, encoding) for item in items)


def build_step(item: Item, encoding: str) -> Step:
    """Return the step for one item, including its condition and array."""
    single = item._replace(condition=None)
    if item.times is not None:
        step = _array_step(single, item.times, encoding)
    else:
        step = _STEPS[item.kind](single, encoding)
    return step if item.condition is None else _conditional(step, item.condition)


def _evaluator(template: Template) -> Callable[[bytes, int, Out], Any]:
    needs_frame = bool(template.names & FRAME_NAMES)

    def evaluate(data: bytes, at: int, out: Out) -> Any:
        frame = {"_size": len(data), "_left": len(data) - at} if needs_frame else {}
        try:
            return template.evaluate({**out, **frame} if frame else out)
        except ExpressionError as error:
            raise BadItem(str(error)) from None

    return evaluate


def _conditional(step: Step, condition: Template) -> Step:
    evaluate = _evaluator(condition)

    def conditional(data: bytes, at: int, end: int, out: Out) -> int:
        return step(data, at, end, out) if evaluate(data, at, out) else at

    return conditional


def _number_step(item: Item, encoding: str) -> Step:
    read, size, meaning = plain_reader(item.number), item.number.size, meaning_of(item)
    const, name = const_of(item), item.id
    has_meaning = const is None and bool(name)

    def step(data: bytes, at: int, end: int, out: Out) -> int:
        after = at + size
        if after > end:
            raise OtherFrame
        raw = read(data, at)
        if const is not None and raw != const:
            raise OtherFrame
        if has_meaning:
            note(out, name, meaning, raw)
        return after

    return step


def const_of(item: Item) -> Any:
    """Return a constant as a frame returns it: 0.1 in 32 bits is not exactly 0.1."""
    if item.const is None or item.kind != "number":
        return item.const
    return plain_reader(item.number)(number_writer(item.number, item.id)(item.const), 0)


def _bits_step(item: Item, encoding: str) -> Step:
    read, size = plain_reader(item.number), item.number.size
    parts = bit_parts(item)

    def step(data: bytes, at: int, end: int, out: Out) -> int:
        after = at + size
        if after > end:
            raise OtherFrame
        whole = read(data, at)
        for part, shift, mask, sign, meaning in parts:
            raw = whole >> shift & mask
            if raw & sign:
                raw -= mask + 1
            if part.const is not None:
                if raw != part.const:
                    raise OtherFrame
            elif part.id:
                note(out, part.id, meaning, raw)
        return after

    return step


def bit_parts(item: Item) -> list[BitPart]:
    """Return the parts of a ``bits`` item."""
    parts = []
    left = item.number.bits
    for part in item.items:
        width = part.number.bits
        left -= width
        shift = item.number.bits - left - width if item.is_lsb_first else left
        named = part._replace(id=joined_name(item.id, part.id) if part.id else "")
        sign = 1 << width - 1 if part.number.is_signed else 0
        parts.append((named, shift, (1 << width) - 1, sign, meaning_of(named)))
    return parts


def _text_step(item: Item, encoding: str) -> Step:
    amount, until = build_amount(item.size, item.id), item.until
    meaning, const, name = text_of_bytes(item, encoding), item.const, item.id

    def step(data: bytes, at: int, end: int, out: Out) -> int:
        if until:
            stop = data.find(until, at, end)
            after = stop + len(until)
            if stop < 0:
                raise OtherFrame
        else:
            size, at = amount(data, at, end, out)
            after = stop = at + size if size >= 0 else end
            if stop > end:
                raise OtherFrame
        raw = data[at:stop]
        if const is not None:
            if raw != const:
                raise OtherFrame
        elif name:
            note(out, name, meaning, raw)
        return after

    return step


def _padding_step(item: Item, encoding: str) -> Step:
    amount = build_amount(item.size, "padding")

    def step(data: bytes, at: int, end: int, out: Out) -> int:
        size, at = amount(data, at, end, out)
        if size > end - at:
            raise OtherFrame
        return at + size if size >= 0 else end

    return step


def build_amount(extent: Extent | None, name: str) -> Amount:
    """Return a function that computes a size or count from the values of earlier items."""
    if extent is None or extent.kind == "rest":
        return lambda data, at, end, out: (-1, at)
    if extent.kind == "fixed":
        number = extent.number
        return lambda data, at, end, out: (number, at)
    if extent.prefix is not None:
        return _prefix_amount(extent)
    assert extent.expression is not None  # noqa: S101  # guaranteed by the loader
    evaluate = _evaluator(extent.expression)

    def amount(data: bytes, at: int, end: int, out: Out) -> tuple[int, int]:
        found = evaluate(data, at, out)
        if isinstance(found, float) and found.is_integer():
            found = int(found)
        if not isinstance(found, int) or found < 0:
            raise BadItem(f"{name}: {quoted(found)} is not a valid size")
        return found, at

    return amount


def _prefix_amount(extent: Extent) -> Amount:
    assert extent.prefix is not None  # noqa: S101  # checked by the caller
    read = coded_reader(extent.prefix)
    return lambda data, at, end, out: read(data, at, end)


def _array_step(item: Item, count: Extent, encoding: str) -> Step:
    """Read consecutive items.

    Each item takes at least one byte, so the size of the frame limits the number of items.
    """
    single = item._replace(times=None)
    if item.kind == "packed":
        return packed_step(single, count)
    if item.kind == "number" and format_of(item.number):
        return _numbers_step(single, count)
    amount, name, least = build_amount(count, item.id), item.id, max(1, least_size((single,)))
    is_struct = item.kind == "struct"
    step = _STEPS[item.kind](single._replace(id="") if is_struct else single, encoding)

    def array(data: bytes, at: int, end: int, out: Out) -> int:
        number, at = amount(data, at, end, out)
        if number * least > end - at:
            raise OtherFrame
        found: list[Any] = []
        left = number if number >= 0 else end - at
        while left > 0 and not (number < 0 and at >= end):
            left -= 1
            one: Out = {}
            before, at = at, step(data, at, end, one)
            if at == before:
                raise OtherFrame
            if FAULT in one:
                out.setdefault(FAULT, one.pop(FAULT))
            if name:
                found.append(one if is_struct else one.get(name))
            else:
                out |= one
        if name:
            out[name] = found
        return at

    return array


def _numbers_step(item: Item, count: Extent) -> Step:
    amount, name, meaning = build_amount(count, item.id), item.id, meaning_of(item)
    order, code, size = order_of(item.number), format_of(item.number), item.number.size
    is_plain = item == Item("number", item.id, item.number)

    def numbers(data: bytes, at: int, end: int, out: Out) -> int:
        number, at = amount(data, at, end, out)
        if number < 0:
            number, over = divmod(end - at, size)
            if over:
                raise OtherFrame
        after = at + number * size
        if after > end:
            raise OtherFrame
        raws = list(unpack_from(f"{order}{number}{code}", data, at))
        if name and is_plain:
            out[name] = raws
        elif name:
            note(out, name, lambda raws: [meaning(raw) for raw in raws], raws)
        return after

    return numbers


def _struct_step(item: Item, encoding: str) -> Step:
    steps, name = build_steps(item.items, encoding), item.id
    body = _windowed(steps, item) if item.size is not None else _body(steps)
    if not name:
        return body

    def struct(data: bytes, at: int, end: int, out: Out) -> int:
        inner: Out = {}
        after = body(data, at, end, inner)
        for key, value in inner.items():
            if key == FAULT:
                out.setdefault(FAULT, value)
            else:
                out[joined_name(name, key)] = value
        return after

    return struct


def _body(steps: tuple[Step, ...]) -> Step:
    def body(data: bytes, at: int, end: int, out: Out) -> int:
        for step in steps:
            at = step(data, at, end, out)
        return at

    return body


def _windowed(steps: tuple[Step, ...], item: Item) -> Step:
    """Return the step for a struct that must fill its declared size, except for trimmed bytes."""
    body, amount = _body(steps), build_amount(item.size, item.id)
    trim, full = item.trim, least_size(item.items)

    def windowed(data: bytes, at: int, end: int, out: Out) -> int:
        size, at = amount(data, at, end, out)
        stop = at + size if size >= 0 else end
        if stop > end:
            raise OtherFrame
        if trim is not None and stop - at < full:
            whole = data[at:stop] + bytes((trim,)) * (full - (stop - at))
            body(whole, 0, full, out)
        elif body(data, at, stop, out) != stop:
            raise OtherFrame
        return stop

    return windowed


def _switch_step(item: Item, encoding: str) -> Step:
    switch: Switch = item.switch  # type: ignore[assignment]  # a switch has one
    evaluate = _evaluator(switch.by)
    cases: dict[object, Step | None] = {
        key: _body(build_steps(inner, encoding)) for key, inner in switch.cases
    }
    default = None if switch.default is None else _body(build_steps(switch.default, encoding))

    def step(data: bytes, at: int, end: int, out: Out) -> int:
        key = evaluate(data, at, out)
        chosen = cases.get(key, default) if isinstance(key, (int, float, str)) else default
        if chosen is None:
            raise OtherFrame
        return chosen(data, at, end, out)

    return step


_STEPS: dict[str, Callable[[Item, str], Step]] = {
    "number": _number_step,
    "coded": lambda item, encoding: coded_step(item),
    "bits": _bits_step,
    "bytes": _text_step,
    "text": _text_step,
    "padding": _padding_step,
    "struct": _struct_step,
    "switch": _switch_step,
}
