"""A driver: what can be said to a robot, what it says back, and over which lines."""

from collections.abc import Mapping
from typing import Final, Literal, NamedTuple

from urc.expressions import ExpressionError, Template
from urc.model.codec import FramingSpec, ReadSpec, WriteSpec
from urc.model.flow import (
    Asides,
    Confirm,
    ErrorReply,
    Hold,
    Keepalive,
    Offline,
    Priority,
    Queue,
    Requirement,
    Retry,
    Stage,
    Verify,
)
from urc.model.sequence import ExpectStep, RunStep, Step, all_steps
from urc.model.values import NOTHING, ElementType, Reading, Signal, Value
from urc.patterns import Pattern

__all__ = [
    "MOST_ELEMENTS",
    "STOPPED",
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


class Timeouts(NamedTuple):
    """Every wait of a transport has one; seconds."""

    connect_s: float = 3.0
    reply_s: float = 2.0
    idle_s: float | None = None
    """Close a line that has been silent this long; None = never."""
    on_connect_s: float | None = None
    """For all steps of ``on_connect``; None: each has its own end, and all of them none."""


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
    options: Mapping[str, object] = NOTHING
    """What the transport's own factory takes, e.g. ``host`` and ``port``: plain values, templates
    over settings, and lists and mappings of them."""
    connection: Literal["persistent", "per_request"] = "persistent"
    framing: FramingSpec = FramingSpec()
    encoding: str = "utf-8"
    """Python codec name of text on this line."""
    timeouts: Timeouts = Timeouts()
    backoff: Backoff = Backoff()
    min_gap_s: float = 0.0
    """Shortest time between two requests on this line."""
    queue: Queue = Queue()
    keepalive: Keepalive | None = None
    on_connect: tuple[Step, ...] = ()
    """What makes a fresh connection usable; until then nothing else is sent on it."""
    on_close: tuple[Step, ...] = ()
    """What is said before the line is closed in good order."""
    stale_after_s: float | None = None
    """Silence after which the line is told to be silent; None = never."""
    via: str = ""
    """Transport that it goes through; "": none."""
    is_half_duplex: bool = False
    """One side talks at a time: nothing but a stop may overtake an answer that the robot owes."""
    never_answers: bool = False
    """The robot says nothing on this line, by design: its silence means nothing."""
    errors: tuple[Pattern, ...] = ()
    """Answers that mean failure, whatever was asked."""
    faults: tuple[ErrorReply, ...] = ()
    """As `errors`, of any form."""


class Reply(NamedTuple):
    """What answers a request; a frame that matches one of `errors` means that it failed."""

    read: ReadSpec
    errors: tuple[Pattern, ...] = ()
    timeout_s: float | None = None
    """None: the transport's ``timeouts.reply``."""
    match: Template | None = None
    """Whose answer it is: over the fields, the command's arguments, and ``seq.NAME``, the counters
    in the request. None: answers come in the order of the requests."""
    stages: tuple[Stage, ...] = ()
    """What must come after it until the request is done."""
    faults: tuple[ErrorReply, ...] = ()
    """Answers that mean failure, beside `errors`."""
    framing: FramingSpec | None = None
    """How the answer is cut; None: as everything else on the line."""
    asides: Asides = Asides()
    """What may come before its first answer."""

    def with_errors(self, errors: tuple[Pattern, ...], faults: tuple[ErrorReply, ...]) -> "Reply":
        """Return the reply with more answers that mean failure, at every stage."""
        if not (errors or faults):
            return self
        return self._replace(
            errors=(*self.errors, *errors),
            faults=(*self.faults, *faults),
            stages=tuple(
                one._replace(errors=(*one.errors, *errors), faults=(*one.faults, *faults))
                for one in self.stages
            ),
        )

    @property
    def names(self) -> set[str]:
        """What a step that runs the request knows afterwards: each field as ``_field``."""
        reads = (self.read, *(stage.read for stage in self.stages))
        return {f"_{name.lstrip('_')}" for read in reads for name in read.fields}

    @property
    def is_asked_again(self) -> bool:
        """Whether the robot may ask for the request again, at any stage."""
        asides = (self.asides, *(stage.asides for stage in self.stages))
        return any(one.resend is not None for one in asides)


MOST_ELEMENTS: Final = 1024
"""Of an array that is given to a command."""


class Argument(NamedTuple):
    """A typed argument of a command."""

    name: str
    type: Literal["integer", "number", "boolean", "string", "array"] = "number"
    title: str = ""
    unit: str = ""
    min: float | None = None
    max: float | None = None
    choices: tuple[Value, ...] = ()
    default: Reading = None
    is_required: bool = True
    allows_control: bool = False
    """Only for strings: control characters may pass (an argument can otherwise not end a frame)."""
    description: str = ""
    of: ElementType = "number"
    """Kind of the elements of an array, to each of which range and choices apply."""
    size: int | None = None
    """Elements of an array; None: any number up to `MOST_ELEMENTS`."""
    confirm: Mapping[str, Confirm] = NOTHING
    """Value, as it is written → the question before it is sent."""


STOPPED: Final = "STOP was pressed meanwhile: give it anew"
"""Why what moves is not sent when it was wished before a stop."""


class Command(NamedTuple):
    """A named action. A command without a reply is done when its bytes are handed over."""

    name: str
    transport: str
    send: WriteSpec
    arguments: Mapping[str, Argument] = NOTHING
    reply: Reply | None = None
    title: str = ""
    description: str = ""
    priority: Priority = "normal"
    is_latest_only: bool = False
    """A newer one takes the place of one that still waits to be sent."""
    rate_per_s: float | None = None
    """How often it is sent on average; two may follow each other at once. None: no limit."""
    is_idempotent: bool = False
    """Doing it twice is the same as once."""
    retries: int = 0
    """How often it is sent again at most: after a timeout where it is idempotent, and when the
    robot asks for it. 0: `RESENDS` times where the robot may ask."""
    retry: Retry = Retry()
    """How long it waits before each of them."""
    hold: Hold | None = None
    moves: bool = False
    """It moves something by itself, with no hand that holds it; true of a sequence that runs what
    does, or what is held."""
    moves_if: Template | None = None
    """Over its arguments: only then it does. None: whatever they are."""
    stops: bool = False
    """It is given once when STOP is pressed."""
    confirm: Confirm | None = None
    requires: tuple[Requirement, ...] = ()
    verify: Verify | None = None
    steps: tuple[Step, ...] = ()
    """Of a sequence: what it does instead of sending. `transport` is then the first that it uses,
    and `send` is empty."""

    def moves_with(self, arguments: Mapping[str, object]) -> bool:
        """Return whether it moves something with these; what cannot be told does."""
        if self.moves_if is None or not self.moves:
            return self.moves
        defaults = {name: one.default for name, one in self.arguments.items()}
        try:
            return bool(self.moves_if.evaluate({**defaults, **arguments}))
        except ExpressionError:
            return True


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
    run: str = ""
    """Command whose `send` and `reply` these are; "" when they are the poll's own."""
    arguments: Mapping[str, Reading] = NOTHING
    """Of the command in `run`, defaults included."""
    when: Template | None = None
    """Asked only while it holds, over fresh signals and settings."""
    priority: Priority = "low"
    offline: Offline | None = None


class Message(NamedTuple):
    """An incoming frame that answers nothing: which one it is, and which signals it sets."""

    name: str
    transport: str
    read: ReadSpec
    answer: WriteSpec | None = None
    """What is sent back at once."""


class Driver(NamedTuple):
    """Everything needed to talk to one kind of robot. Valid by construction of the loader."""

    transports: Mapping[str, TransportSpec] = NOTHING
    signals: Mapping[str, Signal] = NOTHING
    commands: Mapping[str, Command] = NOTHING
    messages: Mapping[str, Message] = NOTHING
    polls: tuple[Poll, ...] = ()
    discovery: tuple[str, ...] = ()
    """Types of services by which such robots announce themselves: ``_rosbridge._tcp``."""

    def learnt(self, transport: str) -> frozenset[str]:
        """Return the names that the login of a line reads: ``_nonce``; known while it is open."""
        names: set[str] = set()
        for step in all_steps(self.transports[transport].on_connect):
            if isinstance(step, ExpectStep):
                names |= {name for name in step.read.fields if name.startswith("_")}
            elif isinstance(step, RunStep) and step.command in self.commands:
                reply = self.commands[step.command].reply
                names |= reply.names if reply is not None else set()
        return frozenset(names)
