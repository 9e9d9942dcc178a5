"""Converts a server's messages to signals, readings, links and log lines.

Layer 5. Pure. Ages are converted to times on this process's monotonic clock. A browser's JSON has
no tuples and no integers beyond 2^53, so values are converted according to their signal's type.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import get_args

import msgspec

from urc.model.values import Alarm, AlarmLimits, Axes, Reading, Sample, Signal, SignalType
from urc.runtime.hub import LinkState, LinkStatus, LogEntry, SequenceProgress
from urc.wire.server_messages import (
    HelloMessage,
    LinksMessage,
    LogRow,
    ProgressMessage,
    ServerMessage,
    SignalRow,
    ValuesMessage,
)

__all__ = [
    "decode_message",
    "entry_of",
    "links_of",
    "progress_of",
    "reading_of",
    "readings_of",
    "samples_of",
    "signals_of",
]

_decoder: msgspec.json.Decoder[ServerMessage] = msgspec.json.Decoder(ServerMessage)
_indexes = msgspec.json.Decoder(list[int])
_TYPES, _AXES, _ALARMS = get_args(SignalType), get_args(Axes), get_args(Alarm)
_STATES = get_args(LinkState)
_LEVELS = ("info", "warning", "error")


def decode_message(text: str | bytes) -> ServerMessage | None:
    """Decode a message; return None for a message that is invalid or unknown to this version."""
    try:
        return _decoder.decode(text)
    except (msgspec.MsgspecError, UnicodeError, RecursionError):
        return None


def signals_of(hello: HelloMessage) -> dict[str, Signal]:
    """Return the robot's signals by name, in the order of their indexes in messages."""
    return {row.name: _signal(row) for row in hello.signals}


def samples_of(message: ValuesMessage, signals: Sequence[Signal], now_s: float) -> Iterator[Sample]:
    """Yield the readings in a message; their ages are relative to `now_s`."""
    indexes = _indexes.decode(message.i)
    ages = message.a if isinstance(message.a, Sequence) else [message.a] * len(indexes)
    alarms = message.s or [""] * len(indexes)
    for index, value, age_ms, alarm in zip(indexes, message.v, ages, alarms, strict=True):
        signal = signals[index]
        reading = reading_of(value, signal)
        known: Alarm = alarm if alarm in _ALARMS else ""  # type: ignore[assignment]
        yield Sample(signal.name, reading, now_s - age_ms / 1000, known)


def readings_of(values: Mapping[str, object], signals: Mapping[str, Signal]) -> dict[str, Reading]:
    """Return the values in a reply, each converted to its signal's type."""
    return {name: reading_of(value, signals.get(name)) for name, value in values.items()}


def reading_of(value: object, signal: Signal | None) -> Reading:
    """Return a value converted to its signal's type; `signal` may be None for an unknown signal."""
    kind = signal.type if signal is not None else ""
    if kind == "integer" and isinstance(value, str):
        try:
            return int(value)  # an integer beyond 2^53 arrives as text
        except ValueError:
            return value
    if isinstance(value, list):
        return tuple(value)
    return value  # type: ignore[return-value] # any other JSON value is a reading


def links_of(message: LinksMessage, now_s: float) -> Iterator[LinkStatus]:
    """Yield the state of every transport in a server's message."""
    for row in message.links:
        state: LinkState = row.state if row.state in _STATES else "lost"  # type: ignore[assignment]
        since_s = now_s - row.since / 1000
        yield LinkStatus(
            transport=row.transport,
            state=state,
            address=row.address,
            since_s=since_s,
            detail=row.detail,
            attempts=row.attempts,
            faults=row.faults,
            is_ready=row.ready,
        )


def entry_of(row: LogRow, now_s: float) -> LogEntry:
    """Return the line of the robot's log that `row` describes."""
    level = row.level if row.level in _LEVELS else "info"
    return LogEntry(now_s - row.age / 1000, level, row.source, row.text)  # type: ignore[arg-type]


def progress_of(message: ProgressMessage) -> Iterator[SequenceProgress]:
    """Yield the progress of every sequence in a server's message."""
    for row in message.sequences:
        yield SequenceProgress(row.command, row.place, row.of, row.state, row.reason)  # type: ignore[arg-type]


def _signal(row: SignalRow) -> Signal:
    limits = row.limits or {}
    return Signal(
        name=row.name,
        type=row.type if row.type in _TYPES else "object",  # type: ignore[arg-type]
        title=row.title,
        unit=row.unit,
        min=row.min,
        max=row.max,
        precision=row.precision,
        states=tuple((row.states or {}).items()),
        limits=AlarmLimits(
            limits.get("lolo"), limits.get("low"), limits.get("high"), limits.get("hihi")
        ),
        stale_after_s=row.stale_after_s,
        axes=row.axes if row.axes in _AXES else "",  # type: ignore[arg-type]
    )
