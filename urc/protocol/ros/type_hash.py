"""Hashes of ROS 2 types: version 1 of the ROS Interface Hashing Standard (RIHS01).

Pure. The hash is the SHA-256 of a type's description: the names and types of all fields, including
those of nested types. Default values, constants and comments do not count. Source: the package
rosidl_generator_type_description of ROS 2.
"""

import hashlib
import json
from typing import Any, Final

from urc.protocol.ros.definition import (
    STANDARD,
    BadDefinition,
    Definitions,
    MessageField,
    full_name,
    plain_name,
)

__all__ = ["message_name", "type_hash"]

_IDS: Final = {
    "int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8,
    "uint64": 9, "float32": 10, "float64": 11, "char": 3, "bool": 15, "byte": 16, "octet": 16,
    "string": 17, "wstring": 18,
}  # fmt: skip
"""Numbers of the primitive types, from type_description_interfaces/msg/FieldType."""
_NESTED: Final = 1
_ARRAY, _BOUNDED, _UNBOUNDED = 48, 96, 144
"""Numbers to add for fixed arrays, bounded sequences and unbounded sequences."""
_PADDING: Final = MessageField("structure_needs_at_least_one_member", "uint8")
MAX_NESTED: Final = 512
"""Maximum number of different nested types."""


def message_name(name: str) -> str:
    """Return a message type's name in the form ``pkg/msg/Type``."""
    package, _, base = plain_name(name).partition("/")
    return f"{package}/msg/{base}"


def type_hash(name: str, definitions: Definitions) -> str:
    """Return the hash of a message type, such as ``RIHS01_df66…``.

    Args:
        name: type name in any form.
        definitions: definitions of the type and of all nested types.

    Raises:
        BadDefinition: a type is missing, or too many types are nested.
    """
    described: dict[str, dict[str, Any]] = {}
    todo = [plain_name(name)]
    while todo:
        one = todo.pop()
        if one in described:
            continue
        if len(described) > MAX_NESTED:
            raise BadDefinition(f"{name} has more than {MAX_NESTED} nested types")
        described[one], nested = _described(one, definitions)
        todo += nested
    own = described.pop(plain_name(name))
    others = sorted(described.values(), key=lambda one: str(one["type_name"]))
    text = json.dumps(
        {"type_description": own, "referenced_type_descriptions": others}, separators=(", ", ": ")
    )
    return f"RIHS01_{hashlib.sha256(text.encode()).hexdigest()}"


def _described(name: str, definitions: Definitions) -> tuple[dict[str, Any], list[str]]:
    """Return the description of one type, and the names of its nested types."""
    found = definitions.get(name)
    fields = found.fields if found is not None else STANDARD.get(name)
    if fields is None:
        raise BadDefinition(f"the type {name} has no definition")
    nested: list[str] = []
    shown = []
    for field in fields or (_PADDING,):
        number, inner = _IDS.get(field.type, 0), ""
        if not number:
            number, inner = _NESTED, full_name(field.type, name, definitions)
            nested.append(inner)
        capacity = 0
        if field.length is not None:
            capacity = field.bound or field.length
            number += _BOUNDED if field.bound else _ARRAY if field.length else _UNBOUNDED
        kind = {
            "type_id": number,
            "capacity": capacity,
            "string_capacity": 0,
            "nested_type_name": message_name(inner) if inner else "",
        }
        shown.append({"name": field.name, "type": kind})
    return {"type_name": message_name(name), "fields": shown}, nested
