"""Random messages and schemas by Google's own library, for the tests of our reader and writer."""

import base64
import importlib
import math
import random
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

__all__ = ["FOXGLOVE", "every_kind", "expected", "filled", "foxglove_type", "schema_of"]

FOXGLOVE = (
    *("CameraCalibration", "CompressedImage", "FrameTransforms", "Grid", "ImageAnnotations"),
    *("JointStates", "LaserScan", "LocationFix", "Log", "Odometry", "PackedElementField"),
    *("PointCloud", "PoseInFrame", "PosesInFrame", "RawImage", "SceneUpdate", "VoxelGrid"),
)
"""Types of the package foxglove-schemas-protobuf, which protoc has compiled."""
_NUMBERS = {
    "int32": (-(2**31), 2**31 - 1), "sint32": (-(2**31), 2**31 - 1),
    "sfixed32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1), "fixed32": (0, 2**32 - 1),
    "int64": (-(2**63), 2**63 - 1), "sint64": (-(2**63), 2**63 - 1),
    "sfixed64": (-(2**63), 2**63 - 1), "uint64": (0, 2**64 - 1), "fixed64": (0, 2**64 - 1),
}  # fmt: skip
_KINDS = {
    number: name.removeprefix("TYPE_").lower()
    for name, number in descriptor_pb2.FieldDescriptorProto.Type.items()
}


def foxglove_type(name: str) -> Any:
    """Return a message class of foxglove-schemas-protobuf."""
    return getattr(importlib.import_module(f"foxglove_schemas_protobuf.{name}_pb2"), name)


def schema_of(descriptor: Any) -> str:
    """Return a type with all its imports as a FileDescriptorSet in base64."""
    found, seen = descriptor_pb2.FileDescriptorSet(), set()

    def add(file: Any) -> None:
        if file.name not in seen:
            seen.add(file.name)
            for one in file.dependencies:
                add(one)
            file.CopyToProto(found.file.add())

    add(descriptor.file)
    return base64.b64encode(found.SerializeToString()).decode()


def every_kind(syntax: str) -> Any:
    """Return a message class with a field of every kind: alone, repeated, optional and in a map."""
    file = descriptor_pb2.FileDescriptorProto(name=f"{syntax}.proto", package="pkg.sub")
    file.syntax = syntax
    outer = file.message_type.add(name="Outer")
    inner = outer.nested_type.add(name="Inner")
    inner.field.add(name="x", number=1, type=1, label=1)
    inner.field.add(name="deeper", number=2, type=11, label=1, type_name=".pkg.sub.Outer")
    mode = outer.enum_type.add(name="Mode")
    for name, number in (("OFF", 0), ("ON", 1), ("BROKEN", -1)):
        mode.value.add(name=name, number=number)
    types = {11: ".pkg.sub.Outer.Inner", 14: ".pkg.sub.Outer.Mode"}
    outer.oneof_decl.add(name="choice")
    for place, kind in enumerate(_KINDS):
        if kind == 10:
            continue
        name, more = _KINDS[kind], {"type": kind, "type_name": types.get(kind)}
        outer.field.add(name=f"one_{name}", number=100 + place, label=1, **more)
        outer.field.add(name=f"each_{name}", number=200 + place, label=3, **more)
        if kind not in (11, 12):
            outer.field[-1].options.packed = place % 2 == 0 and kind != 9
        outer.field.add(name=f"any_{name}", number=300 + place, label=1, oneof_index=0, **more)
    entry = outer.nested_type.add(name="CountsEntry")
    entry.options.map_entry = True
    entry.field.add(name="key", number=1, type=9, label=1)
    entry.field.add(name="value", number=2, type=11, label=1, type_name=types[11])
    entry_name = ".pkg.sub.Outer.CountsEntry"
    outer.field.add(name="counts", number=9, type=11, label=3, type_name=entry_name)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("pkg.sub.Outer"))


def filled(kind: Any, chance: random.Random, depth: int = 0, *, is_finite: bool = False) -> Any:
    """Return a message in which each field has a random value with a probability of two thirds."""
    made = kind()
    for field in made.DESCRIPTOR.fields:
        if chance.random() < 1 / 3 or (field.message_type and depth > 3):
            continue
        is_map = field.message_type and field.message_type.GetOptions().map_entry
        if is_map:
            for number in range(chance.randrange(3)):
                _into(getattr(made, field.name)[f"key {number}"], chance, depth + 1, is_finite)
        elif field.is_repeated:
            target = getattr(made, field.name)
            for _ in range(chance.randrange(4)):
                if field.message_type:
                    _into(target.add(), chance, depth + 1, is_finite)
                else:
                    target.append(_value(field, chance, is_finite))
        elif field.message_type:
            _into(getattr(made, field.name), chance, depth + 1, is_finite)
        else:
            setattr(made, field.name, _value(field, chance, is_finite))
    return made


def _into(message: Any, chance: random.Random, depth: int, is_finite: bool) -> None:
    message.CopyFrom(filled(type(message), chance, depth, is_finite=is_finite))
    message.SetInParent()


def _value(field: Any, chance: random.Random, is_finite: bool) -> Any:
    kind = _KINDS[field.type]
    if kind in _NUMBERS:
        low, high = _NUMBERS[kind]
        return chance.choice((low, high, 0, chance.randint(low, high), chance.randrange(200)))
    if kind == "enum":
        return chance.choice([one.number for one in field.enum_type.values])
    if kind == "bool":
        return chance.random() < 0.5
    if kind == "string":
        return "".join(chance.choices("abc µ☃", k=chance.randrange(6)))
    if kind == "bytes":
        return chance.randbytes(chance.randrange(6))
    odd = () if is_finite else (math.nan, math.inf, -math.inf)
    return chance.choice((0.0, 1.5, chance.uniform(-1e6, 1e6), *odd))


def expected(message: Any) -> dict[str, Any]:
    """Return a message of Google's library in the shape in which a driver reads it."""
    kind, found = message.DESCRIPTOR, {}
    is_time = kind.full_name in ("google.protobuf.Timestamp", "google.protobuf.Duration")
    for field in kind.fields:
        name = {"seconds": "sec", "nanos": "nanosec"}[field.name] if is_time else field.name
        value = getattr(message, field.name)
        if field.message_type and field.message_type.GetOptions().map_entry:
            found[name] = {str(key): expected(inner) for key, inner in value.items()}
        elif field.is_repeated:
            found[name] = [expected(one) if field.message_type else _plain(one) for one in value]
        elif field.has_presence and not message.HasField(field.name):
            found[name] = None
        else:
            found[name] = expected(value) if field.message_type else _plain(value)
    return found


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
