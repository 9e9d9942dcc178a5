"""Message types for the controls, without any logic.

Layer 5. These types are part of `urc.web.wire.messages`, which documents the direction of each
message.
"""

from typing import Literal

import msgspec

from urc.model.role import includes
from urc.motion.hold_to_run import Reason
from urc.motion.lease import REQUEST_S, LeaseState, Operator
from urc.web.wire.text import Outbound, cut, encoded, milliseconds

__all__ = [
    "NO_TICK",
    "Doubled",
    "Drive",
    "Driving",
    "Release",
    "JoinRedundant",
    "Stop",
    "Tick",
    "command_of",
    "decode_tick",
    "encode_beat",
    "encode_lease",
    "encode_refused",
    "encode_stopped",
]

_Scalar = bool | int | float | str


class _Person(msgspec.Struct, frozen=True):
    id: str
    name: str


class _Lease(Outbound, tag="lease", omit_defaults=False, frozen=True):
    you: str
    name: str
    """Name of the page, as other pages show it."""
    epoch: int
    holder: _Person | None
    asker: _Person | None
    left: int
    """Time until the asking page gets the controls, in milliseconds."""
    latched: str
    """Name of the operator who pressed STOP; "" while STOP is not latched."""
    stops: int
    """Number of STOPs in this run of the server."""
    confirmed: bool
    """Whether all transports of the robot have accepted the stop."""
    drives: bool
    """Whether the page may drive."""
    forces: bool
    """Whether the page may take the lease from another page without its consent."""
    spare: str
    """Secret key for the redundant socket of the page; "" for watchers."""


class _Beat(Outbound, tag="beat", frozen=True):
    n: int


class _Stopped(Outbound, tag="stopped", frozen=True):
    command: str
    reason: str


class _Refused(Outbound, tag="refused", frozen=True):
    about: str
    message: str
    command: str = ""


Verb = Literal["take", "ask", "yes", "no", "force", "leave", "reset"]


class Drive(msgspec.Struct, tag_field="t", tag="drive", forbid_unknown_fields=True, frozen=True):
    """A request about the lease; `for_s` is the time for the holder's answer, in seconds."""

    verb: Verb
    for_s: float = REQUEST_S


class Tick(msgspec.Struct, tag_field="t", tag="tick", forbid_unknown_fields=True, frozen=True):
    """One sample of a held control. See `urc.motion.freshness.ControlInput`."""

    command: str
    epoch: int
    number: int
    echo: int
    arguments: dict[str, bool | int | float | str | tuple[_Scalar, ...] | None] = {}


class Release(
    msgspec.Struct, tag_field="t", tag="release", forbid_unknown_fields=True, frozen=True
):
    """The release of a held control.

    Releases and ticks share one count; without a redundant socket, the number is 0.
    """

    command: str
    number: int = 0


class Stop(msgspec.Struct, tag_field="t", tag="stop", forbid_unknown_fields=True, frozen=True):
    """A press of STOP, with a number as in `Release`."""

    number: int = 0


Driving = Drive | Tick | Release | Stop
decode_tick = msgspec.json.Decoder(Tick).decode
"""Decoder for a text that is probably a tick; raises one of the exceptions in `NO_TICK` for any
other text."""
NO_TICK = (msgspec.MsgspecError, UnicodeError, RecursionError)
_TICK_OF = b'{"t":"tick","command":"'
"""First bytes of a page's tick; ticks in any other form are decoded more slowly."""


def command_of(data: bytes) -> str:
    """Return the command of a tick, read from its first bytes; "" if they do not contain it."""
    end = data.find(b'"', len(_TICK_OF)) if data.startswith(_TICK_OF) else -1
    return data[len(_TICK_OF) : end].decode("ascii", "replace") if end > 0 else ""


Doubled = Tick | Release | Stop
"""Messages that a page may also send over its redundant socket."""


class JoinRedundant(
    msgspec.Struct, tag_field="t", tag="spare", forbid_unknown_fields=True, frozen=True
):
    """First message of a redundant socket, with the key from the page's lease."""

    key: str


def encode_lease(
    state: LeaseState, you: Operator, *, left_s: float, is_confirmed: bool, spare: str = ""
) -> str:
    """Return the lease message for a page; `spare` is the key for its redundant socket."""
    return encoded(
        _Lease(
            you=you.id,
            name=you.name,
            epoch=state.epoch,
            holder=_person(state.holder),
            asker=_person(state.asked_by),
            left=milliseconds(left_s),
            latched=state.latched_by,
            stops=state.stops,
            confirmed=is_confirmed,
            drives=includes(you.role, "drive"),
            forces=includes(you.role, "maintain"),
            spare=spare if includes(you.role, "drive") else "",
        )
    )


def encode_beat(number: int) -> str:
    """Return the message with a heartbeat number, which the page echoes."""
    return encoded(_Beat(number))


def encode_stopped(command: str, reason: Reason) -> str:
    """Return the message that a control stopped before its release."""
    return encoded(_Stopped(command, reason))


def encode_refused(about: str, command: str, message: str) -> str:
    """Return the message that a tick, or a request about the controls, was refused."""
    return encoded(_Refused(about, cut(message), command))


def _person(client: Operator | None) -> _Person | None:
    return None if client is None else _Person(client.id, client.name)
