"""Generated functions that read struct items, one per declaration.

Pure. Each run of fixed items becomes one `struct.Struct` and Python code without loops. The
closures of `urc.protocol.struct.read` read all other items. Tests require equal results from the
generated functions and the closures.
"""

from collections.abc import Callable, Mapping

from urc._number_codec import format_of
from urc.model.binary import Item
from urc.protocol.compile.source_builder import SourceBuilder
from urc.protocol.struct.read import FAULT, OtherFrame, build_step, const_of
from urc.protocol.struct.runs import FixedField, FixedRun, runs_of
from urc.protocol.struct.value import meaning_of, not_valid, text_of_bytes
from urc.protocol.values.convert import divisor_of
from urc.protocol.values.payload import BadItem, Frame

__all__ = ["add_fixed", "generate_read"]

Read = Callable[[Frame], Mapping[str, object] | None]


def generate_read(items: tuple[Item, ...], encoding: str) -> Read:
    """Return a function that returns a frame's fields, or None if the frame does not match.

    The returned function raises `BadItem` if a matching frame contains an invalid value.
    """
    source = SourceBuilder()
    source.scope |= {"FAULT": FAULT, "not_valid": not_valid, "BadItem": BadItem}
    source.add("data = frame.payload")
    has_open_end = bool(items) and _is_open_end(items[-1])
    parts = list(runs_of(items[:-1] if has_open_end else items))
    fixed = add_fixed(source, items, encoding, "data")
    if fixed is not None:
        lines, fields = fixed
        for line in lines:
            source.add(line)
        pairs = [f"{name!r}: {expression}" for name, expression in fields.items()]
        source.add(f"return {{{', '.join(pairs)}}}")
    else:
        _add_mixed(source, parts, encoding, has_open_end)
    read: Read = source.compile("read_struct", "frame")
    return read


def _is_open_end(item: Item) -> bool:
    is_rest = item.size is not None and item.size.kind == "rest"
    return item.kind == "padding" and is_rest and item.condition is None and item.times is None


def add_fixed(
    source: SourceBuilder, items: tuple[Item, ...], encoding: str, data: str
) -> tuple[list[str], dict[str, str]] | None:
    """Add source that unpacks a frame; return None unless all items have fixed positions.

    Args:
        source: builder of a function that returns None for a non-matching frame.
        items: items of the frame.
        encoding: default text encoding.
        data: name of the variable that contains the frame.

    Returns:
        The source lines for decoding, and for each field an expression valid after those lines.
    """
    has_open_end = bool(items) and _is_open_end(items[-1])
    parts = list(runs_of(items[:-1] if has_open_end else items))
    runs = [part for part in parts if isinstance(part, FixedRun)]
    if len(runs) < len(parts):
        return None
    size = sum(run.struct.size for run in runs)
    # An `Envelope` is a tuple of three, so its length excludes it only for larger frames.
    kind = f"type({data}) is not bytes or " if size <= 3 else ""
    source.add(f"if {kind}len({data}) {'<' if has_open_end else '!='} {size}: return None")
    lines: list[str] = []
    fields: list[str] = []
    at = 0
    for place, run in enumerate(runs):
        _add_unpack(source, run, place, f"{data}, {at}" if at else data)
        at += run.struct.size
        for number, leaf in enumerate(run.leaves):
            names = _variables(place, number, leaf)
            _add_leaf(source, leaf, names, encoding, lines, fields)
    # Each is ``'name': expression``; a name contains neither a blank nor a colon.
    return lines, {
        name.strip("'\""): value for name, _, value in (field.partition(": ") for field in fields)
    }


def _variables(place: int, number: int, leaf: FixedField) -> list[str]:
    return [f"v{place}_{number}_{index}" for index in range(leaf.values)]


def _add_unpack(source: SourceBuilder, run: FixedRun, place: int, where: str) -> None:
    """Add source that unpacks a run and checks its constants."""
    names = [
        name for number, leaf in enumerate(run.leaves) for name in _variables(place, number, leaf)
    ]
    if not names:
        return
    unpack = source.bind("unpack", run.struct.unpack_from)
    source.add(f"{', '.join(names)}, = {unpack}({where})")
    for number, leaf in enumerate(run.leaves):
        item = leaf.item
        (name, *_) = _variables(place, number, leaf) or ("",)
        is_whole = item.kind == "bits" or (item.kind == "number" and item.const is not None)
        if is_whole and not format_of(item.number):
            source.add(f"{name} = {_from_bytes(item, name)}")
        if item.const is not None:
            source.add(f"if {name} != {const_of(item)!r}: return None")
        for part, shift, mask, _, _ in leaf.bit_parts() if item.kind == "bits" else ():
            if part.const is not None:
                source.add(f"if {name} >> {shift} & {mask} != {int(part.const)}: return None")


def _from_bytes(item: Item, name: str) -> str:
    signed = item.number.is_signed and item.kind == "number"
    return f"int.from_bytes({name}, {item.number.endian!r}, signed={signed})"


def _add_leaf(
    source: SourceBuilder,
    leaf: FixedField,
    names: list[str],
    encoding: str,
    lines: list[str],
    fields: list[str],
) -> None:
    """Add the source lines of one item to the lists, and its ``'name': value`` pairs."""
    item = leaf.item
    if item.kind == "bits":
        for part, shift, mask, sign, _ in leaf.bit_parts():
            if not part.id or part.const is not None:
                continue
            raw = f"{names[0]} >> {shift} & {mask}"
            raw = f"(({raw}) ^ {sign}) - {sign}" if sign else raw
            _add_value(source, part, f"({raw})", lines, fields)
    elif not leaf.name or item.const is not None:
        return
    elif item.kind in ("text", "bytes"):
        value = names[0]
        if item.kind == "text":
            text = source.bind("text", text_of_bytes(item, encoding))
            lines.append(f"{value} = {text}({value})")
        fields.append(f"{leaf.name!r}: {value}")
    elif item.times is not None:
        _add_array(source, leaf, names, lines, fields)
    else:
        raw = names[0] if format_of(item.number) else _from_bytes(item, names[0])
        _add_value(source, item._replace(id=leaf.name), raw, lines, fields)


def _add_array(
    source: SourceBuilder, leaf: FixedField, names: list[str], lines: list[str], fields: list[str]
) -> None:
    item = leaf.item
    values = ", ".join(names)
    if item.enum or item.valid is not None:
        meaning = source.bind("meaning", meaning_of(item))
        lines.append(f"{names[0]} = [{meaning}(raw) for raw in ({values},)]")
        fields.append(f"{leaf.name!r}: {names[0]}")
    else:
        scaled = _scaled(item, "raw")
        whole = f"[{values}]" if scaled == "raw" else f"[{scaled} for raw in ({values},)]"
        fields.append(f"{leaf.name!r}: {whole}")


def _add_value(
    source: SourceBuilder, item: Item, raw: str, lines: list[str], fields: list[str]
) -> None:
    value = _scaled(item, raw)
    if item.valid is not None:
        low, high = item.valid
        kept = f"x{len(lines)}"
        lines.append(f"{kept} = {value}")
        refuse = f"raise not_valid({item.id!r}, {kept}, {item.valid!r})"
        lines.append(f"if not {low!r} <= {kept} <= {high!r}: {refuse}")
        value = kept
    if item.enum:
        words = source.bind("words", dict(item.enum))
        value = f"{words}.get({value}, {value})"
    fields.append(f"{item.id!r}: {value}")


def _scaled(item: Item, raw: str) -> str:
    divisor = divisor_of(item.scale)
    if divisor:
        raw = f"{raw} / {divisor}"
    elif item.scale != 1:
        raw = f"{raw} * {item.scale!r}"
    return f"{raw} + {item.offset!r}" if item.offset else raw


def _add_mixed(
    source: SourceBuilder, parts: list[FixedRun | Item], encoding: str, has_open_end: bool
) -> None:
    """Add source that unpacks fixed runs directly and calls the closures for other items."""
    source.scope["OtherFrame"] = OtherFrame
    source.add("if type(data) is not bytes: return None")
    source.add("end = len(data)")
    source.add("out = {}")
    source.add("at = 0")
    for place, part in enumerate(parts):
        if isinstance(part, Item):
            step = source.bind("step", build_step(part, encoding))
            source.add("try:")
            source.add(f"at = {step}(data, at, end, out)", 2)
            source.add("except OtherFrame:")
            source.add("return None", 2)
            continue
        source.add(f"if end - at < {part.struct.size}: return None")
        _add_unpack(source, part, place, "data, at")
        source.add(f"at += {part.struct.size}")
        for number, leaf in enumerate(part.leaves):
            lines: list[str] = []
            fields: list[str] = []
            names = _variables(place, number, leaf)
            _add_leaf(source, leaf, names, encoding, lines, fields)
            _add_noted(source, lines, fields)
    if not has_open_end:
        source.add("if at != end: return None")
    source.add("if FAULT in out: raise out[FAULT]")
    source.add("return out")


def _add_noted(source: SourceBuilder, lines: list[str], fields: list[str]) -> None:
    """Add source for the value of one item; errors are raised after the whole frame is read."""
    if not fields:
        return
    depth = 1
    if lines:
        source.add("try:")
        depth = 2
    for line in lines:
        source.add(line, depth)
    for field in fields:
        name, _, value = field.partition(": ")
        source.add(f"out[{name}] = {value}", depth)
    if lines:
        source.add("except BadItem as error:")
        source.add("out.setdefault(FAULT, error)", 2)
