"""The driver for one kind of robot: transports, signals, commands, messages and polls."""

from collections.abc import Mapping
from typing import Final, Literal, NamedTuple

from urc.expressions import ExpressionError, Template
from urc.model.exchange import (
    Confirm,
    ErrorReply,
    Hold,
    Keepalive,
    Offline,
    Priority,
    ProvisionalReplies,
    Queue,
    Requirement,
    Retry,
    Stage,
    Verify,
)
from urc.model.payload import FramingSpec, ReadSpec, WriteSpec
from urc.model.role import Role
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
    "Timeouts",
    "TransportSpec",
    "slowed_arguments",
]


class Timeouts(NamedTuple):
    """Timeouts of a transport, in seconds."""

    connect_s: float = 3.0
    reply_s: float = 2.0
    idle_s: float | None = None
    """Time without received data after which the connection is closed, in seconds; None: never."""
    on_connect_s: float | None = None
    """Timeout for all steps of ``on_connect`` together, in seconds; None means that only the
    timeouts of the individual steps apply."""


class Backoff(NamedTuple):
    """Delays between connection attempts, doubling from `initial_s` to `max_s`, in seconds."""

    initial_s: float = 0.25
    max_s: float = 5.0
    jitter: float = 0.2
    """Fraction of each delay that is random, 0 to 1."""


class TransportSpec(NamedTuple):
    """A transport of a driver; `type` is a transport type, such as ``tcp``."""

    name: str
    type: str
    options: Mapping[str, object] = NOTHING
    """Options of the transport, such as ``host`` and ``port``. Each option is a plain value, a
    template using settings, or a list or mapping of plain values and templates."""
    connection: Literal["persistent", "per_request"] = "persistent"
    framing: FramingSpec = FramingSpec()
    encoding: str = "utf-8"
    """Name of the Python codec for text on this connection."""
    timeouts: Timeouts = Timeouts()
    backoff: Backoff = Backoff()
    min_gap_s: float = 0.0
    """Minimum time between two requests on this connection, in seconds."""
    queue: Queue = Queue()
    keepalive: Keepalive | None = None
    on_connect: tuple[Step, ...] = ()
    """Steps that prepare a new connection; other requests wait until all steps are complete."""
    on_close: tuple[Step, ...] = ()
    """Steps that run before the connection is closed in an orderly way."""
    stale_after_s: float | None = None
    """Time without received data after which the connection is stale, in seconds; None means
    never."""
    tunnel: str = ""
    """Name of the transport that tunnels this connection; "" means no tunnel."""
    is_half_duplex: bool = False
    """Whether the connection is half-duplex. In half-duplex mode, only a stop may be sent before
    the reply to the previous request arrives."""
    never_replies: bool = False
    """Whether the robot never sends on this connection, so that silence does not indicate a lost
    connection."""
    errors: tuple[Pattern, ...] = ()
    """Patterns of error replies to any request."""
    faults: tuple[ErrorReply, ...] = ()
    """Error replies to any request, in forms other than a pattern."""
    hint: str = ""
    """Next step for the operator while the transport cannot connect; "" means the default step for
    the cause."""

    @property
    def has_keys(self) -> bool:
        """Whether the topics of this transport are Zenoh keys."""
        return self.type == "zenoh"

    @property
    def is_camera(self) -> bool:
        """Whether this is the video of a camera, which accepts no data and moves nothing.

        Cameras therefore stay out of the guard. Their data is not recorded as traffic, because
        their signals contain all of it.
        """
        return self.type == "camera"


class Reply(NamedTuple):
    """The reply to a request; a frame that matches one of `errors` reports a failure."""

    read: ReadSpec
    errors: tuple[Pattern, ...] = ()
    timeout_s: float | None = None
    """Reply timeout, in seconds; None means the transport's ``timeouts.reply``."""
    match: Template | None = None
    """Condition that identifies the reply to a request, using the reply's fields, the command's
    arguments, and the request's counters (``seq.NAME``). Without a condition, replies must arrive
    in the order of the requests."""
    stages: tuple[Stage, ...] = ()
    """Replies that must follow the first reply before the request is complete."""
    faults: tuple[ErrorReply, ...] = ()
    """Error replies in forms other than a pattern, in addition to `errors`."""
    framing: FramingSpec | None = None
    """Framing of the reply; None means the connection's framing."""
    asides: ProvisionalReplies = ProvisionalReplies()
    """Provisional replies that may precede the first reply."""

    def with_errors(self, errors: tuple[Pattern, ...], faults: tuple[ErrorReply, ...]) -> "Reply":
        """Return the reply with additional error replies at every stage."""
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
        """Names of the reply's fields for later steps, such as ``_field`` for ``field``."""
        reads = (self.read, *(stage.read for stage in self.stages))
        return {f"_{name.lstrip('_')}" for read in reads for name in read.fields}

    @property
    def is_asked_again(self) -> bool:
        """Whether the robot may request a retransmission at any stage."""
        asides = (self.asides, *(stage.asides for stage in self.stages))
        return any(one.resend is not None for one in asides)


MOST_ELEMENTS: Final = 1024
"""Maximum number of elements in an array argument."""


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
    """Whether a string may contain control characters, such as the delimiter of a frame."""
    description: str = ""
    items: ElementType = "number"
    """Type of an array's elements; range and choices apply to each element."""
    size: int | None = None
    """Required number of elements of an array; None means any number up to `MOST_ELEMENTS`."""
    confirm: Mapping[str, Confirm] = NOTHING
    """Confirmation questions, keyed by argument value as written in the document."""


STOPPED: Final = "STOP was pressed meanwhile: send it again"
"""Reason for refusing a motion request made before the last STOP."""


class Command(NamedTuple):
    """A named action.

    A command without a reply is complete when the transport has accepted the command's bytes.
    """

    name: str
    transport: str
    send: WriteSpec
    arguments: Mapping[str, Argument] = NOTHING
    reply: Reply | None = None
    title: str = ""
    description: str = ""
    priority: Priority = "normal"
    is_latest_only: bool = False
    """Whether a new call of the command replaces a queued call."""
    rate_per_s: float | None = None
    """Average rate limit in calls per second, with bursts of two calls; None means unlimited."""
    is_idempotent: bool = False
    """Whether repeating the command has the same effect as sending it once."""
    retries: int = 0
    """Maximum number of retries after a timeout of an idempotent command, or at the robot's
    request. If the robot may request retransmissions, 0 means `RESENDS`."""
    retry: Retry = Retry()
    """Delays before the retries."""
    hold: Hold | None = None
    moves: bool = False
    """Whether the command starts autonomous motion. `moves` is also true for a sequence that runs a
    held command or a command that starts autonomous motion."""
    moves_if: Template | None = None
    """Condition on the arguments under which a call starts autonomous motion; None means that every
    call starts motion if `moves` is true."""
    stops: bool = False
    """Whether STOP sends this command; each STOP sends it once."""
    role: Role = "drive"
    """Role that a visitor needs for the command: ``drive``, ``maintain`` or ``administer``. A
    sequence requires at least the roles of the commands that it runs. STOP requires no role."""
    confirm: Confirm | None = None
    requires: tuple[Requirement, ...] = ()
    verify: Verify | None = None
    steps: tuple[Step, ...] = ()
    """Steps of a sequence; () for a plain command. For a sequence, `send` is empty, and `transport`
    is the first transport of the steps."""

    def moves_with(self, arguments: Mapping[str, object]) -> bool:
        """Return whether a call with `arguments` starts motion; True if `moves_if` fails."""
        if self.moves_if is None or not self.moves:
            return self.moves
        defaults = {name: one.default for name, one in self.arguments.items()}
        try:
            return bool(self.moves_if.evaluate({**defaults, **arguments}))
        except ExpressionError:
            return True


def slowed_arguments(command: Command) -> dict[str, Reading]:
    """Return the arguments of a held command that set its speed, with their values at rest.

    These are the numeric arguments without choices that ``release`` names, or whose default is 0.
    A value closer to rest may be a higher speed for any other argument, such as a gain.
    """
    release = command.hold.release if command.hold is not None else NOTHING
    found: dict[str, Reading] = {}
    for name, one in command.arguments.items():
        kind = one.items if one.type == "array" else one.type
        rest = release.get(name, one.default)
        if (
            kind in ("integer", "number")
            and not one.choices
            and (name in release or _is_zero(rest))
        ):
            found[name] = rest
    return found


def _is_zero(value: Reading) -> bool:
    """Return whether a value is the number 0, or a list of zeros."""
    items = value if isinstance(value, (tuple, list)) else (value,)
    return bool(items) and all(type(one) in (int, float) and one == 0 for one in items)


class Poll(NamedTuple):
    """A request that is repeated while the robot is connected."""

    name: str
    """Name of the poll: the value of ``name``, or a generated name such as ``polls.0``."""
    transport: str
    every_s: float
    send: WriteSpec
    reply: Reply | None = None
    phase_s: float = 0.0
    """Delay from the opening of the connection to the first request, in seconds."""
    run: str = ""
    """Command that supplies the poll's `send` and `reply`; "" means that the poll declares both."""
    arguments: Mapping[str, Reading] = NOTHING
    """Arguments of the command in `run`, including defaults."""
    when: Template | None = None
    """Condition for sending the request, using fresh signals and settings; None means that the
    request is always sent."""
    priority: Priority = "low"
    offline: Offline | None = None


class LogLine(NamedTuple):
    """The log entry that a message becomes; its expressions use the message's fields."""

    text: Template
    level: Template | None = None
    """Expression for the level: ``info``, ``warning`` or ``error``. If the result is empty, there
    is no entry. None means ``info``."""


class Message(NamedTuple):
    """A declared unsolicited frame and the signals that it updates."""

    name: str
    transport: str
    read: ReadSpec
    acknowledge: WriteSpec | None = None
    """Frame that immediately acknowledges the message; None means no acknowledgement."""
    log: LogLine | None = None
    """Log entry about the message; None means no entry."""


class Driver(NamedTuple):
    """The complete declaration of one kind of robot, validated by the loader."""

    transports: Mapping[str, TransportSpec] = NOTHING
    signals: Mapping[str, Signal] = NOTHING
    commands: Mapping[str, Command] = NOTHING
    messages: Mapping[str, Message] = NOTHING
    polls: tuple[Poll, ...] = ()
    discovery: tuple[str, ...] = ()
    """DNS-SD service types of the robots, such as ``_rosbridge._tcp``."""

    def learnt(self, transport: str) -> frozenset[str]:
        """Return the names of the fields that a login reads, such as ``_nonce``.

        Fields from the login are available while the connection is open.
        """
        names: set[str] = set()
        for step in all_steps(self.transports[transport].on_connect):
            if isinstance(step, ExpectStep):
                names |= {name for name in step.read.fields if name.startswith("_")}
            elif isinstance(step, RunStep) and step.command in self.commands:
                reply = self.commands[step.command].reply
                names |= reply.names if reply is not None else set()
        return frozenset(names)
