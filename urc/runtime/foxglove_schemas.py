"""JSON Schemas of Foxglove's standard messages, which viewers recognise by name.

Layer 4. Pure. Source: github.com/foxglove/foxglove-sdk, schemas/jsonschema (MIT), on npm as
``@foxglove/schemas`` 2.1. The descriptions are omitted.
"""

from collections.abc import Mapping
from typing import Any, Final

__all__ = [
    "COMPRESSED_IMAGE",
    "COMPRESSED_VIDEO",
    "FRAME_TRANSFORMS",
    "LASER_SCAN",
    "LOCATION_FIX",
    "LOG",
    "POINT_CLOUD",
    "POSE_IN_FRAME",
]

_TEXT: Final = {"type": "string"}
_NUMBER: Final = {"type": "number"}
_SIZE: Final = {"type": "integer", "minimum": 0}
_NUMBERS: Final = {"type": "array", "items": _NUMBER}
_TIME: Final = {
    "type": "object",
    "title": "time",
    "properties": {
        "sec": {"type": "integer", "minimum": 0},
        "nsec": {"type": "integer", "minimum": 0, "maximum": 999_999_999},
    },
}


def _message(name: str, /, **properties: Mapping[str, Any]) -> dict[str, Any]:
    """Return the schema of a message whose properties are all required."""
    return {
        "title": f"foxglove.{name}",
        "type": "object",
        "properties": properties,
        "required": list(properties),
    }


def _words(name: str, *words: str) -> dict[str, Any]:
    """Return the schema of an enumeration that counts from zero."""
    alternatives = [{"title": word, "const": number} for number, word in enumerate(words)]
    return {"title": f"foxglove.{name}", "oneOf": alternatives}


_VECTOR: Final = _message("Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_ROTATION: Final = _message("Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE: Final = _message("Pose", position=_VECTOR, orientation=_ROTATION)

COMPRESSED_IMAGE: Final = _message(
    "CompressedImage",
    timestamp=_TIME,
    frame_id=_TEXT,
    data={"type": "string", "contentEncoding": "base64"},
    format=_TEXT,
)
COMPRESSED_VIDEO: Final = _message(
    "CompressedVideo",
    timestamp=_TIME,
    frame_id=_TEXT,
    data={"type": "string", "contentEncoding": "base64"},
    format=_TEXT,
)
FRAME_TRANSFORMS: Final = _message(
    "FrameTransforms",
    transforms={
        "type": "array",
        "items": _message(
            "FrameTransform",
            timestamp=_TIME,
            parent_frame_id=_TEXT,
            child_frame_id=_TEXT,
            translation=_VECTOR,
            rotation=_ROTATION,
        ),
    },
)
LOG: Final = _message(
    "Log",
    timestamp=_TIME,
    level=_words("LogLevel", "UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"),
    message=_TEXT,
    name=_TEXT,
    file=_TEXT,
    line=_SIZE,
)
LASER_SCAN: Final = _message(
    "LaserScan",
    timestamp=_TIME,
    frame_id=_TEXT,
    pose=_POSE,
    start_angle=_NUMBER,
    end_angle=_NUMBER,
    ranges=_NUMBERS,
    intensities=_NUMBERS,
)
POINT_CLOUD: Final = _message(
    "PointCloud",
    timestamp=_TIME,
    frame_id=_TEXT,
    pose=_POSE,
    point_stride=_SIZE,
    fields={
        "type": "array",
        "items": _message(
            "PackedElementField",
            name=_TEXT,
            offset=_SIZE,
            type=_words(
                "NumericType",
                *("UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32"),
                *("FLOAT32", "FLOAT64"),
            ),
        ),
    },
    data={"type": "string", "contentEncoding": "base64"},
)
POSE_IN_FRAME: Final = _message("PoseInFrame", timestamp=_TIME, frame_id=_TEXT, pose=_POSE)
_FIX: Final = _message(
    "LocationFix",
    timestamp=_TIME,
    frame_id=_TEXT,
    latitude=_NUMBER,
    longitude=_NUMBER,
    altitude=_NUMBER,
    position_covariance={**_NUMBERS, "minItems": 9, "maxItems": 9},
    position_covariance_type=_words(
        "PositionCovarianceType", "UNKNOWN", "APPROXIMATED", "DIAGONAL_KNOWN", "KNOWN"
    ),
)
LOCATION_FIX: Final[Mapping[str, Any]] = {
    **_FIX,
    "properties": {
        **_FIX["properties"],
        "heading": _NUMBER,
        "velocity": _VECTOR,
        "color": _message("Color", r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER),
        "metadata": {"type": "array", "items": _message("KeyValuePair", key=_TEXT, value=_TEXT)},
    },
}
