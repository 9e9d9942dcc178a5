"""The messages between the engine's process and the guard process.

Each message is a MessagePack array that begins with the message type. `line` is a transport's name,
and `control` is a held command's name. `turn` counts how many times the engine has opened the
connection. The receiver drops messages with an earlier `turn`.
"""

from collections.abc import Mapping
from math import inf
from typing import Any

import msgspec

from urc.model.payload import Count, Numbered, Payload
from urc.motion.hold_to_run import HoldTerms, Reason
from urc.transports.base import GoalRecord

__all__ = [
    "ArmControl",
    "Heartbeat",
    "CloseLine",
    "LineClosed",
    "CountersAdvanced",
    "FlowCredit",
    "FromGuard",
    "GoalsChanged",
    "LineLost",
    "MakeTransport",
    "OpenLine",
    "OpenFailed",
    "LineOpened",
    "RecoverStop",
    "BytesReceived",
    "SendRefused",
    "ReleaseControl",
    "ReplaceStop",
    "SendBytes",
    "SendDone",
    "SendStale",
    "StopDue",
    "StopMotion",
    "StopWritten",
    "RenewLease",
    "ToGuard",
    "decoder_of_guard",
    "decoder_of_server",
    "encoder",
]


class MakeTransport(msgspec.Struct, array_like=True, frozen=True, tag=1):
    """Create a transport in the guard; `OpenLine` opens the transport."""

    line: str
    factory: str
    """The transport's factory as ``module:attribute``, as listed in the table of transports."""
    options: dict[str, Any]
    subscriptions: list[tuple[str, dict[str, Any]]]
    tunnel: str
    """Name of the previously created tunnel that carries this transport; "" if there is no
    tunnel."""
    stalled_s: float
    """Age of unsent motion data at which a connection counts as stalled and is reset, in seconds.
    """
    is_strict: bool
    """Whether the transport is slow to open; if so, a motion frame is written only when no bytes
    are unsent.
    """
    silent_s: float | None = None
    """Maximum silence of a moving robot before the connection is reset, in seconds; None means
    unlimited."""
    goals: GoalRecord = GoalRecord()
    """Goals that an earlier guard has started or cancelled."""


class OpenLine(msgspec.Struct, array_like=True, frozen=True, tag=2):
    """Open a connection; the answer is `LineOpened` or `OpenFailed`."""

    line: str
    turn: int
    timeout_s: float


class SendBytes(msgspec.Struct, array_like=True, frozen=True, tag=3):
    """Send a frame that causes no motion; the answer is `SendDone` or `SendRefused`."""

    line: str
    turn: int
    number: int
    """Number of the frame, counted separately for each connection."""
    data: Payload
    count: Count | None = None
    """Counter values of the frame; None for a frame without counters. The frame is sent only if
    each value directly follows the last sent value."""
    round: int = 0
    """Number of `SendStale` messages that the engine has received on this connection. The guard
    drops the frame if the guard has sent a different number of these messages."""


class CloseLine(msgspec.Struct, array_like=True, frozen=True, tag=4):
    """Stop all controls that move the robot and close the connection; reply with `LineClosed`."""

    line: str
    turn: int


class FlowCredit(msgspec.Struct, array_like=True, frozen=True, tag=5):
    """The engine's acknowledgement that it has processed `amount` bytes from a connection."""

    line: str
    turn: int
    amount: int


class ArmControl(msgspec.Struct, array_like=True, frozen=True, tag=6):
    """Arm a control: accept its ticks from now on."""

    line: str
    control: str
    terms: HoldTerms


class RenewLease(msgspec.Struct, array_like=True, frozen=True, tag=7):
    """A tick of sampled input, which renews a control's lease."""

    control: str
    number: int
    """Number of the tick, counted separately for each control."""
    data: Payload
    at_s: float
    """Time of the sample on this machine's monotonic clock, in seconds. A delayed tick keeps its
    original time."""
    count: Count | None = None
    """Counter values of the frame, as in `SendBytes`."""
    until_s: float = inf
    """Time at which the operator's image becomes too old, on the same clock as `at_s`. The lease
    ends at this time at the latest."""


class ReleaseControl(msgspec.Struct, array_like=True, frozen=True, tag=8):
    """The operator released a control, so the guard must stop its motion."""

    control: str


class StopMotion(msgspec.Struct, array_like=True, frozen=True, tag=9):
    """Stop the listed controls, even if idle; each entry contains line, control and terms."""

    controls: list[tuple[str, str, HoldTerms]]


class RecoverStop(msgspec.Struct, array_like=True, frozen=True, tag=10):
    """Reopen a connection to stop a control that was moving the robot when the last guard died."""

    line: str
    control: str
    terms: HoldTerms


class ReplaceStop(msgspec.Struct, array_like=True, frozen=True, tag=11):
    """Replace a control's stop frame, because the old frame's counter value is already used."""

    control: str
    stop: Payload
    stops: tuple[Numbered, ...] = ()


class EndCancellations(msgspec.Struct, array_like=True, frozen=True, tag=12):
    """End a transport's unanswered cancellations of STOP, because STOP was reset."""

    line: str
    actions: tuple[str, ...]
    """The actions of which STOP has cancelled all goals."""


class LineOpened(msgspec.Struct, array_like=True, frozen=True, tag=21):
    """A connection was opened."""

    line: str
    turn: int
    address: str
    """Address to display, which may be more precise than the configured address."""
    stand: dict[str, int] = {}
    """Counter values that stop frames have already used."""


class OpenFailed(msgspec.Struct, array_like=True, frozen=True, tag=22):
    """A connection could not be opened."""

    line: str
    turn: int
    message: str


class BytesReceived(msgspec.Struct, array_like=True, frozen=True, tag=23):
    """Bytes or an envelope was received on a connection."""

    line: str
    turn: int
    data: Payload
    is_new: bool = True
    """Whether the remote program has sent data since the last message of this type. It has not if
    the transport itself has made the envelope, or has held it back."""


class SendDone(msgspec.Struct, array_like=True, frozen=True, tag=24):
    """All frames up to `number` were handed to the transport."""

    line: str
    turn: int
    number: int


class SendRefused(msgspec.Struct, array_like=True, frozen=True, tag=25):
    """A `SendBytes` frame could not be sent."""

    line: str
    turn: int
    number: int
    message: str
    is_closed: bool
    """Whether the frame was refused because the connection is closed."""


class LineLost(msgspec.Struct, array_like=True, frozen=True, tag=26):
    """A connection was lost; no more data will arrive."""

    line: str
    turn: int
    message: str


class LineClosed(msgspec.Struct, array_like=True, frozen=True, tag=27):
    """A connection was closed on request."""

    line: str
    turn: int


class StopWritten(msgspec.Struct, array_like=True, frozen=True, tag=28):
    """A control's stop frame was written."""

    control: str
    reason: Reason
    number: int
    """Number of the control's newest tick before the stop."""


class StopDue(msgspec.Struct, array_like=True, frozen=True, tag=32):
    """A control's stop may have been lost with the connection; the guard first repeats the stop."""

    control: str


class Heartbeat(msgspec.Struct, array_like=True, frozen=True, tag=29):
    """Periodic proof that the guard is alive."""

    late_s: float
    """Delay with which the guard's timer sent this heartbeat, in seconds."""


class CountersAdvanced(msgspec.Struct, array_like=True, frozen=True, tag=30):
    """The guard has sent frames with counters."""

    line: str
    turn: int
    sent: int
    """Number of the newest sent `SendBytes` with counters."""
    stand: dict[str, int]
    """Last sent value of each counter, keyed by the counter's name."""
    stale: list[tuple[str, int]]
    """Control and number of each tick that cannot be sent, because other frames used its counter
    values."""


class SendStale(msgspec.Struct, array_like=True, frozen=True, tag=31):
    """A `SendBytes` with used counter values, and all later `SendBytes`, were refused."""

    line: str
    turn: int
    number: int
    """Number of the first frame that was not sent."""
    stand: dict[str, int]


class GoalsChanged(msgspec.Struct, array_like=True, frozen=True, tag=33):
    """A transport's unfinished goals or cancellations have changed; sent before a new goal is."""

    line: str
    record: GoalRecord


ToGuard = (
    MakeTransport
    | OpenLine
    | SendBytes
    | CloseLine
    | FlowCredit
    | ArmControl
    | RenewLease
    | ReleaseControl
    | ReplaceStop
    | StopMotion
    | RecoverStop
    | EndCancellations
)
FromGuard = (
    LineOpened
    | OpenFailed
    | BytesReceived
    | SendDone
    | SendRefused
    | LineLost
    | LineClosed
    | StopWritten
    | StopDue
    | Heartbeat
    | CountersAdvanced
    | SendStale
    | GoalsChanged
)


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return dict(value)
    raise NotImplementedError(f"{type(value).__name__} cannot be passed on")


def encoder() -> msgspec.msgpack.Encoder:
    """Return a new encoder for messages from either side.

    For an unsupported body, the encoder raises `TypeError`, `OverflowError` or
    `NotImplementedError`, never `msgspec.EncodeError`.
    """
    return msgspec.msgpack.Encoder(enc_hook=_plain)


def decoder_of_guard() -> msgspec.msgpack.Decoder[ToGuard]:
    """Return the guard's decoder, for messages from the engine."""
    return msgspec.msgpack.Decoder(ToGuard)


def decoder_of_server() -> msgspec.msgpack.Decoder[FromGuard]:
    """Return the engine's decoder, for messages from the guard."""
    return msgspec.msgpack.Decoder(FromGuard)
