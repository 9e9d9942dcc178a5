"""Frames of the Foxglove WebSocket protocol. Pure.

A text frame is a JSON object with the key ``op``. The first byte of a binary frame is its kind, and
all numbers are little-endian. The specification is foxglove/ws-protocol, version 1. The subprotocol
``foxglove.sdk.v1`` uses the same frames.
"""

import struct
from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from urc.transports.ros.rosbridge_operations import BadOperation, OperationReader, encode_operation

__all__ = [
    "SUBPROTOCOLS",
    "BadOperation",
    "AdvertisedChannel",
    "FrameReader",
    "MessageData",
    "ServiceReply",
    "ServiceType",
    "TimeTold",
    "call_frame",
    "channel_of",
    "encode_operation",
    "listed",
    "publish_frame",
    "service_of",
]

SUBPROTOCOLS: Final = ("foxglove.sdk.v1", "foxglove.websocket.v1")
MAX_SCHEMA: Final = 262_144
"""Maximum length of a definition, in characters; longer definitions are dropped."""
_MESSAGE, _TIME, _REPLY = 1, 2, 3
_MESSAGE_HEAD: Final = struct.Struct("<xIQ")
_TIME_HEAD: Final = struct.Struct("<xQ")
_REPLY_HEAD: Final = struct.Struct("<xIII")


class MessageData(NamedTuple):
    """A message on a subscribed channel."""

    subscription: int
    time_ns: int
    """Time at which the bridge received the message, according to the robot's clock."""
    data: bytes


class TimeTold(NamedTuple):
    """The robot's time, which may be simulation time."""

    time_ns: int


class ServiceReply(NamedTuple):
    """The reply to a service call."""

    call: int
    encoding: str
    data: bytes


class AdvertisedChannel(NamedTuple):
    """One of the robot's topics, with the definition of the topic's type."""

    id: int
    topic: str
    encoding: str
    type: str
    notation: str
    schema: str


class ServiceType(NamedTuple):
    """A service; `request` and `response` each contain type, encoding, notation and text."""

    id: int
    name: str
    type: str
    request: list[str]
    response: list[str]


class FrameReader:
    """Decodes the frames that a Foxglove server sends."""

    def __init__(self) -> None:
        self._operations = OperationReader()

    def read(self, frame: bytes) -> dict[str, Any] | MessageData | TimeTold | ServiceReply | None:
        """Return a frame's content; None for a frame of an unknown kind.

        Raises:
            BadOperation: the frame is invalid.
        """
        kind = frame[0]
        try:
            if kind == _MESSAGE:
                number, time_ns = _MESSAGE_HEAD.unpack_from(frame)
                return MessageData(number, time_ns, frame[_MESSAGE_HEAD.size :])
            if kind == _TIME:
                return TimeTold(*_TIME_HEAD.unpack_from(frame))
            if kind == _REPLY:
                _, call, length = _REPLY_HEAD.unpack_from(frame)
                start = _REPLY_HEAD.size + length
                if start > len(frame):
                    raise BadOperation("a reply ends too early")
                encoding = frame[_REPLY_HEAD.size : start].decode("ascii", "replace")
                return ServiceReply(call, encoding, frame[start:])
        except struct.error as problem:
            raise BadOperation(f"a frame of {len(frame)} bytes is too short") from problem
        return self._operations.read(frame) if kind == ord("{") else None


def channel_of(said: Mapping[str, Any]) -> AdvertisedChannel:
    """Return an announced channel; raise `BadOperation` for an invalid channel."""
    number, topic, encoding = _number(said), said.get("topic"), said.get("encoding")
    if number is None or not isinstance(topic, str) or not isinstance(encoding, str):
        raise BadOperation("a channel has no id, topic or encoding")
    schema = _text(said, "schema")
    if len(schema) > MAX_SCHEMA:
        raise BadOperation(f"the definition of a channel is too long ({len(schema)} characters)")
    notation = _text(said, "schemaEncoding") or {"cdr": "ros2msg", "ros1": "ros1msg"}.get(
        encoding, ""
    )
    return AdvertisedChannel(number, topic, encoding, _text(said, "schemaName"), notation, schema)


def service_of(said: Mapping[str, Any], encodings: tuple[str, ...]) -> ServiceType:
    """Return an announced service; raise `BadOperation` for an invalid service.

    Older servers send only ``requestSchema`` and ``responseSchema``, in the server's encoding.
    """
    number, name, kind = _number(said), said.get("name"), _text(said, "type")
    if number is None or not isinstance(name, str):
        raise BadOperation("a service has no id or name")
    parts = []
    usual = next((one for one in encodings if one in ("cdr", "ros1")), "cdr")
    for part in ("request", "response"):
        inner = said.get(part)
        if isinstance(inner, Mapping):
            encoding = _text(inner, "encoding") or usual
            schema, notation = _text(inner, "schema"), _text(inner, "schemaEncoding")
            type_name = _text(inner, "schemaName")
        else:
            encoding, schema, notation, type_name = usual, _text(said, f"{part}Schema"), "", ""
        if len(schema) > MAX_SCHEMA:
            raise BadOperation(
                f"the definition of a service is too long ({len(schema)} characters)"
            )
        notation = notation or ("ros1msg" if encoding == "ros1" else "ros2msg")
        parts.append([type_name or f"{kind}_{part.capitalize()}", encoding, notation, schema])
    return ServiceType(number, name, kind, *parts)


def publish_frame(channel: int, data: bytes) -> bytes:
    """Return the frame for a message on one of the client's channels."""
    return struct.pack("<BI", 1, channel) + data


def call_frame(service: int, call: int, encoding: str, data: bytes) -> bytes:
    """Return the frame for a service call."""
    name = encoding.encode()
    return struct.pack("<BIII", 2, service, call, len(name)) + name + data


def listed(said: Mapping[str, Any], name: str) -> list[Mapping[str, Any]]:
    """Return the objects in one list of an operation; [] without a list."""
    found = said.get(name)
    return [one for one in found if isinstance(one, Mapping)] if isinstance(found, list) else []


def _number(said: Mapping[str, Any]) -> int | None:
    value = said.get("id")
    is_number = isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**32
    return value if is_number else None


def _text(said: Mapping[str, Any], name: str) -> str:
    found = said.get(name)
    return found if isinstance(found, str) else ""
