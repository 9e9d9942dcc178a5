"""Parser for sequences: list of steps → `Step` values."""

from typing import Final, NamedTuple

from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext, parse_write
from urc.config.parse.reply import parse_own_framing, parse_stage, refuse
from urc.expressions import Template, compile_template
from urc.model import sequence
from urc.model.exchange import Stage
from urc.model.payload import ReadSpec
from urc.model.values import Value

__all__ = ["VERBS", "StepContext", "parse_steps"]

_BESIDE: Final = {
    "send": ("redact", "to"),
    "expect": ("from", "timeout", "else"),
    "prompt": ("from", "timeout", "else"),
    "wait": ("else",),
    "repeat": ("times", "until", "else"),
    "run": ("args",),
    "set": (),
    "if": ("then", "else"),
    "fail": (),
}
"""Additional keys of a step, by its verb."""
VERBS: Final = tuple(_BESIDE)
_OF_REQUESTS: Final = ("match", "stages", "resend", "extend")
_NEVER: Final = compile_template("")
_NO_PATTERN: Final = "^$"


class StepContext(NamedTuple):
    """The facts about a sequence that the parsers of its steps need."""

    transport: str
    """Default transport of the steps; "" if each step must name its transport."""
    is_named: bool
    """Whether the steps form a named sequence; only such steps may name a transport."""
    forms: FormContext


def parse_steps(part: Node, context: StepContext, problems: Problems) -> tuple[sequence.Step, ...]:
    """Return the steps in the list at `part`, including their branches."""
    steps = _steps(part, context, problems)
    count = sum(1 for _ in sequence.all_steps(steps))
    if count > sequence.MAX_STEPS:
        problems.error(
            part,
            "too-many-steps",
            f"found {count} steps, including branches; the limit is {sequence.MAX_STEPS}",
        )
    most = sequence.most_steps(steps)
    if most > sequence.MAX_STEPS_DONE:
        problems.error(
            part,
            "too-many-steps",
            f"with all repetitions of 'repeat', the sequence has {most} steps; the limit is"
            f" {sequence.MAX_STEPS_DONE}",
            hint="make 'times' smaller",
        )
    return steps


def _steps(
    part: Node | None, context: StepContext, problems: Problems
) -> tuple[sequence.Step, ...]:
    if part is None:
        return ()
    found = [_step(inner, context, problems) for inner in part.items()]
    return tuple(step for step in found if step is not None)


def _step(part: Node, context: StepContext, problems: Problems) -> sequence.Step | None:
    verbs = [verb for verb in VERBS if verb in part.data]
    if len(verbs) != 1:
        problems.error(
            part,
            "two-verbs" if verbs else "missing-verb",
            f"'{verbs[0]}' and '{verbs[1]}' are two actions in one step"
            if verbs
            else "this step has no action",
            at=verbs[1] if verbs else "",
            key=True,
            hint="write two steps" if verbs else f"use one of: {', '.join(VERBS)}",
        )
        return None
    verb = verbs[0]
    for key in part.data:
        if key != verb and key not in _BESIDE[verb]:
            text = f"'{key}' has no effect with '{verb}'"
            problems.error(part, "misplaced-key", text, at=key, key=True)
    if not context.is_named:
        refuse(
            part,
            ("to", "from"),
            "is allowed only in sequences; these steps use the transport that declares them",
            problems,
        )
    return _one(verb, part, context, problems)


def _one(verb: str, part: Node, context: StepContext, problems: Problems) -> sequence.Step | None:
    inner = part.must(verb)
    match verb:
        case "send":
            send = parse_write(inner, problems, context.forms)
            transport = part.text("to", context.transport)
            return sequence.SendStep(transport, send, part.flag("redact", default=False))
        case "expect":
            return _expect(part, inner, context, problems)
        case "prompt":
            return _prompt(part, inner, context, problems)
        case "wait":
            return _wait(part, inner, context, problems)
        case "repeat":
            return _repeat(part, inner, context, problems)
        case "run":
            return sequence.RunStep(str(inner.data), _values(part.named("args"), problems))
        case "set":
            return sequence.SetStep(_values(inner.entries(), problems))
        case "if":
            return _if(part, inner, context, problems)
        case _:
            text = problems.template(inner)
            return sequence.FailStep(text or _NEVER)


def _expect(
    part: Node, inner: Node, context: StepContext, problems: Problems
) -> sequence.ExpectStep | None:
    transport = part.text("from", context.transport)
    framing = None
    if isinstance(inner.data, dict):
        refuse(inner, _OF_REQUESTS, "has no effect in a step", problems)
        refuse(inner, ("timeout",), "must be next to 'expect', not inside it", problems)
        framing, forms = parse_own_framing(inner, problems, context.forms)
        stage = parse_stage(inner, problems, forms)
    else:
        pattern = problems.pattern(inner)
        if pattern is None:
            return None
        stage = Stage(ReadSpec("regex", {"pattern": pattern}, pattern.groups))
    otherwise, text = _else(part, context, problems)
    return sequence.ExpectStep(
        transport,
        stage.read,
        stage.errors,
        stage.faults,
        _timeout_s(part, problems),
        otherwise,
        text,
        framing,
    )


def _prompt(
    part: Node, inner: Node, context: StepContext, problems: Problems
) -> sequence.PromptStep | None:
    pattern = problems.pattern(inner)
    if pattern is None:
        return None
    otherwise, text = _else(part, context, problems)
    transport = part.text("from", context.transport)
    return sequence.PromptStep(transport, pattern, _timeout_s(part, problems), otherwise, text)


def _wait(
    part: Node, inner: Node, context: StepContext, problems: Problems
) -> sequence.Step | None:
    if not isinstance(inner.data, dict):
        refuse(part, ("else",), "has no effect for a wait without a condition", problems)
        return sequence.WaitStep(problems.duration(part, "wait", 0.0, most=sequence.MAX_STEP_S))
    condition = problems.expression(inner.must("until"))
    otherwise, text = _else(part, context, problems)
    timeout_s = problems.duration(inner, "timeout", 0.0, most=sequence.MAX_STEP_S)
    return None if condition is None else sequence.UntilStep(condition, timeout_s, otherwise, text)


def _repeat(
    part: Node, inner: Node, context: StepContext, problems: Problems
) -> sequence.Step | None:
    times = part.integer("times")
    if times is None:
        problems.error(
            part,
            "missing-key",
            "'times' is missing: the number of repetitions has no limit",
            key=True,
            hint="write times: 10, and add until: CONDITION if the loop may end earlier",
        )
    until = part.get("until")
    if until is None:
        refuse(part, ("else",), "needs 'until'", problems)
    otherwise, text = _else(part, context, problems)
    return sequence.RepeatStep(
        _steps(inner, context, problems),
        times or 1,
        problems.expression(until) if until else None,
        otherwise,
        text,
    )


def _timeout_s(part: Node, problems: Problems) -> float | None:
    return problems.duration(part, "timeout", 0.0, most=sequence.MAX_STEP_S) or None


def _else(
    part: Node, context: StepContext, problems: Problems
) -> tuple[tuple[sequence.Step, ...] | None, str]:
    """Return the steps or the failure message under ``else``."""
    inner = part.get("else")
    if inner is None:
        return None, ""
    if isinstance(inner.data, list):
        return _steps(inner, context, problems), ""
    return None, "" if inner.data == "fail" else str(inner.data)


def _if(
    part: Node, inner: Node, context: StepContext, problems: Problems
) -> sequence.IfStep | None:
    condition = problems.expression(inner)
    then = _steps(part.get("then"), context, problems)
    otherwise, text = _else(part, context, problems)
    if text:
        problems.error(
            part.must("else"),
            "wrong-type",
            "'else' of an 'if' must be a list of steps",
            hint="write else: [{ fail: … }] to end here",
        )
    if "then" not in part.data and "else" not in part.data:
        problems.error(
            part, "missing-key", "'then' is missing, so this step does nothing", key=True
        )
    return None if condition is None else sequence.IfStep(condition, then, otherwise or ())


def _values(parts: dict[str, Node], problems: Problems) -> dict[str, Template | Value]:
    """Return the given values, with strings compiled as templates."""
    values: dict[str, Template | Value] = {}
    for name, inner in parts.items():
        if isinstance(inner.data, str):
            template = problems.template(inner)
            if template is not None:
                values[name] = template
        else:
            values[name] = inner.data
    return values
