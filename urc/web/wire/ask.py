"""What a page and the server say about questions and sequences: message shapes, and nothing else.

Floor 5. Part of `urc.web.wire.messages`, which says who sends what.
"""

from typing import Literal

import msgspec

from urc.protocol.reins import Pull
from urc.runtime.hub import Progress
from urc.web.wire.text import Outbound, cut, encoded, milliseconds

__all__ = [
    "Agree",
    "Arguments",
    "Prepare",
    "Steer",
    "encode_ask",
    "encode_asked",
    "encode_progress",
    "encode_token",
]


class _Ask(Outbound, tag="ask", omit_defaults=False, frozen=True):
    n: int
    """Number of the question."""
    id: int
    """Of the command that waits for it, on the screen that gave it; 0 on the others."""
    who: str
    command: str
    text: str
    level: str
    left: int
    """Milliseconds until nobody has said yes."""


class _Asked(Outbound, tag="asked", frozen=True):
    n: int


class _Token(Outbound, tag="token", omit_defaults=False, frozen=True):
    id: int
    token: str


class _Progress(msgspec.Struct, omit_defaults=False, frozen=True):
    command: str
    place: int
    of: int
    state: str
    reason: str


class _AllProgress(Outbound, tag="progress", omit_defaults=False, frozen=True):
    sequences: list[_Progress]


class Agree(msgspec.Struct, tag_field="t", tag="agree", forbid_unknown_fields=True, frozen=True):
    """What somebody says to the question `n`; no from the screen that asks takes it back."""

    n: int
    yes: bool


_Scalar = bool | int | float | str
Arguments = dict[str, bool | int | float | str | tuple[_Scalar, ...] | None]
"""Of a command, as a page says them."""


class Prepare(
    msgspec.Struct, tag_field="t", tag="prepare", forbid_unknown_fields=True, frozen=True
):
    """Somebody has said yes to just this command: asks for the `token` that lets it be given."""

    id: int
    command: str
    arguments: Arguments = {}
    stops: int | None = None
    """As of `Run`, which is what counts."""


class Steer(msgspec.Struct, tag_field="t", tag="steer", forbid_unknown_fields=True, frozen=True):
    """What somebody wants of a sequence."""

    command: str
    verb: Pull


def encode_ask(
    number: int,
    run: int,
    who: str,
    command: str,
    text: str,
    level: Literal["normal", "hazardous"],
    left_s: float,
) -> str:
    """Return a question that a second person is asked, and the first one is told of."""
    return encoded(_Ask(number, run, who, command, cut(text), level, milliseconds(left_s)))


def encode_asked(number: int) -> str:
    """Return that a question is over."""
    return encoded(_Asked(number))


def encode_token(run: int, token: str) -> str:
    """Return what lets the command `run` be given, once and soon."""
    return encoded(_Token(run, token))


def encode_progress(all_progress: tuple[Progress, ...]) -> str:
    """Return where the sequences stand."""
    return encoded(
        _AllProgress(
            [
                _Progress(one.command, one.place, one.of, one.state, cut(one.reason))
                for one in all_progress
            ]
        )
    )
