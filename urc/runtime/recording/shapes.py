"""The contents of a recording: its topics, and events as JSON messages.

Layer 4, pure. A recording is an MCAP file (https://mcap.dev/spec) of JSON messages. The file
includes the JSON Schemas of its messages, so any MCAP program can display the messages. Images,
videos and the log use standard message types, such as ``foxglove.CompressedVideo``: see
https://docs.foxglove.dev/docs/visualization/message-schemas/introduction.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from urc.model.driver import Driver
from urc.model.values import Reading, Sample
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.hub import (
    AuditRecord,
    LinkStatus,
    LogEntry,
    MotionRecord,
    Tapped,
    Traffic,
)
from urc.runtime.json_messages import (
    LINK_SCHEMA,
    LOG_SCHEMA,
    MessageSchema,
    argument_property,
    as_json,
    link_message,
    log_message,
    object_schema,
    sample_message,
    signal_schema,
)

__all__ = [
    "COMMANDS",
    "DRIVING",
    "FILES",
    "LINK",
    "LOG",
    "PROFILE",
    "SIGNALS",
    "WIRE",
    "McapChannel",
    "RecordingEncoder",
    "channels",
]

PROFILE: Final = "profile.yaml"
"""Name of the attachment that contains the robot's complete document."""
FILES: Final = "files/"
"""Prefix of the names of attachments that contain widget files."""
LOG: Final = "/log"
DRIVING: Final = "/driving"
SIGNALS, LINK, WIRE, COMMANDS = "/signals/", "/link/", "/wire/", "/commands/"
_LAST_S: Final = 1e9
_LAST_NS: Final = 2**63 - 1
"""Latest time that all MCAP programs can read, in nanoseconds since 1970."""
_BYTES: Final = {
    "direction": {"type": "string", "enum": ["sent", "received"]},
    "text": {"type": "string", "description": "data as text, if it is valid UTF-8"},
    "hex": {"type": "string", "description": "data in hex, if it is not valid UTF-8"},
}
_ENTRY: Final = {
    name: {"type": {str: "string", int: "integer", float: "number"}[kind]}
    for name, kind in AuditEntry.__annotations__.items()
}


class McapChannel(NamedTuple):
    """One topic of a recording, and its message type."""

    topic: str
    shape: str
    """Name of the topic's JSON Schema."""
    schema: Mapping[str, object]


def channels(driver: Driver) -> tuple[McapChannel, ...]:
    """Return the topics of a robot's recordings: signals, motion, traffic, log and audit."""
    found = [
        _channel(SIGNALS + signal.name, signal_schema(signal)) for signal in driver.signals.values()
    ]
    for command in driver.commands.values():
        if command.hold is not None:
            types = {name: argument_property(one) for name, one in command.arguments.items()}
            shape = object_schema(f"urc.Command.{command.name}", types)
            found.append(_channel(COMMANDS + command.name, shape))
    for name, spec in driver.transports.items():
        found.append(_channel(LINK + name, LINK_SCHEMA))
        if not spec.is_camera:
            found.append(_channel(WIRE + name, object_schema("urc.Wire", _BYTES)))
    found.append(_channel(LOG, LOG_SCHEMA))
    found.append(_channel(DRIVING, object_schema("urc.Driving", _ENTRY)))
    return tuple(found)


def _channel(topic: str, shape: MessageSchema) -> McapChannel:
    return McapChannel(topic, shape.name, shape.schema)


class RecordingEncoder:
    """The encoder of one recording's events; the times of its messages never decrease."""

    def __init__(self, driver: Driver, utc_ns: Callable[[float], int]) -> None:
        """Start a recording.

        Args:
            driver: driver of the robot.
            utc_ns: function that converts monotonic seconds to nanoseconds since 1970.
        """
        self._signals = driver.signals
        self._commands = driver.commands
        self._cameras = {name for name, one in driver.transports.items() if one.is_camera}
        self._utc_ns = utc_ns
        self._told_ns = 0

    def messages(self, event: Tapped) -> list[tuple[str, int, bytes]]:
        """Return the topic, the time and the JSON text of each message for an event."""
        match event:
            case Sample():
                return [self._sample(event)]
            case Traffic():
                return [] if event.transport in self._cameras else [self._traffic(event)]
            case MotionRecord():
                return [self._moved(event.command, event.arguments, self._now(event.time_s))]
            case LinkStatus():
                return [self._line(event)]
            case LogEntry():
                time_ns = self._now(event.time_s)
                return [(LOG, time_ns, log_message(event, time_ns))]
            case AuditRecord():
                entry, time_ns = event.entry, self._now(event.time_s)
                told = entry._asdict()
                return [(DRIVING, time_ns, as_json(told)), *self._ended(entry, time_ns)]

    def _sample(self, sample: Sample) -> tuple[str, int, bytes]:
        time_ns = self._now(sample.time_s)
        data = sample_message(self._signals[sample.signal], sample, time_ns)
        return SIGNALS + sample.signal, time_ns, data

    def _line(self, status: LinkStatus) -> tuple[str, int, bytes]:
        return LINK + status.transport, self._now(status.since_s), link_message(status)

    def _moved(
        self, command: str, arguments: Mapping[str, Reading], time_ns: int
    ) -> tuple[str, int, bytes]:
        return COMMANDS + command, time_ns, as_json(arguments)

    def _ended(self, entry: AuditEntry, time_ns: int) -> list[tuple[str, int, bytes]]:
        """Return the message that ends a motion; otherwise, the motion would seem to continue."""
        command = self._commands.get(entry.command)
        if entry.what != "stopped" or command is None or command.hold is None:
            return []
        return [self._moved(command.name, command.hold.release, time_ns)]

    def _traffic(self, traffic: Traffic) -> tuple[str, int, bytes]:
        told = _wire(traffic.direction, traffic.data)
        return WIRE + traffic.transport, self._now(traffic.time_s), as_json(told)

    def _now(self, time_s: float) -> int:
        """Return the later of `time_s` and the last returned time, so that times never decrease.

        The time of a reading is the arrival time of its first byte, which may be earlier than the
        time of the last encoded traffic.
        """
        time_ns = self._utc_ns(min(max(time_s, 0.0), _LAST_S)) if time_s == time_s else 0
        self._told_ns = min(max(self._told_ns, time_ns), _LAST_NS)
        return self._told_ns


def _wire(direction: str, data: bytes) -> dict[str, object]:
    try:
        return {"direction": direction, "text": data.decode()}
    except UnicodeDecodeError:
        return {"direction": direction, "hex": data.hex()}
