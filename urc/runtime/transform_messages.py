"""Transform trees as Foxglove's message ``FrameTransforms``.

Layer 4. Pure. Viewers place poses, scans and points by these transforms. A server may
show several robots, and each robot has a frame such as ``map``. The name of each frame therefore
begins with the name of the robot.
"""

from collections.abc import Iterator, Mapping
from typing import Any, Final

from urc.runtime.foxglove_schemas import FRAME_TRANSFORMS
from urc.runtime.json_messages import MessageSchema, as_json, stamp

__all__ = ["TRANSFORMS_SCHEMA", "transforms_message"]

TRANSFORMS_SCHEMA: Final = MessageSchema("foxglove.FrameTransforms", FRAME_TRANSFORMS)
_SECOND_NS: Final = 1_000_000_000


def transforms_message(value: object, time_ns: int, prefix: str) -> bytes | None:
    """Return the transforms of a tree as JSON text; None for a value without transforms.

    Args:
        value: value of a signal of type ``transform_tree``.
        time_ns: time of the value, in nanoseconds since 1970. The time of each transform is earlier
            by the age of the transform; a static transform has the time of the value.
        prefix: text before the name of each frame.
    """
    rows = value.get("frames") if isinstance(value, Mapping) else None
    found = list(_transforms(rows, time_ns, prefix)) if isinstance(rows, (list, tuple)) else []
    return as_json({"transforms": found}) if found else None


def _transforms(
    rows: list[Any] | tuple[Any, ...], time_ns: int, prefix: str
) -> Iterator[dict[str, object]]:
    for row in rows:
        if not isinstance(row, Mapping) or not row.get("parent"):
            continue  # a root has no transform
        move, turn = row.get("translation"), row.get("rotation")
        if not isinstance(move, (list, tuple)) or not isinstance(turn, (list, tuple)):
            continue
        age_ns = round((row.get("age") or 0.0) * _SECOND_NS)
        yield {
            "timestamp": stamp(max(0, time_ns - max(0, age_ns))),
            "parent_frame_id": f"{prefix}{row['parent']}",
            "child_frame_id": f"{prefix}{row['name']}",
            "translation": dict(zip("xyz", move, strict=False)),
            "rotation": dict(zip("xyzw", turn, strict=False)),
        }
