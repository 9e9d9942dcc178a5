"""A reader for messages in Protocol Buffers, which reads only the wanted fields.

Theory of operation. For each type, the reader has a table from tags to functions. A function reads
one value, stores it, and returns the offset after the value. Fields without a function are skipped,
including all that they contain. Values have the same shapes as those of ROS messages:

- A message is a mapping that contains all its wanted fields. An absent message becomes None, and so
  does an absent field with presence. Other absent fields are zero or empty.
- ``bytes`` is bytes, an enumeration is a number, and a map is a mapping with text keys.
- ``Timestamp`` and ``Duration`` have the fields ``sec`` and ``nanosec``.
- Non-finite numbers become None.

The data is untrusted. Two bytes may stand for a mapping with thousands of fields. The values of a
message are therefore counted before they are created.
"""

import struct
import sys
from array import array
from collections.abc import Callable
from typing import Any, Final

from urc.protocol.protobuf.schema import (
    DURATION,
    TIMESTAMP,
    ProtoField,
    ProtoMessage,
    ProtoTypes,
)
from urc.protocol.protobuf.wire import BYTES, FIXED32, FIXED64, VARINT, read_varint, skip
from urc.protocol.ros.definition import BadDefinition
from urc.protocol.ros.read_source import MAX_NUMBERS, BadRosMessage
from urc.protocol.ros.wanted import ALL, EACH, FEW, PACKED, Wanted
from urc.protocol.values.transform_tree import MAX_TRANSFORMS

__all__ = ["MAX_DEPTH", "MAX_VALUES", "ProtobufReader", "time_name"]

MAX_VALUES: Final = 500_000
"""Maximum number of fields and values in one message, not counting the numbers in packed lists."""
MAX_DEPTH: Final = 100
"""Maximum depth of nested messages, as in the libraries of Protocol Buffers."""
_FAULTS: Final = (struct.error, IndexError, OverflowError, ValueError, MemoryError)
_HIGH: Final = bytes(range(128, 256))
_FIXED: Final = {
    "double": "d", "float": "f", "fixed32": "I", "sfixed32": "i", "fixed64": "Q", "sfixed64": "q",
}  # fmt: skip
"""Format code of each kind with a fixed size."""
_TIME_NAMES: Final = {"seconds": "sec", "nanos": "nanosec"}

Store = Callable[[dict[Any, Any], int, int, int], int]
"""Function that reads the value at an offset, up to an end, at a depth; it returns the offset
after the value."""


def time_name(owner: str, name: str) -> str:
    """Return the name of a field of the type `owner`; in times, it is the name that ROS uses."""
    return _TIME_NAMES.get(name, name) if owner in (TIMESTAMP, DURATION) else name


def _signed64(value: int) -> int:
    return value - 2**64 if value >= 2**63 else value


def _signed32(value: int) -> int:
    value &= 0xFFFF_FFFF
    return value - 2**32 if value >= 2**31 else value


def _zigzag(value: int) -> int:
    return value >> 1 ^ -(value & 1)


_VARINTS: Final[dict[str, Callable[[int], Any]]] = {
    "int64": _signed64,
    "int32": _signed32,
    "enum": _signed32,
    "uint64": int,
    "uint32": lambda value: value & 0xFFFF_FFFF,
    "bool": lambda value: value != 0,
    "sint32": lambda value: _zigzag(value & 0xFFFF_FFFF),
    "sint64": _zigzag,
}


class _Plan:
    """How to read one type: a function for each tag, and the values of absent fields."""

    def __init__(self) -> None:
        self.stores: dict[int, Store] = {}
        self.blank: dict[str, Any] = {}
        self.lists: list[str] = []
        self.maps: list[str] = []
        self.oneofs: dict[int, list[str]] = {}
        """Names of the fields in each ``oneof``, of which only the last one sent has a value."""


class ProtobufReader:
    """A reader for the messages of one type."""

    def __init__(self, types: ProtoTypes, name: str, wanted: Wanted = ALL) -> None:
        """Prepare the reader.

        Args:
            types: types of the schema.
            name: full name of the message type.
            wanted: parts to read.

        Raises:
            BadDefinition: the type, or a type that it uses, is missing or not supported.
        """
        self._types = types
        self._whole: dict[str, _Plan] = {}
        self._data = b""
        self._values = self._numbers = 0
        self.size = 0
        """Number of prepared fields."""
        try:
            self._plan = self._plan_of(name.lstrip("."), wanted)
        except RecursionError:
            raise BadDefinition("the types are nested too deeply") from None

    def read(self, data: bytes) -> dict[str, Any]:
        """Return the wanted parts of a message; raise `BadRosMessage` if it is invalid."""
        self._data, self._values, self._numbers = data, MAX_VALUES, MAX_NUMBERS
        try:
            return self._message(self._plan, {}, 0, len(data), 0)
        except BadRosMessage:
            raise
        except _FAULTS as fault:
            raise BadRosMessage(f"the message does not match its definition ({fault})") from fault
        finally:
            self._data = b""

    # -- reading

    def _message(
        self, plan: _Plan, found: dict[Any, Any], at: int, end: int, depth: int
    ) -> dict[str, Any]:
        """Read a message into `found`; a message that is sent in two parts is merged."""
        if depth > MAX_DEPTH:
            raise BadRosMessage(f"the message is nested more than {MAX_DEPTH} levels deep")
        data, stores = self._data, plan.stores
        if not found:
            self._take(len(plan.blank) + 1)
            found.update(plan.blank)
            for name in plan.lists:
                found[name] = []
            for name in plan.maps:
                found[name] = {}
        while at < end:
            self._values -= 1
            if self._values < 0:
                self._take(0)
            tag = data[at]
            if tag < 128:
                at += 1
            else:
                tag, at = read_varint(data, at)
            store = stores.get(tag)
            at = skip(data, at, tag) if store is None else store(found, at, end, depth)
            if at > end:
                raise BadRosMessage("a field is longer than its message")
        for number, names in plan.oneofs.items():
            last = found.pop(number, None)
            if last is not None:
                found.update({name: None for name in names if name != last})
        return found

    def _take(self, count: int) -> None:
        self._values -= count
        if self._values < 0:
            raise BadRosMessage(f"the message has more than {MAX_VALUES} values")

    def _take_numbers(self, count: int) -> None:
        self._numbers -= count
        if self._numbers < 0:
            raise BadRosMessage(f"the message has more than {MAX_NUMBERS} numbers")

    def _sized(self, at: int, end: int) -> tuple[int, int]:
        """Return the begin and end of a value with a length, which must lie before `end`."""
        size, at = read_varint(self._data, at)
        if size > end - at:
            raise BadRosMessage("a field is longer than its message")
        return at, at + size

    # -- preparing

    def _plan_of(self, name: str, wanted: Wanted) -> _Plan:
        if wanted is True and name in self._whole:
            return self._whole[name]
        kind = self._types.message(name)
        plan = _Plan()
        if wanted is True:
            self._whole[name] = plan
        for field in kind.fields:
            known = time_name(name, field.name)
            part = wanted if isinstance(wanted, bool) else wanted.get(known, False)
            if part:
                self._add(plan, kind, field, known, part)
        return plan

    def _add(
        self, plan: _Plan, kind: ProtoMessage, field: ProtoField, name: str, wanted: Wanted
    ) -> None:
        self.size += 1
        if field.kind == "group":
            raise BadDefinition(f"{kind.name} has the group {field.name}: not supported")
        tag = field.number << 3
        if _is_map(field, self._types):
            plan.maps.append(name)
            plan.blank[name] = None
            plan.stores[tag | BYTES] = self._map(field, name, wanted)
            return
        plan.blank[name] = None if field.is_repeated else _absent(field, self._types)
        if field.is_repeated:
            plan.lists.append(name)
        stores = self._stores(field, name, wanted)
        if field.oneof is not None:
            plan.oneofs.setdefault(field.oneof, []).append(name)
        for wire, store in stores.items():
            last = store if field.oneof is None else _noting(store, field.oneof, name)
            plan.stores[tag | wire] = last

    def _stores(self, field: ProtoField, name: str, wanted: Wanted) -> dict[int, Store]:
        if field.kind == "message":
            return {BYTES: self._nested(field, name, wanted)}
        if field.kind in ("string", "bytes"):
            return {BYTES: self._text(field, name)}
        if field.kind in _FIXED:
            return self._fixed(field, name)
        return self._varints(field, name)

    def _nested(self, field: ProtoField, name: str, wanted: Wanted) -> Store:
        is_few = isinstance(wanted, dict) and FEW in wanted
        if field.is_repeated and isinstance(wanted, dict):
            wanted = PACKED in wanted or wanted.get(FEW if is_few else EACH, False)
        plan = self._plan_of(field.type, wanted)

        def store_one(found: dict[Any, Any], at: int, end: int, depth: int) -> int:
            at, after = self._sized(at, end)
            found[name] = self._message(plan, found.get(name) or {}, at, after, depth + 1)
            return after

        def store_each(found: dict[Any, Any], at: int, end: int, depth: int) -> int:
            at, after = self._sized(at, end)
            values = found[name]
            if is_few and len(values) >= MAX_TRANSFORMS:
                raise BadRosMessage(f"more than {MAX_TRANSFORMS} transforms in one message")
            values.append(self._message(plan, {}, at, after, depth + 1))
            return after

        return store_each if field.is_repeated else store_one

    def _map(self, field: ProtoField, name: str, wanted: Wanted) -> Store:
        if isinstance(wanted, dict):  # a path names a key of the map, or each value
            wanted = ALL
        entry = self._plan_of(field.type, wanted)
        absent = {one.name: one for one in self._types.message(field.type).fields}.get("value")

        def store(found: dict[Any, Any], at: int, end: int, depth: int) -> int:
            at, after = self._sized(at, end)
            self._take(1)
            one = self._message(entry, {}, at, after, depth + 1)
            key, value = one.get("key"), one.get("value")
            if value is None and absent is not None and absent.kind == "message":
                value = self._message(self._plan_of(absent.type, ALL), {}, at, at, depth + 1)
            found[name][str(key).lower() if isinstance(key, bool) else str(key)] = value
            return after

        return store

    def _text(self, field: ProtoField, name: str) -> Store:
        is_text = field.kind == "string"

        def store(found: dict[Any, Any], at: int, end: int, depth: int) -> int:
            at, after = self._sized(at, end)
            value: Any = self._data[at:after]
            if is_text:
                value = value.decode("utf-8", "replace")
            if field.is_repeated:
                self._take(1)
                found[name].append(value)
            else:
                found[name] = value
            return after

        return store

    def _fixed(self, field: ProtoField, name: str) -> dict[int, Store]:
        code = _FIXED[field.kind]
        one = struct.Struct("<" + code)
        unpack, size, is_float = one.unpack_from, one.size, code in "df"

        def store(found: dict[Any, Any], at: int, end: int, depth: int) -> int:
            value = unpack(self._data, at)[0]
            if is_float and value - value != 0:
                value = None
            if field.is_repeated:
                self._take_numbers(1)
                found[name].append(value)
            else:
                found[name] = value
            return at + size

        def store_packed(found: dict[Any, Any], at: int, end: int, depth: int) -> int:
            at, after = self._sized(at, end)
            if (after - at) % size:
                raise BadRosMessage(f"a list of numbers has {after - at} bytes, not {size} each")
            self._take_numbers((after - at) // size)
            values = array(_NATIVE.get(code, code), self._data[at:after])
            if sys.byteorder == "big":
                values.byteswap()
            numbers: list[Any] = values.tolist()
            if is_float and (total := sum(numbers)) - total != 0:
                numbers = [number if number - number == 0 else None for number in numbers]
            found[name] += numbers
            return after

        wire = FIXED64 if size == 8 else FIXED32
        return {wire: store, BYTES: store_packed} if field.is_repeated else {wire: store}

    def _varints(self, field: ProtoField, name: str) -> dict[int, Store]:
        convert = _VARINTS[field.kind]

        def store(found: dict[Any, Any], at: int, end: int, depth: int) -> int:
            value, at = read_varint(self._data, at)
            if field.is_repeated:
                self._take_numbers(1)
                found[name].append(convert(value))
            else:
                found[name] = convert(value)
            return at

        def store_packed(found: dict[Any, Any], at: int, end: int, depth: int) -> int:
            at, after = self._sized(at, end)
            data = self._data[at:after]
            count = len(data.translate(None, _HIGH))  # the last byte of each number is below 128
            self._take_numbers(count)
            if count == len(data):
                found[name] += map(convert, data)
                return after
            values, place = found[name], 0
            while place < len(data):
                value, place = read_varint(data, place)
                values.append(convert(value))
            return after

        return {VARINT: store, BYTES: store_packed} if field.is_repeated else {VARINT: store}


_NATIVE: Final = {"I": "I", "i": "i"} if array("I").itemsize == 4 else {"I": "L", "i": "l"}


def _noting(store: Store, oneof: int, name: str) -> Store:
    """Return a function that also notes `name` as the last field of a ``oneof``, by its number."""

    def stored(found: dict[Any, Any], at: int, end: int, depth: int) -> int:
        found[oneof] = name
        return store(found, at, end, depth)

    return stored


def _is_map(field: ProtoField, types: ProtoTypes) -> bool:
    """Return whether a field is a map, which is a list of entries in the binary form."""
    is_list = field.kind == "message" and field.is_repeated
    return is_list and types.message(field.type).is_map_entry


def _absent(field: ProtoField, types: ProtoTypes) -> Any:
    """Return the value of an absent field."""
    if field.default is not None:
        return _default(field, field.default, types)
    if field.has_presence:
        return None
    return {"string": "", "bytes": b"", "bool": False}.get(
        field.kind, 0.0 if field.kind in ("double", "float") else 0
    )


def _default(field: ProtoField, text: str, types: ProtoTypes) -> Any:
    """Return a declared default value of proto2."""
    try:
        if field.kind == "string":
            return text
        if field.kind == "bytes":
            return text.encode("latin-1").decode("unicode_escape").encode("latin-1")
        if field.kind == "bool":
            return text == "true"
        if field.kind == "enum":
            return types.enums.get(field.type, {}).get(text)
        value = float(text) if field.kind in ("double", "float") else int(text)
    except (ValueError, UnicodeError):
        raise BadDefinition(f"the field {field.name!r} has an invalid default value") from None
    return value if value - value == 0 else None
