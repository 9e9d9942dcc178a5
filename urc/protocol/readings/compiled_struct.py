"""Generated decoders of binary frames: one function per declaration, from bytes to samples.

Pure. Generated decoders support only frames in which all items have fixed positions. The ordinary
decoder reads frames with invalid values, as in `urc.protocol.readings.compiled`.
"""

from typing import cast

from urc.model.binary import Item
from urc.model.payload import ReadSpec
from urc.protocol.compile.source_builder import BUILTINS, SourceBuilder
from urc.protocol.readings.compiled_value import Compiled, Value, finish, of_json_type, value_of
from urc.protocol.readings.readings import Readings
from urc.protocol.struct.read_source import add_fixed
from urc.protocol.struct.value import not_valid
from urc.protocol.values.payload import BadItem

__all__ = ["build_fast_struct"]


def build_fast_struct(
    spec: ReadSpec, encoding: str, readings: Readings, slow: Compiled
) -> Compiled | None:
    """Return a generated function for frames of `spec`; None if `spec` is not supported."""
    items = cast("tuple[Item, ...]", spec.options["items"])
    source = SourceBuilder()
    source.scope |= {"not_valid": not_valid, "BadItem": BadItem}
    late = add_fixed(source, items, encoding, "payload")
    if late is None:
        return None
    lines, fields = late
    numbers = {item.id: item for item in _numbers(items)}
    raws: list[str] = []
    values: list[Value] = []
    checks: list[str] = []
    for name, expression in fields.items():
        if name.startswith("_"):
            continue
        value = value_of(readings.signals[name], "json", True)
        if value is None:
            return None
        raw = f"r{len(values)}"
        lines.append(f"{raw} = {expression}")
        if not _is_sure(numbers.get(name), value):
            checks.append(of_json_type(value.signal.type, raw))
        elif value.signal.type == "number":
            value = value._replace(is_finite=True)
        raws.append(raw)
        values.append(value)
    head = source.lines
    body = ["    try:", *(f"        {line}" for line in lines or ["pass"])]
    body += ["    except (BadItem, ValueError):", "        return slow(frame, now)"]
    if checks:
        body += [f"    if not ({' and '.join(checks)}):", "        return slow(frame, now)"]
    scope = {**BUILTINS, **source.scope, "str": str}
    return finish(values, raws, [*head, *body], readings, scope, slow)


def _numbers(items: tuple[Item, ...]) -> list[Item]:
    """Return the outermost integer items that have no conversion other than a scale."""
    return [
        item
        for item in items
        if item.kind == "number"
        and item.number.kind == "integer"
        and item.number.bits <= 48
        and item.times is None
        and not item.enum
    ]


def _is_sure(item: Item | None, value: Value) -> bool:
    """Return whether every value that the item can have is a finite number of the signal's type."""
    if item is None:
        return False
    if value.signal.type == "number":
        return abs(item.scale) < 1e200 and abs(item.offset) < 1e200
    return value.signal.type == "integer" and item.scale == 1 and item.offset == 0
