"""Declarations of how frames are read and written: a form, and its parsed options.

A *form* is one notation for the content of a frame (``regex``, ``struct``, ``json`` …). Each form
has a parser in `urc.config`, which fills `options`, and a factory in `urc.protocol`, which reads
them. Parser and factory agree on the content of `options`; no other module reads it.

Decoding gives *fields*: name → raw value. A field with the name of a signal sets that signal. A
field whose name starts with ``_`` stays inside the document (conditions, correlation, command
replies).
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
    "CountedFrame",
    "Envelope",
    "FramingSpec",
    "Numbered",
    "Payload",
    "ReadSpec",
    "FrameVariants",
    "WriteSpec",
    "size_of",
    "traffic_of",
]


class Envelope(NamedTuple):
    """The unit of a transport that carries messages instead of bytes."""

    verb: str
    """Operation. The driver sends ``publish``, ``call``, ``goal``, ``cancel`` and ``request``. The
    transport delivers ``message``, ``response``, ``feedback`` and its own ``notice``."""
    attributes: Mapping[str, object] = NOTHING
    """Address and options: topic, type, method, path, headers, quality of service … A request has
    an ``id``, and its response the same one. A response has ``ok``, and on failure a ``reason``."""
    body: object = None
    """JSON-like data, or bytes."""


NUMBERED: Final = frozenset(("call", "goal", "request"))
"""Verbs of requests. Each request gets a ``response`` with the same ``id``."""

Payload = bytes | Envelope
"""The content of one frame, without its framing."""


class Count(NamedTuple):
    """The effect of a frame on the counters of its connection."""

    before: dict[str, int]
    """Last number of each counter before the frame; a missing counter is unused so far."""
    after: dict[str, int]
    """Last number of each counter after the frame."""


class Numbered(NamedTuple):
    """A frame with counters. The frame may be sent only while its numbers are the next ones."""

    data: Payload
    takes: Count


class FrameVariants(NamedTuple):
    """One frame, rendered once for each set of numbers that may be next when it is sent."""

    frames: tuple[Numbered, ...]


class CountedFrame(NamedTuple):
    """A frame with counters, and a function that renders it again."""

    numbered: Numbered
    again: Callable[[], Numbered | None]
    """Render the frame with the next numbers; None: the frame has become impossible."""


class FramingSpec(NamedTuple):
    """How a byte stream is cut into frames. `type` is a row of the framings table."""

    type: str = "delimiter"
    options: Mapping[str, object] = NOTHING
    """Parsed options; for ``delimiter``, `tx` and `rx` as bytes."""
    max_bytes: int = 65536
    """Longest accepted frame, in bytes; a longer one is dropped and counted."""
    timeout_s: float | None = None
    """Timeout within a frame, in seconds, after which an incomplete frame is dropped; None:
    never."""
    strips_ansi: bool = False
    """Whether terminal escape sequences are removed from received data."""
    sent: "FramingSpec | None" = None
    """Framing of sent data, where it differs from that of received data; None: the same."""


def size_of(payload: Payload) -> int:
    """Return the size of a payload in bytes; an estimate for an envelope."""
    if not isinstance(payload, Envelope):
        return len(payload)
    return 256 + (len(payload.body) if isinstance(payload.body, bytes) else 0)


def traffic_of(payload: Payload) -> bytes:
    """Return a payload as the traffic view shows it: ``publish topic=/cmd_vel {"x":1}``."""
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
    """A value that is collected from several frames."""

    value: Template
    """Expression over the fields of each frame: one value, a list of values, or bytes."""
    begin: Template | None = None
    """Condition that marks the first frame of a new value."""
    end: Template | None = None
    """Condition that marks the last frame. Without a condition, the first frame of the next value
    ends this one."""
    max: int = 4096
    """Largest number of values, or of bytes, in total."""


class ReadSpec(NamedTuple):
    """How a frame is decoded into fields."""

    form: str
    """Row of the readers' table, such as ``regex``."""
    options: Mapping[str, object] = NOTHING
    fields: tuple[str, ...] = ()
    """Names of all possible fields, in the order of the frame, then the names of `sets`."""
    conversions: Mapping[str, Conversion] = NOTHING
    """Field → conversion for this frame; the conversion of the signal follows it."""
    sets: Mapping[str, Template] = NOTHING
    """Signal → expression over the converted fields."""
    when: Template | None = None
    """Condition over the converted fields; false means another kind of frame."""
    lines: int | Pattern | None = None
    """Number of frames in the reply, or a pattern that finds the last one. LF joins them."""
    topic: Template | None = None
    """Source topic, over settings, on a transport that carries messages; None: any topic."""
    collects: Mapping[str, Collect] = NOTHING
    """Signal → rule that collects it; these names come last in `fields`."""
    head: Mapping[str, str] = NOTHING
    """Field → header of an HTTP response in lower case, or ``status``."""
    listen: Mapping[str, Value] = NOTHING
    """Subscription options of `topic`: type, throttle in seconds, quality of service …"""


class WriteSpec(NamedTuple):
    """How arguments are encoded into a frame."""

    form: str
    """Row of the writers' table, such as ``text``; ``frames`` has several specifications."""
    options: Mapping[str, object] = NOTHING
    names: frozenset[str] = frozenset()
    """Root names that its templates use."""
    settings: frozenset[str] = frozenset()
    """Names of the settings that its templates use, as ``settings.NAME``."""


def each_of(send: WriteSpec) -> tuple[WriteSpec, ...]:
    """Return the frames of `send`: `send` itself, or all frames of a group."""
    frames = send.options.get("frames")
    return frames if send.form == "frames" and isinstance(frames, tuple) else (send,)
