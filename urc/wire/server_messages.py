"""The types of server messages, which are identified by their tag ``t``.

Layer 3½. Pure. `urc.web.wire` encodes these messages, and `urc.client` decodes them. Times are in
milliseconds on the server's monotonic clock; ages are in milliseconds at the moment of encoding.
Images are binary messages; see `urc.wire.picture`.
"""

from collections.abc import Mapping, Sequence

import msgspec

from urc.model.role import Role
from urc.model.values import AlarmPriority

__all__ = [
    "CLOSE_BAD_MESSAGES",
    "CLOSE_FAILED",
    "CLOSE_FULL",
    "CLOSE_NOT_LET_IN",
    "CLOSE_NOT_READY",
    "CLOSE_NO_ROBOT",
    "CLOSE_TOO_FAST",
    "VERSION",
    "Outbound",
    "SignalRow",
    "HelloMessage",
    "ValuesMessage",
    "LinkRow",
    "LinksMessage",
    "LogRow",
    "LogMessage",
    "ReplyMessage",
    "PongMessage",
    "ErrorMessage",
    "OperatorRow",
    "LeaseMessage",
    "InputRow",
    "HeartbeatMessage",
    "StoppedMessage",
    "RefusedMessage",
    "QuestionMessage",
    "QuestionEndMessage",
    "TokenMessage",
    "SequenceRow",
    "GoalRow",
    "ProgressMessage",
    "TopicMismatchRow",
    "TopicsMessage",
    "AlarmRow",
    "AlarmsMessage",
    "ServerMessage",
]

VERSION = 1
"""Version of the message format, sent in `HelloMessage`."""
CLOSE_BAD_MESSAGES = 4400
CLOSE_NOT_LET_IN = 4401
CLOSE_NO_ROBOT = 4404
CLOSE_NOT_READY = 4409
CLOSE_TOO_FAST = 4429
CLOSE_FAILED = 4500
CLOSE_FULL = 4503


class Outbound(msgspec.Struct, tag_field="t", omit_defaults=True, frozen=True):
    """The base class of all text messages to a page."""


class SignalRow(msgspec.Struct, omit_defaults=True, frozen=True):
    """The description of one signal, as in `urc.model.values.Signal`."""

    name: str
    type: str
    title: str = ""
    unit: str = ""
    min: float | None = None
    max: float | None = None
    precision: int | None = None
    states: dict[str, str] | None = None
    limits: dict[str, float] | None = None
    stale_after_s: float = 0.0
    sources: tuple[str, ...] = ()
    """Transports that supply the signal's readings; if none is connected, the value is stale
    immediately."""
    axes: str = ""
    """The signal's axis convention; "" if unknown."""
    has_alarms: bool = False
    """Whether a limit or state of the signal can cause an alarm."""
    priorities: dict[str, AlarmPriority] | None = None
    """Priority of each limit and alarm state; None if all have their usual priority: ``high`` for
    ``lolo`` and ``hihi``, otherwise ``medium``."""
    frozen_after_s: float | None = None
    """Time in seconds after which equal images of a video count as one image; None means never."""


class HelloMessage(Outbound, tag="hello", omit_defaults=False, frozen=True):
    """The first message: the robot, and the signal names that later messages refer to by index."""

    version: int
    session: str
    """The session's identifier; log line numbers restart in each new session."""
    robot: str
    title: str
    now: int
    names: tuple[str, ...]
    signals: list[SignalRow]
    roles: dict[str, Role] = {}
    """Lowest role that may run each command, keyed by command."""
    controls: tuple[str, ...] = ()
    """Names of the held commands."""
    pictures: str = ""
    """Secret key for the page's socket for images; "" if the server has no such socket."""


class ValuesMessage(Outbound, tag="v", frozen=True):
    """Changed signals: `i` holds name indexes, `v` values and `s` alarms (None if all are normal).

    A signal with a history may have several values, oldest first; `e` maps the signal's index to
    the number of the first value. `n` is the server's time in milliseconds.
    """

    n: int
    i: msgspec.Raw
    v: Sequence[object]
    a: int | Sequence[int]
    """Ages of the values in milliseconds; a single number if all ages are equal."""
    s: Sequence[str] | None = None
    e: Mapping[int, int] | None = None


class LinkRow(msgspec.Struct, frozen=True):
    """The state of one transport; `since` is the duration of this state, in milliseconds."""

    transport: str
    state: str
    address: str
    since: int
    detail: str
    attempts: int
    faults: int
    cause: str = ""
    """Name of the cause of a lost connection; "" for an unknown cause."""
    ready: bool = False
    """Whether the connection is open and its login has ended, even if no data has arrived yet."""


class LinksMessage(Outbound, tag="links", omit_defaults=False, frozen=True):
    """The state of every transport."""

    links: list[LinkRow]


class TopicMismatchRow(msgspec.Struct, omit_defaults=True, frozen=True):
    """One difference between the driver's topics and those of a ROS robot."""

    code: str
    """Kind of the difference, as in `urc.runtime.topic_check.TopicMismatch`."""
    topic: str
    found: str = ""
    """Type or ROS version of the robot."""
    wanted: str = ""
    """Type or ROS version of the driver."""
    commands: tuple[str, ...] = ()
    """Commands that publish the topic."""
    signals: tuple[str, ...] = ()
    """Signals that the topic sets."""


class TopicsMessage(Outbound, tag="topics", omit_defaults=False, frozen=True):
    """All differences between the driver's topics and those of a ROS robot."""

    mismatches: list[TopicMismatchRow]


class LogRow(msgspec.Struct, frozen=True):
    """One line of the log; `age` is in milliseconds."""

    age: int
    level: str
    source: str
    text: str


class LogMessage(Outbound, tag="log", omit_defaults=False, frozen=True):
    """New lines of the log, oldest first; a gap in the numbers means that lines were dropped."""

    first: int
    """Number of this message's first log line, counted from 0 in each session."""
    lines: list[LogRow]


class ReplyMessage(Outbound, tag="reply", frozen=True):
    """The only reply to a command: its values, or the `code` and `message` of its failure."""

    id: int
    ok: bool
    values: Mapping[str, object] | None = None
    code: str = ""
    message: str = ""


class PongMessage(Outbound, tag="pong", frozen=True):
    """The reply to a ping with the same `c`; `n` is the server's time in milliseconds."""

    c: float
    n: int
    u: int = 0
    """The server's time in milliseconds since 1970; omitted if unknown."""


class ErrorMessage(Outbound, tag="error", frozen=True):
    """The reason why a message was invalid, or why the server closes the socket."""

    code: str
    message: str


class OperatorRow(msgspec.Struct, frozen=True):
    """A page or program that may hold the lease."""

    id: str
    name: str


class LeaseMessage(Outbound, tag="lease", omit_defaults=False, frozen=True):
    """The robot's lease: its holder, the client that requests it and the latch of STOP."""

    you: str
    name: str
    """The page's name, as shown on other pages."""
    epoch: int
    holder: OperatorRow | None
    asker: OperatorRow | None
    left: int
    """Time until the asking page gets the controls, in milliseconds."""
    latched: str
    """Name of the operator who pressed STOP; "" while STOP is not latched."""
    stops: int
    """Number of presses of STOP since the server started."""
    confirmed: bool
    """Whether all transports of the robot have accepted the stop, and the robot has answered all
    cancellations of goals."""
    drives: bool
    """Whether the page may drive."""
    forces: bool
    """Whether the page may take the lease from another page without that page's consent."""
    spare: str
    """Secret key for the page's redundant socket; "" for watchers."""
    role: Role | None = None
    """The page's role for the robot; None if the page has no rights."""
    override: int = 0
    """Time for which the holder may still drive without an image, in milliseconds."""
    limit: str = ""
    """Why the robot's site limits the role of a visitor from another site; "" if it does not."""


class InputRow(msgspec.Struct, frozen=True):
    """The newest tick from another site; see `urc.motion.link_age`."""

    age: int
    """Age at the arrival, in milliseconds."""
    percent: int
    """Permitted share of the requested speed, in percent."""


class HeartbeatMessage(Outbound, tag="beat", frozen=True):
    """A heartbeat number for the client that drives; the client echoes the number in its ticks."""

    n: int
    input: InputRow | None = None
    """The client's newest tick; None for clients of the robot's own site, and without recent ticks.
    """


class StoppedMessage(Outbound, tag="stopped", frozen=True):
    """A report that a control stopped before its release; it moves only after a new gesture."""

    command: str
    reason: str


class RefusedMessage(Outbound, tag="refused", frozen=True):
    """The refusal of a tick or of a request about the controls."""

    about: str
    message: str
    command: str = ""


class QuestionMessage(Outbound, tag="ask", omit_defaults=False, frozen=True):
    """A question to a second person; the asking page receives a copy."""

    n: int
    """The question's number."""
    id: int
    """Number that the asking page gave the command; 0 in messages to other pages."""
    who: str
    command: str
    text: str
    level: str
    left: int
    """Time until the question expires, in milliseconds."""


class QuestionEndMessage(Outbound, tag="asked", frozen=True):
    """A report that question `n` is over: answered, withdrawn or expired."""

    n: int


class TokenMessage(Outbound, tag="token", omit_defaults=False, frozen=True):
    """The token that allows the command `id` once, for a few seconds."""

    id: int
    token: str


class SequenceRow(msgspec.Struct, omit_defaults=False, frozen=True):
    """The progress of one sequence, as in `urc.runtime.hub.SequenceProgress`."""

    command: str
    place: int
    of: int
    state: str
    reason: str


class GoalRow(msgspec.Struct, omit_defaults=True, frozen=True):
    """One command with autonomous motion, as in `urc.runtime.running_goals.RunningGoal`."""

    number: int
    command: str
    places: Mapping[str, object]
    """Arguments of the command that are numbers or lists of numbers."""
    by: str
    """Name of the operator who has started it."""
    page: str
    """Identifier of the operator's page, as in `LeaseMessage.you`."""
    since: int
    """Time since its start, in milliseconds."""
    lost: bool = False
    """Whether its reply can't arrive any more, although the robot may go on."""
    title: str = ""
    """Title of the command; "" without one."""


class ProgressMessage(Outbound, tag="progress", omit_defaults=False, frozen=True):
    """The state of all sequences, and the commands that now move the robot.

    `moving` contains the unanswered commands and the running sequences with autonomous motion, of
    all pages and programs.
    """

    sequences: list[SequenceRow]
    moving: list[str] = []
    goals: list[GoalRow] = []
    """The unanswered commands with autonomous motion, oldest first, and goals whose reply is
    lost."""


class AlarmRow(msgspec.Struct, omit_defaults=True, frozen=True):
    """One alarm, as in `urc.alarms.record.AlarmRecord`; times are in ms since 1970."""

    signal: str
    condition: str
    priority: str
    state: str
    """State of the alarm: ``unacknowledged``, ``acknowledged``, ``returned``, ``shelved`` or
    ``suppressed``."""
    number: int
    """Number of the activation; these numbers give the first-out order."""
    group: int
    """Number of the alarm burst to which the alarm belongs."""
    raised: int
    """Number that the page repeats when it acknowledges the alarm."""
    began: int
    value: str = ""
    active: bool = False
    known: bool = False
    """Whether the signal's current value is known."""
    times: int = 1
    returned: int = 0
    acknowledged: int = 0
    acknowledged_by: str = ""
    shelved_until: int = 0
    shelved_by: str = ""
    cause: str = ""
    action: str = ""
    command: str = ""
    """Command that carries out the action."""
    title: str = ""
    """The signal's title."""


class AlarmsMessage(Outbound, tag="alarms", frozen=True):
    """The robot's changed alarms, or all non-normal alarms if `full` is set."""

    now: int
    """Server time in ms since 1970."""
    rows: list[AlarmRow]
    gone: tuple[str, ...] = ()
    """Names of the signals whose alarms have become normal."""
    full: bool = False
    flood: bool = False
    """Whether more than 10 alarms began within 10 minutes."""


ServerMessage = (
    HelloMessage
    | ValuesMessage
    | LinksMessage
    | LogMessage
    | ReplyMessage
    | PongMessage
    | ErrorMessage
    | LeaseMessage
    | HeartbeatMessage
    | StoppedMessage
    | RefusedMessage
    | QuestionMessage
    | QuestionEndMessage
    | TokenMessage
    | ProgressMessage
    | AlarmsMessage
    | TopicsMessage
)
"""Every text message that the server sends."""
