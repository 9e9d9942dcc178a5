"""Encoders and decoders for the messages on a dashboard's WebSocket.

Layer 5. `urc.wire` defines the shapes of the messages. Messages are JSON text in both directions.
Times are in milliseconds on the server's monotonic clock. Ages are in milliseconds at the time of
encoding. Messages with values use indexes into the names in `HelloMessage`.

Messages from the server to the page, listed by their tag ``t``::

    hello   once, first: names, meaning of each signal, role of each command, the server's clock
    v       changed signals: i indexes, v values, a ages (one number if all are equal),
            s alarms (left out if all are normal). A signal with a history may have several values,
            oldest first; e has the number of its first value, by index
    links   the state of every transport
    topics  the differences between the driver's topics and those of a ROS robot
    log     lines, oldest first; a gap in the numbers shows dropped lines
    reply   the only reply to a command
    pong    the reply to a ping
    error   the reason why a message was invalid, or why the socket closes

    lease   the page that drives, the page that asks to drive, and the STOP latch
    beat    a heartbeat number every 50 ms for the page that drives, whose ticks echo it
    stopped a control stopped before its release; it needs a new gesture
    refused a tick, or a request about the controls, was refused

    ask     a question for a second person; ``asked`` closes it
    token   the reply to ``prepare``: allows one command, once, within 5 s
    progress the state of the sequences
    alarms  changed alarms of the robot; the first message has all alarms

Images are sent as binary messages; see `urc.web.wire.picture`.

Messages from the page to the server are ``ping``, ``run``, ``show``, ``agree``, ``prepare`` and
``steer``. The messages for the controls are ``drive``, ``tick``, ``release`` and ``stop``. Ticks,
releases and stops may also use a redundant socket, which begins with the message ``spare`` and
receives heartbeats.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Final, TypeVar

import msgspec

from urc.model.profile import Profile
from urc.model.values import (
    NOTHING,
    AlarmLimits,
    AlarmPriority,
    Reading,
    Sample,
    Signal,
)
from urc.runtime.connection_cause import cause_of
from urc.runtime.hub import LinkStatus, LogEntry
from urc.runtime.signal_sources import sources_of
from urc.runtime.topic_check import TopicMismatch
from urc.web.wire.text import cut, encoded, encoded_bytes, milliseconds, repaired
from urc.wire.client_messages import INBOUND_BYTES, ClientMessage, CommandRequest, Ping
from urc.wire.server_messages import (
    CLOSE_BAD_MESSAGES,
    CLOSE_FAILED,
    CLOSE_FULL,
    CLOSE_NO_ROBOT,
    CLOSE_NOT_LET_IN,
    CLOSE_NOT_READY,
    CLOSE_TOO_FAST,
    VERSION,
    ErrorMessage,
    HelloMessage,
    LinkRow,
    LinksMessage,
    LogMessage,
    LogRow,
    PongMessage,
    ReplyMessage,
    SignalRow,
    TopicMismatchRow,
    TopicsMessage,
    ValuesMessage,
)

__all__ = [
    "CLOSE_BAD_MESSAGES",
    "CLOSE_FAILED",
    "CLOSE_FULL",
    "CLOSE_NOT_LET_IN",
    "CLOSE_NO_ROBOT",
    "CLOSE_NOT_READY",
    "CLOSE_TOO_FAST",
    "INBOUND_BYTES",
    "decoded",
    "BadMessage",
    "Inbound",
    "Indexes",
    "Ping",
    "CommandRequest",
    "decode",
    "encode_error",
    "encode_hello",
    "encode_links",
    "encode_log",
    "encode_pong",
    "encode_reply",
    "encode_topics",
    "encode_values",
]

_AS_THEY_ARE = frozenset((float, bool, type(None)))
_LIMITS: Final = ("lolo", "low", "high", "hihi")
_EXACT = 2**53 - 1  # browsers cannot represent all integers above this limit


class BadMessage(Exception):
    """An invalid message from a page; the error text describes the expected form."""


Inbound = ClientMessage

_Message = TypeVar("_Message")


def decoded(decoder: msgspec.json.Decoder[_Message], text: str | bytes) -> _Message:
    """Return the decoded message from a page.

    Raises:
        BadMessage: the message is too long or matches none of the decoder's types.
    """
    if len(text) > INBOUND_BYTES:
        raise BadMessage(f"the message is longer than {INBOUND_BYTES} bytes")
    try:
        return decoder.decode(text)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise BadMessage(str(error)) from error


_decoder: msgspec.json.Decoder[Inbound] = msgspec.json.Decoder(Inbound)


def decode(text: str | bytes) -> Inbound:
    """Return the decoded message; raise `BadMessage` with the reason if the text is invalid."""
    return decoded(_decoder, text)


def encode_hello(
    profile: Profile, session: str, now_s: float, *, is_playback: bool = False, pictures: str = ""
) -> str:
    """Return the first message, which defines the meaning of all indexes.

    The key `pictures` is for the page's socket for images.

    The page does not compare the images of a playback, because a jump shows images again.
    """
    sources = sources_of(profile.driver)
    signals = profile.driver.signals
    return encoded(
        HelloMessage(
            version=VERSION,
            session=session,
            robot=profile.name,
            title=profile.title,
            now=milliseconds(now_s),
            names=tuple(signals),
            signals=[
                _signal(signal, sources.get(name, ()), is_playback=is_playback)
                for name, signal in signals.items()
            ],
            roles={name: one.role for name, one in profile.driver.commands.items()},
            controls=tuple(
                name for name, one in profile.driver.commands.items() if one.hold is not None
            ),
            pictures=pictures,
        )
    )


class Indexes:
    """Converts signal names to indexes, and caches the result of the last conversion."""

    def __init__(self, index: Mapping[str, int]) -> None:
        self._index = index
        self._names: tuple[str, ...] = ()
        self._found = msgspec.Raw(b"[]")

    def keyed(self, numbers: Mapping[str, int]) -> dict[int, int]:
        """Return the mapping with each signal name replaced by its index."""
        return {self._index[name]: number for name, number in numbers.items()}

    def of(self, names: tuple[str, ...]) -> msgspec.Raw:
        """Return the indexes of names, encoded as JSON."""
        if names is not self._names and names != self._names:
            found = [*map(self._index.__getitem__, names)]
            self._names, self._found = names, msgspec.Raw(msgspec.json.encode(found))
        return self._found


def encode_values(
    samples: Iterable[Sample], indexes: Indexes, now_s: float, firsts: Mapping[str, int] = NOTHING
) -> bytes:
    """Return one frame of readings; `firsts` maps each signal to its first reading's number."""
    values: Sequence[object]
    names, values, times, alarms = zip(*samples, strict=True)
    count, first_s = len(names), times[0]
    ages: int | list[int]
    if times.count(first_s) == count:  # samples with the same time have the same age
        ages = max(0, round((now_s - first_s) * 1000))
    else:
        ages = [max(0, milliseconds(now_s - time_s)) for time_s in times]
    if not _AS_THEY_ARE.issuperset(map(type, values)):
        values = tuple(map(_plain, values))
    are_normal = alarms.count("") == count
    now_ms, numbers = round(now_s * 1000), indexes.of(names)
    told = None if are_normal else alarms
    counted = indexes.keyed(firsts) if firsts else None
    return encoded_bytes(ValuesMessage(now_ms, numbers, values, ages, told, counted))


def encode_links(links: Iterable[LinkStatus], now_s: float) -> str:
    """Return the message with the states of all transports."""
    return encoded(
        LinksMessage(
            [
                LinkRow(
                    transport=link.transport,
                    state=link.state,
                    address=link.address,
                    since=max(0, milliseconds(now_s - link.since_s)),
                    detail=cut(link.detail),
                    attempts=link.attempts,
                    faults=link.faults,
                    cause=cause_of(link.detail, link.address) if link.state == "lost" else "",
                    ready=link.is_ready,
                )
                for link in links
            ]
        )
    )


def encode_topics(mismatches: Iterable[TopicMismatch]) -> str:
    """Return the message with the differences between the driver's topics and the robot's."""
    rows = []
    for code, use, found, wanted in mismatches:
        commands, signals = (use.names, ()) if use.is_published else ((), use.names)
        rows.append(TopicMismatchRow(code, cut(use.topic), found, wanted, commands, signals))
    return encoded(TopicsMessage(rows))


def encode_log(notes: Iterable[LogEntry], first: int, now_s: float) -> str:
    """Return a message with log lines; `first` is the first line's number in its session."""
    lines = [
        LogRow(max(0, milliseconds(now_s - note.time_s)), note.level, note.source, cut(note.text))
        for note in notes
    ]
    return encoded(LogMessage(first, lines))


def encode_reply(
    run: CommandRequest,
    *,
    values: Mapping[str, Reading] | None = None,
    code: str = "",
    message: str = "",
) -> str:
    """Return the reply to a command, with its values or a failure's `code` and `message`."""
    if code:
        return encoded(ReplyMessage(run.id, ok=False, code=code, message=cut(message)))
    plain = {name: _plain(value) for name, value in (values or {}).items()}
    return encoded(ReplyMessage(run.id, ok=True, values=plain))


def encode_pong(ping: Ping, now_s: float, utc_s: float = 0.0) -> str:
    """Return the reply to a ping; `utc_s` is the current time in seconds since 1970."""
    return encoded(PongMessage(ping.c, milliseconds(now_s), milliseconds(utc_s)))


def encode_error(code: str, message: str) -> str:
    """Return the message that states why a message was invalid or why the socket closes."""
    return encoded(ErrorMessage(code, cut(message)))


def _plain(value: object) -> object:
    """Return a value that browsers can read: long text is cut, and bytes become their size."""
    if isinstance(value, str):
        return repaired(cut(value))
    if type(value) is int and not -_EXACT <= value <= _EXACT:
        return str(value)
    if value is None or isinstance(value, (bool, int, float)):
        return value
    if isinstance(value, (bytes, bytearray)):
        return {"bytes": len(value)}
    if isinstance(value, Mapping):
        return {str(repaired(str(name))): _plain(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        are_plain = _AS_THEY_ARE.issuperset(map(type, value))
        return value if are_plain else [_plain(item) for item in value]
    return repaired(cut(str(value)))


def _priorities(limits: AlarmLimits) -> dict[str, AlarmPriority] | None:
    """Return the priorities of all conditions; None if all conditions have their usual priority."""
    numeric = [name for name in _LIMITS if getattr(limits, name) is not None]
    found = {one: limits.attributes_of(one).priority for one in (*numeric, *limits.states)}
    usual = AlarmLimits()
    is_usual = all(usual.attributes_of(one).priority == found[one] for one in found)
    return None if is_usual else found


def _signal(signal: Signal, sources: tuple[str, ...], *, is_playback: bool) -> SignalRow:
    is_compared = signal.type == "video" and not is_playback
    limits = {
        name: value for name in _LIMITS if (value := getattr(signal.limits, name)) is not None
    }
    return SignalRow(
        name=signal.name,
        type=signal.type,
        title=signal.title,
        unit=signal.unit,
        min=signal.min,
        max=signal.max,
        precision=signal.precision,
        states=dict(signal.states) or None,
        limits=limits or None,
        stale_after_s=signal.stale_after_s,
        sources=sources,
        axes=signal.axes,
        has_alarms=not signal.limits.is_empty,
        priorities=_priorities(signal.limits),
        frozen_after_s=signal.frozen_after_s or None if is_compared else None,
    )
