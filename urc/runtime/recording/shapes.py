"""The contents of a recording: its topics, and events as JSON messages.

Layer 4, pure. A recording is an MCAP file (https://mcap.dev/spec) of JSON messages. The file
includes the JSON Schemas of its messages, so any MCAP program can display the messages. Images and
the log use standard message types, ``foxglove.CompressedImage`` and ``foxglove.Log``: see
https://docs.foxglove.dev/docs/visualization/message-schemas/introduction.
"""

import base64
import json
import math
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple, get_args

import msgspec

from urc.images import media_type
from urc.model.driver import Driver
from urc.model.values import Alarm, Reading, Sample, Signal
from urc.runtime.audit_entry import AuditEntry
from urc.runtime.hub import (
    AuditRecord,
    LinkState,
    LinkStatus,
    LogEntry,
    MotionRecord,
    Tapped,
    Traffic,
)

__all__ = [
    "COMMANDS",
    "DRIVING",
    "LEVELS",
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
"""Start of the names of attachments that contain the files of widgets."""
LOG: Final = "/log"
DRIVING: Final = "/driving"
SIGNALS, LINK, WIRE, COMMANDS = "/signals/", "/link/", "/wire/", "/commands/"
_SECOND_NS: Final = 1_000_000_000
_LAST_S: Final = 1e9
_LAST_NS: Final = 2**63 - 1
"""Latest time that every MCAP program can read, in nanoseconds since 1970."""
LEVELS: Final = {"info": 2, "warning": 3, "error": 4}
_TEXT: Final = {"type": "string"}
_WHOLE: Final = {"type": "integer"}
_TIME: Final = {
    "type": "object",
    "title": "time",
    "properties": {
        "sec": {"type": "integer", "minimum": 0},
        "nsec": {"type": "integer", "minimum": 0, "maximum": _SECOND_NS - 1},
    },
}
_IMAGE: Final = {
    "timestamp": _TIME,
    "frame_id": _TEXT,
    "data": {"type": "string", "contentEncoding": "base64"},
    "format": _TEXT,
}
_LOG: Final = {
    "timestamp": _TIME,
    "level": _WHOLE,
    "message": _TEXT,
    "name": _TEXT,
    "file": _TEXT,
    "line": _WHOLE,
}
_LINK_STATE: Final = {
    "state": {"enum": list(get_args(LinkState))},
    "address": _TEXT,
    "detail": _TEXT,
    "attempts": _WHOLE,
    "faults": _WHOLE,
}
_BYTES: Final = {
    "direction": {"enum": ["sent", "received"]},
    "text": {"type": "string", "description": "data as text, if it is valid UTF-8"},
    "hex": {"type": "string", "description": "data in hex, if it is not valid UTF-8"},
}
_ENTRY: Final = {
    name: {"type": {str: "string", int: "integer", float: "number"}[kind]}
    for name, kind in AuditEntry.__annotations__.items()
}

_encode: Final = msgspec.json.Encoder(enc_hook=lambda value: _plain(value)).encode


class McapChannel(NamedTuple):
    """One topic of a recording, and its message type."""

    topic: str
    shape: str
    """Name of the topic's JSON Schema."""
    schema: Mapping[str, object]


def channels(driver: Driver) -> tuple[McapChannel, ...]:
    """Return the topics of a robot's recordings: signals, motion, traffic, log and audit."""
    found = [_signal_channel(signal) for signal in driver.signals.values()]
    for command in driver.commands.values():
        if command.hold is not None:
            types = {name: {"type": one.type} for name, one in command.arguments.items()}
            found.append(_channel(COMMANDS + command.name, f"urc.Command.{command.name}", types))
    for name in driver.transports:
        found.append(_channel(LINK + name, "urc.Link", _LINK_STATE))
        found.append(_channel(WIRE + name, "urc.Wire", _BYTES))
    found.append(_channel(LOG, "foxglove.Log", _LOG))
    found.append(_channel(DRIVING, "urc.Driving", _ENTRY))
    return tuple(found)


def _channel(topic: str, shape: str, properties: Mapping[str, object]) -> McapChannel:
    return McapChannel(topic, shape, {"title": shape, "type": "object", "properties": properties})


def _signal_channel(signal: Signal) -> McapChannel:
    topic = SIGNALS + signal.name
    if signal.type == "image":
        return _channel(topic, "foxglove.CompressedImage", _IMAGE)
    about = " ".join(filter(None, (signal.title or signal.description, signal.unit)))
    value: dict[str, object] = {"description": about} if about else {}
    if signal.type == "blob":
        value |= {"type": "string", "contentEncoding": "base64"}
    elif signal.type == "array":
        value |= {"type": "array", "items": {"type": signal.items}}
    else:
        value |= {"type": signal.type}
    alarm = {"enum": list(get_args(Alarm))}
    return _channel(topic, f"urc.Signal.{signal.name}", {"value": value, "alarm": alarm})


class RecordingEncoder:
    """A stateful encoder for one recording; the encoded times never decrease."""

    def __init__(self, driver: Driver, utc_ns: Callable[[float], int]) -> None:
        """Start a recording.

        Args:
            driver: driver of the robot.
            utc_ns: function that converts monotonic seconds to nanoseconds since 1970.
        """
        self._signals = driver.signals
        self._commands = driver.commands
        self._utc_ns = utc_ns
        self._told_ns = 0

    def messages(self, event: Tapped) -> list[tuple[str, int, bytes]]:
        """Return the topic, the time and the JSON text of each message for an event."""
        match event:
            case Sample():
                return [self._sample(event)]
            case Traffic():
                return [self._traffic(event)]
            case MotionRecord():
                return [self._moved(event.command, event.arguments, self._now(event.time_s))]
            case LinkStatus():
                return [self._line(event)]
            case LogEntry():
                time_ns = self._now(event.time_s)
                return [(LOG, time_ns, _json(_log(event, time_ns)))]
            case AuditRecord():
                entry, time_ns = event.entry, self._now(event.time_s)
                told = entry._asdict()
                return [(DRIVING, time_ns, _json(told)), *self._ended(entry, time_ns)]

    def _sample(self, sample: Sample) -> tuple[str, int, bytes]:
        time_ns, value = self._now(sample.time_s), sample.value
        signal = self._signals[sample.signal]
        if signal.type == "image" and isinstance(value, bytes):
            told: dict[str, object] = {
                "timestamp": _stamp(time_ns),
                "frame_id": sample.signal,
                "data": value,
                "format": _format(value),
            }
        else:
            told = {"value": value}
            if sample.alarm:
                told["alarm"] = sample.alarm
        return SIGNALS + sample.signal, time_ns, _json(told)

    def _line(self, status: LinkStatus) -> tuple[str, int, bytes]:
        told = {
            "state": status.state,
            "address": status.address,
            "detail": status.detail,
            "attempts": status.attempts,
            "faults": status.faults,
        }
        return LINK + status.transport, self._now(status.since_s), _json(told)

    def _moved(
        self, command: str, arguments: Mapping[str, Reading], time_ns: int
    ) -> tuple[str, int, bytes]:
        return COMMANDS + command, time_ns, _json(arguments)

    def _ended(self, entry: AuditEntry, time_ns: int) -> list[tuple[str, int, bytes]]:
        """Return the message that ends a motion, which would otherwise seem to continue."""
        command = self._commands.get(entry.command)
        if entry.what != "stopped" or command is None or command.hold is None:
            return []
        return [self._moved(command.name, command.hold.release, time_ns)]

    def _traffic(self, traffic: Traffic) -> tuple[str, int, bytes]:
        told = _wire(traffic.direction, traffic.data)
        return WIRE + traffic.transport, self._now(traffic.time_s), _json(told)

    def _now(self, time_s: float) -> int:
        """Return the later of `time_s` and the last returned time, so that times never decrease.

        A reading's time is the arrival time of its first byte; traffic's time is its own arrival
        time.
        """
        time_ns = self._utc_ns(min(max(time_s, 0.0), _LAST_S)) if time_s == time_s else 0
        self._told_ns = min(max(self._told_ns, time_ns), _LAST_NS)
        return self._told_ns


def _wire(direction: str, data: bytes) -> dict[str, object]:
    try:
        return {"direction": direction, "text": data.decode()}
    except UnicodeDecodeError:
        return {"direction": direction, "hex": data.hex()}


def _log(note: LogEntry, time_ns: int) -> dict[str, object]:
    return {
        "timestamp": _stamp(time_ns),
        "level": LEVELS[note.level],
        "message": note.text,
        "name": note.source,
        "file": "",
        "line": 0,
    }


def _stamp(time_ns: int) -> dict[str, int]:
    return {"sec": time_ns // _SECOND_NS, "nsec": time_ns % _SECOND_NS}


def _format(data: bytes) -> str:
    kind, _, name = media_type(data).partition("/")
    return name if kind == "image" else ""


def _json(told: Mapping[str, object]) -> bytes:
    try:
        return _encode(told)
    except (UnicodeEncodeError, OverflowError):
        # The cause is a lone surrogate in a robot's text, or an integer of more than 64 bits.
        return json.dumps(_mended(told), allow_nan=False).encode()


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
