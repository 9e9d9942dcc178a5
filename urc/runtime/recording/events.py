"""Decoding of recorded messages into events.

Layer 4, pure. A file may be damaged or come from another program, so messages that do not match
`shapes` are ignored.
"""

import base64
from collections.abc import Mapping
from typing import Any, Final, cast, get_args

import msgspec

from urc.model.values import BINARY_TYPES, PICTURE_TYPES, Alarm, Reading, Sample, Signal
from urc.runtime.cloud_messages import cloud_file
from urc.runtime.hub import LinkState, LinkStatus, LogEntry, Traffic
from urc.runtime.json_messages import LEVELS
from urc.runtime.recording.shapes import DRIVING, LINK, LOG, SIGNALS, WIRE
from urc.runtime.recording.videos import RecordedVideos

__all__ = ["event_of", "is_loss", "is_state", "topic_of"]

_MOST: Final = 2**31 - 1


def is_state(topic: str) -> bool:
    """Return whether the last message of a topic is a current state: of a signal or a transport."""
    return topic.startswith((SIGNALS, LINK))


def is_loss(note: LogEntry) -> bool:
    """Return whether a log entry states that data is missing from the recording."""
    return note.source == "recording" and note.level == "warning"


def topic_of(signal: str) -> str:
    """Return a signal's topic."""
    return SIGNALS + signal


def event_of(
    topic: str,
    data: bytes,
    time_s: float,
    signals: Mapping[str, Signal],
    videos: RecordedVideos | None = None,
) -> Sample | LinkStatus | LogEntry | Traffic | None:
    """Return the event that a message describes; None if the message is not recognised.

    Args:
        topic: topic of the message in the recording.
        data: JSON text of the message.
        time_s: time of the event, in monotonic seconds.
        signals: signals of the displayed profile, which may differ from the recorded profile.
        videos: videos of the playback; None if only keyframes of videos are needed.
    """
    try:
        told = msgspec.json.decode(data)
        if not isinstance(told, dict):
            return None
        return _event(topic, told, time_s, signals, videos or RecordedVideos())
    except Exception:  # the message is damaged, or from another program
        return None


def _event(
    topic: str,
    told: dict[str, Any],
    time_s: float,
    signals: Mapping[str, Signal],
    videos: RecordedVideos,
) -> Sample | LinkStatus | LogEntry | Traffic | None:
    if topic.startswith(SIGNALS):
        signal = signals.get(topic.removeprefix(SIGNALS))
        alarm = told.get("alarm", "")
        if signal is None or alarm not in get_args(Alarm):
            return None
        if signal.type == "video" and "data" in told:
            return Sample(signal.name, videos.value(signal.name, told, time_s), time_s)
        return Sample(signal.name, _value(signal, told), time_s, cast("Alarm", alarm))
    if topic.startswith(LINK):
        if told["state"] not in get_args(LinkState):
            return None
        name, address, detail = topic.removeprefix(LINK), told["address"], told.get("detail", "")
        attempts, faults = (min(int(told.get(each, 0)), _MOST) for each in ("attempts", "faults"))
        is_ready = bool(told.get("ready", told["state"] in ("live", "silent")))
        state, numbers = told["state"], (attempts, faults, is_ready)
        return LinkStatus(name, state, str(address), time_s, str(detail), *numbers)
    if topic.startswith(WIRE):
        data = str(told["text"]).encode() if "text" in told else bytes.fromhex(told["hex"])
        direction: Any = "sent" if told["direction"] == "sent" else "received"
        return Traffic(time_s, topic.removeprefix(WIRE), direction, data)
    if topic == LOG:
        level: Any = next((name for name, no in LEVELS.items() if no == told["level"]), "info")
        return LogEntry(time_s, level, str(told["name"]), str(told["message"]))
    if topic == DRIVING:
        words = [told.get(name) for name in ("who", "what", "command", "arguments", "outcome")]
        return LogEntry(time_s, "info", "driving", " ".join(str(word) for word in words if word))
    return None


_KINDS: Final[Mapping[str, type | tuple[type, ...]]] = {
    "integer": (int, float),
    "number": (int, float),
    "boolean": bool,
    "string": str,
    "array": list,
    "object": dict,
    "transform_tree": dict,
    "image": str,
    "occupancy_grid": str,
    "point_cloud": str,
    "blob": str,
    "video": str,
}


def _value(signal: Signal, told: Mapping[str, Any]) -> Reading:
    if signal.type == "point_cloud" and "data" in told:
        return cloud_file(told)
    value = told["data"] if signal.type in PICTURE_TYPES and "data" in told else told["value"]
    if value is None:
        return None
    if not isinstance(value, _KINDS[signal.type]) or (
        isinstance(value, bool) and signal.type != "boolean"
    ):
        raise TypeError(f"{signal.name} is not of type {signal.type}")
    if signal.type in BINARY_TYPES:
        return base64.b64decode(str(value), validate=True)
    return _frozen(value)


def _frozen(value: Any) -> Reading:
    if isinstance(value, list):
        return tuple(map(_frozen, value))
    if isinstance(value, dict):
        return {name: _frozen(one) for name, one in value.items()}
    return cast("Reading", value)
