"""JSON messages of the HTTP API about robots, in snake case.

Layer 5. Pure. Times are in seconds.
"""

from typing import Annotated, Any, Final, Literal

import msgspec

from urc.model.role import Role
from urc.model.values import Alarm
from urc.wire.client_messages import Arguments, Verb

__all__ = [
    "LONGEST_TIMEOUT_S",
    "ActiveAlarms",
    "ArgumentInfo",
    "BatteryLevel",
    "CommandAnswer",
    "CommandAsked",
    "CommandInfo",
    "ConfirmInfo",
    "ConnectionInfo",
    "HoldInfo",
    "LeaseAnswer",
    "LeaseAsked",
    "MotionAnswer",
    "MotionAsked",
    "MotionNotice",
    "RecordingInfo",
    "RecordingList",
    "RecordingState",
    "RobotInfo",
    "RobotList",
    "RobotSummary",
    "SignalInfo",
    "SignalValue",
    "SignalValues",
]

LONGEST_TIMEOUT_S: Final = 600.0

_Word = Annotated[str, msgspec.Meta(max_length=200)]
_Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]


class ApiMessage(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The base class of all messages in this module."""


class ConnectionInfo(ApiMessage, frozen=True):
    """One connection of a robot."""

    transport: str
    state: Literal["idle", "connecting", "live", "silent", "lost"]
    """``idle``: URC is not connected, because no client needs the robot."""
    address: str = ""
    detail: str = ""
    """Reason for an abnormal state, in one line."""


class BatteryLevel(ApiMessage, frozen=True):
    """The state of charge of a robot's battery, or its voltage."""

    value: float
    unit: str
    alarm: Alarm = ""
    """Exceeded limit of the signal."""


class ActiveAlarms(ApiMessage, frozen=True):
    """The alarms of a robot at this moment."""

    count: int = 0
    worst: str = ""
    """Highest priority of all alarms; "" without an alarm."""


class RobotSummary(ApiMessage, frozen=True):
    """A robot in a list."""

    name: str
    """Name of the robot in paths."""
    title: str
    summary: str
    tags: tuple[str, ...]
    state: Literal["idle", "connecting", "live", "silent", "lost"]
    """The worst state of all connections; ``idle`` without a session."""
    holder: str
    """Name of the operator who drives; "" if no operator drives."""
    latched: str
    """Name of the operator who pressed STOP; "" while STOP is not latched."""
    emulated: bool
    """Whether the robot is emulated, or is the playback of a recording."""
    role: Role
    """Role of the visitor at this robot."""
    connected: bool = False
    """Whether URC connects to the robot, because a page or program needs it."""
    detail: str = ""
    """Reason for an abnormal state, in one line."""
    battery: BatteryLevel | None = None
    """null: the robot has no signal of this kind, or its value is unknown or stale."""
    alarms: ActiveAlarms = ActiveAlarms()
    used_at: float | None = None
    """Time at which a page or program last used the robot, in seconds since 1970 (UTC)."""
    seen_at: float | None = None
    """Time at which a connection to the robot was last live, in seconds since 1970 (UTC)."""


class RobotList(ApiMessage, frozen=True):
    """The robots that the visitor may watch, in the order of `urc.web.api.overview.in_order`."""

    robots: tuple[RobotSummary, ...]
    time: float = 0.0
    """Time of the server, in seconds since 1970 (UTC)."""


class ConfirmInfo(ApiMessage, frozen=True):
    """A question that must be confirmed before a command is sent."""

    text: str
    level: Literal["normal", "hazardous"]
    two_person: bool
    """Whether a second person must agree; then the command needs a page."""


class ArgumentInfo(ApiMessage, frozen=True):
    """An argument of a command."""

    name: str
    type: Literal["integer", "number", "boolean", "string", "array"]
    title: str
    description: str
    unit: str
    min: float | None
    max: float | None
    choices: tuple[Any, ...]
    default: Any
    required: bool
    items: str
    """Type of the elements of an array; "" for other types."""
    size: int | None
    """Number of elements of an array; None: any number."""
    confirm: dict[str, ConfirmInfo]
    """Questions by argument value."""


class HoldInfo(ApiMessage, frozen=True):
    """Motion under a lease: the robot moves only while motion requests arrive."""

    period_s: float
    """Period at which the server sends setpoints to the robot."""
    lease_s: float
    """Time without a motion request after which the robot stops."""
    release: dict[str, Any]
    """Arguments that stop the robot."""


class CommandInfo(ApiMessage, frozen=True):
    """A command or sequence of a robot."""

    name: str
    title: str
    description: str
    role: Role
    """Role that the command needs."""
    allowed: bool
    """Whether the visitor's role and the scope of its token permit the command."""
    moves: bool
    """Whether the command starts autonomous motion."""
    stops: bool
    """Whether STOP sends the command."""
    sequence: bool
    hold: HoldInfo | None
    """Terms of a held command, which needs motion requests; None for other commands."""
    confirm: ConfirmInfo | None
    arguments: tuple[ArgumentInfo, ...]


class SignalInfo(ApiMessage, frozen=True):
    """A signal of a robot."""

    name: str
    type: Literal["integer", "number", "boolean", "string", "array", "object", "image", "blob"]
    title: str
    description: str
    unit: str
    min: float | None
    max: float | None
    precision: int | None
    states: dict[str, str]
    """Displayed words by raw text, for enumerated signals."""
    limits: dict[str, float]
    """Alarm limits by name: ``lolo``, ``low``, ``high``, ``hihi``."""
    stale_after_s: float
    axes: str
    items: str
    """Type of the elements of an array; "" for other types."""


class RobotInfo(ApiMessage, frozen=True):
    """A robot with its signals and commands."""

    robot: RobotSummary
    missing: tuple[str, ...]
    """Names of required settings without a value, which prevent a connection."""
    connections: tuple[ConnectionInfo, ...]
    confirmed: bool
    """Whether the last stop has reached the robot."""
    stops: int
    """Number of STOPs since the server started."""
    signals: tuple[SignalInfo, ...]
    commands: tuple[CommandInfo, ...]


class SignalValue(ApiMessage, frozen=True):
    """The latest value of a signal."""

    value: Any
    """Value; null: unknown, or “not available”. An image is an object with its number of bytes."""
    age_s: float | None
    """Age of the value; null: no value has arrived yet."""
    stale: bool
    """Whether the value is missing, or older than the signal permits."""
    alarm: Alarm = ""
    """Crossed limit, or severity of an alarm state; empty: no alarm."""


class SignalValues(ApiMessage, frozen=True):
    """Latest values of several signals."""

    time: float
    """Time of the server, in seconds since 1970 (UTC)."""
    values: dict[str, SignalValue]
    """Values by signal."""


class CommandAsked(ApiMessage, frozen=True):
    """A command with its arguments."""

    arguments: Arguments = {}
    timeout_s: Annotated[float, msgspec.Meta(ge=0.01, le=LONGEST_TIMEOUT_S)] | None = None
    """Longest wait for the reply; null: 30 s for a command, 600 s for a sequence."""
    confirmed: bool = False
    """Whether a person has confirmed the question of the command."""
    stops: _Count | None = None
    """Number of STOPs that the program knew; the command is refused after a newer STOP."""
    session: _Word = ""
    """Secret of the session from the lease; "" without a lease."""


class CommandAnswer(ApiMessage, frozen=True):
    """The reply to a command."""

    values: dict[str, Any]
    """Values of the reply, by field."""


class LeaseAsked(ApiMessage, frozen=True):
    """A request about the controls of a robot."""

    verb: Verb | Literal["keep"]
    """``keep`` changes nothing, and only keeps the session open."""
    for_s: Annotated[float, msgspec.Meta(ge=0, le=600)] = 10.0
    """Time for the holder's answer to ``ask``, 3 to 60 s."""
    session: _Word = ""
    """Secret of an open session; "" opens a session."""


class MotionNotice(ApiMessage, frozen=True):
    """A report about the controls since the last answer."""

    kind: Literal["refused", "stopped"]
    about: str
    """Name of the held command or request."""
    message: str


class LeaseAnswer(ApiMessage, frozen=True):
    """State of the controls, for one session."""

    session: str
    """Secret of the session, for further requests; "" after its end."""
    name: str
    """Name of the program, as operators see it."""
    drives: bool
    """Whether this session has the controls."""
    epoch: int
    """Number of the lease; motion requests repeat it."""
    holder: str
    """Name of the operator who has the controls; "" without one."""
    asker: str
    """Name of the operator who asks for the controls; "" without one."""
    latched: str
    """Name of the operator who pressed STOP; "" while STOP is not latched."""
    stops: int
    """Number of STOPs since the server started."""
    beat: int | None
    """Newest heartbeat number, which the next motion request repeats; null without controls."""
    idle_s: float
    """Time without a request after which the session ends."""
    notices: tuple[MotionNotice, ...] = ()


class MotionAsked(ApiMessage, frozen=True):
    """The newest input of a held command; silence longer than its lease stops the robot."""

    session: _Word
    command: _Word
    epoch: _Count
    """Number of the lease, from the lease answer."""
    number: _Count
    """Number of this input; it grows with every input of the command."""
    beat: _Count
    """Newest heartbeat number that the program has received, at most 0.4 s old."""
    arguments: Arguments = {}
    release: bool = False
    """Whether the control is released; the robot stops at once."""


class MotionAnswer(ApiMessage, frozen=True):
    """State after an input."""

    epoch: int
    beat: int | None
    """Newest heartbeat number, for the next motion request."""
    queued: bool
    """Whether the input waits a few milliseconds, because inputs arrive too fast."""
    notices: tuple[MotionNotice, ...] = ()


class RecordingInfo(ApiMessage, frozen=True):
    """A file with a recording."""

    file: str
    """Name of the file in paths."""
    robot: str
    """Name of the recorded robot."""
    began: str
    """Start of the recording (UTC), in the form ``20261123T141502Z``."""
    bytes: int
    active: bool
    """Whether this server writes the file at the request of a program."""


class RecordingList(ApiMessage, frozen=True):
    """Recordings, newest first."""

    recordings: tuple[RecordingInfo, ...]


class RecordingState(ApiMessage, frozen=True):
    """State of the recording that a program has started."""

    active: bool
    file: str
    """Name of the file; "" before its creation."""
    messages: int
    """Number of messages written so far."""
    fault: str
    """Reason why the recording has stopped; "" without a fault."""
