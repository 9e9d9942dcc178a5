"""Steps of a sequence: one class for each kind of step and the union type `Step`.

Modules that handle every kind of step import this module as `sequence`.
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
"""Maximum number of steps in one sequence, including all branches."""
MAX_STEPS_DONE = 10_000
"""Maximum number of steps in one run, counting every repetition of every ``repeat``."""
MAX_STEP_S = 600.0
"""Maximum wait in one step, in seconds."""


class SendStep(NamedTuple):
    """Send a frame."""

    transport: str
    send: WriteSpec
    is_secret: bool = False
    """Whether the sent text is redacted in all logs and messages."""


class ExpectStep(NamedTuple):
    """Wait for a frame; later steps can use the frame's private fields."""

    transport: str
    read: ReadSpec
    errors: tuple[Pattern, ...] = ()
    faults: tuple[ErrorReply, ...] = ()
    timeout_s: float | None = None
    """Reply timeout, in seconds; None means the transport's ``timeouts.reply``."""
    otherwise: "tuple[Step, ...] | None" = None
    """Steps to run after a timeout; None means that the sequence fails."""
    text: str = ""
    """Error message after a timeout; "" means a generated message."""
    framing: FramingSpec | None = None
    """Framing of the connection during the wait; None means the framing declared by the
    transport."""


class PromptStep(NamedTuple):
    """Wait for unterminated text, such as a password prompt."""

    transport: str
    pattern: Pattern
    timeout_s: float | None = None
    otherwise: "tuple[Step, ...] | None" = None
    text: str = ""


class WaitStep(NamedTuple):
    """Wait for a fixed time."""

    seconds: float


class UntilStep(NamedTuple):
    """Wait until a condition is true."""

    condition: Template
    """Condition on fresh signals, settings and the fields from earlier steps."""
    timeout_s: float
    otherwise: "tuple[Step, ...] | None" = None
    text: str = ""


class RepeatStep(NamedTuple):
    """Repeat steps a limited number of times."""

    body: "tuple[Step, ...]"
    times: int
    """Maximum number of repetitions."""
    until: Template | None = None
    """Condition that ends the loop, checked after each repetition; None means no early end."""
    otherwise: "tuple[Step, ...] | None" = None
    """Steps to run if `until` is false after the last repetition; None: the sequence fails."""
    text: str = ""


class RunStep(NamedTuple):
    """Run a command or another sequence, and wait until it is complete."""

    command: str
    arguments: Mapping[str, Template | Value] = NOTHING


class SetStep(NamedTuple):
    """Set signals."""

    values: Mapping[str, Template | Value]


class IfStep(NamedTuple):
    """Run one of two branches, depending on a condition."""

    condition: Template
    then: "tuple[Step, ...]"
    otherwise: "tuple[Step, ...]" = ()


class FailStep(NamedTuple):
    """End the sequence with a failure."""

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
    """Yield all steps, including the steps in branches."""
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
    """Return the maximum number of steps in one run, counting both branches of every ``if``."""
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
