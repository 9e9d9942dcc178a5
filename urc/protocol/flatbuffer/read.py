"""A reader for messages in FlatBuffers, which reads only the wanted fields.

Theory of operation. For each type, the reader has a list of fields with a function each, which is
prepared once. Values have the same shapes as those of ROS messages:

- A table or a struct is a mapping that contains all its wanted fields. An absent table is null in a
  document.
  An absent text or vector is empty, and an absent number has its declared default value.
- A vector of ``ubyte`` is bytes, and an enumeration is a number.
- A union is the mapping of its member; the number of the member is in the field ``…_type``.
- ``foxglove.Time`` and ``foxglove.Duration`` have the fields ``sec`` and ``nanosec``.
- Non-finite numbers become None.

The data is untrusted. Many offsets may lead to the same table, so a small message could stand for a
huge one. The values and the bytes of a message are therefore counted before they are created.
"""

import struct
import sys
from array import array
from collections.abc import Callable
from typing import Any, Final

from urc.protocol.flatbuffer.schema import (
    ARRAY,
    CODES,
    OBJECT,
    STRING,
    UNION,
    VECTOR,
    FlatField,
    FlatKind,
    FlatObject,
    FlatTypes,
)
from urc.protocol.flatbuffer.tables import Tables
from urc.protocol.ros.definition import BadDefinition
from urc.protocol.ros.read_source import MAX_NUMBERS, BadRosMessage
from urc.protocol.ros.wanted import ALL, EACH, FEW, PACKED, Wanted
from urc.protocol.values.transform_tree import MAX_TRANSFORMS

__all__ = ["MAX_DEPTH", "MAX_VALUES", "FlatbufferReader"]

MAX_VALUES: Final = 500_000
"""Maximum number of values in one message, not counting the numbers in vectors."""
MAX_DEPTH: Final = 64
"""Maximum depth of nested tables, as in the verifier of FlatBuffers."""
_MORE_BYTES: Final = 4
"""Maximum number of bytes in text and vectors, as a multiple of the bytes of the message."""
_FAULTS: Final = (struct.error, IndexError, OverflowError, ValueError, MemoryError)
_TIMES: Final = ("foxglove.Time", "foxglove.Duration")
_UBYTE: Final = 4

Take = Callable[[int, int, int], Any]
"""Function that returns the value at a place, in the table at a place, at a depth."""


class _Plan:
    """How to read one table or struct."""

    def __init__(self, kind: FlatObject) -> None:
        self.is_struct, self.size = kind.is_struct, kind.size
        self.fields: list[tuple[int, str, Take, Any]] = []
        """Offset, name, function and value of the absent field."""
        self.lists: list[str] = []
        """Names of fields whose absent value is an empty list."""


class FlatbufferReader:
    """A reader for the messages of one type."""

    def __init__(self, types: FlatTypes, name: str, wanted: Wanted = ALL) -> None:
        """Prepare the reader.

        Args:
            types: types of the schema.
            name: full name of the message type, such as ``foxglove.Log``.
            wanted: parts to read.

        Raises:
            BadDefinition: the type, or a type that it uses, is missing or not supported.
        """
        self._types = types
        self._whole: dict[int, _Plan] = {}
        self._slots: dict[str, dict[str, int]] = {}
        """Offset of each field, keyed by type and by name."""
        self._unions_read: dict[int, dict[int, Take]] = {}
        """Function for each member, keyed by the number of the union."""
        self._tables = Tables(b"")
        self._values = self._numbers = self._bytes = 0
        self.size = 0
        """Number of prepared fields."""
        try:
            self._plan = self._plan_of(types.number(name), wanted)
        except RecursionError:
            raise BadDefinition("the types are nested too deeply") from None

    def read(self, data: bytes) -> dict[str, Any]:
        """Return the wanted parts of a message; raise `BadRosMessage` if it is invalid."""
        self._tables = Tables(data)
        self._values, self._numbers = MAX_VALUES, MAX_NUMBERS
        self._bytes = _MORE_BYTES * len(data)
        try:
            return self._object(self._plan, self._tables.root(), 0)
        except BadRosMessage:
            raise
        except _FAULTS as fault:
            raise BadRosMessage(f"the message does not match its definition ({fault})") from fault
        finally:
            self._tables = Tables(b"")

    # -- reading

    def _object(self, plan: _Plan, at: int, depth: int) -> dict[str, Any]:
        if depth > MAX_DEPTH:
            raise BadRosMessage(f"the message is nested more than {MAX_DEPTH} levels deep")
        self._take(len(plan.fields) + 1)
        if plan.is_struct:
            return {name: take(at + offset, at, depth) for offset, name, take, _ in plan.fields}
        found, field = {}, self._tables.field
        for offset, name, take, absent in plan.fields:
            place = field(at, offset)
            found[name] = take(place, at, depth) if place else absent
        for name in plan.lists:
            if found[name] is None:
                found[name] = []
        return found

    def _take(self, count: int) -> None:
        self._values -= count
        if self._values < 0:
            raise BadRosMessage(f"the message has more than {MAX_VALUES} values")

    def _take_bytes(self, count: int) -> None:
        self._bytes -= count
        if self._bytes < 0:
            raise BadRosMessage(f"the values are longer than {_MORE_BYTES} times the message")

    # -- preparing

    def _plan_of(self, number: int, wanted: Wanted) -> _Plan:
        if wanted is True and number in self._whole:
            return self._whole[number]
        if not 0 <= number < len(self._types.objects):
            raise BadDefinition(f"the definition has no type with the number {number}")
        kind = self._types.objects[number]
        plan = _Plan(kind)
        if wanted is True:
            self._whole[number] = plan
        for field in kind.fields:
            name = "nanosec" if kind.name in _TIMES and field.name == "nsec" else field.name
            part = wanted if isinstance(wanted, bool) else wanted.get(name, False)
            if not part:
                continue
            self.size += 1
            take = self._field(kind, field, part)
            absent: Any = field.default if field.kind.base in CODES else None
            if field.kind.base == VECTOR:
                absent = b"" if field.kind.element == _UBYTE else None
            if field.kind.base == VECTOR and absent is None:
                plan.lists.append(name)
            absent = "" if field.kind.base == STRING else absent
            plan.fields.append((field.offset, name, take, absent))
        return plan

    def _field(self, owner: FlatObject, field: FlatField, wanted: Wanted) -> Take:
        kind = field.kind
        if kind.base in CODES:
            return self._number(CODES[kind.base])
        if kind.base == STRING:
            return self._text
        if kind.base == OBJECT:
            return self._nested(kind.number, wanted)
        if kind.base == VECTOR:
            return self._vector(owner, field, wanted)
        if kind.base == ARRAY:
            return self._array(kind, wanted)
        if kind.base == UNION:
            return self._union(owner, field)
        raise BadDefinition(f"{owner.name}.{field.name} has a type that is not supported")

    def _number(self, code: str) -> Take:
        unpack = struct.Struct("<" + code).unpack_from
        if code not in "fd":
            return lambda at, table, depth: unpack(self._tables.data, at)[0]

        def take(at: int, table: int, depth: int) -> Any:
            value = unpack(self._tables.data, at)[0]
            return value if value - value == 0 else None

        return take

    def _text(self, at: int, table: int, depth: int) -> str:
        begin, count = self._tables.span(at, 1)
        self._take_bytes(count)
        return self._tables.data[begin : begin + count].decode("utf-8", "replace")

    def _nested(self, number: int, wanted: Wanted) -> Take:
        plan = self._plan_of(number, wanted)
        if plan.is_struct:
            return lambda at, table, depth: self._object(plan, at, depth + 1)
        return lambda at, table, depth: self._object(plan, self._tables.follow(at), depth + 1)

    def _vector(self, owner: FlatObject, field: FlatField, wanted: Wanted) -> Take:
        kind = field.kind
        is_few = isinstance(wanted, dict) and FEW in wanted
        if isinstance(wanted, dict):
            wanted = PACKED in wanted or wanted.get(FEW if is_few else EACH, False)
        if kind.element in CODES:
            return self._numbers_of(CODES[kind.element], is_bytes=kind.element == _UBYTE)
        element: Take
        if kind.element == STRING:
            element, size = self._text, 4
        elif kind.element == OBJECT:
            element = self._nested(kind.number, wanted)
            inner = self._types.objects[kind.number]
            size = inner.size if inner.is_struct else 4
        elif kind.element == UNION:
            return self._unions(owner, field)
        else:
            raise BadDefinition(f"{owner.name}.{field.name} has a type that is not supported")
        if size < 1:
            raise BadDefinition(f"{owner.name}.{field.name} has elements of {size} bytes")

        def take(at: int, table: int, depth: int) -> list[Any]:
            begin, count = self._tables.span(at, size)
            self._take(count)
            if is_few and count > MAX_TRANSFORMS:
                raise BadRosMessage(f"more than {MAX_TRANSFORMS} transforms in one message")
            end = begin + count * size
            return [element(place, table, depth) for place in range(begin, end, size)]

        return take

    def _numbers_of(self, code: str, *, is_bytes: bool) -> Take:
        size = struct.calcsize(f"<{code}")

        def take(at: int, table: int, depth: int) -> Any:
            begin, count = self._tables.span(at, size)
            if is_bytes:
                self._take_bytes(count)
                return self._tables.data[begin : begin + count]
            return self._listed(code, begin, count)

        return take

    def _listed(self, code: str, begin: int, count: int) -> list[Any]:
        """Return `count` numbers as a list."""
        self._numbers -= count
        if self._numbers < 0:
            raise BadRosMessage(f"the message has more than {MAX_NUMBERS} numbers")
        end = begin + count * struct.calcsize(f"<{code}")
        if end > self._tables.size:
            raise BadRosMessage("an array is longer than its message")
        data = self._tables.data[begin:end]
        if code == "?":
            return [one != 0 for one in data]
        values = array(code, data)
        if sys.byteorder == "big":
            values.byteswap()
        numbers: list[Any] = values.tolist()
        if code in "fd" and (total := sum(numbers)) - total != 0:
            return [number if number - number == 0 else None for number in numbers]
        return numbers

    def _array(self, kind: FlatKind, wanted: Wanted) -> Take:
        """Return the function for an array in a struct."""
        if kind.element in CODES:
            code = CODES[kind.element]
            return lambda at, table, depth: self._listed(code, at, kind.length)
        if isinstance(wanted, dict):
            wanted = wanted.get(EACH, False)
        if kind.element != OBJECT:
            raise BadDefinition("an array has elements that are not supported")
        plan = self._plan_of(kind.number, wanted)

        def take(at: int, table: int, depth: int) -> list[Any]:
            self._take(kind.length)
            places = range(at, at + kind.length * plan.size, max(plan.size, 1))
            return [self._object(plan, place, depth + 1) for place in places]

        return take

    # -- unions

    def _members(self, owner: FlatObject, field: FlatField) -> tuple[int, dict[int, Take]]:
        """Return the offset of the field with the member's number, and a function per member."""
        name, number = f"{field.name}_type", field.kind.number
        slots = self._slots.get(owner.name)
        if slots is None:
            slots = self._slots[owner.name] = {one.name: one.offset for one in owner.fields}
        if name not in slots or not 0 <= number < len(self._types.unions):
            raise BadDefinition(f"the union {owner.name}.{field.name} has no {name}")
        takes = self._unions_read.get(number)
        if takes is None:
            takes = self._unions_read[number] = {}
            for member, kind in self._types.unions[number].items():
                if kind.base == STRING:
                    takes[member] = self._text
                elif kind.base == OBJECT:
                    # A struct in a union is behind an offset, as a table is.
                    takes[member] = self._behind(self._plan_of(kind.number, ALL))
        return slots[name], takes

    def _behind(self, plan: _Plan) -> Take:
        return lambda at, table, depth: self._object(plan, self._tables.follow(at), depth + 1)

    def _union(self, owner: FlatObject, field: FlatField) -> Take:
        slot, takes = self._members(owner, field)

        def take(at: int, table: int, depth: int) -> Any:
            place = self._tables.field(table, slot)
            member = takes.get(self._tables.data[place]) if place else None
            return None if member is None else member(at, table, depth)

        return take

    def _unions(self, owner: FlatObject, field: FlatField) -> Take:
        """Return the function for a vector of unions; another vector contains their numbers."""
        slot, takes = self._members(owner, field)

        def take(at: int, table: int, depth: int) -> list[Any]:
            begin, count = self._tables.span(at, 4)
            self._take(count)
            place = self._tables.field(table, slot)
            numbers, known = self._tables.span(place, 1) if place else (0, 0)
            if known != count:
                raise BadRosMessage("a vector of unions has another length than its types")
            found = []
            for number in range(count):
                member = takes.get(self._tables.data[numbers + number])
                one = None if member is None else member(begin + 4 * number, table, depth)
                found.append(one)
            return found

        return take
