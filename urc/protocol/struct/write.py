"""Closures that write the values of struct items as bytes.

Pure. These closures are the inverse of the closures in `urc.protocol.struct.read`. Theory of
operation: every item becomes a step ``(pen, scope)`` that appends its bytes. Two kinds of items
leave a gap in the frame until their number can be computed. Gaps for the size of a later item are
stored in the scope. Gaps for values that depend on the size of the whole frame are stored in
`FrameBuilder.late`.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from urc.expressions import Template, quoted
from urc.model.binary import (
    FRAME_NAMES,
    OUTER_NAMES,
    Extent,
    Item,
    Number,
    Switch,
    derived_sizes,
    joined_name,
    least_size,
    names_of,
)
from urc.protocol.struct.coded import coded_writer, packed_writer
from urc.protocol.struct.frame_builder import (
    GAP,
    LARGEST_FRAME,
    Backpatch,
    FrameBuilder,
    Scope,
    evaluate,
    solved,
)
from urc.protocol.struct.read import bit_parts, const_of
from urc.protocol.struct.value import (
    bytes_of_text,
    checked_raw,
    fitting,
    fixed_bytes,
    number_writer,
)
from urc.protocol.values.payload import NotWritable

__all__ = [
    "StructWriteScope",
    "WriteStep",
    "build_write_steps",
    "write_frame",
]

WriteStep = Callable[[FrameBuilder, Scope], None]


class StructWriteScope(NamedTuple):
    """Settings that all steps of one frame or inner struct share."""

    encoding: str
    derived: Mapping[str, Template]
    """Formulas for sizes and counts, keyed by the name of the item that contains the number."""
    is_lenient: bool
    """Whether missing values count as zero, because an emulated robot sets only some values."""


def build_write_steps(
    items: tuple[Item, ...], encoding: str, *, is_lenient: bool
) -> tuple[WriteStep, ...]:
    """Return the steps that write items whose sizes and counts refer only to each other."""
    rules = StructWriteScope(encoding, derived_sizes(items), is_lenient)
    return tuple(_build(item, rules) for item in items)


def write_frame(steps: tuple[WriteStep, ...], namespace: Mapping[str, object]) -> bytes:
    """Return a frame with the values in `namespace`; raise `NotWritable` if impossible."""
    builder = FrameBuilder()
    scope: Scope = dict(namespace)
    for step in steps:
        step(builder, scope)
    size = len(builder.bytes)
    for gap, template, known in builder.late:
        frame = {"_size": size, "_left": size - gap.at}
        builder.fill(gap, evaluate(template, {**known, **frame}))
    return bytes(builder.bytes)


def _build(item: Item, rules: StructWriteScope) -> WriteStep:
    single = item._replace(condition=None)
    if item.times is not None:
        step = _array_step(single, item.times, rules)
    else:
        step = _STEPS[item.kind](single, rules)
    return step if item.condition is None else _conditional(step, item, item.condition, rules)


def _conditional(
    step: WriteStep, item: Item, condition: Template, rules: StructWriteScope
) -> WriteStep:
    # An item whose condition depends on the unfinished frame is present if it has a value.
    is_known = not condition.names & (FRAME_NAMES | rules.derived.keys())
    names = tuple(names_of((item,)))

    def conditional(builder: FrameBuilder, scope: Scope) -> None:
        if is_known:
            is_there = evaluate(condition, scope)
        else:
            is_there = any(scope.get(name) is not None for name in names)
        if is_there:
            step(builder, scope)

    return conditional


def _given(item: Item, scope: Scope, rules: StructWriteScope, zero: object) -> Any:
    """Return the value of `item`: the computed value, the given value, or zero."""
    # A reply repeats the number of its request, which only the request computes.
    is_repeated = rules.is_lenient and bool(item.id) and scope.get(item.id) is not None
    if item.value is not None and not is_repeated:
        return evaluate(item.value, scope)
    value = scope.get(item.id) if item.id else None
    if value is not None:
        return value
    if rules.is_lenient or not item.id:
        return zero
    raise NotWritable(f"{item.id!r} has no value here")


def _raw_number(item: Item, rules: StructWriteScope) -> Callable[[Scope], Any]:
    """Return a function that encodes the item's number and stores the value in the scope."""
    checked, zero, name = checked_raw(item), _zero_of(item), item.id

    def raw_number(scope: Scope) -> Any:
        raw, value = checked(_given(item, scope, rules, zero))
        if name:
            scope[name] = value
        return raw

    return raw_number


def _deferral(
    item: Item, rules: StructWriteScope
) -> Callable[[FrameBuilder, Scope, Backpatch], None] | None:
    """Return the handler for the gap if the number is computed later, otherwise None."""
    value = item.value
    if value is None and item.id in rules.derived:
        return lambda builder, scope, gap: scope.__setitem__(GAP + item.id, gap)
    if value is not None and value.names & (FRAME_NAMES | rules.derived.keys()):
        return lambda builder, scope, gap: builder.late.append((gap, value, scope))
    return None


def _number_step(item: Item, rules: StructWriteScope) -> WriteStep:
    write = number_writer(item.number, item.id)
    if item.const is not None:
        constant = write(const_of(item))
        return lambda builder, scope: builder.append(constant)
    defer, blank = _deferral(item, rules), bytes(item.number.size)
    if defer is not None:

        def leave_gap(builder: FrameBuilder, scope: Scope) -> None:
            defer(builder, scope, Backpatch(len(builder.bytes), item, item.number))
            builder.append(blank)

        return leave_gap
    raw_number = _raw_number(item, rules)
    return lambda builder, scope: builder.append(write(raw_number(scope)))


def _coded_step(item: Item, rules: StructWriteScope) -> WriteStep:
    write = coded_writer(item.number, item.id)
    if item.const is not None:
        constant = write(int(item.const))
        return lambda builder, scope: builder.append(constant)
    raw_number = _raw_number(item, rules)
    return lambda builder, scope: builder.append(write(raw_number(scope)))


def _zero_of(item: Item) -> float:
    """Return zero, or the valid value nearest to zero."""
    zero = item.offset if item.id else 0
    if item.valid is None:
        return zero
    return min(max(zero, item.valid[0]), item.valid[1])


def _bits_step(item: Item, rules: StructWriteScope) -> WriteStep:
    container = item.number
    write = number_writer(container, item.id)
    parts = [
        (part, shift, mask, _deferral(part, rules), _raw_number(part, rules))
        for part, shift, mask, _, _ in bit_parts(item)
    ]

    def step(builder: FrameBuilder, scope: Scope) -> None:
        whole = 0
        for part, shift, mask, defer, raw_number in parts:
            if part.const is not None:
                whole |= (int(part.const) & mask) << shift
            elif defer is not None:
                defer(builder, scope, Backpatch(len(builder.bytes), part, container, shift))
            else:
                whole |= (raw_number(scope) & mask) << shift
        builder.append(write(whole))

    return step


def _text_step(item: Item, rules: StructWriteScope) -> WriteStep:
    encode, zero = bytes_of_text(item, rules.encoding), b"" if item.kind == "bytes" else ""
    finish = _finisher(item, rules)

    def step(builder: FrameBuilder, scope: Scope) -> None:
        if item.const is not None:
            finish(builder, scope, item.const)
            return
        value = _given(item, scope, rules, zero)
        if item.id:
            scope[item.id] = value
        finish(builder, scope, encode(value))

    return step


def _finisher(item: Item, rules: StructWriteScope) -> Callable[[FrameBuilder, Scope, Any], None]:
    """Return a function that writes bytes with padding, size field or terminator."""
    name, size = item.id or item.kind, item.size
    if size is None or item.const is not None:
        return lambda builder, scope, raw: builder.append(raw + item.until)
    if size.kind == "fixed":
        padded = fixed_bytes(item)
        return lambda builder, scope, raw: builder.append(padded(raw))

    def finish(builder: FrameBuilder, scope: Scope, raw: bytes) -> None:
        _put_size(builder, scope, size, len(raw), name, rules)
        builder.append(raw)

    return finish


def _put_size(
    builder: FrameBuilder,
    scope: Scope,
    extent: Extent,
    number: int,
    name: str,
    rules: StructWriteScope,
) -> None:
    """Write the size or count `number` into its field, or compare it with the declared size."""
    if extent.prefix is not None:
        builder.append(coded_writer(extent.prefix, name)(int(fitting(extent.prefix, number, name))))
    elif extent.kind == "fixed":
        if number != extent.number:
            raise NotWritable(f"{name}: expected {extent.number} items, found {number}")
    elif extent.expression is not None:
        (only, *others) = extent.expression.names or ("",)
        gap = scope.pop(GAP + only, None)
        if gap is not None and not others:
            scope[only] = solved(extent.expression, only, number, name)
            builder.fill(gap, scope[only])
        elif evaluate(extent.expression, scope) != number:
            wanted = f"{extent.expression.source.strip()!r} gives a different length"
            raise NotWritable(f"{name}: the length is {number}, but {wanted}")


def _padding_step(item: Item, rules: StructWriteScope) -> WriteStep:
    if item.size is None or item.size.kind == "rest":
        return lambda builder, scope: None
    if item.size.kind == "fixed":
        padding = bytes((item.pad,)) * item.size.number
        return lambda builder, scope: builder.append(padding)
    expression = item.size.expression

    def pad(builder: FrameBuilder, scope: Scope) -> None:
        number = 0 if expression is None else evaluate(expression, scope)
        if not isinstance(number, int) or not 0 <= number <= LARGEST_FRAME:
            raise NotWritable(f"padding: {quoted(number)} is not a valid size")
        builder.append(bytes((item.pad,)) * number)

    return pad


def _array_step(item: Item, count: Extent, rules: StructWriteScope) -> WriteStep:
    if item.kind == "packed":
        pack = packed_writer(item._replace(times=None), count)
        return lambda builder, scope: builder.append(pack(scope, rules.is_lenient))
    if item.kind == "struct" and not item.id:
        return _records_step(item, count, rules)
    name, single = item.id or "an array", item._replace(times=None, value=None)
    is_struct = item.kind == "struct"
    if is_struct:
        steps = build_write_steps(item.items, rules.encoding, is_lenient=rules.is_lenient)
    else:
        steps = (_STEPS[item.kind](single, rules),)
    missing: list[Any] = [_ZEROS.get(item.kind, _zero_of(item))]

    def array(builder: FrameBuilder, scope: Scope) -> None:
        zeros = missing * (count.number if count.kind == "fixed" else 0)
        values = _given(item, scope, rules, zeros)
        if not isinstance(values, (list, tuple)):
            raise NotWritable(f"{name}: expected a list, found {quoted(values)}")
        _put_size(builder, scope, count, len(values), name, rules)
        for value in values:
            if is_struct and not isinstance(value, Mapping):
                raise NotWritable(f"{name}: expected a mapping, found {quoted(value)}")
            inner: Scope = {**value, **_outer(scope)} if is_struct else {item.id: value}
            for step in steps:
                step(builder, inner)

    return array


def _records_step(item: Item, count: Extent, rules: StructWriteScope) -> WriteStep:
    """Return the step for a list of nameless structs with different signals.

    Each case of the switch whose fields all have values becomes one struct. Without a switch, the
    list has at most one struct.
    """
    own = rules._replace(derived={**rules.derived, **derived_sizes(item.items)})
    body = _struct_step(item._replace(times=None), own)
    switches = [one for one in item.items if one.switch is not None]
    switch = switches[0].switch if switches else None
    cases = [(key, frozenset(names_of(inner))) for key, inner in switch.cases] if switch else []
    by = switch.by.source.strip() if switch else ""

    def records(builder: FrameBuilder, scope: Scope) -> None:
        chosen = [{by: key} for key, names in cases if names and _has_all(scope, names)]
        if not switch:
            chosen = [{}] if _has_all(scope, frozenset(names_of(item.items))) else []
        _put_size(builder, scope, count, len(chosen), "the records", rules)
        for choice in chosen:
            body(builder, {**scope, **choice})

    return records


def _has_all(scope: Scope, names: frozenset[str]) -> bool:
    return all(scope.get(name) is not None for name in names)


def _struct_step(item: Item, rules: StructWriteScope) -> WriteStep:
    if item.id:
        steps = build_write_steps(item.items, rules.encoding, is_lenient=rules.is_lenient)
    else:
        steps = tuple(_build(inner, rules) for inner in item.items)
    names = {name: joined_name(item.id, name) for name in names_of(item.items)}

    def struct(builder: FrameBuilder, scope: Scope) -> None:
        inner = scope
        if item.id:
            inner = {name: scope[full] for name, full in names.items() if full in scope}
            inner |= _outer(scope)
        for step in steps:
            step(builder, inner)

    return struct if item.size is None else _windowed(struct, item, item.size, rules)


def _outer(scope: Scope) -> Scope:
    """Return the values from the outer scope that a struct may use, keyed by name."""
    return {name: scope[name] for name in OUTER_NAMES if name in scope}


def _windowed(body: WriteStep, item: Item, size: Extent, rules: StructWriteScope) -> WriteStep:
    """Return the step that writes a struct and its size field, but not the trimmed bytes."""
    full, name = least_size(item.items), item.id or "a struct"
    is_variable = size.prefix is not None and size.prefix.is_variable
    gap = bytes(size.prefix.size) if size.prefix and not is_variable else b""

    def windowed(builder: FrameBuilder, scope: Scope) -> None:
        builder.append(gap)
        start = len(builder.bytes)
        body(builder, scope)
        if item.trim is not None and size.kind != "fixed":
            kept = len(builder.bytes[start : start + full].rstrip(bytes((item.trim,))))
            del builder.bytes[start + max(kept, 1) :]
        number = len(builder.bytes) - start
        if size.kind == "fixed":
            if number != size.number:
                raise NotWritable(f"{name}: expected {size.number} bytes, found {number}")
        elif size.prefix is not None and is_variable:
            builder.insert(start, coded_writer(size.prefix, name)(number), scope)
        elif size.prefix is not None:
            builder.fill(_prefix_gap(start, size.prefix, name), number)
        else:
            _put_size(builder, scope, size, number, name, rules)

    return windowed


def _prefix_gap(start: int, prefix: Number, name: str) -> Backpatch:
    return Backpatch(start - prefix.size, Item("number", name, prefix), prefix)


def _switch_step(item: Item, rules: StructWriteScope) -> WriteStep:
    switch: Switch = item.switch  # type: ignore[assignment]  # a switch has one
    cases: dict[object, tuple[WriteStep, ...] | None] = {
        key: tuple(_build(one, rules) for one in inner) for key, inner in switch.cases
    }
    default = switch.default
    otherwise = None if default is None else tuple(_build(one, rules) for one in default)

    def step(builder: FrameBuilder, scope: Scope) -> None:
        key = evaluate(switch.by, scope)
        steps = cases.get(key, otherwise) if isinstance(key, (int, float, str)) else otherwise
        if steps is None:
            raise NotWritable(f"no case for {switch.by.source.strip()} = {quoted(key)}")
        for one in steps:
            one(builder, scope)

    return step


_ZEROS: dict[str, Any] = {"struct": {}, "text": "", "bytes": b""}
_STEPS: dict[str, Callable[[Item, StructWriteScope], WriteStep]] = {
    "number": _number_step,
    "coded": _coded_step,
    "bits": _bits_step,
    "bytes": _text_step,
    "text": _text_step,
    "padding": _padding_step,
    "struct": _struct_step,
    "switch": _switch_step,
}
