"""What the engine's process and the guard say to each other.

Each message is an array in MessagePack whose first element says what it is. `line` is the name of a
transport, `control` that of a held command, and `turn` counts how often the engine has opened a
line: what belongs to an earlier connection is nobody's.
"""

from collections.abc import Mapping
from typing import Any

import msgspec

from urc.model.codec import Count, Numbered, Payload
from urc.motion.hold import Reason, Terms

__all__ = [
    "Arm",
    "Beat",
    "Close",
    "Closed",
    "Counted",
    "Credit",
    "FromGuard",
    "Lost",
    "Make",
    "Open",
    "OpenFailed",
    "Opened",
    "Owe",
    "Received",
    "Refused",
    "Release",
    "Renew",
    "Send",
    "Sent",
    "Stale",
    "Stop",
    "Stopped",
    "Tick",
    "ToGuard",
    "decoder_of_guard",
    "decoder_of_server",
    "encoder",
]


class Make(msgspec.Struct, array_like=True, frozen=True, tag=1):
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


class Open(msgspec.Struct, array_like=True, frozen=True, tag=2):
    """Open a line; answered by `Opened` or `OpenFailed`."""

    line: str
    turn: int
    timeout_s: float


class Send(msgspec.Struct, array_like=True, frozen=True, tag=3):
    """Send what is no motion; answered by `Sent` or `Refused`."""

    line: str
    turn: int
    number: int
    """Counts up with each of a connection."""
    data: Payload
    count: Count | None = None
    """Where it carries numbers of counters: it is sent only while these are next."""
    round: int = 0
    """How many `Stale` of the connection it comes after; else it is not sent."""


class Close(msgspec.Struct, array_like=True, frozen=True, tag=4):
    """Close a line; what moves is stopped before. Answered by `Closed`."""

    line: str
    turn: int


class Credit(msgspec.Struct, array_like=True, frozen=True, tag=5):
    """The engine has taken so much of what a line brought."""

    line: str
    turn: int
    amount: int


class Arm(msgspec.Struct, array_like=True, frozen=True, tag=6):
    """Take ticks of a control."""

    line: str
    control: str
    terms: Terms


class Tick(msgspec.Struct, array_like=True, frozen=True, tag=7):
    """Sampled input: renews the lease of a control."""

    control: str
    number: int
    """Counts up with each of a control."""
    data: Payload
    at_s: float
    """When it was taken, on this machine's monotonic clock: one that waited here is as old."""
    count: Count | None = None
    """As with `Send`."""


class Release(msgspec.Struct, array_like=True, frozen=True, tag=8):
    """A control was let go."""

    control: str


class Stop(msgspec.Struct, array_like=True, frozen=True, tag=9):
    """Stop, whatever moves: line, control and terms of each."""

    controls: list[tuple[str, str, Terms]]


class Owe(msgspec.Struct, array_like=True, frozen=True, tag=10):
    """A control was moving when the guard before this one died: open its line, stop it first."""

    line: str
    control: str
    terms: Terms


class Renew(msgspec.Struct, array_like=True, frozen=True, tag=11):
    """Stop a control with these bytes from now on: the number in those before is used up."""

    control: str
    stop: Payload
    stops: tuple[Numbered, ...] = ()


class Opened(msgspec.Struct, array_like=True, frozen=True, tag=21):
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


class Received(msgspec.Struct, array_like=True, frozen=True, tag=23):
    """Something arrived."""

    line: str
    turn: int
    data: Payload


class Sent(msgspec.Struct, array_like=True, frozen=True, tag=24):
    """Everything up to this number was handed over."""

    line: str
    turn: int
    number: int


class Refused(msgspec.Struct, array_like=True, frozen=True, tag=25):
    """Something could not be sent."""

    line: str
    turn: int
    number: int
    message: str
    is_closed: bool
    """Whether the line is closed."""


class Lost(msgspec.Struct, array_like=True, frozen=True, tag=26):
    """Nothing more will come from a line."""

    line: str
    turn: int
    message: str


class Closed(msgspec.Struct, array_like=True, frozen=True, tag=27):
    """A line that was to be closed is."""

    line: str
    turn: int


class Stopped(msgspec.Struct, array_like=True, frozen=True, tag=28):
    """The stop of a control was written."""

    control: str
    reason: Reason
    number: int
    """Of the newest tick by then."""


class Beat(msgspec.Struct, array_like=True, frozen=True, tag=29):
    """The guard is alive."""

    late_s: float
    """By how much its own timer was late."""


class Counted(msgspec.Struct, array_like=True, frozen=True, tag=30):
    """Frames with counters have left."""

    line: str
    turn: int
    sent: int
    """Number of the newest `Send` with counters among them."""
    stand: dict[str, int]
    """Counter → the last number that has left."""
    stale: list[tuple[str, int]]
    """Control and number of ticks that cannot be written: another frame has used their numbers."""


class Stale(msgspec.Struct, array_like=True, frozen=True, tag=31):
    """A `Send` and all that follow it in its round were not sent: its numbers were used up."""

    line: str
    turn: int
    number: int
    """Of that one."""
    stand: dict[str, int]


ToGuard = Make | Open | Send | Close | Credit | Arm | Tick | Release | Renew | Stop | Owe
FromGuard = (
    Opened
    | OpenFailed
    | Received
    | Sent
    | Refused
    | Lost
    | Closed
    | Stopped
    | Beat
    | Counted
    | Stale
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
