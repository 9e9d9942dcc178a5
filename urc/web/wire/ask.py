"""Encoders for the messages about questions and sequences.

Layer 5. `urc.web.wire.messages` documents the direction of each message.
"""

from typing import Literal

from urc.runtime.hub import SequenceProgress
from urc.runtime.running_goals import RunningGoal
from urc.web.wire.text import cut, encoded, milliseconds
from urc.wire.client_messages import Approval, ApprovalRequest, Arguments, SequenceAction
from urc.wire.server_messages import (
    GoalRow,
    ProgressMessage,
    QuestionEndMessage,
    QuestionMessage,
    SequenceRow,
    TokenMessage,
)

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


def encode_ask(
    number: int,
    run: int,
    who: str,
    command: str,
    text: str,
    level: Literal["normal", "hazardous"],
    left_s: float,
) -> str:
    """Return a question to the second person; the first person's page receives a copy."""
    return encoded(
        QuestionMessage(number, run, who, command, cut(text), level, milliseconds(left_s))
    )


def encode_asked(number: int) -> str:
    """Return the message that closes a question."""
    return encoded(QuestionEndMessage(number))


def encode_token(run: int, token: str) -> str:
    """Return the message with the token for one run of a command, identified by `run`."""
    return encoded(TokenMessage(run, token))


def encode_progress(
    all_progress: tuple[SequenceProgress, ...],
    moving: list[str],
    goals: tuple[RunningGoal, ...],
    now_s: float,
) -> str:
    """Return the message with the states of all sequences and the commands that move the robot."""
    return encoded(
        ProgressMessage(
            [
                SequenceRow(one.command, one.place, one.of, one.state, cut(one.reason))
                for one in all_progress
            ],
            moving,
            [
                GoalRow(
                    one.number,
                    one.command,
                    dict(one.places),
                    cut(one.by),
                    one.page,
                    milliseconds(now_s - one.since_s),
                    one.is_lost,
                    cut(one.title),
                )
                for one in goals
            ],
        )
    )
