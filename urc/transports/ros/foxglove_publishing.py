"""The form in which messages leave through the Foxglove protocol: binary, or JSON.

The codec has added the binary form if it knows the type. If the server does not accept this form,
the message is sent as JSON. No I/O.
"""

import time
from collections.abc import Iterable
from typing import NamedTuple

from urc.model.payload import Envelope
from urc.transports.base import TransportError
from urc.transports.ros.foxglove_frames import AdvertisedChannel, BadOperation, encode_operation
from urc.transports.ros.robot_time import RobotTime
from urc.transports.ros.types import spelled

__all__ = ["PublishedType", "message_data", "message_json"]


class PublishedType(NamedTuple):
    """The type of a topic that URC publishes."""

    name: str
    schema: str = ""
    """Schema of Protocol Buffers; "" for types of ROS."""


def _in_known_form(envelope: Envelope, channels: Iterable[AdvertisedChannel]) -> Envelope:
    """Return a message without its bytes if the robot has changed the definition of its type.

    Args:
        envelope: the message. Its attribute ``definition`` is the definition from an earlier
            connection, if the type is not yet defined on this one.
        channels: the robot's topics.
    """
    said = envelope.attributes
    text = said.get("definition")
    if text is None:
        return envelope
    name = spelled(str(said.get("type")), "msg", 2)
    schemas = (one.schema for one in channels if spelled(one.type, "msg", 2) == name)
    if not any(schema and schema != text for schema in schemas):
        return envelope
    rest = {name: one for name, one in said.items() if name not in ("data", "encoding")}
    return envelope._replace(attributes=rest)


def message_data(
    envelope: Envelope,
    encodings: tuple[str, ...],
    robot: RobotTime,
    channels: Iterable[AdvertisedChannel] = (),
) -> tuple[str, bytes, str]:
    """Return the encoding, the bytes and the schema of a message, with the robot's time.

    Args:
        envelope: the message.
        encodings: encodings that the server accepts; () if unknown.
        robot: the robot's time, for fields with the value ``now``.
        channels: the robot's topics.

    Raises:
        TransportError: the server accepts no form of the message.
    """
    said = _in_known_form(envelope, channels).attributes
    encoding, data = str(said.get("encoding") or ""), said.get("data")
    if not isinstance(data, bytes) or (encodings and encoding not in encodings):
        if encodings and "json" not in encodings:
            known, kind = ", ".join(encodings), str(said.get("type") or "")
            topic = str(said.get("topic") or "")
            raise TransportError(
                f"the type {kind} of {topic} is unknown; the bridge accepts {known}"
            )
        return "json", message_json(envelope.body, robot), ""
    is_protobuf = encoding == "protobuf"
    stamps = said.get("stamps")
    if isinstance(stamps, list) and stamps:
        data = robot.stamped(data, stamps, time.time_ns(), is_protobuf=is_protobuf)
    return encoding, data, str(said.get("schema") or "") if is_protobuf else ""


def message_json(body: object, robot: RobotTime) -> bytes:
    """Return a message as JSON text, with the robot's time in place of ``now``."""
    try:
        return encode_operation(robot.timed({} if body is None else body, time.time_ns()))
    except BadOperation as problem:
        raise TransportError(str(problem)) from problem
