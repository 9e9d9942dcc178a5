"""Definitions of ROS message types, and the layout of a message.

Pure. A robot sends the definition of each type as text (`urc.protocol.ros.msg_text`,
`urc.protocol.ros.idl_text`). `layout_of` expands a definition into a tree of layouts without type
names. Definitions are untrusted input, so their size and depth are limited.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from urc.problems import UrcError

__all__ = [
    "BYTE_CODES",
    "MAX_TEXT",
    "SIZES",
    "STANDARD",
    "TIME_TYPES",
    "Array",
    "BadDefinition",
    "Definition",
    "Definitions",
    "MessageField",
    "Layout",
    "Primitive",
    "Record",
    "Text",
    "full_name",
    "layout_of",
    "plain_name",
]

MAX_TEXT: Final = 262_144
"""Maximum length of the definition text of one type, in characters."""
MAX_TYPES: Final = 512
"""Maximum number of types in one definition text."""
MAX_LAYOUTS: Final = 8192
"""Maximum number of layouts for one message. Without this limit, nested types could make the number
of layouts grow exponentially."""
MAX_DEPTH: Final = 24
"""Maximum depth of nested types."""
MAX_FIXED: Final = 1_000_000
"""Maximum number of elements in an array of fixed length."""


class BadDefinition(UrcError):
    """An unreadable definition; the error message names the line or the type."""


class MessageField(NamedTuple):
    """One field of a type."""

    name: str
    type: str
    """Primitive type such as ``float64``, or the name of a type such as ``geometry_msgs/Point``."""
    length: int | None = None
    """Length of a fixed array; 0 for a sequence, None for a single value."""
    default: object = None
    """Default value; None means zero or empty."""
    bound: int | None = None
    """Maximum length of a sequence; None means unlimited."""


class Definition(NamedTuple):
    """A message type: its name, its fields in order, and its constants."""

    name: str
    """Name in the short form ``pkg/Type``."""
    fields: tuple[MessageField, ...]
    constants: Mapping[str, object]


Definitions = Mapping[str, Definition]
"""Definitions, keyed by short name ``pkg/Type``."""

CODES: Final[Mapping[str, str]] = {
    "bool": "?", "byte": "B", "char": "B", "octet": "B",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I",
    "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
"""Format code for the module `struct`, keyed by primitive type."""
SIZES: Final[Mapping[str, int]] = {
    "?": 1, "b": 1, "B": 1, "h": 2, "H": 2, "i": 4, "I": 4, "q": 8, "Q": 8, "f": 4, "d": 8,
}  # fmt: skip
"""Size in bytes, keyed by format code."""
BYTE_CODES: Final = "B"
"""Format code of numbers whose arrays are read as bytes, such as the pixels of an image."""
TIME_TYPES: Final = frozenset(("builtin_interfaces/Time", "time"))
"""Types of a point in time; a document may give the text ``now`` in place of a time."""


class Primitive(NamedTuple):
    """A number or a boolean, with its format code for the module `struct`."""

    code: str
    default: object = None


class Text(NamedTuple):
    """A string, in UTF-16 if `is_wide` is true."""

    is_wide: bool = False
    default: object = None


class Record(NamedTuple):
    """A nested message."""

    fields: tuple[tuple[str, "Layout"], ...]
    is_time: bool = False


class Array(NamedTuple):
    """A fixed array of `length` elements, or a sequence if `length` is 0."""

    element: "Layout"
    length: int
    default: object = None
    bound: int | None = None


Layout = Primitive | Text | Record | Array

STANDARD: Final = {
    "builtin_interfaces/Time": (MessageField("sec", "int32"), MessageField("nanosec", "uint32")),
    "builtin_interfaces/Duration": (
        MessageField("sec", "int32"),
        MessageField("nanosec", "uint32"),
    ),
    "time": (MessageField("secs", "uint32"), MessageField("nsecs", "uint32")),
    "duration": (MessageField("secs", "int32"), MessageField("nsecs", "int32")),
}
"""Types that definition text can use without defining them: the time types of ROS 2 and ROS 1."""
_PADDING: Final = (("structure_needs_at_least_one_member", Primitive("B")),)
"""The only field of an empty type in ROS 2, according to rosidl."""


def plain_name(name: str) -> str:
    """Return a type name in the short form ``pkg/Type``."""
    words = name.replace("::", "/").split("/")
    return f"{words[0]}/{words[-1]}" if len(words) > 1 else name


def layout_of(name: str, definitions: Definitions, *, is_ros1: bool = False) -> Record:
    """Return the layout of a type.

    Args:
        name: type name in any form.
        definitions: definitions of the type and of all nested types.
        is_ros1: whether to use the ROS 1 format, in which empty types take no space.

    Raises:
        BadDefinition: a type is missing, nested too deeply, or too large.
    """
    return _Expansion(definitions, is_ros1).record(plain_name(name), 0)


def full_name(name: str, owner: str, definitions: Definitions) -> str:
    """Return the short form of a field's type name, which may lack its package.

    Args:
        name: type name as written in the definition of `owner`.
        owner: short name of the type with the field.
        definitions: definitions of all types.
    """
    if "/" in name or "::" in name or name in STANDARD:
        return plain_name(name)
    for package in (owner.partition("/")[0], "std_msgs"):
        if f"{package}/{name}" in definitions:
            return f"{package}/{name}"
    found = [known for known in definitions if known.endswith(f"/{name}")]
    return found[0] if len(found) == 1 else name


class _Expansion:
    def __init__(self, definitions: Definitions, is_ros1: bool) -> None:
        self._definitions = definitions
        self._is_ros1 = is_ros1
        self._count = 0

    def record(self, name: str, depth: int) -> Record:
        if depth > MAX_DEPTH:
            raise BadDefinition(f"{name} is nested more than {MAX_DEPTH} levels deep")
        found = self._definitions.get(name)
        fields = found.fields if found is not None else STANDARD.get(name)
        if fields is None:
            raise BadDefinition(f"the type {name} has no definition")
        made = tuple((one.name, self._field(one, name, depth)) for one in fields)
        if not made and not self._is_ros1:
            made = _PADDING
        return Record(made, name in TIME_TYPES)

    def _field(self, field: MessageField, owner: str, depth: int) -> Layout:
        self._count += 1
        if self._count > MAX_LAYOUTS:
            raise BadDefinition(f"a message has more than {MAX_LAYOUTS} fields")
        is_single = field.length is None
        default = field.default if is_single else None
        element: Layout
        if field.type in CODES:
            is_signed = self._is_ros1 and field.type == "byte"
            element = Primitive("b" if is_signed else CODES[field.type], default)
        elif field.type in ("string", "wstring"):
            element = Text(field.type == "wstring", default)
        else:
            element = self.record(full_name(field.type, owner, self._definitions), depth + 1)
        if field.length is None:
            return element
        return Array(element, field.length, field.default, field.bound)
