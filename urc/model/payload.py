"""Declarations for reading and writing frames: a form and its parsed options.

A *form* is one notation for the content of a frame (``regex``, ``struct``, ``json`` …). Each form
has a parser in `urc.config`, which writes `options`, and a factory in `urc.protocol`, which reads
`options`. Only the parser and the factory of a form use the content of `options`.

Decoding returns *fields*: raw values by name. A field with the name of a signal sets that signal. A
field name that starts with ``_`` is private to the document, for use in conditions, correlation and
command replies.
"""

import json
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from urc.expressions import Template
from urc.model.values import NOTHING, Conversion, Value
from urc.patterns import Pattern

__all__ = [
    "LOST",
    "NUMBERED",
    "RESTARTED",
    "UNKNOWN_END",
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
    """A message on a transport that carries messages instead of bytes."""

    verb: str
    """Operation of the envelope. The driver sends ``publish``, ``call``, ``goal``, ``cancel``,
    ``request`` and ``get``. The transport delivers ``message``, ``response``, ``feedback`` and
    ``notice``. A ROS transport answers ``topics`` with ``topics``."""
    attributes: Mapping[str, object] = NOTHING
    """Address and options: topic, type, method, path, headers, quality of service and so on. A
    request and its response have the same ``id``. Every response has the attribute ``ok``; a
    response that reports a failure also has ``reason``."""
    body: object = None
    """Content of the envelope: JSON-like data, or bytes."""


RESTARTED: Final = "restarted"
"""The verb of an envelope that a ROS transport makes if the robot's clock, which may be simulated,
went back. The body is one line of text about it; "" if the step is not worth a line."""
UNKNOWN_END: Final = "is_end_unknown"
"""Attribute of a response that reports a failure: true if the robot may still follow the goal."""
LOST: Final = "lost"
"""The attribute of a message that is true if messages of its topic were lost before it. Only
transports of ROS set it, and only for the topics of videos."""
NUMBERED: Final = frozenset(("call", "goal", "request", "get"))
"""Verbs of requests. The ``response`` to a request has the request's ``id``."""

Payload = bytes | Envelope
"""The content of one frame, without its framing."""


class Count(NamedTuple):
    """The counters of a connection before and after a frame."""

    before: dict[str, int]
    """Last number of each counter that the frame uses, before the frame."""
    after: dict[str, int]
    """Last number of each counter, after the frame."""


class Numbered(NamedTuple):
    """A frame with counters, valid only until another frame uses the same counters."""

    data: Payload
    takes: Count


class FrameVariants(NamedTuple):
    """One frame, rendered once for each possible set of next counter numbers."""

    frames: tuple[Numbered, ...]


class CountedFrame(NamedTuple):
    """A frame with counters and a function that renders the frame again."""

    numbered: Numbered
    again: Callable[[], Numbered | None]
    """Function that renders the frame with the next numbers, or returns None on failure."""


class FramingSpec(NamedTuple):
    """Rules for cutting a byte stream into frames; `type` is a framing, such as ``delimiter``."""

    type: str = "delimiter"
    options: Mapping[str, object] = NOTHING
    """Parsed options of the framing, such as `tx` and `rx` as bytes for ``delimiter``."""
    max_bytes: int = 65536
    """Maximum size of a frame, in bytes; a larger frame is dropped and counted."""
    timeout_s: float | None = None
    """Timeout after which an incomplete frame is dropped, in seconds; None means never."""
    strips_ansi: bool = False
    """Whether terminal escape sequences are removed from received data."""
    sent: "FramingSpec | None" = None
    """Framing of sent data; None means the framing of received data."""


def size_of(payload: Payload) -> int:
    """Return the size of a payload in bytes; the size of an envelope is an estimate."""
    if not isinstance(payload, Envelope):
        return len(payload)
    return 256 + (len(payload.body) if isinstance(payload.body, bytes) else 0)


def traffic_of(payload: Payload) -> bytes:
    """Return a payload as text for traffic views: ``publish topic=/cmd_vel {"x":1}``."""
    if not isinstance(payload, Envelope):
        return payload
    words = [
        f"{name}={value}"
        for name, value in payload.attributes.items()
        # The bytes of a ROS message are the same message as the body.
        if value is not None and not isinstance(value, bytes | list)
    ]
    head = " ".join((payload.verb, *words)).encode()
    if payload.body is None:
        return head
    body = payload.body
    text = body if isinstance(body, bytes) else json.dumps(body, default=repr).encode()
    return head + b" " + text


class Collect(NamedTuple):
    """A value assembled from several frames."""

    value: Template
    """Expression using the fields of one frame; the result is one value, a list of values, or
    bytes."""
    begin: Template | None = None
    """Condition for the first frame of a new value."""
    end: Template | None = None
    """Condition for the last frame of a value; None means that the first frame of the next value
    ends the previous value."""
    max: int = 4096
    """Maximum number of elements or bytes of the assembled value."""


class ReadSpec(NamedTuple):
    """Rules for decoding a frame into fields."""

    form: str
    """Name of the form in which the frame is read, such as ``regex``."""
    options: Mapping[str, object] = NOTHING
    fields: tuple[str, ...] = ()
    """Names of all possible fields in frame order, followed by the names in `sets`."""
    conversions: Mapping[str, Conversion] = NOTHING
    """Conversions of the frame's fields, keyed by field, applied before the signals'
    conversions."""
    sets: Mapping[str, Template] = NOTHING
    """Expressions using the converted fields, keyed by signal."""
    when: Template | None = None
    """Condition on the converted fields; if false, the frame does not match. Without a condition,
    every frame with the fields matches."""
    lines: int | Pattern | None = None
    """Number of frames in the reply, or a pattern that only the last frame matches. The reader
    receives the frames of a reply as one string, joined by LF."""
    topic: Template | None = None
    """Template for the source topic, which can use settings; only on message transports. None means
    any topic."""
    collects: Mapping[str, Collect] = NOTHING
    """Rules for values assembled from several frames, keyed by signal; these signals are last in
    `fields`."""
    head: Mapping[str, str] = NOTHING
    """Lower-case names of HTTP response headers, or ``status``, keyed by field."""
    listen: Mapping[str, Value] = NOTHING
    """Subscription options for `topic`, such as type, throttle in seconds and quality of
    service."""


class WriteSpec(NamedTuple):
    """Rules for encoding arguments into a frame."""

    form: str
    """Name of the form in which the frame is written, such as ``text``. The form ``frames``
    contains the specifications of several frames."""
    options: Mapping[str, object] = NOTHING
    names: frozenset[str] = frozenset()
    """Names that the templates use; of a name such as ``settings.host``, only the first part."""
    settings: frozenset[str] = frozenset()
    """Names of the settings that the templates use as ``settings.NAME``."""


def each_of(send: WriteSpec) -> tuple[WriteSpec, ...]:
    """Return the frames of a command that sends several frames together, or only `send`."""
    frames = send.options.get("frames")
    return frames if send.form == "frames" and isinstance(frames, tuple) else (send,)
