"""Readings, log entries and connection states as JSON messages with JSON Schemas.

Layer 4. Pure. Recordings and the Foxglove server share this mapping, so a viewer shows both in the
same way. Images, videos, point clouds and the log use Foxglove's standard messages.

Viewers read the fields of a message from its schema. Each property in a schema therefore has a
``type``, or the alternatives of an enumeration. A property without a type makes some viewers reject
the whole topic.
"""

import base64
import json
import math
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, Final, NamedTuple, get_args

import msgspec

from urc.images import media_type
from urc.model.driver import Argument
from urc.model.values import BINARY_TYPES, PICTURE_TYPES, Alarm, Sample, Signal
from urc.protocol.values.convert import BadValue
from urc.runtime.cloud_messages import cloud_fields
from urc.runtime.foxglove_schemas import COMPRESSED_IMAGE, COMPRESSED_VIDEO, POINT_CLOUD
from urc.runtime.foxglove_schemas import LOG as FOXGLOVE_LOG
from urc.runtime.hub import LinkState, LinkStatus, LogEntry
from urc.video import VideoUnit, arrival_s, read_unit

__all__ = [
    "LEVELS",
    "LINK_SCHEMA",
    "LOG_SCHEMA",
    "MessageSchema",
    "argument_property",
    "as_json",
    "link_message",
    "log_message",
    "object_schema",
    "sample_message",
    "signal_property",
    "signal_schema",
    "stamp",
]

LEVELS: Final = {"info": 2, "warning": 3, "error": 4}
"""Levels of ``foxglove.Log``."""
_SECOND_NS: Final = 1_000_000_000
_HEVC: Final = ("hev1", "hvc1")
"""Beginnings of the codec strings of H.265."""
_TEXT: Final = {"type": "string"}
_WHOLE: Final = {"type": "integer"}

_encode: Final = msgspec.json.Encoder(enc_hook=lambda value: _plain(value)).encode


class MessageSchema(NamedTuple):
    """The type of a JSON message: its name and JSON Schema."""

    name: str
    schema: Mapping[str, object]
    """JSON Schema of the message."""


def object_schema(name: str, properties: Mapping[str, object]) -> MessageSchema:
    """Return the type of an object with optional properties."""
    return MessageSchema(name, {"title": name, "type": "object", "properties": properties})


LINK_SCHEMA: Final = object_schema(
    "urc.Link",
    {
        "state": {**_TEXT, "enum": list(get_args(LinkState))},
        "address": _TEXT,
        "detail": _TEXT,
        "attempts": _WHOLE,
        "faults": _WHOLE,
        "ready": {"type": "boolean"},
    },
)
LOG_SCHEMA: Final = MessageSchema("foxglove.Log", FOXGLOVE_LOG)
_IMAGE_SCHEMA: Final = MessageSchema("foxglove.CompressedImage", COMPRESSED_IMAGE)
_VIDEO_SCHEMA: Final = MessageSchema("foxglove.CompressedVideo", COMPRESSED_VIDEO)
_CLOUD_SCHEMA: Final = MessageSchema("foxglove.PointCloud", POINT_CLOUD)


def signal_schema(signal: Signal) -> MessageSchema:
    """Return the type of a signal's readings."""
    if signal.type in PICTURE_TYPES:
        return _IMAGE_SCHEMA
    if signal.type == "video":
        return _VIDEO_SCHEMA
    if signal.type == "point_cloud":
        return _CLOUD_SCHEMA
    about = " ".join(filter(None, (signal.title or signal.description, signal.unit)))
    value = signal_property(signal)
    if about:
        value = {"description": about, **value}
    alarm = {**_TEXT, "enum": list(get_args(Alarm))}
    return object_schema(f"urc.Signal.{signal.name}", {"value": value, "alarm": alarm})


def signal_property(signal: Signal) -> dict[str, object]:
    """Return the schema of a signal's value as a property."""
    if signal.type in BINARY_TYPES:
        return {"type": "string", "contentEncoding": "base64"}
    if signal.type == "array":
        return {"type": "array", "items": {"type": signal.items}}
    return {"type": "object" if signal.type == "transform_tree" else signal.type}


def argument_property(argument: Argument) -> dict[str, object]:
    """Return the JSON Schema of a command's argument, without its minimum and maximum."""
    if argument.type == "array":
        return {"type": "array", "items": {"type": argument.items}}
    return {"type": argument.type}


def sample_message(signal: Signal, sample: Sample, time_ns: int, prefix: str = "") -> bytes:
    """Return a reading as JSON text.

    Args:
        signal: the signal.
        sample: a reading of the signal.
        time_ns: time of the reading, in nanoseconds since 1970.
        prefix: text before the name of a point cloud's coordinate frame.
    """
    value = sample.value
    if signal.type in PICTURE_TYPES and isinstance(value, bytes):
        return as_json(
            {
                "timestamp": stamp(time_ns),
                "frame_id": sample.signal,
                "data": value,
                "format": _format(value),
            }
        )
    if signal.type == "video" and isinstance(value, bytes):
        unit = read_unit(value)
        if unit is not None:
            return _video_message(unit, sample, time_ns)
    if signal.type == "point_cloud" and isinstance(value, bytes):
        with suppress(BadValue):  # the file comes from another program
            fields = cloud_fields(value)
            fields["frame_id"] = f"{prefix}{fields['frame_id']}"
            return as_json({"timestamp": stamp(time_ns), **fields})
    told: dict[str, object] = {"value": value}
    if sample.alarm:
        told["alarm"] = sample.alarm
    return as_json(told)


def _video_message(unit: VideoUnit, sample: Sample, time_ns: int) -> bytes:
    """Return an access unit as JSON text, with its time of arrival."""
    late_s = sample.time_s - arrival_s(unit, sample.time_s)
    return as_json(
        {
            "timestamp": stamp(max(0, time_ns - round(late_s * _SECOND_NS))),
            "frame_id": sample.signal,
            "data": unit.data,
            "format": "h265" if unit.codec.startswith(_HEVC) else "h264",
        }
    )


def link_message(status: LinkStatus) -> bytes:
    """Return the state of a connection as JSON text."""
    return as_json(
        {
            "state": status.state,
            "address": status.address,
            "detail": status.detail,
            "attempts": status.attempts,
            "faults": status.faults,
            "ready": status.is_ready,
        }
    )


def log_message(note: LogEntry, time_ns: int) -> bytes:
    """Return a log entry as JSON text; `time_ns` is in nanoseconds since 1970."""
    return as_json(
        {
            "timestamp": stamp(time_ns),
            "level": LEVELS[note.level],
            "message": note.text,
            "name": note.source,
            "file": "",
            "line": 0,
        }
    )


def stamp(time_ns: int) -> dict[str, int]:
    """Return a time in the form of Foxglove's messages; `time_ns` is in nanoseconds since 1970."""
    return {"sec": time_ns // _SECOND_NS, "nsec": time_ns % _SECOND_NS}


def as_json(told: Mapping[str, object]) -> bytes:
    """Return JSON text; values that JSON cannot represent are replaced."""
    try:
        return _encode(told)
    except (UnicodeEncodeError, OverflowError):
        # The cause is a lone surrogate in a robot's text, or an integer of more than 64 bits.
        return json.dumps(_mended(told), allow_nan=False).encode()


def _format(data: bytes) -> str:
    kind, _, name = media_type(data).partition("/")
    return name if kind == "image" else ""


def _mended(value: Any) -> Any:
    """Return `value`, with all parts that JSON cannot represent replaced."""
    if isinstance(value, str):
        return value.encode("utf-8", "replace").decode()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, tuple | list):
        return [_mended(one) for one in value]
    if isinstance(value, Mapping):
        return {_mended(str(name)): _mended(one) for name, one in value.items()}
    return value if value is None or isinstance(value, bool | int) else _plain(value)


def _plain(value: object) -> object:
    if isinstance(value, bytes):
        return base64.b64encode(value).decode("ascii")
    if isinstance(value, Mapping):
        return dict(value)
    raise NotImplementedError(f"{type(value).__name__} cannot be converted to JSON")
