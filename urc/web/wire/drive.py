"""What a page and the server say about the controls: message shapes, and nothing else.

Floor 5. Part of `urc.web.wire.messages`, which says who sends what.
"""

from typing import Literal

import msgspec

from urc.motion.hold import Reason
from urc.motion.lease import REQUEST_S, Client, LeaseState
from urc.web.wire.text import Outbound, cut, encoded, milliseconds

__all__ = [
    "NO_TICK",
    "Doubled",
    "Drive",
    "Driving",
    "Release",
    "Spare",
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
    """What the others call this screen."""
    epoch: int
    holder: _Person | None
    asker: _Person | None
    left: int
    """Milliseconds until the asker gets the controls."""
    latched: str
    """Who pressed STOP; "" while nothing is latched."""
    stops: int
    """How often it was pressed."""
    confirmed: bool
    """Whether the robot's lines have taken the stop."""
    drives: bool
    """Whether this screen may drive, ..."""
    forces: bool
    """... and take the controls from whoever has them."""
    spare: str
    """Names the seat of this screen on a second line; nobody else is told. "" for viewers."""


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
    """What a screen wants with the controls; `for_s` is how long the holder has to answer."""

    verb: Verb
    for_s: float = REQUEST_S


class Tick(msgspec.Struct, tag_field="t", tag="tick", forbid_unknown_fields=True, frozen=True):
    """A sample of what is held. See `urc.motion.fresh.Input`."""

    command: str
    epoch: int
    number: int
    echo: int
    arguments: dict[str, bool | int | float | str | tuple[_Scalar, ...] | None] = {}


class Release(
    msgspec.Struct, tag_field="t", tag="release", forbid_unknown_fields=True, frozen=True
):
    """A control was let go. `number` counts with the ticks; 0: there is no second line."""

    command: str
    number: int = 0


class Stop(msgspec.Struct, tag_field="t", tag="stop", forbid_unknown_fields=True, frozen=True):
    """STOP; `number` as of `Release`."""

    number: int = 0


Driving = Drive | Tick | Release | Stop
decode_tick = msgspec.json.Decoder(Tick).decode
"""Of a text that is most likely one; raises what is in `NO_TICK`."""
NO_TICK = (msgspec.MsgspecError, UnicodeError, RecursionError)
_TICK_OF = b'{"t":"tick","command":"'
"""So a page's ticks begin; written otherwise they only take the longer way."""


def command_of(data: bytes) -> str:
    """Return whose tick this is by its first bytes, without reading the rest; "" where unclear."""
    end = data.find(b'"', len(_TICK_OF)) if data.startswith(_TICK_OF) else -1
    return data[len(_TICK_OF) : end].decode("ascii", "replace") if end > 0 else ""


Doubled = Tick | Release | Stop
"""What a screen may say on its second line."""


class Spare(msgspec.Struct, tag_field="t", tag="spare", forbid_unknown_fields=True, frozen=True):
    """First on a second line: whose it is, by the key of the lease."""

    key: str


def encode_lease(
    state: LeaseState, you: Client, *, left_s: float, is_confirmed: bool, spare: str = ""
) -> str:
    """Return who has the controls, as one screen is told; `spare` is the key of its seat."""
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
            drives=you.role != "viewer",
            forces=you.role in ("engineer", "admin"),
            spare=spare if you.role != "viewer" else "",
        )
    )


def encode_beat(number: int) -> str:
    """Return a number to be echoed."""
    return encoded(_Beat(number))


def encode_stopped(command: str, reason: Reason) -> str:
    """Return that a control stopped without being let go."""
    return encoded(_Stopped(command, reason))


def encode_refused(about: str, command: str, message: str) -> str:
    """Return why a tick, or a wish about the controls, was not taken."""
    return encoded(_Refused(about, cut(message), command))


def _person(client: Client | None) -> _Person | None:
    return None if client is None else _Person(client.id, client.name)
