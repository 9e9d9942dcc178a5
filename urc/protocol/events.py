"""What an engine asks for and tells: the only way anything leaves it."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

from urc.model.codec import Counted, Payload
from urc.model.values import NOTHING, Reading, Sample

__all__ = [
    "Close",
    "Event",
    "Failed",
    "Fault",
    "Open",
    "Ready",
    "Replied",
    "Request",
    "Samples",
    "Send",
]


class Request(NamedTuple):
    """One command to run. One id, one answer: `Replied` or `Failed`."""

    id: int
    command: str
    arguments: Mapping[str, Reading] = NOTHING
    confirmed_by: tuple[str, ...] = ()
    """Who said yes to the question before it, who asks for it among them."""
    on_sent: Callable[[Payload], None] | None = None
    """Told what goes out for it, each time; not what is secret, nor what a sequence sends."""


class Open(NamedTuple):
    """Connect this transport: a request waits for it (``connection: per_request``)."""

    transport: str


class Send(NamedTuple):
    """Hand these bytes, framing included, or this envelope to the transport."""

    transport: str
    data: Payload
    is_secret: bool = False
    """Its text must not be shown or logged."""
    counted: Counted | None = None
    """The same frame, where others send frames with counters on this connection, too."""


class Close(NamedTuple):
    """Close this transport; the engine is done with it or gives it up."""

    transport: str
    reason: str = ""
    """"" for the normal end of a per-request connection."""


class Ready(NamedTuple):
    """The steps of a connection are done: its login has succeeded, and anybody may talk."""

    transport: str


class Samples(NamedTuple):
    """Readings out of frames that came in one go: in their order, each with what it computes."""

    transport: str
    """"" when no frame brought them: time alone began an alarm."""
    samples: tuple[Sample, ...]


class Replied(NamedTuple):
    """The request is done. `values` are the reply's groups by name."""

    id: int
    command: str
    values: Mapping[str, Reading] = NOTHING


class Failed(NamedTuple):
    """The request is over without success."""

    id: int
    command: str
    code: str
    """``timed-out``, ``refused``, ``disconnected``, ``bad-argument``, ``queue-full``, ``at-work``,
    ``unknown-command``, ``superseded``, ``not-allowed``, ``not-confirmed``,
    ``not-verified``, ``failed``."""
    message: str


class Fault(NamedTuple):
    """Something on the wire was not as declared: counted and shown, never raised."""

    transport: str
    code: str
    """``frame-too-long``, ``no-match``, ``bad-value``, ``bad-text``, ``cut-frame``,
    ``reply-timeout``, ``late-reply``, ``refused``, ``bad-argument``, ``silent``, ``failed``."""
    message: str


Event = Open | Send | Close | Ready | Samples | Replied | Failed | Fault
