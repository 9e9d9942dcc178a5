"""What a recording holds: topics, and what happens as JSON messages, both ways.

Floor 4, pure. A recording is an MCAP file (https://mcap.dev/spec) of JSON messages whose shapes are
told by JSON Schemas in it, so that any program for such files shows it. Images and the log have the
shapes that those programs know by name (``foxglove.CompressedImage``, ``foxglove.Log``; see
https://docs.foxglove.dev/docs/visualization/message-schemas/introduction).
"""

import base64
import binascii
import json
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple, cast, get_args

import msgspec

from urc.model.driver import Driver
from urc.model.values import Alarm, Reading, Sample, Signal
from urc.runtime.audit import Entry
from urc.runtime.blanking import Blanker
from urc.runtime.hub import LinkState, LinkStatus, Moved, Note, Tapped, Traffic

__all__ = [
    "DRIVING",
    "LOG",
    "PROFILE",
    "Channel",
    "Shapes",
    "channels",
    "event_of",
    "is_state",
]

PROFILE: Final = "profile.yaml"
"""Attachment: the robot's document, with all that it is made of."""
LOG: Final = "/log"
DRIVING: Final = "/driving"
_SIGNALS, _LINK, _WIRE, _COMMANDS = "/signals/", "/link/", "/wire/", "/commands/"
_SECOND_NS: Final = 1_000_000_000
_LEVELS: Final = {"info": 2, "warning": 3, "error": 4}
_FORMATS: Final = (
    (b"\xff\xd8\xff", "jpeg"),
    (b"\x89PNG\r\n\x1a\n", "png"),
    (b"GIF8", "gif"),
    (b"BM", "bmp"),
)

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
    "text": {"type": "string", "description": "what is text in UTF-8"},
    "hex": {"type": "string", "description": "what is not"},
}
_ENTRY: Final = {
    name: {"type": {str: "string", int: "integer", float: "number"}[kind]}
    for name, kind in Entry.__annotations__.items()
}

_encode: Final = msgspec.json.Encoder(enc_hook=lambda value: _plain(value)).encode


class Channel(NamedTuple):
    """One topic of a recording, and the shape of its messages."""

    topic: str
    shape: str
    """Name of the schema."""
    schema: Mapping[str, object]


def channels(driver: Driver) -> tuple[Channel, ...]:
    """Return the topics of a robot's recordings: signals, motion, lines, log, and who drove."""
    found = [_signal_channel(signal) for signal in driver.signals.values()]
    for command in driver.commands.values():
        if command.hold is not None:
            types = {name: {"type": one.type} for name, one in command.arguments.items()}
            found.append(_channel(_COMMANDS + command.name, f"urc.Command.{command.name}", types))
    for name in driver.transports:
        found.append(_channel(_LINK + name, "urc.Link", _LINK_STATE))
        found.append(_channel(_WIRE + name, "urc.Wire", _BYTES))
    found.append(_channel(LOG, "foxglove.Log", _LOG))
    found.append(_channel(DRIVING, "urc.Driving", _ENTRY))
    return tuple(found)


def _channel(topic: str, shape: str, properties: Mapping[str, object]) -> Channel:
    return Channel(topic, shape, {"title": shape, "type": "object", "properties": properties})


def _signal_channel(signal: Signal) -> Channel:
    topic = _SIGNALS + signal.name
    if signal.type == "image":
        return _channel(topic, "foxglove.CompressedImage", _IMAGE)
    about = " ".join(filter(None, (signal.title or signal.description, signal.unit)))
    value: dict[str, object] = {"description": about} if about else {}
    if signal.type == "blob":
        value |= {"type": "string", "contentEncoding": "base64"}
    elif signal.type == "array":
        value |= {"type": "array", "items": {"type": signal.of}}
    else:
        value |= {"type": signal.type}
    alarm = {"enum": list(get_args(Alarm))}
    return _channel(topic, f"urc.Signal.{signal.name}", {"value": value, "alarm": alarm})


class Shapes:
    """Makes the messages of one recording: stateful, since a secret may come in pieces."""

    def __init__(self, driver: Driver, blanker: Blanker, utc_ns: Callable[[float], int]) -> None:
        """Begin.

        Args:
            driver: of the robot.
            blanker: takes the values of secret settings out of all that is kept.
            utc_ns: monotonic seconds → nanoseconds since 1970.
        """
        self._signals = driver.signals
        self._commands = driver.commands
        self._streams = {
            name for name, spec in driver.transports.items() if spec.framing.type != "datagram"
        }
        self._blanker = blanker
        self._utc_ns = utc_ns
        self._told_ns = 0

    def messages(self, event: Tapped) -> list[tuple[str, int, bytes]]:
        """Return topic, time and JSON of what happened; none while it may be part of a secret."""
        match event:
            case Sample():
                return [self._sample(event)]
            case Traffic():
                return self._traffic(event)
            case Moved():
                return [self._moved(event.command, event.arguments, self._now(event.time_s))]
            case LinkStatus():
                told: dict[str, object] = {
                    "state": event.state,
                    "address": self._blanker.text(event.address),
                    "detail": self._blanker.text(event.detail),
                    "attempts": event.attempts,
                    "faults": event.faults,
                }
                return [(_LINK + event.transport, self._now(event.since_s), _json(told))]
            case Note():
                time_ns = self._now(event.time_s)
                text = self._blanker.text(event.text)
                return [(LOG, time_ns, _json(_log(event, text, time_ns)))]
            case Entry():
                time_ns = self._latest(round(event.at * _SECOND_NS))
                return [(DRIVING, time_ns, _json(event._asdict())), *self._ended(event, time_ns)]

    def rest(self, time_s: float) -> list[tuple[str, int, bytes]]:
        """Return what was held back of streams on which nothing has come for a while."""
        time_ns = self._now(time_s)
        return [
            (_WIRE + transport, time_ns, _json(_wire(direction, data)))
            for (transport, direction), data in self._blanker.rest()
        ]

    def _sample(self, sample: Sample) -> tuple[str, int, bytes]:
        time_ns, value = self._now(sample.time_s), self._blanked(sample.value)
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
        return _SIGNALS + sample.signal, time_ns, _json(told)

    def _moved(
        self, command: str, arguments: Mapping[str, Reading], time_ns: int
    ) -> tuple[str, int, bytes]:
        told = {name: self._blanked(value) for name, value in arguments.items()}
        return _COMMANDS + command, time_ns, _json(told)

    def _ended(self, entry: Entry, time_ns: int) -> list[tuple[str, int, bytes]]:
        """Return what a motion that has ended tells the robot: else it seems to last for ever."""
        command = self._commands.get(entry.command)
        if entry.what != "stopped" or command is None or command.hold is None:
            return []
        return [self._moved(command.name, command.hold.release, time_ns)]

    def _traffic(self, traffic: Traffic) -> list[tuple[str, int, bytes]]:
        if traffic.envelope is None and traffic.transport in self._streams:
            key = (traffic.transport, str(traffic.direction))
            data = self._blanker.stream(key, traffic.data)
            if not data and traffic.data:
                return []
        else:
            data = self._blanker.whole(traffic.data)
        told = _wire(traffic.direction, data)
        return [(_WIRE + traffic.transport, self._now(traffic.time_s), _json(told))]

    def _blanked(self, value: Reading) -> Reading:
        if isinstance(value, str):
            return self._blanker.text(value)
        if isinstance(value, tuple):
            return tuple(map(self._blanked, value))
        if isinstance(value, Mapping):
            return {name: self._blanked(one) for name, one in value.items()}
        return value

    def _now(self, time_s: float) -> int:
        return self._latest(self._utc_ns(time_s))

    def _latest(self, time_ns: int) -> int:
        """Return a time that is not before what was told last: the file is played in its order.

        A reading has the time of its first byte, its bytes that of their arrival.
        """
        self._told_ns = max(self._told_ns, time_ns)
        return self._told_ns


def _wire(direction: str, data: bytes) -> dict[str, object]:
    try:
        return {"direction": direction, "text": data.decode()}
    except UnicodeDecodeError:
        return {"direction": direction, "hex": data.hex()}


def _log(note: Note, text: str, time_ns: int) -> dict[str, object]:
    return {
        "timestamp": _stamp(time_ns),
        "level": _LEVELS[note.level],
        "message": text,
        "name": note.source,
        "file": "",
        "line": 0,
    }


def _stamp(time_ns: int) -> dict[str, int]:
    return {"sec": time_ns // _SECOND_NS, "nsec": time_ns % _SECOND_NS}


def _format(data: bytes) -> str:
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "webp"
    return next((name for sign, name in _FORMATS if data.startswith(sign)), "")


def _json(told: Mapping[str, object]) -> bytes:
    try:
        return _encode(told)
    except (UnicodeEncodeError, OverflowError):
        # A lone surrogate in a robot's text, or a number of more than 64 bits.
        text = json.dumps(told, default=_plain, ensure_ascii=True)
        return text.encode("ascii")


def _plain(value: object) -> object:
    if isinstance(value, bytes):
        return base64.b64encode(value).decode("ascii")
    if isinstance(value, Mapping):
        return dict(value)
    raise NotImplementedError(f"no JSON for {type(value).__name__}")


# -- back


def is_state(topic: str) -> bool:
    """Return whether the last message of a topic holds until the next: a signal, or a line."""
    return topic.startswith((_SIGNALS, _LINK))


def event_of(
    topic: str, data: bytes, time_s: float, signals: Mapping[str, Signal]
) -> Sample | LinkStatus | Note | Traffic | None:
    """Return what a message tells, as if it happened now; None when it tells nothing known.

    Args:
        topic: of the message.
        data: its JSON.
        time_s: monotonic seconds at which it happens.
        signals: of the profile that shows it, which may have changed since.
    """
    try:
        told = msgspec.json.decode(data)
        return _event(topic, told, time_s, signals) if isinstance(told, dict) else None
    except (ValueError, TypeError, KeyError, binascii.Error):
        return None  # not one of ours, or damaged


def _event(
    topic: str, told: dict[str, Any], time_s: float, signals: Mapping[str, Signal]
) -> Sample | LinkStatus | Note | Traffic | None:
    if topic.startswith(_SIGNALS):
        signal = signals.get(topic.removeprefix(_SIGNALS))
        alarm = told.get("alarm", "")
        if signal is None or alarm not in get_args(Alarm):
            return None
        return Sample(signal.name, _value(signal, told), time_s, cast("Alarm", alarm))
    if topic.startswith(_LINK):
        if told["state"] not in get_args(LinkState):
            return None
        texts = (str(told.get("detail", "")), int(told.get("attempts", 0)))
        faults, name = int(told.get("faults", 0)), topic.removeprefix(_LINK)
        return LinkStatus(name, told["state"], str(told["address"]), time_s, *texts, faults)
    if topic.startswith(_WIRE):
        data = str(told["text"]).encode() if "text" in told else bytes.fromhex(told["hex"])
        direction: Any = "sent" if told["direction"] == "sent" else "received"
        return Traffic(time_s, topic.removeprefix(_WIRE), direction, data)
    if topic == LOG:
        level: Any = next((name for name, no in _LEVELS.items() if no == told["level"]), "info")
        return Note(time_s, level, str(told["name"]), str(told["message"]))
    if topic == DRIVING:
        words = [told.get(name) for name in ("who", "what", "command", "arguments", "outcome")]
        return Note(time_s, "info", "driving", " ".join(str(word) for word in words if word))
    return None


def _value(signal: Signal, told: Mapping[str, Any]) -> Reading:
    value = told["data"] if signal.type == "image" and "data" in told else told["value"]
    if value is not None and signal.type in ("image", "blob"):
        return base64.b64decode(value, validate=True)
    return _frozen(value)


def _frozen(value: Any) -> Reading:
    if isinstance(value, list):
        return tuple(map(_frozen, value))
    if isinstance(value, dict):
        return {name: _frozen(one) for name, one in value.items()}
    return cast("Reading", value)
