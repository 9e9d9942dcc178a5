"""How a frame is read and written, as declared: a form, and what the form's parser made of it.

A *form* is one way of saying what is in a frame (``regex``, ``struct``, ``json`` …). Each form has
a parser in `urc.config`, which fills `options`, and a factory in `urc.protocol`, which reads them;
the two agree on what is in there, and nobody else looks.

Reading a frame gives *fields*: name → raw value. A field that is named like a signal sets it; one
whose name starts with ``_`` stays inside the document (conditions, correlation, command replies).
"""

import json
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from urc.expressions import Template
from urc.model.values import NOTHING, Conversion, Value
from urc.patterns import Pattern

__all__ = [
    "NUMBERED",
    "Collect",
    "Count",
    "Counted",
    "Envelope",
    "FramingSpec",
    "Numbered",
    "Payload",
    "ReadSpec",
    "Series",
    "WriteSpec",
    "size_of",
    "traffic_of",
]


class Envelope(NamedTuple):
    """What goes over a transport that carries messages instead of bytes."""

    verb: str
    """What the transport is asked to do (``publish``, ``call``, ``goal``, ``cancel``, ``request``),
    or what it brings (``message``, ``response``, ``feedback``; the transport's own ``notice``)."""
    attributes: Mapping[str, object] = NOTHING
    """What addresses it: topic, type, method, path, headers, quality of service … What is answered
    has an ``id``, and its answer the same; that one says ``ok``, and why not as ``reason``."""
    body: object = None
    """JSON-like data, or bytes."""


NUMBERED: Final = frozenset(("call", "goal", "request"))
"""Verbs of envelopes that are answered by a ``response`` with the same ``id``."""

Payload = bytes | Envelope
"""One frame without its framing."""


class Count(NamedTuple):
    """What a frame does to the counters of its connection."""

    before: dict[str, int]
    """Last number of each counter in the frame, when the frame leaves; none: not used so far."""
    after: dict[str, int]
    """Number of each counter in the frame."""


class Numbered(NamedTuple):
    """A frame with counters. It may leave only while its numbers are the next ones."""

    data: Payload
    takes: Count


class Series(NamedTuple):
    """One frame, rendered once for each of the numbers that may be next when it leaves."""

    frames: tuple[Numbered, ...]


class Counted(NamedTuple):
    """A frame with counters, and how to make it again."""

    numbered: Numbered
    again: Callable[[], Numbered | None]
    """Renders it with the numbers that are next now; None: the frame is no longer possible."""


class FramingSpec(NamedTuple):
    """How a byte stream is cut into frames. `type` is a row of the framings table."""

    type: str = "delimiter"
    options: Mapping[str, object] = NOTHING
    """As parsed by the loader: for ``delimiter``, ``tx`` and ``rx`` as bytes."""
    max_bytes: int = 65536
    """Longest frame accepted; a longer one is dropped and counted."""
    timeout_s: float | None = None
    """Silence inside of a frame after which what there is of it is dropped; None: never."""
    strips_ansi: bool = False
    """Whether the escape sequences of a terminal are taken out of what comes."""
    sent: "FramingSpec | None" = None
    """Of what URC sends, where that is framed otherwise than what comes; None: the same."""


def size_of(payload: Payload) -> int:
    """Return how many bytes a payload takes, of an envelope about."""
    if not isinstance(payload, Envelope):
        return len(payload)
    return 256 + (len(payload.body) if isinstance(payload.body, bytes) else 0)


def traffic_of(payload: Payload) -> bytes:
    """Return what is shown of a payload in the traffic: ``publish topic=/cmd_vel {"x":1}``."""
    if not isinstance(payload, Envelope):
        return payload
    words = [f"{name}={value}" for name, value in payload.attributes.items() if value is not None]
    head = " ".join((payload.verb, *words)).encode()
    if payload.body is None:
        return head
    body = payload.body
    text = body if isinstance(body, bytes) else json.dumps(body, default=repr).encode()
    return head + b" " + text


class Collect(NamedTuple):
    """A value that is put together out of several frames."""

    value: Template
    """What each frame adds, over its fields: one value, or a list of them, or bytes."""
    begin: Template | None = None
    """Holds for the first frame of a new one."""
    end: Template | None = None
    """Holds for the last frame. Without it, the first frame of the next one ends it."""
    most: int = 4096
    """Values, or bytes, in all."""


class ReadSpec(NamedTuple):
    """How a frame becomes fields."""

    form: str
    """Row of the readers' table: ``regex`` …"""
    options: Mapping[str, object] = NOTHING
    fields: tuple[str, ...] = ()
    """Every field that it can give, in the order of the frame; then the names of `sets`."""
    conversions: Mapping[str, Conversion] = NOTHING
    """Field → conversion of this frame alone; the signal's own comes after it."""
    sets: Mapping[str, Template] = NOTHING
    """Signal → expression over the converted fields."""
    when: Template | None = None
    """Expression over the converted fields; the frame is another one where it is not true."""
    lines: int | Pattern | None = None
    """The reply is that many frames, or all up to one that the pattern finds; joined by LF."""
    topic: Template | None = None
    """Over settings: where it comes from, on a transport that carries messages. None: anywhere."""
    collects: Mapping[str, Collect] = NOTHING
    """Signal → how it is put together; these names are the last of `fields`."""
    head: Mapping[str, str] = NOTHING
    """Field → header of an http answer in small letters, or ``status``."""
    listen: Mapping[str, Value] = NOTHING
    """How `topic` is listened to: type, throttle in seconds, quality of service …"""


class WriteSpec(NamedTuple):
    """How arguments become a frame."""

    form: str
    """Row of the writers' table: ``text`` …; ``frames`` are several, each with its own."""
    options: Mapping[str, object] = NOTHING
    names: frozenset[str] = frozenset()
    """Root names that its templates use."""
    settings: frozenset[str] = frozenset()
    """Names used as ``settings.NAME``."""


def each_of(send: WriteSpec) -> tuple[WriteSpec, ...]:
    """Return the frames of `send`: itself, or all that go out together."""
    frames = send.options.get("frames")
    return frames if send.form == "frames" and isinstance(frames, tuple) else (send,)
