"""The messages between the engine's process and the guard.

A message is a MessagePack array whose first element is its type. `line` is the name of a transport,
`control` that of a held command. `turn` is the number of times that the engine has opened the line.
Messages of an earlier turn are dropped.
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
    """Create a transport without opening it."""

    line: str
    factory: str
    """``module:attribute``, as in the table of transports."""
    options: dict[str, Any]
    subscriptions: list[tuple[str, dict[str, Any]]]
    tunnel: str
    """Line that carries this one, created before; "" without one."""
    stalled_s: float
    """Age of unsent motion at which the line counts as stalled, in seconds. A stalled line is
    reset.
    """
    is_strict: bool
    """Whether the line is slow to open: then nothing is written while any byte is unsent."""
    silent_s: float | None = None
    """Silence of a moving robot after which the line is reset, in seconds; None: unlimited."""


class OpenLine(msgspec.Struct, array_like=True, frozen=True, tag=2):
    """Open a line; answered by `LineOpened` or `OpenFailed`."""

    line: str
    turn: int
    timeout_s: float


class SendBytes(msgspec.Struct, array_like=True, frozen=True, tag=3):
    """Send a frame that is no motion; answered by `SendDone` or `SendRefused`."""

    line: str
    turn: int
    number: int
    """Number of the frame on this connection."""
    data: Payload
    count: Count | None = None
    """Counter values of the frame, if any: it is sent only while these are the next ones."""
    round: int = 0
    """Number of `SendStale` messages before it on this connection; otherwise it is not sent."""


class CloseLine(msgspec.Struct, array_like=True, frozen=True, tag=4):
    """Close a line; moving controls are stopped before. Answered by `LineClosed`."""

    line: str
    turn: int


class FlowCredit(msgspec.Struct, array_like=True, frozen=True, tag=5):
    """The engine has processed this many bytes from a line."""

    line: str
    turn: int
    amount: int


class ArmControl(msgspec.Struct, array_like=True, frozen=True, tag=6):
    """Accept ticks of a control."""

    line: str
    control: str
    terms: HoldTerms


class RenewLease(msgspec.Struct, array_like=True, frozen=True, tag=7):
    """A tick of sampled input: it renews the lease of a control."""

    control: str
    number: int
    """Number of the tick of this control."""
    data: Payload
    at_s: float
    """Time of the sample on this machine's monotonic clock. A delayed tick keeps its age."""
    count: Count | None = None
    """Counter values, as in `SendBytes`."""


class ReleaseControl(msgspec.Struct, array_like=True, frozen=True, tag=8):
    """A control was released."""

    control: str


class StopMotion(msgspec.Struct, array_like=True, frozen=True, tag=9):
    """Stop these controls, moving or not: line, control and terms of each."""

    controls: list[tuple[str, str, HoldTerms]]


class RecoverStop(msgspec.Struct, array_like=True, frozen=True, tag=10):
    """A control was moving when the previous guard died: open its line, and stop it first."""

    line: str
    control: str
    terms: HoldTerms


class ReplaceStop(msgspec.Struct, array_like=True, frozen=True, tag=11):
    """Replace the stop frame of a control: the counter value of the old one is used up."""

    control: str
    stop: Payload
    stops: tuple[Numbered, ...] = ()


class LineOpened(msgspec.Struct, array_like=True, frozen=True, tag=21):
    """A line is open."""

    line: str
    turn: int
    address: str
    """Address for people; it may be more precise than before."""
    stand: dict[str, int] = {}
    """Counter values that stops have used already."""


class OpenFailed(msgspec.Struct, array_like=True, frozen=True, tag=22):
    """A line could not be opened."""

    line: str
    turn: int
    message: str


class BytesReceived(msgspec.Struct, array_like=True, frozen=True, tag=23):
    """Bytes or an envelope arrived."""

    line: str
    turn: int
    data: Payload


class SendDone(msgspec.Struct, array_like=True, frozen=True, tag=24):
    """All frames up to this number were handed over."""

    line: str
    turn: int
    number: int


class SendRefused(msgspec.Struct, array_like=True, frozen=True, tag=25):
    """A frame could not be sent."""

    line: str
    turn: int
    number: int
    message: str
    is_closed: bool
    """Whether the line is closed."""


class LineLost(msgspec.Struct, array_like=True, frozen=True, tag=26):
    """A line is lost: nothing more will arrive."""

    line: str
    turn: int
    message: str


class LineClosed(msgspec.Struct, array_like=True, frozen=True, tag=27):
    """A line was closed on request."""

    line: str
    turn: int


class StopWritten(msgspec.Struct, array_like=True, frozen=True, tag=28):
    """The stop of a control was written."""

    control: str
    reason: Reason
    number: int
    """Number of the newest tick at that time."""


class Heartbeat(msgspec.Struct, array_like=True, frozen=True, tag=29):
    """The guard is alive."""

    late_s: float
    """Delay of the guard's own timer, in seconds."""


class CountersAdvanced(msgspec.Struct, array_like=True, frozen=True, tag=30):
    """Frames with counters have been sent."""

    line: str
    turn: int
    sent: int
    """Number of the newest `SendBytes` with counters that was sent."""
    stand: dict[str, int]
    """Counter → last value sent."""
    stale: list[tuple[str, int]]
    """Control and number of ticks that cannot be sent: other frames used their counter values."""


class SendStale(msgspec.Struct, array_like=True, frozen=True, tag=31):
    """A `SendBytes` and all later ones of its round were not sent: its counters are used up."""

    line: str
    turn: int
    number: int
    """Number of the first frame that was not sent."""
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

    The encoder raises `TypeError`, `OverflowError` or `NotImplementedError` for a body that cannot
    be encoded, never `msgspec.EncodeError`.
    """
    return msgspec.msgpack.Encoder(enc_hook=_plain)


def decoder_of_guard() -> msgspec.msgpack.Decoder[ToGuard]:
    """Return the decoder of the guard."""
    return msgspec.msgpack.Decoder(ToGuard)


def decoder_of_server() -> msgspec.msgpack.Decoder[FromGuard]:
    """Return the decoder of the engine's side."""
    return msgspec.msgpack.Decoder(FromGuard)
