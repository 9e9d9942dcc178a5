"""Steps of a sequence: a class for each kind, and `Step` for any of them.

A module that handles every kind imports this one whole, as `sequence`.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from urc.expressions import Template
from urc.model.exchange import ErrorReply
from urc.model.payload import FramingSpec, ReadSpec, WriteSpec
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
"""Largest number of steps in one sequence, including those in its branches."""
MAX_STEPS_DONE = 10_000
"""Largest number of steps in one run, counting every round of every ``repeat``."""
MAX_STEP_S = 600.0
"""Longest wait of one step, in seconds."""


class SendStep(NamedTuple):
    """Send a frame."""

    transport: str
    send: WriteSpec
    is_secret: bool = False
    """Whether the text must not appear in any message."""


class ExpectStep(NamedTuple):
    """Wait for a frame; its ``_fields`` are names in the later steps."""

    transport: str
    read: ReadSpec
    errors: tuple[Pattern, ...] = ()
    faults: tuple[ErrorReply, ...] = ()
    timeout_s: float | None = None
    """Reply timeout, in seconds; None: ``timeouts.reply`` of the transport."""
    otherwise: "tuple[Step, ...] | None" = None
    """Steps after a timeout; None: the sequence fails."""
    text: str = ""
    """Message after a timeout; "" for a generated one."""
    framing: FramingSpec | None = None
    """Framing of the connection during the wait; None: unchanged."""


class PromptStep(NamedTuple):
    """Wait for text without a terminator, such as a password prompt."""

    transport: str
    pattern: Pattern
    timeout_s: float | None = None
    otherwise: "tuple[Step, ...] | None" = None
    text: str = ""


class WaitStep(NamedTuple):
    """Pause for some time."""

    seconds: float


class UntilStep(NamedTuple):
    """Wait for a condition to come true."""

    condition: Template
    """Condition over fresh signals, settings and the fields that earlier steps have read."""
    timeout_s: float
    otherwise: "tuple[Step, ...] | None" = None
    text: str = ""


class RepeatStep(NamedTuple):
    """Repeat the same steps, a bounded number of times."""

    body: "tuple[Step, ...]"
    times: int
    """Largest number of rounds."""
    until: Template | None = None
    """Condition after each round that ends the loop; None: all rounds run."""
    otherwise: "tuple[Step, ...] | None" = None
    """Steps when `until` is still false after the last round; None: the sequence fails."""
    text: str = ""


class RunStep(NamedTuple):
    """Run a command or another sequence, and wait for its end."""

    command: str
    arguments: Mapping[str, Template | Value] = NOTHING


class SetStep(NamedTuple):
    """Set signals."""

    values: Mapping[str, Template | Value]


class IfStep(NamedTuple):
    """Choose between two branches."""

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
    """Yield the steps, including those in branches."""
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
    """Return the largest number of steps in one run, counting both branches of a choice."""
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
