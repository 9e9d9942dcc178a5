"""The form in which messages leave through the Foxglove protocol: binary, or JSON.

The codec has added the binary form if it knows the type. If the server does not accept this form,
the message is sent as JSON. No I/O.
"""

import time
from typing import NamedTuple

from urc.model.payload import Envelope
from urc.transports.base import TransportError
from urc.transports.ros.foxglove_frames import BadOperation, encode_operation
from urc.transports.ros.robot_time import RobotTime

__all__ = ["PublishedType", "message_data", "message_json"]


class PublishedType(NamedTuple):
    """The type of a topic that URC publishes."""

    name: str
    schema: str = ""
    """Schema of Protocol Buffers; "" for types of ROS."""


def message_data(
    envelope: Envelope, encodings: tuple[str, ...], robot: RobotTime
) -> tuple[str, bytes, str]:
    """Return the encoding, the bytes and the schema of a message, with the robot's time.

    Args:
        envelope: the message.
        encodings: encodings that the server accepts; () if unknown.
        robot: the robot's time, for fields with the value ``now``.

    Raises:
        TransportError: the server accepts no form of the message.
    """
    said = envelope.attributes
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
