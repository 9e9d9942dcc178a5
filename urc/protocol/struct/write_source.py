"""Generated functions that write struct items, one per declaration.

Pure. Generated writers are the inverse of the generated readers in
`urc.protocol.struct.read_source`. Generated writers support only fixed items. Closures handle all
other items and all invalid values.
"""

import struct
from collections.abc import Callable, Mapping
from typing import Any

from urc._number_codec import format_of
from urc.expressions import ExpressionError
from urc.model.binary import Item, derived_sizes
from urc.protocol.compile.source_builder import SourceBuilder
from urc.protocol.struct.read import const_of
from urc.protocol.struct.runs import FixedField, FixedRun, runs_of
from urc.protocol.struct.value import (
    bytes_of_text,
    checked_raw,
    fixed_bytes,
    number_writer,
)
from urc.protocol.struct.write import build_write_steps, write_frame
from urc.protocol.values.convert import divisor_of
from urc.protocol.values.payload import NotWritable

__all__ = ["generate_write"]

Write = Callable[[Mapping[str, object]], bytes]


def generate_write(items: tuple[Item, ...], encoding: str) -> Write:
    """Return a function that encodes arguments to a frame, or raises `NotWritable`.

    The generated code handles only valid values. After an error, the closures encode the frame
    again. The closures round and convert values, and report invalid values.
    """
    steps = build_write_steps(items, encoding, is_lenient=False)

    def slow(namespace: Mapping[str, object]) -> bytes:
        return write_frame(steps, namespace)

    parts = list(runs_of(items))
    runs = [part for part in parts if isinstance(part, FixedRun)]
    leaves = [leaf for run in runs for leaf in run.leaves]
    if len(runs) != len(parts) or derived_sizes(items) or not all(map(_is_quick, leaves)):
        return slow
    source = SourceBuilder()
    wrong = (ExpressionError, NotWritable, struct.error, LookupError, TypeError, ValueError)
    source.scope |= {"slow": slow, "Wrong": (*wrong, OverflowError)}
    source.add("try:")
    frames = []
    for run in runs:
        values = [text for leaf in run.leaves for text in _written(source, leaf, encoding)]
        frames.append(f"{source.bind('pack', run.struct.pack)}({', '.join(values)})")
    source.add(f"return {' + '.join(frames) or repr(b'')}", 2)
    source.add("except Wrong:")
    source.add("return slow(namespace)", 2)
    write: Write = source.compile("write_struct", "namespace")
    return write


def _is_quick(leaf: FixedField) -> bool:
    """Return whether an item can be written without the values of other items."""
    item = leaf.item
    inner = item.items if item.kind == "bits" else (item,)
    if any(one.value is not None for one in inner):
        return False
    return not (item.kind == "padding" and item.pad)


def _written(source: SourceBuilder, leaf: FixedField, encoding: str) -> list[str]:
    """Return the source of the arguments of ``pack`` for one item."""
    item = leaf.item
    if item.kind == "padding":
        return []
    if item.kind == "bits":
        return [_written_bits(source, leaf)]
    value = f"namespace[{leaf.name!r}]"
    if item.kind in ("text", "bytes"):
        if item.const is not None:
            return [repr(item.const)]
        encode, pad = bytes_of_text(item, encoding), fixed_bytes(item)
        return [f"{source.bind('pad', pad)}({source.bind('encode', encode)}({value}))"]
    if item.times is not None:
        checked = checked_raw(item)
        write = source.bind("raws", lambda values: _exactly(values, leaf.values, checked))
        return [f"*{write}({value})"]
    return [_written_number(source, leaf, value)]


def _written_number(source: SourceBuilder, leaf: FixedField, value: str) -> str:
    item = leaf.item
    pack = number_writer(item.number, item.id)
    if item.const is not None or not leaf.name:
        raw = const_of(item) if item.const is not None else 0
        return repr(raw if format_of(item.number) else pack(raw))
    if not format_of(item.number):
        checked = checked_raw(item)
        return f"{source.bind('bytes', lambda one: pack(checked(one)[0]))}({value})"
    if item.enum and item.valid is None:
        return f"{source.bind('numbers', {word: raw for raw, word in item.enum})}[{value}]"
    if item.valid is not None or item.number.kind == "boolean":
        return f"{source.bind('raw', checked_raw(item))}({value})[0]"
    divisor = divisor_of(item.scale)
    if item.offset:
        value = f"({value} - {item.offset!r})"
    if divisor:
        value = f"{value} * {divisor}"
    elif item.scale != 1:
        value = f"{value} / {item.scale!r}"
    is_scaled = item.scale != 1 or item.offset
    return f"round({value})" if is_scaled and item.number.kind == "integer" else value


def _written_bits(source: SourceBuilder, leaf: FixedField) -> str:
    item = leaf.item
    terms = []
    for part, shift, mask, _, _ in leaf.bit_parts():
        if part.const is not None:
            terms.append(str((int(part.const) & mask) << shift))
        elif part.id:
            raw = source.bind("raw", checked_raw(part))
            terms.append(f"({raw}(namespace[{part.id!r}])[0] & {mask}) << {shift}")
    whole = " | ".join(terms) or "0"
    if format_of(item.number):
        return whole
    pack = source.bind("bytes", number_writer(item.number, item.id))
    return f"{pack}({whole})"


def _exactly(values: Any, count: int, checked: Callable[[Any], tuple[Any, Any]]) -> list[Any]:
    if not isinstance(values, (list, tuple)) or len(values) != count:
        raise TypeError
    return [checked(value)[0] for value in values]
