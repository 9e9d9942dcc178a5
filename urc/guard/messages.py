"""What the engine's process and the guard say to each other.

Each message is an array in MessagePack whose first element says what it is. `line` is the name of a
transport, `control` that of a held command, and `turn` counts how often the engine has opened a
line: what belongs to an earlier connection is nobody's.
"""

from collections.abc import Mapping
from typing import Any

import msgspec

from urc.model.payload import Count, Numbered, Payload
from urc.motion.hold_to_run import HoldTerms, Reason

__all__ = [
    "ArmControl",
    "Heartbeat",
    "CloseLine",
    "LineClosed",
    "CountersAdvanced",
    "FlowCredit",
    "FromGuard",
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
    "StopMotion",
    "StopWritten",
    "RenewLease",
    "ToGuard",
    "decoder_of_guard",
    "decoder_of_server",
    "encoder",
]


class MakeTransport(msgspec.Struct, array_like=True, frozen=True, tag=1):
    """Make a transport; it is not opened."""

    line: str
    factory: str
    """``module:attribute``, as in the table of transports."""
    options: dict[str, Any]
    subscriptions: list[tuple[str, dict[str, Any]]]
    tunnel: str
    """Line that it goes through, made before; "": none."""
    stalled_s: float
    """Unsent motion of this age means that the line is stalled: it is reset and opened afresh."""
    is_strict: bool
    """Opening it is dear: nothing is written while anything is unsent, however young."""
    silent_s: float | None = None
    """While something moves, a robot that says nothing for so long stands still: the line is reset
    and opened afresh. None: nothing is expected of it."""


class OpenLine(msgspec.Struct, array_like=True, frozen=True, tag=2):
    """Open a line; answered by `LineOpened` or `OpenFailed`."""

    line: str
    turn: int
    timeout_s: float


class SendBytes(msgspec.Struct, array_like=True, frozen=True, tag=3):
    """Send what is no motion; answered by `SendDone` or `SendRefused`."""

    line: str
    turn: int
    number: int
    """Counts up with each of a connection."""
    data: Payload
    count: Count | None = None
    """Where it carries numbers of counters: it is sent only while these are next."""
    round: int = 0
    """How many `SendStale` of the connection it comes after; else it is not sent."""


class CloseLine(msgspec.Struct, array_like=True, frozen=True, tag=4):
    """Close a line; what moves is stopped before. Answered by `LineClosed`."""

    line: str
    turn: int


class FlowCredit(msgspec.Struct, array_like=True, frozen=True, tag=5):
    """The engine has taken so much of what a line brought."""

    line: str
    turn: int
    amount: int


class ArmControl(msgspec.Struct, array_like=True, frozen=True, tag=6):
    """Take ticks of a control."""

    line: str
    control: str
    terms: HoldTerms


class RenewLease(msgspec.Struct, array_like=True, frozen=True, tag=7):
    """Sampled input: renews the lease of a control."""

    control: str
    number: int
    """Counts up with each of a control."""
    data: Payload
    at_s: float
    """When it was taken, on this machine's monotonic clock: one that waited here is as old."""
    count: Count | None = None
    """As with `SendBytes`."""


class ReleaseControl(msgspec.Struct, array_like=True, frozen=True, tag=8):
    """A control was let go."""

    control: str


class StopMotion(msgspec.Struct, array_like=True, frozen=True, tag=9):
    """Stop, whatever moves: line, control and terms of each."""

    controls: list[tuple[str, str, HoldTerms]]


class RecoverStop(msgspec.Struct, array_like=True, frozen=True, tag=10):
    """A control was moving when the guard before this one died: open its line, stop it first."""

    line: str
    control: str
    terms: HoldTerms


class ReplaceStop(msgspec.Struct, array_like=True, frozen=True, tag=11):
    """Stop a control with these bytes from now on: the number in those before is used up."""

    control: str
    stop: Payload
    stops: tuple[Numbered, ...] = ()


class LineOpened(msgspec.Struct, array_like=True, frozen=True, tag=21):
    """A line is open."""

    line: str
    turn: int
    address: str
    """Where it leads, for people; may be known better now."""
    stand: dict[str, int] = {}
    """Counters that stops have used already."""


class OpenFailed(msgspec.Struct, array_like=True, frozen=True, tag=22):
    """A line could not be opened."""

    line: str
    turn: int
    message: str


class BytesReceived(msgspec.Struct, array_like=True, frozen=True, tag=23):
    """Something arrived."""

    line: str
    turn: int
    data: Payload


class SendDone(msgspec.Struct, array_like=True, frozen=True, tag=24):
    """Everything up to this number was handed over."""

    line: str
    turn: int
    number: int


class SendRefused(msgspec.Struct, array_like=True, frozen=True, tag=25):
    """Something could not be sent."""

    line: str
    turn: int
    number: int
    message: str
    is_closed: bool
    """Whether the line is closed."""


class LineLost(msgspec.Struct, array_like=True, frozen=True, tag=26):
    """Nothing more will come from a line."""

    line: str
    turn: int
    message: str


class LineClosed(msgspec.Struct, array_like=True, frozen=True, tag=27):
    """A line that was to be closed is."""

    line: str
    turn: int


class StopWritten(msgspec.Struct, array_like=True, frozen=True, tag=28):
    """The stop of a control was written."""

    control: str
    reason: Reason
    number: int
    """Of the newest tick by then."""


class Heartbeat(msgspec.Struct, array_like=True, frozen=True, tag=29):
    """The guard is alive."""

    late_s: float
    """By how much its own timer was late."""


class CountersAdvanced(msgspec.Struct, array_like=True, frozen=True, tag=30):
    """Frames with counters have left."""

    line: str
    turn: int
    sent: int
    """Number of the newest `SendBytes` with counters among them."""
    stand: dict[str, int]
    """Counter → the last number that has left."""
    stale: list[tuple[str, int]]
    """Control and number of ticks that cannot be written: another frame has used their numbers."""


class SendStale(msgspec.Struct, array_like=True, frozen=True, tag=31):
    """A `SendBytes` and all that follow it in its round were not sent: its numbers were used up."""

    line: str
    turn: int
    number: int
    """Of that one."""
    stand: dict[str, int]


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
    | Heartbeat
    | CountersAdvanced
    | SendStale
)


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return dict(value)
    raise NotImplementedError(f"{type(value).__name__} cannot be passed on")


def encoder() -> msgspec.msgpack.Encoder:
    """Return an encoder of either side's messages.

    It raises `TypeError`, `OverflowError` or `NotImplementedError` for a body that no message can
    carry, and `msgspec.EncodeError` is none of them.
    """
    return msgspec.msgpack.Encoder(enc_hook=_plain)


def decoder_of_guard() -> msgspec.msgpack.Decoder[ToGuard]:
    """Return what the guard reads with."""
    return msgspec.msgpack.Decoder(ToGuard)


def decoder_of_server() -> msgspec.msgpack.Decoder[FromGuard]:
    """Return what the engine's side reads with."""
    return msgspec.msgpack.Decoder(FromGuard)
