"""A driver: what can be said to a robot, what it says back, and over which lines."""

from collections.abc import Mapping
from typing import Literal, NamedTuple

from urc.expressions import Template
from urc.model.codec import ReadSpec, WriteSpec
from urc.model.values import NOTHING, Signal, Value
from urc.patterns import Pattern

__all__ = [
    "Argument",
    "Backoff",
    "Command",
    "Driver",
    "FramingSpec",
    "Message",
    "Poll",
    "Reply",
    "ScalarOrTemplate",
    "Timeouts",
    "TransportSpec",
]

ScalarOrTemplate = bool | int | float | str | None | Template
"""An option as written: a plain value, or a template over ``settings``."""


class FramingSpec(NamedTuple):
    """How a byte stream is cut into frames. `type` is a row of the framings table."""

    type: str = "delimiter"
    options: Mapping[str, object] = NOTHING
    """As parsed by the loader: for ``delimiter``, ``tx`` and ``rx`` as bytes."""
    max_bytes: int = 65536
    """Longest frame accepted; a longer one is dropped and counted."""


class Timeouts(NamedTuple):
    """Every wait of a transport has one; seconds."""

    connect_s: float = 3.0
    reply_s: float = 2.0
    idle_s: float | None = None
    """Close a line that has been silent this long; None = never."""


class Backoff(NamedTuple):
    """Waits between attempts to connect, doubling from `initial_s` to `max_s`, in seconds."""

    initial_s: float = 0.25
    max_s: float = 5.0
    jitter: float = 0.2
    """Share of each wait that is random, 0..1."""


class TransportSpec(NamedTuple):
    """One connection of a driver. `type` is a row of the transports table."""

    name: str
    type: str
    options: Mapping[str, ScalarOrTemplate] = NOTHING
    """What the transport's own factory takes, e.g. ``host`` and ``port``."""
    connection: Literal["persistent", "per_request"] = "persistent"
    framing: FramingSpec = FramingSpec()
    encoding: str = "utf-8"
    """Python codec name of text on this line."""
    timeouts: Timeouts = Timeouts()
    backoff: Backoff = Backoff()
    min_gap_s: float = 0.0
    """Shortest time between two requests on this line."""


class Reply(NamedTuple):
    """What answers a request; a frame that matches one of `errors` means that it failed."""

    read: ReadSpec
    errors: tuple[Pattern, ...] = ()
    timeout_s: float | None = None
    """None: the transport's ``timeouts.reply``."""


class Argument(NamedTuple):
    """A typed argument of a command."""

    name: str
    type: Literal["integer", "number", "boolean", "string"] = "number"
    title: str = ""
    unit: str = ""
    min: float | None = None
    max: float | None = None
    choices: tuple[Value, ...] = ()
    default: Value = None
    is_required: bool = True
    allows_control: bool = False
    """Only for strings: control characters may pass (an argument can otherwise not end a frame)."""
    description: str = ""


class Command(NamedTuple):
    """A named action. A command without a reply is done when its bytes are handed over."""

    name: str
    transport: str
    send: WriteSpec
    arguments: Mapping[str, Argument] = NOTHING
    reply: Reply | None = None
    title: str = ""
    description: str = ""


class Poll(NamedTuple):
    """A request that is repeated for as long as the robot is connected."""

    name: str
    """``polls.0``, or its ``name:``."""
    transport: str
    every_s: float
    send: WriteSpec
    reply: Reply | None = None
    phase_s: float = 0.0
    """Delay of the first one after the connection."""


class Message(NamedTuple):
    """An incoming frame that answers nothing: which one it is, and which signals it sets."""

    name: str
    transport: str
    read: ReadSpec


class Driver(NamedTuple):
    """Everything needed to talk to one kind of robot. Valid by construction of the loader."""

    transports: Mapping[str, TransportSpec] = NOTHING
    signals: Mapping[str, Signal] = NOTHING
    commands: Mapping[str, Command] = NOTHING
    messages: Mapping[str, Message] = NOTHING
    polls: tuple[Poll, ...] = ()
