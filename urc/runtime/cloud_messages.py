"""Point clouds as Foxglove's standard message, and back.

Layer 4. Pure. Source: foxglove.PointCloud and foxglove.PackedElementField, in
`urc.runtime.foxglove_schemas`.
"""

import base64
from collections.abc import Mapping
from typing import Any, Final

from urc.protocol.values.point_cloud import COLOURS, Cloud, encode_cloud, read_cloud

__all__ = ["cloud_fields", "cloud_file"]

_UINT8, _FLOAT32 = 1, 7
"""Values of foxglove.NumericType."""
_PLACE: Final = tuple(
    {"name": name, "offset": 4 * at, "type": _FLOAT32} for at, name in enumerate(("x", "y", "z"))
)
_COLOUR: Final = tuple(
    {"name": name, "offset": 12 + at, "type": _UINT8}
    for at, name in enumerate(("blue", "green", "red"))
)
"""Parts of a colour 0x00RRGGBB in little-endian order."""
_UPRIGHT: Final = {
    "position": {"x": 0.0, "y": 0.0, "z": 0.0},
    "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
}


def cloud_fields(data: bytes) -> dict[str, object]:
    """Return the fields of foxglove.PointCloud, except for the time; `data` is a PCD file of URC.

    Raises:
        BadValue: `data` is another file.
    """
    cloud = read_cloud(data)
    fields = [*_PLACE]
    if cloud.colour in COLOURS:
        fields += _COLOUR
    elif cloud.colour:
        fields.append({"name": cloud.colour, "offset": 12, "type": _FLOAT32})
    return {
        "frame_id": cloud.frame,
        "pose": _UPRIGHT,
        "point_stride": cloud.stride,
        "fields": fields,
        "data": cloud.points,
    }


def cloud_file(told: Mapping[str, Any]) -> bytes:
    """Return the PCD file of a message that `cloud_fields` has made; raise any error for others."""
    names = [str(one["name"]) for one in told["fields"][3:]]
    colour = "" if not names else COLOURS[0] if len(names) > 1 else names[0]
    points = base64.b64decode(str(told["data"]), validate=True)
    stride = int(told["point_stride"])
    if len(points) % stride or stride != (16 if colour else 12):
        raise ValueError("the points do not match their stride")
    return encode_cloud(Cloud(str(told["frame_id"]), colour, len(points) // stride, points))
