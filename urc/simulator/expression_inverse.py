"""Invert expressions: find the field value for which an expression has the wanted value.

Pure. An expression of one field with a chain of filters is inverted from the last filter to the
first. If several expressions ``unpack`` parts of the same bytes, the parts are merged. An
expression without an inverse yields None.
"""

import ast
from collections.abc import Callable, Iterable
from typing import Any, Final

from urc._number_types import number_of
from urc.expressions import Template, spelt
from urc.filters.binary import written_number
from urc.filters.parse import CUT_FILTERS
from urc.model.payload import ReadSpec
from urc.protocol.values.convert import BadValue

__all__ = ["computed_fields", "field_of"]

_MOST_BYTES: Final = 4096


def computed_fields(spec: ReadSpec, raw: Callable[[str], object]) -> dict[str, object]:
    """Return the values of all fields from which a signal is computed without other fields.

    Args:
        spec: the frame.
        raw: function that returns the raw value of a signal, or raises `BadValue` if there is no
            value.
    """
    wanted: dict[str, list[tuple[Template, object]]] = {}
    for name, template in spec.sets.items():
        if len(template.names) == 1:
            try:
                pair = (template, raw(name))
            except BadValue:
                continue
            wanted.setdefault(next(iter(template.names)), []).append(pair)
    fields: dict[str, object] = {}
    for field, pairs in wanted.items():
        whole = field_of(pairs)
        if whole is not None:
            fields[field] = whole
        elif not any(_takes_apart(template) for template, _ in pairs):
            fields[field] = pairs[0][1]  # most others only convert text to a number
    return fields


def _takes_apart(template: Template) -> bool:
    """Return whether the expression uses parts of its field, which then differs from the signal."""
    return any(f"_filter_{name}(" in template.python for name in ("split", *CUT_FILTERS, *_TEXTS))


def field_of(wanted: Iterable[tuple[Template, object]]) -> object | None:
    """Return a field value for which all expressions have their wanted values."""
    whole: bytearray | None = None
    last: Callable[[bytes], object] | None = None
    found: object | None = None
    for template, value in wanted:
        try:
            chain = _chain(template.python)
            if not chain:
                return None
            found, at = _undone(chain, value)
        except (ValueError, TypeError, KeyError, OverflowError):
            return None
        if isinstance(found, bytes) and at + len(found) <= _MOST_BYTES:
            whole = bytearray() if whole is None else whole
            whole.extend(bytes(max(0, at + len(found) - len(whole))))
            whole[at : at + len(found)] = found
            last = _TEXTS.get(chain[-1][0])
    if whole is None:
        return found
    return bytes(whole) if last is None else last(bytes(whole))


Step = tuple[str, tuple[Any, ...]]


def _chain(python: str) -> list[Step]:
    """Return an expression's chain of filters, last filter first; [] for any other form."""
    node, steps = ast.parse(python, mode="eval").body, list[Step]()
    while isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.args:
        subject, *rest = node.args
        if not all(isinstance(one, ast.Constant) for one in rest):
            return []
        values = tuple(one.value for one in rest if isinstance(one, ast.Constant))
        steps.append((node.func.id.removeprefix("_filter_"), values))
        node = subject
    return steps if isinstance(node, ast.Subscript) else []


def _undone(chain: list[Step], value: Any) -> tuple[object, int]:
    """Return the field's value and 0, or some of the field's bytes and their offset."""
    at = 0
    for name, arguments in chain:
        if name in _TEXTS:
            break  # several expressions may read bytes of the same text
        match name, arguments:
            case "unpack", (type_name, *place):
                value, at = _packed(type_name, value), int(place[0]) if place else 0
            case "numbers", (type_name,):
                value = b"".join(_packed(type_name, one) for one in value)
            case "signed", (bits,):
                value = round(value) & (1 << bits) - 1
            case "digits", (width, base, *zero):
                first = ord(zero[0]) if zero and isinstance(zero[0], str) else (*zero, 48)[0]
                value = "".join(_digits(round(one), width, base, first) for one in value)
            case "first", ():
                value = [value]
            case "int", (_, 16):
                value = f"{round(value):X}"
            case (("int" | "float"), _):
                value = spelt(value)
            case _:
                raise ValueError(name)
    return value, at


def _packed(type_name: str, value: Any) -> bytes:
    """Return the value as bytes, clamped to the range of the type."""
    number = number_of(type_name)
    if number is None:
        raise ValueError(type_name)
    if number.kind != "float":
        value = min(max(round(value), number.least), number.most)
    return written_number(type_name, value)


def _digits(number: int, width: int, base: int, zero: int) -> str:
    number = min(max(number, 0), base**width - 1)
    places = (number // base**place % base for place in reversed(range(width)))
    return "".join(chr(zero + digit) for digit in places)


def _base64(data: bytes) -> str:
    from binascii import b2a_base64

    return b2a_base64(data, newline=False).decode("ascii")


_TEXTS: Final[dict[str, Callable[[bytes], object]]] = {
    "b64decode": _base64,
    "hexbytes": lambda data: data.hex().upper(),
}
"""Inverse functions of the filters that decode text to bytes, keyed by filter."""
