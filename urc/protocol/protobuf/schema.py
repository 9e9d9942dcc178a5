"""Schemas of Protocol Buffers: the types in a serialized ``FileDescriptorSet``.

Pure. A server sends this set as base64 text. The set is itself a message, so no compiler and no
library is needed to read it. Schemas are untrusted input: their size, the number of types and of
fields, and the depth of nested types are limited. Types may contain each other, as in
``google.protobuf.Value``.

Source: google/protobuf/descriptor.proto.
"""

import base64
import binascii
from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from urc.problems import printable
from urc.protocol.protobuf.wire import BadWire, parts_of
from urc.protocol.ros.definition import MAX_TEXT, BadDefinition

__all__ = ["DURATION", "TIMESTAMP", "ProtoField", "ProtoMessage", "ProtoTypes", "parse_schema"]

MAX_TYPES: Final = 2048
"""Maximum number of messages and enumerations in one schema."""
MAX_FIELDS: Final = 16_384
"""Maximum number of fields and enumeration values in one schema."""
MAX_NESTED: Final = 24
"""Maximum depth of types that are declared within each other."""
TIMESTAMP: Final = "google.protobuf.Timestamp"
DURATION: Final = "google.protobuf.Duration"
_SHOWN: Final = 60
_KINDS: Final = (
    *("", "double", "float", "int64", "uint64", "int32", "fixed64", "fixed32", "bool", "string"),
    *("group", "message", "bytes", "uint32", "enum", "sfixed32", "sfixed64", "sint32", "sint64"),
)
"""Names of the kinds of fields, by their numbers in ``FieldDescriptorProto.Type``."""
_REPEATED: Final = 3
_IMPLICIT: Final = 2
_MAX_NUMBER: Final = 2**29


class ProtoField(NamedTuple):
    """One field of a message."""

    number: int
    name: str
    kind: str
    """Kind in the notation of a ``.proto`` file, such as ``double``; also ``message``, ``enum``."""
    type: str
    """Full name of the message or enumeration, or ""."""
    is_repeated: bool
    has_presence: bool
    """Whether an absent field differs from a field that is zero or empty."""
    default: str | None
    """Declared default value as text (proto2)."""
    oneof: int | None
    """Number of the ``oneof`` that contains the field."""


class ProtoMessage(NamedTuple):
    """A message type."""

    name: str
    fields: tuple[ProtoField, ...]
    is_map_entry: bool
    """Whether the type is the entry of a map, with the fields ``key`` and ``value``."""


class ProtoTypes(NamedTuple):
    """The types of one schema, keyed by full name such as ``foxglove.Log``."""

    messages: Mapping[str, ProtoMessage]
    enums: Mapping[str, Mapping[str, int]]
    """Number of each value of an enumeration, keyed by the enumeration and the value's name."""

    def message(self, name: str) -> ProtoMessage:
        """Return a message type; raise `BadDefinition` if the schema does not contain it."""
        found = self.messages.get(name)
        if found is None:
            shown = printable(name[:_SHOWN])
            raise BadDefinition(f"the definition does not contain the type {shown!r}")
        return found


def parse_schema(text: str) -> ProtoTypes:
    """Return the types of a ``FileDescriptorSet`` in base64.

    Raises:
        BadDefinition: the schema is invalid or too large.
    """
    if len(text) > MAX_TEXT:
        raise BadDefinition(f"the definition has more than {MAX_TEXT} characters")
    try:
        return _Schema().parse(base64.b64decode(text, validate=True))
    except (binascii.Error, ValueError) as fault:  # also BadWire and UnicodeDecodeError
        raise BadDefinition(f"the definition is not a FileDescriptorSet ({fault})") from fault


class _Schema:
    """The types found so far."""

    def __init__(self) -> None:
        self._messages: dict[str, ProtoMessage] = {}
        self._enums: dict[str, dict[str, int]] = {}
        self._fields = 0

    def parse(self, data: bytes) -> ProtoTypes:
        for file in _inner(data, 1):
            said = _values(file)
            syntax, package = _text(said, 12), _text(said, 2)
            is_explicit = syntax != "proto3"
            if syntax == "editions":
                is_explicit = _presence(_bytes(said, 8), 50) != _IMPLICIT
            for one in _inner(file, 4):
                self._message(one, package, is_explicit, 0)
            for one in _inner(file, 5):
                self._enum(one, package)
        return ProtoTypes(self._messages, self._enums)

    def _count(self, fields: int) -> None:
        self._fields += fields
        if len(self._messages) + len(self._enums) > MAX_TYPES:
            raise BadDefinition(f"the definition has more than {MAX_TYPES} types")
        if self._fields > MAX_FIELDS:
            raise BadDefinition(f"the definition has more than {MAX_FIELDS} fields")

    def _message(self, data: bytes, scope: str, is_explicit: bool, depth: int) -> None:
        if depth > MAX_NESTED:
            raise BadDefinition(f"types are declared more than {MAX_NESTED} levels deep")
        said = _values(data)
        name = f"{scope}.{_text(said, 1)}".lstrip(".")
        fields = tuple(_field(one, is_explicit) for one in _inner(data, 2))
        is_map = bool(_values(_bytes(said, 7)).get(7))
        self._messages[name] = ProtoMessage(name, fields, is_map)
        self._count(len(fields))
        for one in _inner(data, 3):
            self._message(one, name, is_explicit, depth + 1)
        for one in _inner(data, 4):
            self._enum(one, name)

    def _enum(self, data: bytes, scope: str) -> None:
        values: dict[str, int] = {}
        for one in _inner(data, 2):
            said = _values(one)
            number = _int(said, 2)
            values[_text(said, 1)] = number - 2**64 if number >= 2**63 else number
        self._enums[f"{scope}.{_text(_values(data), 1)}".lstrip(".")] = values
        self._count(len(values))


def _field(data: bytes, is_explicit: bool) -> ProtoField:
    said = _values(data)
    number, name, code = _int(said, 3), _text(said, 1), _int(said, 5)
    if not 0 < number < _MAX_NUMBER or not 0 < code < len(_KINDS):
        shown = printable(name[:_SHOWN])
        raise BadDefinition(f"the field {shown!r} has the number {number} and the kind {code}")
    kind, is_repeated = _KINDS[code], _int(said, 4) == _REPEATED
    oneof = _int(said, 9) if 9 in said else None
    told = _presence(_bytes(said, 8), 21)
    if told is not None:
        is_explicit = told != _IMPLICIT
    has_presence = not is_repeated and (kind == "message" or oneof is not None or is_explicit)
    default = _text(said, 7) if 7 in said else None
    type_name = _text(said, 6).lstrip(".")
    is_alone = oneof is None or 17 in said  # proto3_optional: a oneof of its own
    return ProtoField(
        number,
        name,
        kind,
        type_name,
        is_repeated,
        has_presence,
        default,
        None if is_alone else oneof,
    )


def _presence(options: bytes, number: int) -> int | None:
    """Return the feature ``field_presence`` in the options of a file or of a field, or None."""
    features = _values(_bytes(_values(options), number))
    return _int(features, 1) if 1 in features else None


def _inner(data: bytes, number: int) -> Iterator[bytes]:
    for found, value in parts_of(data):
        if found == number and isinstance(value, bytes):
            yield value


def _values(data: bytes) -> dict[int, int | bytes]:
    """Return the last value of each field."""
    return dict(parts_of(data))


def _bytes(said: Mapping[int, int | bytes], number: int) -> bytes:
    value = said.get(number, b"")
    if not isinstance(value, bytes):
        raise BadWire("a number in place of bytes")
    return value


def _text(said: Mapping[int, int | bytes], number: int) -> str:
    return _bytes(said, number).decode()


def _int(said: Mapping[int, int | bytes], number: int) -> int:
    value = said.get(number, 0)
    if not isinstance(value, int):
        raise BadWire("bytes in place of a number")
    return value
