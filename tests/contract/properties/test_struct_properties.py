"""Any declaration of a struct: what is written is read again, and no bytes can do harm."""

import linecache
import struct
from collections.abc import Callable
from typing import Any, Literal

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.effort import examples
from urc.expressions import compile_expression
from urc.model.binary import Extent, Item, Number, Switch, joined_name, number_of
from urc.model.payload import Envelope, ReadSpec
from urc.protocol.struct.form import StructReader
from urc.protocol.struct.read import build_steps, read_frame
from urc.protocol.struct.read_source import generate_read
from urc.protocol.struct.write import build_write_steps, write_frame
from urc.protocol.struct.write_source import generate_write
from urc.protocol.values.payload import BadItem, CodecContext, Frame, NotWritable

Declared = tuple[tuple[Item, ...], st.SearchStrategy[dict[str, Any]]]
"""Items, and values that fit them."""

SIZES = (8, 16, 24, 32, 40, 48, 56, 64)
BOTH_ENDS: list[Literal["big", "little"]] = ["big", "little"]
endians = st.sampled_from(BOTH_ENDS)


def plain_numbers(kind: str, sizes: tuple[int, ...], *signed: bool) -> st.SearchStrategy[Number]:
    """Plain numbers: Hypothesis would fill in the odd orders of bytes as well."""
    parts = st.tuples(st.sampled_from(sizes), st.sampled_from(signed), endians)
    return parts.map(lambda one: Number(kind, *one))  # type: ignore[arg-type]


prefixes = plain_numbers("integer", (8, 16), False)
integers = plain_numbers("integer", SIZES, False, True)
floats = plain_numbers("float", (16, 32, 64), True)
ODD_ORDERS = [
    *(
        f"{kind}{order}"
        for kind in "ui"
        for order in ("32cdab", "32badc", "64ghefcdab", "64badcfehg")
    ),
    *(
        f"{kind}{bits}by7{end}"
        for kind in "ui"
        for bits in (14, 21, 35, 63)
        for end in ("be", "le")
    ),
]
texts = st.text(st.characters(codec="utf-8", exclude_characters="\0 ", exclude_categories=["Cs"]))


def whole(number: Number) -> st.SearchStrategy[int]:
    return st.integers(number.least, number.most)


@st.composite
def number_items(draw: st.DrawFn, name: str) -> Declared:
    """A number of any kind, plain, scaled, with words, constant, nameless, or an array."""
    if draw(st.integers(0, 5)) == 0:
        number = draw(floats)
        item = Item("number", name, number)
        return (item,), st.fixed_dictionaries(
            {name: st.floats(width=number.bits, allow_nan=False)}  # type: ignore[arg-type]
        )
    number = draw(integers)
    item, values = Item("number", name, number), whole(number)
    kind = draw(
        st.sampled_from(["plain", "array", "scaled", "words", "constant", "boolean", "computed"])
    )
    if kind == "array":
        size = draw(st.integers(0, 4))
        return (item._replace(times=Extent("fixed", size)),), st.fixed_dictionaries(
            {name: st.lists(values, min_size=size, max_size=size)}
        )
    if kind == "constant":
        return (item._replace(id="", const=draw(values)),), st.just({})
    if kind == "boolean":
        item = item._replace(number=Number("boolean", 8))
        return (item,), st.fixed_dictionaries({name: st.booleans()})
    if kind == "computed" and number.bits >= 32:
        size = compile_expression("_size")
        return (item._replace(id="", value=size),), st.just({})
    if kind == "words":
        item = item._replace(enum=((0, "zero"), (1, "one")))
        return (item,), st.fixed_dictionaries(
            {name: values.map(lambda raw: {0: "zero", 1: "one"}.get(raw, raw))}
        )
    if kind == "scaled" and number.bits <= 32:
        scale, offset = draw(st.sampled_from([(0.1, 0), (0.5, -40), (10, 3), (-0.01, 0.5)]))
        item = item._replace(scale=scale, offset=offset)
        return (item,), st.fixed_dictionaries({name: values.map(scaled(scale, offset))})
    return (item,), st.fixed_dictionaries({name: values})


@st.composite
def coded_items(draw: st.DrawFn, name: str) -> Declared:
    """Numbers of as many bytes as they need, of decimal digits, and of any width."""
    kind = draw(st.sampled_from(["varint", "zigzag", "bcd", "packed", "odd", "odd float"]))
    if kind == "packed":
        number = Number("integer", draw(st.integers(1, 63)), draw(st.booleans()))
        count = 8 * draw(st.integers(1, 2))
        item = Item("packed", name, number, times=Extent("fixed", count))
        item = item._replace(is_lsb_first=draw(st.booleans()))
        values = st.lists(whole(number), min_size=count, max_size=count)
        return (item,), st.fixed_dictionaries({name: values})
    if kind.startswith("odd"):
        floating = ["f32cdab", "f32badc", "f64ghefcdab", "f64badcfehg"]
        odd = number_of(draw(st.sampled_from(ODD_ORDERS if kind == "odd" else floating)))
        assert odd is not None
        width: Any = odd.bits
        floats_of = st.floats(width=width, allow_nan=False)
        given = {name: whole(odd) if kind == "odd" else floats_of}
        return (Item("coded", name, odd),), st.fixed_dictionaries(given)
    number = Number("bcd", draw(st.sampled_from(SIZES)), False, draw(endians))
    if kind != "bcd":
        number = Number("zigzag" if kind == "zigzag" else "varint", 64, kind == "zigzag")
    return (Item("coded", name, number),), st.fixed_dictionaries({name: whole(number)})


def scaled(scale: float, offset: float) -> Callable[[int], float]:
    divisor = round(1 / scale) if abs(scale) < 1 else 0

    def value(raw: int) -> float:
        found = raw / divisor if divisor else raw * scale
        return found + offset if offset else found

    return value


@st.composite
def bit_items(draw: st.DrawFn, name: str) -> Declared:
    """Bits of every width, signed and not, constant and reserved, in both orders."""
    bits = draw(st.sampled_from(SIZES))
    parts: list[Item] = []
    values: dict[str, st.SearchStrategy[Any]] = {}
    left = bits
    while left:
        number = Number("integer", draw(st.integers(1, left)), draw(st.booleans()))
        left -= number.bits
        kind = draw(st.sampled_from(["value", "value", "constant", "reserved"]))
        own = f"{name}_{len(parts)}"
        part = Item("number", "" if kind == "reserved" else own, number)
        if kind == "constant":
            part = part._replace(id="", const=draw(st.integers(0, number.most)))
            if number.is_signed:
                part = part._replace(number=number._replace(is_signed=False))
        elif kind == "value":
            values[own] = whole(number)
        parts.append(part)
    item = Item(
        "bits",
        "",
        Number("integer", bits, False, draw(endians)),
        is_lsb_first=draw(st.booleans()),
        items=tuple(parts),
    )
    return (item,), st.fixed_dictionaries(values)


@st.composite
def text_items(draw: st.DrawFn, name: str) -> Declared:
    """Text and bytes, with every way of saying where they end."""
    if draw(st.booleans()):
        raw: st.SearchStrategy[Any] = st.binary(max_size=12)
        item = Item("bytes", name)
    else:
        raw = texts.filter(lambda text: len(text.encode()) <= 12)
        item = Item("text", name)
    way = draw(st.sampled_from(["fixed", "prefix", "until", "counted"]))
    if way == "fixed":
        size = Extent("fixed", 12)
        if item.kind == "bytes":
            return (item._replace(size=size),), st.fixed_dictionaries(
                {name: st.binary(min_size=12, max_size=12)}
            )
        pad = draw(st.sampled_from([0, 32]))
        return (item._replace(size=size, pad=pad),), st.fixed_dictionaries({name: raw})
    if way == "until":
        item = item._replace(until=b"\0\1")
        return (item,), st.fixed_dictionaries(
            {name: raw.filter(lambda one: ends_once(one, b"\0\1"))}
        )
    if way == "prefix":
        size = Extent("prefix", prefix=draw(prefixes))
        return (item._replace(size=size),), st.fixed_dictionaries({name: raw})
    length = Item("number", f"_{name}_size", draw(prefixes))
    by = draw(st.sampled_from(["{}", "{} - 3", "2 + {}"])).format(length.id)
    # So that no size below zero is needed.
    raw = raw.filter(lambda one: len(one if isinstance(one, bytes) else one.encode()) >= 2)
    size = Extent("expression", expression=compile_expression(by))
    return (length, item._replace(size=size)), st.fixed_dictionaries({name: raw})


def ends_once(value: str | bytes, end: bytes) -> bool:
    data = value if isinstance(value, bytes) else value.encode()
    return (data + end).find(end) == len(data)


@st.composite
def nested_items(draw: st.DrawFn, name: str, depth: int) -> Declared:
    """Structs in structs: named, nameless, in arrays, in windows, and by cases."""
    inner, values = draw(declarations(f"{name}_", depth + 1))
    way = draw(st.sampled_from(["nameless", "named", "array", "window", "switch", "condition"]))
    if way == "nameless":
        return (Item("struct", items=inner),), values
    if way == "named":
        named = values.map(lambda found: {joined_name(name, key): found[key] for key in found})
        return (Item("struct", name, items=inner),), named
    if way == "window":
        numbers = st.sampled_from([Number("integer", 16), Number("varint", 64)])
        size = Extent("prefix", prefix=draw(numbers))
        return (Item("struct", items=inner, size=size),), values
    if way == "array":
        first = Item("number", "first", Number("integer", 8))
        item = Item(
            "struct", name, items=(first, *inner), times=Extent("prefix", prefix=draw(prefixes))
        )
        one = values.flatmap(lambda found: whole(first.number).map(lambda n: {"first": n, **found}))
        return (item,), st.fixed_dictionaries({name: st.lists(one, max_size=3)})
    kind = Item("number", f"{name}_kind", Number("integer", 8))
    if way == "condition":
        optional = Item("struct", items=inner, condition=compile_expression(f"{kind.id} > 3"))
        chosen = st.integers(0, 7).flatmap(
            lambda raw: values.map(lambda found: {kind.id: raw, **(found if raw > 3 else {})})
        )
        return (kind, optional), chosen
    switch = Switch(compile_expression(kind.id), ((1, inner), (2, ())), None)
    picked = st.one_of(values.map(lambda found: {kind.id: 1, **found}), st.just({kind.id: 2}))
    return (kind, Item("switch", switch=switch)), picked


@st.composite
def declarations(draw: st.DrawFn, prefix: str = "", depth: int = 0) -> Declared:
    """A few items with names of their own."""
    items: list[Item] = []
    values: list[st.SearchStrategy[dict[str, Any]]] = []
    for place in range(draw(st.integers(1, 5 if depth == 0 else 2))):
        name = f"{prefix}v{place}"
        kinds = [number_items(name), number_items(name), bit_items(name), text_items(name)]
        kinds.append(coded_items(name))
        if depth < 2:
            kinds.append(nested_items(name, depth))
        if draw(st.integers(0, 6)) == 0:
            items.append(Item("padding", size=Extent("fixed", draw(st.integers(0, 3)))))
        more, found = draw(st.one_of(kinds))
        items += more
        values.append(found)
    return tuple(items), st.tuples(*values).map(merged)


def merged(found: tuple[dict[str, Any], ...]) -> dict[str, Any]:
    return {key: value for one in found for key, value in one.items()}


def outcome(function: Callable[..., Any], *arguments: object) -> object:
    """Return what comes out, be it a fault of ours; any other exception is a mistake."""
    try:
        return function(*arguments)
    except (BadItem, NotWritable) as error:
        return type(error), str(error)


def same(left: object, right: object) -> bool:
    """Equality in which not-a-number is itself."""
    return repr(left) == repr(right)


def without_sizes(found: object) -> object:
    """Leave out what is computed."""
    if isinstance(found, dict):
        return {
            key: without_sizes(value) for key, value in found.items() if not key.endswith("_size")
        }
    return [without_sizes(one) for one in found] if isinstance(found, list) else found


@given(declarations().flatmap(lambda one: st.tuples(st.just(one[0]), one[1])))
@settings(max_examples=examples(150), deadline=None)
def test_what_is_written_is_read_again(case: tuple[tuple[Item, ...], dict[str, Any]]) -> None:
    """By the closures and by the generated functions, which write the same bytes."""
    items, values = case
    data = write_frame(build_write_steps(items, "utf-8", is_lenient=False), values)
    assert generate_write(items, "utf-8")(values) == data
    found = read_frame(build_steps(items, "utf-8"), data)
    assert same(found, generate_read(items, "utf-8")(Frame(data, "utf-8")))
    assert without_sizes(found) == values
    assert found is not None
    again = StructReader(ReadSpec("struct", {"items": items}), CodecContext()).write(found)
    assert again == data


@given(st.data())
@settings(max_examples=examples(150), deadline=None)
def test_any_bytes_give_fields_or_none_or_a_fault(data: st.DataObject) -> None:
    """A frame with a changed, missing or added byte: closures and generated code agree."""
    items, values = data.draw(declarations())
    frame = write_frame(build_write_steps(items, "utf-8", is_lenient=False), data.draw(values))
    changed = bytearray(frame)
    for _ in range(data.draw(st.integers(0, 3))):
        place = data.draw(st.integers(0, len(changed)))
        changed[place : place + data.draw(st.integers(0, 2))] = data.draw(st.binary(max_size=2))
    assert_bounded(items, bytes(changed))


@given(declarations(), st.binary(max_size=200))
@settings(max_examples=examples(150), deadline=None)
def test_noise_gives_fields_or_none_or_a_fault(declared: Declared, noise: bytes) -> None:
    """Bytes that nobody wrote."""
    assert_bounded(declared[0], noise)


def assert_bounded(items: tuple[Item, ...], data: bytes) -> None:
    by_closures = outcome(read_frame, build_steps(items, "utf-8"), data)
    generated = outcome(generate_read(items, "utf-8"), Frame(data, "utf-8"))
    assert same(by_closures, generated)
    assert weight(by_closures) <= len(items) * 64 + 64 * len(data)


def weight(value: object) -> int:
    """Return how many plain values there are in a value."""
    if isinstance(value, dict):
        return sum(map(weight, value.values()))
    if isinstance(value, list):
        return sum(map(weight, value))
    return len(value) if isinstance(value, (bytes, str)) else 1


odd_values = st.one_of(
    st.none(), st.booleans(), st.integers(-(2**70), 2**70), st.floats(), st.text(max_size=4),
    st.binary(max_size=4), st.lists(st.integers(-9, 999), max_size=4), st.just("zero"),
)  # fmt: skip


@given(st.data())
@settings(max_examples=examples(150), deadline=None)
def test_any_values_give_bytes_or_are_refused(data: st.DataObject) -> None:
    """Whatever an argument is: the same bytes or the same words from both."""
    items, values = data.draw(declarations())
    given_values = data.draw(values)
    for name in list(given_values):
        if data.draw(st.booleans()):
            given_values[name] = data.draw(odd_values)
    steps = build_write_steps(items, "utf-8", is_lenient=False)
    by_closures = outcome(write_frame, steps, given_values)
    assert outcome(generate_write(items, "utf-8"), given_values) == by_closures


def test_huge_counts_are_another_frame_at_once() -> None:
    """Nothing is made by a length that the frame cannot have."""
    record = (Item("number", "a", Number("integer", 8)),)
    count = Extent("prefix", prefix=Number("integer", 32))
    for item in (
        Item("number", "a", Number("float", 64), times=count),
        Item("number", "a", Number("integer", 24), times=count),
        Item("struct", "a", items=record, times=count),
        Item("bytes", "a", size=count),
    ):
        data = struct.pack(">I", 2**32 - 1) + b"\0" * 64
        assert generate_read((item,), "utf-8")(Frame(data, "utf-8")) is None


def test_traceback_shows_the_generated_line() -> None:
    """The source of a generated function can be read in a debugger and in reports."""
    item = Item("number", "speed", Number("integer", 16))
    file = generate_read((item,), "utf-8").__code__.co_filename
    assert "'speed'" in "".join(linecache.getlines(file))


def test_message_of_another_transport_is_no_frame() -> None:
    """An envelope is a tuple of three, which no declaration takes for three bytes."""
    items = (Item("number", "a", Number("integer", 24)),)
    assert generate_read(items, "utf-8")(Frame(Envelope("publish"), "utf-8")) is None
