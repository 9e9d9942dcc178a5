"""Messages of Foxglove's own schemas, in the shapes of the corresponding ROS messages.

Pure. Servers of the Foxglove SDK send these schemas; readers of ROS messages then need no second
shape. Source: Foxglove schemas, “PointCloud”, “FrameTransform” and “FrameTransforms”.
"""

from collections.abc import Mapping
from typing import Any, Final

from urc.protocol.values.convert import BadValue
from urc.protocol.values.transforms import IDENTITY, Transform

__all__ = ["cloud_of", "origin_of", "transforms_of"]

_DATATYPES: Final = {1: 2, 2: 1, 3: 4, 4: 3, 5: 6, 6: 5, 7: 7, 8: 8}
"""Datatype of a sensor_msgs/PointField, keyed by the type of a foxglove.PackedElementField."""
_NORM_TOLERANCE: Final = 0.01


def cloud_of(raw: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a foxglove.PointCloud as a sensor_msgs/PointCloud2; other messages stay unchanged.

    Raises:
        BadValue: the size of the points does not fit the data.
    """
    if "point_stride" not in raw:
        return raw
    step, data = raw["point_stride"], raw.get("data")
    if not isinstance(step, int) or step < 1 or not isinstance(data, bytes):
        raise BadValue(f"a point cloud with points of {step!r} bytes")
    fields = raw.get("fields")
    return {
        "header": {"frame_id": raw.get("frame_id")},
        "width": len(data) // step,
        "height": 1,
        "point_step": step,
        "row_step": len(data),
        "fields": [_field(one) for one in fields] if isinstance(fields, list) else fields,
        "data": data,
    }


def _field(one: Any) -> Any:
    if not isinstance(one, Mapping):
        return one
    kind = one.get("type")
    return {**one, "datatype": _DATATYPES.get(kind, 0) if isinstance(kind, int) else kind}


def origin_of(raw: Mapping[str, Any]) -> Transform:
    """Return the place of a foxglove.PointCloud in its frame; raise `BadValue` if it is invalid.

    An absent position or orientation is zero, as in the schema.
    """
    pose = raw.get("pose") if "point_stride" in raw else None
    if not isinstance(pose, Mapping):
        return IDENTITY
    place, turn = pose.get("position") or {}, pose.get("orientation") or {"w": 1.0}
    try:
        origin = Transform(
            *(float(place.get(name) or 0) for name in "xyz"),
            *(float(turn.get(name) or 0) for name in "xyzw"),
        )
    except (AttributeError, TypeError, ValueError):
        raise BadValue("a point cloud whose pose has no numbers") from None
    norm = sum(one * one for one in origin[3:])
    if norm == 0:  # a server that leaves the orientation at its default
        return origin._replace(qw=1.0)
    if abs(norm - 1) > _NORM_TOLERANCE:
        raise BadValue("a point cloud whose orientation is not a unit quaternion")
    return origin


def transforms_of(raw: Any) -> Any:
    """Return foxglove.FrameTransform or FrameTransforms as a tf2_msgs/TFMessage.

    Other messages stay unchanged.
    """
    if not isinstance(raw, Mapping):
        return raw
    found = raw.get("transforms")
    if found is None and "parent_frame_id" in raw:
        return {"transforms": [_transform(raw)]}
    if not isinstance(found, list) or not found or not isinstance(found[0], Mapping):
        return raw
    if "parent_frame_id" not in found[0]:
        return raw
    return {"transforms": [_transform(one) for one in found]}


def _transform(one: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "header": {"frame_id": one.get("parent_frame_id"), "stamp": one.get("timestamp")},
        "child_frame_id": one.get("child_frame_id"),
        "transform": {"translation": one.get("translation"), "rotation": one.get("rotation")},
    }
