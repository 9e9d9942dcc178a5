"""Preview of a command: its exact bytes or messages, or the reason for its refusal. Sends nothing.

Layer 5, pure. A sequence may wait for a reply between two steps. The preview shows every frame that
can be built before a reply arrives.
"""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from urc.expressions import COUNTERS, ExpressionError, Template
from urc.model import sequence
from urc.model.driver import Command, Driver
from urc.model.payload import Payload, WriteSpec
from urc.problems import UrcError
from urc.protocol.forms.topics import context_of
from urc.protocol.framing.table import build_framing
from urc.protocol.requests.encode import build_encode, check_arguments
from urc.protocol.requests.rate import Counters
from urc.protocol.sequences.commands import questions

__all__ = ["Preview", "PreviewLine", "preview"]

MOST_FRAMES = 200
MOST_WITHIN = 8
"""Maximum nesting depth of sequences that run other sequences."""


class PreviewLine(NamedTuple):
    """One line of a preview: a frame, or a step between frames."""

    transport: str
    """Name of the transport; "" for a line without a frame."""
    payload: Payload
    text: str
    """Description of a step without a frame, or the reason why its frame is missing."""


class Preview(NamedTuple):
    """A command's preview: its frames, questions and conditions, or its refusal."""

    refusal: str
    """Reason for the refusal; "" for a permitted command."""
    frames: tuple[PreviewLine, ...] = ()
    questions: tuple[str, ...] = ()
    """Confirmation questions to the operator before the command runs."""
    requires: tuple[str, ...] = ()
    """Interlock conditions on the robot's signals, which the preview cannot check."""


def preview(
    driver: Driver,
    settings: Mapping[str, object],
    command: str,
    arguments: Mapping[str, object],
) -> Preview:
    """Return a preview of the frames that `command` would send with `arguments`.

    Args:
        driver: the loaded driver.
        settings: value of every setting, with a placeholder for each secret.
        command: the command's name.
        arguments: values of some arguments; the command's other arguments have their defaults.
    """
    found = driver.commands.get(command)
    if found is None:
        return Preview(
            f"there is no command {command!r}; known commands: {', '.join(driver.commands)}"
        )
    try:
        values = check_arguments(found, arguments)
        frames = tuple(_frames(driver, settings, found, values, 0))
    except UrcError as error:
        return Preview(str(error))
    if not found.steps and frames and frames[0].text:
        return Preview(frames[0].text)
    return Preview(
        "",
        frames[:MOST_FRAMES],
        tuple(one.text or f"Really {command}?" for one in questions(found, values)),
        tuple(one.text for one in found.requires),
    )


def _frames(
    driver: Driver,
    settings: Mapping[str, object],
    command: Command,
    values: Mapping[str, object],
    depth: int,
) -> Iterator[PreviewLine]:
    names = {"settings": settings, **values}
    if not command.steps:
        yield _written(driver, settings, command.transport, command.send, names)
        return
    for step in sequence.all_steps(command.steps):
        if isinstance(step, sequence.SendStep):
            if step.is_secret:
                yield PreviewLine("", b"", f"sends a secret on {step.transport}")
            else:
                yield _written(driver, settings, step.transport, step.send, names)
        elif isinstance(step, sequence.RunStep) and depth < MOST_WITHIN:
            yield from _run(driver, settings, step, names, depth)
        else:
            yield PreviewLine("", b"", _in_words(step))


def _run(
    driver: Driver,
    settings: Mapping[str, object],
    step: sequence.RunStep,
    names: Mapping[str, object],
    depth: int,
) -> Iterator[PreviewLine]:
    yield PreviewLine("", b"", f"runs {step.command}")
    inner = driver.commands[step.command]
    try:
        given = {
            name: value.evaluate(names) if isinstance(value, Template) else value
            for name, value in step.arguments.items()
        }
        yield from _frames(driver, settings, inner, check_arguments(inner, given), depth + 1)
    except ExpressionError as error:
        yield PreviewLine("", b"", f"the arguments are known only at run time: {error}")


def _written(
    driver: Driver,
    settings: Mapping[str, object],
    transport: str,
    send: WriteSpec,
    names: Mapping[str, object],
) -> PreviewLine:
    spec = driver.transports[transport]
    context = context_of(spec, settings)
    if COUNTERS in send.names:
        names = {**names, COUNTERS: Counters().draw()}
    try:
        payload = build_encode(send, build_framing(spec.framing), context)(names)
    except UrcError as error:
        return PreviewLine(transport, b"", str(error))
    return PreviewLine(transport, payload, "")


def _in_words(step: sequence.Step) -> str:
    match step:
        case sequence.ExpectStep(transport):
            return f"waits for a reply on {transport}"
        case sequence.PromptStep(transport):
            return f"waits for a prompt on {transport}"
        case sequence.WaitStep(seconds):
            return f"waits {seconds:g} s"
        case sequence.UntilStep(condition):
            return f"waits until {condition.source}"
        case sequence.RepeatStep(_, times):
            return f"repeats the next steps, at most {times} times"
        case sequence.SetStep(values):
            return f"sets {', '.join(values)}"
        case sequence.IfStep(condition):
            return f"continues if {condition.source}; otherwise runs the steps under 'else'"
        case sequence.FailStep():
            return "ends without success"
        case sequence.RunStep(command) | sequence.SendStep(command):
            return f"runs {command}"
