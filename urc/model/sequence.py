"""Steps of a sequence: a class for each kind, and `Step` for any of them.

A module that handles every kind imports this one whole, as `sequence`.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from urc.expressions import Template
from urc.model.codec import FramingSpec, ReadSpec, WriteSpec
from urc.model.flow import ErrorReply
from urc.model.values import NOTHING, Value
from urc.patterns import Pattern

__all__ = [
    "MAX_STEPS",
    "MAX_STEPS_DONE",
    "MAX_STEP_S",
    "ExpectStep",
    "FailStep",
    "IfStep",
    "PromptStep",
    "RepeatStep",
    "RunStep",
    "SendStep",
    "SetStep",
    "Step",
    "UntilStep",
    "WaitStep",
    "all_steps",
    "most_steps",
]

MAX_STEPS = 200
"""Steps of one sequence, those in its branches included."""
MAX_STEPS_DONE = 10_000
"""Steps that one run may do, every round of every ``repeat`` counted."""
MAX_STEP_S = 600.0
"""Longest wait of one step, in seconds."""


class SendStep(NamedTuple):
    """Send a frame."""

    transport: str
    send: WriteSpec
    is_secret: bool = False
    """Its text must not appear in any message."""


class ExpectStep(NamedTuple):
    """Wait for a frame; its ``_fields`` are names in the steps that follow."""

    transport: str
    read: ReadSpec
    errors: tuple[Pattern, ...] = ()
    faults: tuple[ErrorReply, ...] = ()
    timeout_s: float | None = None
    """None: the transport's ``timeouts.reply``."""
    otherwise: "tuple[Step, ...] | None" = None
    """What to do when it does not come; None: fail."""
    text: str = ""
    """What to say when it does not come; "" for words of our own."""
    framing: FramingSpec | None = None
    """What cuts the line while it is waited for; None: the line's own."""


class PromptStep(NamedTuple):
    """Wait for text that nothing ends, as a prompt for a password."""

    transport: str
    pattern: Pattern
    timeout_s: float | None = None
    otherwise: "tuple[Step, ...] | None" = None
    text: str = ""


class WaitStep(NamedTuple):
    """Do nothing for a while."""

    seconds: float


class UntilStep(NamedTuple):
    """Wait for a condition to come true."""

    condition: Template
    """Over fresh signals, settings and what earlier steps have read."""
    timeout_s: float
    otherwise: "tuple[Step, ...] | None" = None
    text: str = ""


class RepeatStep(NamedTuple):
    """Do the same steps again and again, a bounded number of times."""

    body: "tuple[Step, ...]"
    times: int
    """How often at most."""
    until: Template | None = None
    """Asked after each round: no further one when it is true. None: all rounds are done."""
    otherwise: "tuple[Step, ...] | None" = None
    """What to do when `until` is not true after the last round; None: fail."""
    text: str = ""


class RunStep(NamedTuple):
    """Run a command, or another sequence, and wait until it is done."""

    command: str
    arguments: Mapping[str, Template | Value] = NOTHING


class SetStep(NamedTuple):
    """Set signals."""

    values: Mapping[str, Template | Value]


class IfStep(NamedTuple):
    """Choose between two ways on."""

    condition: Template
    then: "tuple[Step, ...]"
    otherwise: "tuple[Step, ...]" = ()


class FailStep(NamedTuple):
    """End without success."""

    text: Template


Step = (
    SendStep
    | ExpectStep
    | PromptStep
    | WaitStep
    | UntilStep
    | RepeatStep
    | RunStep
    | SetStep
    | IfStep
    | FailStep
)


def all_steps(steps: tuple[Step, ...]) -> Iterator[Step]:
    """Yield the steps and those in their branches."""
    for step in steps:
        yield step
        if isinstance(step, IfStep):
            yield from all_steps(step.then)
            yield from all_steps(step.otherwise)
        elif isinstance(step, (ExpectStep, PromptStep, UntilStep)):
            yield from all_steps(step.otherwise or ())
        elif isinstance(step, RepeatStep):
            yield from all_steps(step.body)
            yield from all_steps(step.otherwise or ())


def most_steps(steps: tuple[Step, ...]) -> int:
    """Return how many steps one run can do at most, both branches of a choice counted."""
    total = 0
    for step in steps:
        total += 1
        if isinstance(step, RepeatStep):
            total += step.times * most_steps(step.body) + most_steps(step.otherwise or ())
        elif isinstance(step, IfStep):
            total += most_steps(step.then) + most_steps(step.otherwise)
        elif isinstance(step, (ExpectStep, PromptStep, UntilStep)):
            total += most_steps(step.otherwise or ())
    return total
