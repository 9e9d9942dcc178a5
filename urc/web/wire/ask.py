"""Message types for questions and sequences, without any logic.

Layer 5. These types are part of `urc.web.wire.messages`, which documents the direction of each
message.
"""

from typing import Literal

import msgspec

from urc.protocol.sequences.sequence_control import Pull
from urc.runtime.hub import SequenceProgress
from urc.web.wire.text import Outbound, cut, encoded, milliseconds

__all__ = [
    "Approval",
    "Arguments",
    "ApprovalRequest",
    "SequenceAction",
    "encode_ask",
    "encode_asked",
    "encode_progress",
    "encode_token",
]


class _Ask(Outbound, tag="ask", omit_defaults=False, frozen=True):
    n: int
    """Number of the question."""
    id: int
    """Number of the command on the asking page; 0 in messages to other pages."""
    who: str
    command: str
    text: str
    level: str
    left: int
    """Time until the question expires, in milliseconds."""


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


class Approval(msgspec.Struct, tag_field="t", tag="agree", forbid_unknown_fields=True, frozen=True):
    """The answer to question `n`; False from the asking page withdraws the question."""

    n: int
    yes: bool


_Scalar = bool | int | float | str
Arguments = dict[str, bool | int | float | str | tuple[_Scalar, ...] | None]
"""Arguments of a command, as the page sends them."""


class ApprovalRequest(
    msgspec.Struct, tag_field="t", tag="prepare", forbid_unknown_fields=True, frozen=True
):
    """The operator's confirmation of one command with its arguments; the reply is a `token`."""

    id: int
    command: str
    arguments: Arguments = {}
    stops: int | None = None
    """Number of STOPs that the page knew. The server checks only the number in `CommandRequest`."""


class SequenceAction(
    msgspec.Struct, tag_field="t", tag="steer", forbid_unknown_fields=True, frozen=True
):
    """A request to pause, step, resume or end a sequence."""

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
    """Return a question to the second person; the page of the first person gets a copy."""
    return encoded(_Ask(number, run, who, command, cut(text), level, milliseconds(left_s)))


def encode_asked(number: int) -> str:
    """Return the message that closes a question."""
    return encoded(_Asked(number))


def encode_token(run: int, token: str) -> str:
    """Return the message with the token that allows the command `run` once, for a short time."""
    return encoded(_Token(run, token))


def encode_progress(all_progress: tuple[SequenceProgress, ...]) -> str:
    """Return the message with the state of all sequences."""
    return encoded(
        _AllProgress(
            [
                _Progress(one.command, one.place, one.of, one.state, cut(one.reason))
                for one in all_progress
            ]
        )
    )
