"""Generated functions that write messages in CDR (ROS 2) and in the ROS 1 format.

Theory of operation. The source is generated once per layout. Consecutive numbers become one
`struct.Struct` format. Alignment works as in `urc.protocol.ros.read_source`. A message is a mapping
of fields, as in a document; missing fields take their default values or zero. The generated
function is fast, but its errors give no reason. After an error, `Writer` searches the message for
the value that caused it.
"""

import base64
import binascii
import math
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

from urc.problems import UrcError, printable
from urc.protocol.compile.source import function_of
from urc.protocol.ros.definition import (
    SIZES,
    Array,
    BadDefinition,
    Layout,
    Primitive,
    Record,
    Text,
)

__all__ = ["NOW", "Unwritable", "Writer", "Written"]

NOW: Final = "now"
"""Placeholder for a point in time; the sender replaces it with the time of sending."""
_HEADER: Final = b"\0\1\0\0"
"""Encapsulation identifier of CDR with little-endian numbers."""
_SHOWN: Final = 40
_ZERO: Final[Mapping[str, object]] = {}
_PAD: Final = tuple(bytes(size) for size in range(8))
_FAULTS: Final = (struct.error, TypeError, ValueError, KeyError, OverflowError, AttributeError)


class Unwritable(UrcError):
    """A message that does not fit its type; the error names the field."""


class Written(NamedTuple):
    """A message in binary form."""

    data: bytes
    stamps: tuple[int, ...]
    """Offsets at which the sender writes the time: seconds and nanoseconds, four bytes each."""


class Writer:
    """A writer for the messages of one type."""

    def __init__(self, layout: Record, *, is_ros1: bool = False) -> None:
        """Generate the function.

        Raises:
            BadDefinition: the layout is nested too deeply for a generated function.
        """
        self._layout = layout
        try:
            self._write = _WriteGenerator(is_ros1).function(layout)
        except (SyntaxError, RecursionError, MemoryError, struct.error) as fault:
            raise BadDefinition(f"the type is too large or nested too deeply ({fault})") from fault

    def write(self, message: object) -> Written:
        """Return the bytes of a message; raise `Unwritable` if a field does not fit."""
        stamps: list[int] = []
        try:
            return Written(self._write({} if message is None else message, stamps), tuple(stamps))
        except _FAULTS as fault:
            reason = _reason(self._layout, message, "") or str(fault)
        raise Unwritable(reason)


def _binary(value: Any, length: int) -> bytes:
    """Convert a ``uint8`` array from bytes, base64 text or a list of numbers to bytes."""
    if isinstance(value, str):
        value = base64.b64decode(value, validate=True)
    data = bytes(value) if not isinstance(value, int) else b"\0"[:-value]
    if length and len(data) != length:
        raise ValueError(f"{len(data)} elements instead of {length}")
    return data


def _listed(value: Any, length: int) -> list[Any]:
    if isinstance(value, str | Mapping) or (length and len(value) != length):
        raise ValueError("a list of a different length")
    return list(value)


def _floats(values: list[Any]) -> list[Any]:
    return [math.nan if value is None else value for value in values]


def _wide(value: str) -> bytes:
    units = value.encode("utf-16-le")
    count = len(units) // 2
    return struct.pack(f"<I{count}I", count, *struct.unpack(f"<{count}H", units))


def _known(value: Any, names: frozenset[str]) -> Any:
    """Return `value` if it is a mapping of known fields; otherwise, raise `TypeError`."""
    if not isinstance(value, Mapping) or not value.keys() <= names:
        raise TypeError("not a mapping of this message's fields")
    return value


_SCOPE: Final[dict[str, Any]] = {
    "bytearray": bytearray, "bytes": bytes, "len": len, "isinstance": isinstance, "str": str,
    "bool": bool, "binary": _binary, "listed": _listed, "floats": _floats, "wide": _wide,
    "known": _known, "pack": struct.pack, "nan": math.nan, "PAD": _PAD, "NOW": NOW, "ZERO": _ZERO,
}  # fmt: skip


class _WriteGenerator:
    """A generator of source text; each instance creates one function."""

    def __init__(self, is_ros1: bool) -> None:
        self._is_ros1 = is_ros1
        self._origin = 0 if is_ros1 else len(_HEADER)
        self._lines: list[str] = []
        self._indent = "    "
        self._scope = dict(_SCOPE)
        self._count = 0
        self._form = ""
        self._values: list[str] = []
        self._modulus, self._rest = 8, 0

    def function(self, layout: Record) -> Callable[[Any, list[int]], bytes]:
        self._record(layout, "message")
        self._flush()
        start = b"" if self._is_ros1 else _HEADER
        lines = [f"    out = bytearray({start!r})", *self._lines, "    return bytes(out)"]
        made: Callable[[Any, list[int]], bytes]
        made = function_of("write_message", "message, stamps", lines, self._scope)
        return made

    def _emit(self, *lines: str) -> None:
        self._lines += [self._indent + line for line in lines]

    @contextmanager
    def _block(self, head: str) -> Iterator[None]:
        self._emit(head)
        indent, self._indent = self._indent, self._indent + "    "
        yield
        self._indent = indent

    def _name(self) -> str:
        self._count += 1
        return f"v{self._count}"

    def _constant(self, value: object) -> str:
        name = f"c{len(self._scope)}"
        self._scope[name] = value
        return name

    def _flush(self) -> None:
        if self._form:
            pack = self._constant(struct.Struct("<" + self._form).pack)
            self._emit(f"out += {pack}({', '.join(self._values)})")
        self._form, self._values = "", []

    def _align(self, size: int) -> None:
        if self._is_ros1 or size == 1:
            return
        if size <= self._modulus:
            padding = -self._rest % size
            self._form += f"{padding}x" * bool(padding)
            self._rest = (self._rest + padding) % self._modulus
            return
        self._flush()
        self._emit(f"out += PAD[({self._origin} - len(out)) & {size - 1}]")
        self._modulus, self._rest = size, 0

    def _lose_place(self, modulus: int = 1) -> None:
        self._modulus, self._rest = modulus, 0

    # -- values; `value` is the source text of an expression

    def _write(self, layout: Layout, value: str) -> None:
        match layout:
            case Primitive():
                self._number(layout.code, value)
            case Text():
                self._text(layout, value)
            case Record():
                self._record(layout, value)
            case Array():
                self._array(layout, value)

    def _number(self, code: str, value: str) -> None:
        self._align(SIZES[code])
        self._form += code
        self._values.append(value)
        self._rest = (self._rest + SIZES[code]) % self._modulus

    def _record(self, layout: Record, value: str) -> None:
        name = self._name()
        if layout.is_time:
            self._time(layout, value, name)
            return
        names = self._constant(frozenset(name for name, _ in layout.fields))
        self._emit(f"{name} = known({value}, {names})")
        for field, inner in layout.fields:
            self._write(inner, self._field(name, field, inner))

    def _time(self, layout: Record, value: str, name: str) -> None:
        self._align(4)
        self._flush()
        names = self._constant(frozenset(name for name, _ in layout.fields))
        with self._block(f"if {value} == NOW:"):
            self._emit("stamps.append(len(out))", f"{name} = ZERO")
        with self._block("else:"):
            self._emit(f"{name} = known({value}, {names})")
        for field, inner in layout.fields:
            self._write(inner, self._field(name, field, inner))

    def _field(self, owner: str, name: str, layout: Layout) -> str:
        """Return the source expression for a field's value; a missing field has its default."""
        match layout:
            case Primitive(code=code, default=default):
                if code in "fd":
                    found = self._name()
                    self._emit(f"{found} = {owner}.get({name!r}, {_literal(default, 0.0)})")
                    return f"({found} if {found} != None else nan)"
                return f"{owner}.get({name!r}, {_literal(default, 0)})"
            case Text(default=default):
                return f"{owner}.get({name!r}, {_literal(default, '')})"
            case Record():
                return f"{owner}.get({name!r}, ZERO)"
            case Array(length=length, default=default):
                if default is not None:
                    return f"{owner}.get({name!r}, {self._constant(default)})"
                empty = self._constant([_zero(layout.element)] * length)
                return f"{owner}.get({name!r}, {empty})"

    def _text(self, layout: Text, value: str) -> None:
        self._align(4)
        self._flush()
        name = self._name()
        if layout.is_wide:
            self._emit(f"out += wide({value})")
            self._lose_place(4)
            return
        self._emit(f"{name} = {value}.encode()")
        if self._is_ros1:
            self._emit(f"out += pack('<I', len({name}))", f"out += {name}")
        else:
            self._emit(f"out += pack('<I', len({name}) + 1)", f"out += {name}", "out.append(0)")
        self._lose_place()

    def _array(self, layout: Array, value: str) -> None:
        element, length = layout.element, layout.length
        code = element.code if isinstance(element, Primitive) else ""
        self._align(4 if not length else SIZES.get(code, 1))
        self._flush()
        name = self._name()
        make = "binary" if code == "B" else "listed"
        self._emit(f"{name} = {make}({value}, {length})")
        if not length:
            self._emit(f"out += pack('<I', len({name}))")
            self._lose_place(4)
        if code:
            self._numbers(code, name, length)
            return
        item = self._name()
        self._lose_place()
        with self._block(f"for {item} in {name}:"):
            self._write(element, item)
            self._flush()
        self._lose_place()

    def _numbers(self, code: str, name: str, length: int) -> None:
        size = SIZES[code]
        if code == "B":
            self._emit(f"out += {name}")
        else:
            if not length and size > 4 and not self._is_ros1:
                with self._block(f"if {name}:"):
                    self._emit(f"out += PAD[({self._origin} - len(out)) & 7]")
            values = f"floats({name})" if code in "fd" else name
            self._emit(f"out += pack(f'<{{len({name})}}{code}', *{values})")
        if length:
            self._rest = (self._rest + length * size) % self._modulus
        else:
            self._lose_place(min(size, 4))


def _literal(value: object, otherwise: object) -> str:
    return repr(otherwise if value is None else value)


def _zero(layout: Layout) -> object:
    match layout:
        case Primitive(code=code):
            return 0.0 if code in "fd" else 0
        case Text():
            return ""
        case Record():
            return {}
        case Array():
            return [_zero(layout.element)] * layout.length


def _reason(layout: Layout, value: object, path: str) -> str:
    """Return the first reason why a value does not fit a layout; "" if the value fits."""
    shown = f"{path.lstrip('.') or 'the message'}: {printable(repr(value))[:_SHOWN]}"
    match layout:
        case Primitive(code=code):
            return "" if _is_number(code, value) else f"{shown} is not a {_WORDS[code]}"
        case Text():
            return "" if isinstance(value, str) else f"{shown} is not text"
        case Record():
            if layout.is_time and value == NOW:
                return ""
            if not isinstance(value, Mapping):
                return f"{shown} is not a mapping of fields"
            fields = dict(layout.fields)
            for name, inner in value.items():
                if name not in fields:
                    known = ", ".join(fields)
                    return f"{path.lstrip('.') or 'the message'} has no {name!r}; it has: {known}"
                if reason := _reason(fields[name], inner, f"{path}.{name}"):
                    return reason
            return ""
        case Array():
            return _array_reason(layout, value, path, shown)


def _array_reason(layout: Array, value: object, path: str, shown: str) -> str:
    if isinstance(layout.element, Primitive) and layout.element.code == "B":
        try:
            _binary(value, layout.length)
        except (*_FAULTS, binascii.Error):
            return f"{shown} is not bytes, base64 text or a list"
        return ""
    if not isinstance(value, list | tuple):
        return f"{shown} is not a list"
    if layout.length and len(value) != layout.length:
        return f"{path.lstrip('.')} has {len(value)} elements, not {layout.length}"
    reasons = (_reason(layout.element, one, f"{path}[{at}]") for at, one in enumerate(value))
    return next((reason for reason in reasons if reason), "")


def _is_number(code: str, value: object) -> bool:
    if value is None:
        return code in "fd"
    if code == "?":
        return isinstance(value, bool | int)
    try:
        struct.pack("<" + code, value)
    except (struct.error, OverflowError, TypeError):
        return False
    return True


_WORDS: Final = {
    "?": "boolean", "f": "number", "d": "number",
    **{code: f"whole number of {8 * SIZES[code]} bits" for code in "bBhHiIqQ"},
}  # fmt: skip
