"""JSON messages of the HTTP API for robots; the keys are in snake case.

Layer 5. Pure. Times are in seconds.
"""

from typing import Annotated, Any, Final, Literal

import msgspec

from urc.model.role import Role
from urc.model.values import Alarm, SignalType
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
    "SiteState",
    "RobotSummary",
    "SignalInfo",
    "SignalValue",
    "SignalValues",
]

LONGEST_TIMEOUT_S: Final = 600.0

_Word = Annotated[str, msgspec.Meta(max_length=200)]
_Count = Annotated[int, msgspec.Meta(ge=0, le=2**53)]


class ApiMessage(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base class of all messages in this module."""


class ConnectionInfo(ApiMessage, frozen=True):
    """The state of one of a robot's connections."""

    transport: str
    state: Literal["idle", "connecting", "live", "silent", "lost"]
    """``idle`` means that URC is not connected, because no client needs the robot."""
    address: str = ""
    """Display text for the target, such as ``tcp 192.168.1.5:6789``."""
    detail: str = ""
    """Reason for an abnormal state, as one line of text."""


class BatteryLevel(ApiMessage, frozen=True):
    """The state of charge or the voltage of a robot's battery."""

    value: float
    """Charge or voltage, in `unit`."""
    unit: str
    """Unit symbol of the signal, such as ``%`` or ``V``."""
    alarm: Alarm = ""
    """Exceeded limit, or severity of an alarm state; "" if there is no alarm."""


class ActiveAlarms(ApiMessage, frozen=True):
    """Number and highest priority of a robot's current alarms."""

    count: int = 0
    """Number of annunciated alarms: all except normal, shelved and suppressed alarms."""
    worst: str = ""
    """Highest priority of the annunciated alarms; "" if there are no such alarms."""


class RobotSummary(ApiMessage, frozen=True):
    """A robot in the list of robots."""

    name: str
    """The robot's name in URLs."""
    title: str
    summary: str
    tags: tuple[str, ...]
    state: Literal["idle", "connecting", "live", "silent", "lost"]
    """Worst state of all connections; ``idle`` if no session is open."""
    holder: str
    """Name of the operator who drives; "" if no operator drives."""
    latched: str
    """Name of the operator who pressed STOP; "" while STOP is not latched."""
    emulated: bool
    """Whether the robot is emulated, or is the playback of a recording."""
    role: Role
    """The visitor's role for this robot."""
    connected: bool = False
    """Whether a session is open, because a page or program needs the robot."""
    detail: str = ""
    """Reason for an abnormal state, as one line of text."""
    battery: BatteryLevel | None = None
    """Battery level; null if there is no battery signal, or if its value is unknown or stale."""
    alarms: ActiveAlarms = ActiveAlarms()
    used_at: float | None = None
    """Time of the last use by a page or program, in seconds since 1970 (UTC)."""
    seen_at: float | None = None
    """Last time at which a connection to the robot was live, in seconds since 1970 (UTC)."""
    can_stop: bool = False
    """Whether the STOP of several robots includes the robot: it can move and has all settings."""
    confirmed: bool = False
    """Whether the robot has confirmed its last stop."""


class SiteState(ApiMessage, frozen=True):
    """Another site of the fleet."""

    name: str
    version: str
    """Version of URC at the site; empty if unknown."""
    present: bool
    """Whether the site can be reached now."""
    fault: str = ""
    """Why its robots cannot be used, although the site can be reached; empty if they can."""


class RobotList(ApiMessage, frozen=True):
    """The robots that the visitor may watch, in the order of `urc.web.api.overview.in_order`."""

    robots: tuple[RobotSummary, ...]
    time: float = 0.0
    """Current time on the server, in seconds since 1970 (UTC)."""
    sites: tuple[SiteState, ...] = ()
    """Other sites of the fleet, for visitors who may watch all robots."""


class ConfirmInfo(ApiMessage, frozen=True):
    """A confirmation question, which a person must answer before a command is sent."""

    text: str
    """The question, as shown to the person."""
    level: Literal["normal", "hazardous"]
    two_person: bool
    """Whether a second person must approve; only pages can send such a command."""


class ArgumentInfo(ApiMessage, frozen=True):
    """An argument of a command."""

    name: str
    type: Literal["integer", "number", "boolean", "string", "array"]
    title: str
    description: str
    unit: str
    """Unit symbol, such as ``m/s``; "" if the argument has no unit."""
    min: float | None
    """Minimum, in `unit`; null if there is no minimum."""
    max: float | None
    """Maximum, in `unit`; null if there is no maximum."""
    choices: tuple[Any, ...]
    """Permitted values; empty if every value in the range is permitted."""
    default: Any
    """Value of an omitted argument; null if there is no default."""
    required: bool
    """Whether the argument must be given."""
    items: str
    """Type of the elements of an array; "" for other types."""
    size: int | None
    """Required number of elements of an array; null for any number."""
    confirm: dict[str, ConfirmInfo]
    """Confirmation questions, keyed by the argument value that requires the question."""


class HoldInfo(ApiMessage, frozen=True):
    """Motion under a lease: the robot moves only while motion requests arrive."""

    period_s: float
    """Interval between the setpoints that the server sends to the robot, in seconds."""
    lease_s: float
    """Time from the last motion request until the robot stops, in seconds."""
    release: dict[str, Any]
    """Argument values that stop the robot."""


class CommandInfo(ApiMessage, frozen=True):
    """A command or sequence of a robot."""

    name: str
    title: str
    description: str
    role: Role
    """Role required for the command."""
    allowed: bool
    """Whether the visitor's role and token scope permit the command."""
    moves: bool
    """Whether the command starts autonomous motion."""
    stops: bool
    """Whether STOP sends the command."""
    sequence: bool
    """Whether the command is a sequence of steps."""
    hold: HoldInfo | None
    """Timing of a held command, which needs motion requests; null for other commands."""
    confirm: ConfirmInfo | None
    """Confirmation question; null if the command needs no confirmation."""
    arguments: tuple[ArgumentInfo, ...]


class SignalInfo(ApiMessage, frozen=True):
    """A signal of a robot."""

    name: str
    type: SignalType
    title: str
    description: str
    unit: str
    """Unit symbol, such as ``m/s``; "" if the signal has no unit."""
    min: float | None
    """Minimum valid value, in `unit`; null if there is no minimum."""
    max: float | None
    """Maximum valid value, in `unit`; null if there is no maximum."""
    precision: int | None
    """Number of displayed digits after the decimal point; null if undeclared."""
    states: dict[str, str]
    """Display text for each raw value, for enumerated signals."""
    limits: dict[str, float]
    """Alarm limits, keyed by name: ``lolo``, ``low``, ``high``, ``hihi``."""
    stale_after_s: float
    """Age in seconds after which a value is stale; 0 if values never become stale."""
    axes: str
    """Axis convention of the value, such as ``FLU``; "" if undeclared."""
    items: str
    """Type of the elements of an array; "" for other types."""


class RobotInfo(ApiMessage, frozen=True):
    """A robot with its signals and commands."""

    robot: RobotSummary
    missing: tuple[str, ...]
    """Names of required settings without a value; URC connects only after all of them are set."""
    connections: tuple[ConnectionInfo, ...]
    confirmed: bool
    """Whether the robot has received the last stop."""
    stops: int
    """Number of STOP presses since the server started."""
    signals: tuple[SignalInfo, ...]
    commands: tuple[CommandInfo, ...]


class SignalValue(ApiMessage, frozen=True):
    """The latest value of a signal."""

    value: Any
    """Null if unknown or “not available”; an image is an object with the image's size in bytes."""
    age_s: float | None
    """Age of the value, in seconds; null if no value has arrived yet."""
    stale: bool
    """Whether the value is missing, or older than the signal's `stale_after`."""
    alarm: Alarm = ""
    """Exceeded limit, or severity of an alarm state; "" if there is no alarm."""


class SignalValues(ApiMessage, frozen=True):
    """Latest values of several signals."""

    time: float
    """Current time on the server, in seconds since 1970 (UTC)."""
    values: dict[str, SignalValue]
    """Values by signal."""


class CommandAsked(ApiMessage, frozen=True):
    """A command with its arguments."""

    arguments: Arguments = {}
    """Argument values, keyed by argument; an omitted argument takes its default."""
    timeout_s: Annotated[float, msgspec.Meta(ge=0.01, le=LONGEST_TIMEOUT_S)] | None = None
    """Longest wait for the reply, in seconds; null means 30, or 600 for a sequence."""
    confirmed: bool = False
    """Whether a person has confirmed the command."""
    stops: _Count | None = None
    """Number of STOP presses last known to the program; the command is refused after a newer
    STOP."""
    session: _Word = ""
    """Session secret from the lease response; "" if the program has no lease."""


class CommandAnswer(ApiMessage, frozen=True):
    """The reply to a command."""

    values: dict[str, Any]
    """Values of the reply, keyed by field name."""


class LeaseAsked(ApiMessage, frozen=True):
    """A request about a robot's lease or latched STOP."""

    verb: Verb | Literal["keep"]
    """Requested action; ``keep`` only keeps the session open."""
    for_s: Annotated[float, msgspec.Meta(ge=0, le=600)] = 10.0
    """Time limit for the holder's answer to ``ask``, in seconds, clamped to the range 3 to 60."""
    session: _Word = ""
    """Secret of an open session; "" opens a new session."""
    stops: int | None = None
    """Number of STOP presses, as stated in the last response. A reset is refused if STOP has been
    pressed again since then; null means the current number."""


class MotionNotice(ApiMessage, frozen=True):
    """A notice about the controls since the last response."""

    kind: Literal["refused", "stopped"]
    about: str
    """Name of the held command or request that the notice is about."""
    message: str
    """Reason for the notice, as one line of text."""


class LeaseAnswer(ApiMessage, frozen=True):
    """State of a robot's controls, as reported to one session."""

    session: str
    """Session secret for further requests; "" after the session has ended."""
    name: str
    """Name of the program as shown to operators."""
    drives: bool
    """Whether this session holds the lease and may therefore drive the robot."""
    epoch: int
    """Number of the lease; motion requests must repeat the number."""
    holder: str
    """Name of the operator in control; "" if no operator is in control."""
    asker: str
    """Name of the operator who requests control; "" if there is no request."""
    latched: str
    """Name of the operator who pressed STOP; "" while STOP is not latched."""
    stops: int
    """Number of STOP presses since the server started."""
    beat: int | None
    """Newest heartbeat number, for the next motion request; null if the session does not drive."""
    idle_s: float
    """Time for which the session stays open after its last request, in seconds."""
    notices: tuple[MotionNotice, ...] = ()
    """Notices since the last response."""


class MotionAsked(ApiMessage, frozen=True):
    """The newest input for a held command. A pause longer than the lease stops the robot."""

    session: _Word
    """Session secret from the lease response."""
    command: _Word
    """Name of a held command."""
    epoch: _Count
    """Number of the lease, from the lease response."""
    number: _Count
    """Number of this input; each new input for the command needs a higher number than the last."""
    beat: _Count
    """Number of the newest received heartbeat, which must be at most 0.4 s old."""
    arguments: Arguments = {}
    """Argument values, keyed by argument; an omitted argument takes its default."""
    release: bool = False
    """Whether the control is released; a release stops the robot immediately."""


class MotionAnswer(ApiMessage, frozen=True):
    """State of the controls after an input."""

    epoch: int
    """Number of the lease; motion requests must repeat the number."""
    beat: int | None
    """Newest heartbeat number, for the next motion request."""
    queued: bool
    """Whether the input is delayed by a few milliseconds because inputs arrive too fast."""
    notices: tuple[MotionNotice, ...] = ()
    """Notices since the last response."""


class RecordingInfo(ApiMessage, frozen=True):
    """A recording file."""

    file: str
    """Name of the file, as used in URLs."""
    robot: str
    """Name of the recorded robot."""
    began: str
    """Start of the recording (UTC), in the form ``20261123T141502Z``."""
    bytes: int
    active: bool
    """Whether a program's recording is currently writing the file."""


class RecordingList(ApiMessage, frozen=True):
    """Recordings, newest first."""

    recordings: tuple[RecordingInfo, ...]


class RecordingState(ApiMessage, frozen=True):
    """State of a recording that a program started."""

    active: bool
    file: str
    """File name; "" before the file is created."""
    messages: int
    """Number of messages written so far."""
    fault: str
    """Reason why the recording failed; "" if it has not failed."""
