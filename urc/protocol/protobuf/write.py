"""A writer for messages in Protocol Buffers.

A message is a mapping of fields, as in a document; missing fields are not written. The text ``now``
in place of a ``Timestamp`` leaves room for the time of sending. The numbers of this time are
varints, which may have more bytes than they need, so their places are known in advance.
"""

import base64
import math
import struct
from collections.abc import Mapping
from typing import Any, Final

from urc.problems import printable
from urc.protocol.protobuf.read import MAX_DEPTH, time_name
from urc.protocol.protobuf.schema import TIMESTAMP, ProtoField, ProtoTypes
from urc.protocol.protobuf.wire import BYTES, FIXED32, FIXED64, VARINT, varint
from urc.protocol.ros.write_source import NOW, Unwritable, Written

__all__ = ["ProtobufWriter"]

_SHOWN: Final = 40
_FIXED: Final = {
    "double": "<d", "float": "<f", "fixed32": "<I", "sfixed32": "<i", "fixed64": "<Q",
    "sfixed64": "<q",
}  # fmt: skip
_RANGES: Final = {
    "int32": (-(2**31), 2**31), "sint32": (-(2**31), 2**31), "enum": (-(2**31), 2**31),
    "uint32": (0, 2**32), "int64": (-(2**63), 2**63), "sint64": (-(2**63), 2**63),
    "uint64": (0, 2**64),
}  # fmt: skip
_STAMP: Final = b"\x08\x80\x80\x80\x80\x00\x10\x80\x80\x80\x80\x00"
"""A time of zero with seconds and nanoseconds in five bytes each."""


class ProtobufWriter:
    """A writer for the messages of one type."""

    def __init__(self, types: ProtoTypes, name: str) -> None:
        """Prepare the writer; raise `BadDefinition` if the schema does not contain the type."""
        self._types = types
        self._name = types.message(name.lstrip(".")).name

    def write(self, message: object) -> Written:
        """Return the bytes of a message; raise `Unwritable` if a field does not fit."""
        data, stamps = self._message(self._name, {} if message is None else message, "", 0)
        return Written(data, tuple(stamps))

    def _message(self, name: str, value: object, path: str, depth: int) -> tuple[bytes, list[int]]:
        if name == TIMESTAMP and value == NOW:
            return _STAMP, [0]
        if not isinstance(value, Mapping) or depth > MAX_DEPTH:
            raise Unwritable(f"{_shown(path, value)} is not a mapping of fields")
        fields = {time_name(name, one.name): one for one in self._types.message(name).fields}
        out, stamps = bytearray(), list[int]()
        for key, inner in value.items():
            field = fields.get(key)
            if field is None:
                known = ", ".join(fields)
                raise Unwritable(f"{path or 'the message'} has no {key!r}; it has: {known}")
            where = f"{path}.{key}".lstrip(".")
            if not field.is_repeated:
                self._one(out, stamps, field, inner, where, depth)
                continue
            for at, element in enumerate(self._elements(field, inner, where)):
                self._one(out, stamps, field, element, f"{where}[{at}]", depth)
        return bytes(out), stamps

    def _elements(self, field: ProtoField, value: object, path: str) -> list[Any]:
        is_map = field.kind == "message" and self._types.message(field.type).is_map_entry
        if is_map and isinstance(value, Mapping):
            return [{"key": key, "value": inner} for key, inner in value.items()]
        if is_map or not isinstance(value, list | tuple):
            expected = "a mapping" if is_map else "a list"
            raise Unwritable(f"{_shown(path, value)} is not {expected}")
        return list(value)

    def _one(
        self,
        out: bytearray,
        stamps: list[int],
        field: ProtoField,
        value: object,
        path: str,
        depth: int,
    ) -> None:
        """Append one field with its tag; None stands for an absent field."""
        if value is None and field.has_presence:
            return
        if field.kind == "message":
            data, inner = self._message(field.type, value, path, depth + 1)
            out += varint(field.number << 3 | BYTES) + varint(len(data))
            stamps += [len(out) + at for at in inner]
            out += data
        elif field.kind in ("string", "bytes"):
            data = _bytes_of(field.kind, value, path)
            out += varint(field.number << 3 | BYTES) + varint(len(data)) + data
        elif field.kind in _FIXED:
            data = _fixed(field.kind, value, path)
            out += varint(field.number << 3 | (FIXED64 if len(data) == 8 else FIXED32)) + data
        else:
            out += varint(field.number << 3 | VARINT) + varint(self._number(field, value, path))

    def _number(self, field: ProtoField, value: object, path: str) -> int:
        if field.kind == "bool":
            if not isinstance(value, bool | int):
                raise Unwritable(f"{_shown(path, value)} is not a boolean")
            return int(bool(value))
        if field.kind == "enum" and isinstance(value, str):
            values = self._types.enums.get(field.type, {})
            if value not in values:
                known = ", ".join(values)
                raise Unwritable(f"{_shown(path, value)} is not one of: {known}")
            value = values[value]
        low, high = _RANGES.get(field.kind, (0, 0))
        is_whole = isinstance(value, float) and value.is_integer()
        number = int(value) if isinstance(value, float) and is_whole else value
        if isinstance(number, bool) or not isinstance(number, int) or not low <= number < high:
            raise Unwritable(f"{_shown(path, value)} is not a valid {field.kind}")
        return number << 1 ^ number >> 63 if field.kind.startswith("sint") else number


def _bytes_of(kind: str, value: object, path: str) -> bytes:
    if kind == "string":
        if not isinstance(value, str):
            raise Unwritable(f"{_shown(path, value)} is not text")
        return value.encode()
    try:
        if isinstance(value, str):
            return base64.b64decode(value, validate=True)
        if isinstance(value, bytes | list | tuple):
            return bytes(value)
    except (ValueError, TypeError):
        pass
    raise Unwritable(f"{_shown(path, value)} is not bytes, base64 text or a list")


def _fixed(kind: str, value: object, path: str) -> bytes:
    if value is None and kind in ("double", "float"):
        value = math.nan
    if not isinstance(value, bool):
        try:
            return struct.pack(_FIXED[kind], value)
        except (struct.error, OverflowError):
            pass
    raise Unwritable(f"{_shown(path, value)} is not a valid {kind}")


def _shown(path: str, value: object) -> str:
    return f"{path or 'the message'}: {printable(repr(value))[:_SHOWN]}"
