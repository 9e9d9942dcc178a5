"""Schemas of FlatBuffers: the types in a binary schema (``.bfbs``), which is a FlatBuffer itself.

Pure. A server sends the binary schema as base64 text. Schemas are untrusted input: their size, and
the number of types and of fields, are limited. Types may contain each other.

Source: reflection.fbs of the FlatBuffers project.
"""

import base64
import binascii
import struct
from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from urc.problems import printable
from urc.protocol.flatbuffer.tables import BadBuffer, Tables
from urc.protocol.ros.definition import MAX_TEXT, BadDefinition

__all__ = ["CODES", "FlatField", "FlatKind", "FlatObject", "FlatTypes", "parse_schema"]

MAX_TYPES: Final = 2048
"""Maximum number of tables, structs and unions in one schema."""
MAX_FIELDS: Final = 16_384
"""Maximum number of fields and members of unions in one schema."""
_NAME: Final = 256
_SHOWN: Final = 60
_IDENTIFIER: Final = b"BFBS"
STRING, VECTOR, OBJECT, UNION, ARRAY = 13, 14, 15, 16, 17
CODES: Final = {
    1: "B", 2: "?", 3: "b", 4: "B", 5: "h", 6: "H", 7: "i", 8: "I", 9: "q", 10: "Q", 11: "f",
    12: "d",
}  # fmt: skip
"""Format code of `struct` for each kind of number."""


class FlatKind(NamedTuple):
    """The type of a field."""

    base: int
    """Number in ``BaseType``: a key of `CODES`, or one of the constants such as `STRING`."""
    element: int = 0
    """The same for the elements of a vector or array."""
    number: int = -1
    """Number of the table, struct or union; -1 for other types."""
    length: int = 0
    """Number of elements of an array."""


class FlatField(NamedTuple):
    """One field of a table or a struct."""

    name: str
    kind: FlatKind
    offset: int
    """Offset in the table of offsets, or in the struct."""
    default: int | float | None
    """Value of an absent number; None if its absence is told apart."""


class FlatObject(NamedTuple):
    """A table or a struct."""

    name: str
    fields: tuple[FlatField, ...]
    is_struct: bool
    size: int
    """Size of a struct in bytes."""


class FlatTypes(NamedTuple):
    """The types of one schema."""

    objects: tuple[FlatObject, ...]
    unions: tuple[Mapping[int, FlatKind], ...]
    """Type of each member, keyed by its number, for each enumeration; {} for other enumerations."""
    root: str
    """Name of the root type, or ""."""

    def number(self, name: str) -> int:
        """Return the number of a type, or else of the root type; raise `BadDefinition`."""
        for wanted in (name, self.root):
            for number, one in enumerate(self.objects):
                if one.name == wanted and wanted:
                    return number
        shown = printable(name[:_SHOWN])
        raise BadDefinition(f"the definition does not contain the type {shown!r}")


def parse_schema(text: str) -> FlatTypes:
    """Return the types of a binary schema in base64.

    Raises:
        BadDefinition: the schema is invalid or too large.
    """
    if len(text) > MAX_TEXT:
        raise BadDefinition(f"the definition has more than {MAX_TEXT} characters")
    try:
        data = base64.b64decode(text, validate=True)
        if data[4:8] != _IDENTIFIER:
            raise BadBuffer("it lacks the mark BFBS")
        return _Schema(data).parse()
    except (binascii.Error, ValueError, struct.error) as fault:  # also BadBuffer
        raise BadDefinition(f"the definition is not a binary schema ({fault})") from fault


class _Schema:
    """A reader for one schema."""

    def __init__(self, data: bytes) -> None:
        self._tables = Tables(data)
        self._fields = 0

    def parse(self) -> FlatTypes:
        root = self._tables.root()
        objects = tuple(map(self._object, self._each(root, 0, MAX_TYPES)))
        unions = tuple(map(self._union, self._each(root, 1, MAX_TYPES)))
        main = self._tables.field(root, 12)
        name = self._name(self._tables.follow(main)) if main else ""
        return FlatTypes(objects, unions, name)

    # -- fields, by their number

    def _each(self, table: int, number: int, most: int) -> Iterator[int]:
        """Yield the places of the tables in a vector."""
        at = self._tables.field(table, 4 + 2 * number)
        begin, count = self._tables.span(at, 4) if at else (0, 0)
        if count > most:
            raise BadDefinition(f"the definition has more than {most} types or fields")
        for place in range(begin, begin + 4 * count, 4):
            yield self._tables.follow(place)

    def _int(self, table: int, number: int, code: str, absent: int | float = 0) -> int | float:
        at = self._tables.field(table, 4 + 2 * number)
        found: int | float = absent
        if at:
            found = struct.unpack_from("<" + code, self._tables.data, at)[0]
        return found

    def _name(self, table: int) -> str:
        at = self._tables.field(table, 4)
        return self._tables.text(at, _NAME) if at else ""

    def _count(self) -> None:
        self._fields += 1
        if self._fields > MAX_FIELDS:
            raise BadDefinition(f"the definition has more than {MAX_FIELDS} fields")

    # -- types

    def _object(self, table: int) -> FlatObject:
        fields = tuple(self._field(one) for one in self._each(table, 1, MAX_FIELDS))
        is_struct = bool(self._int(table, 2, "B"))
        return FlatObject(self._name(table), fields, is_struct, int(self._int(table, 4, "i")))

    def _field(self, table: int) -> FlatField:
        self._count()
        kind = self._kind(self._tables.field(table, 6))
        is_real = kind.base in (11, 12)
        default = self._int(table, 5, "d", 0.0) if is_real else self._int(table, 4, "q")
        value: int | float | None = default
        if self._int(table, 11, "B"):
            value = None
        elif kind.base == 2:
            value = bool(default)
        elif default - default != 0:
            value = None
        if self._int(table, 13, "B"):
            raise BadDefinition(f"{self._name(table)} has 64-bit offsets: not supported")
        return FlatField(self._name(table), kind, int(self._int(table, 3, "H")), value)

    def _kind(self, at: int) -> FlatKind:
        if not at:
            raise BadBuffer("a field without a type")
        table = self._tables.follow(at)
        base, element = int(self._int(table, 0, "b")), int(self._int(table, 1, "b"))
        index, length = int(self._int(table, 2, "i", -1)), int(self._int(table, 3, "H"))
        return FlatKind(base, element, index, length)

    def _union(self, table: int) -> Mapping[int, FlatKind]:
        found = {}
        for one in self._each(table, 1, MAX_FIELDS):
            self._count()
            at = self._tables.field(one, 10)
            if at and self._int(table, 2, "B"):
                found[int(self._int(one, 1, "q"))] = self._kind(at)
        return found
