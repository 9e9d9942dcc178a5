"""Sequences: list of steps → `Step` values."""

from typing import Final, NamedTuple

from urc.config.parse.form import FormContext, parse_write
from urc.config.parse.reply import parse_own_framing, parse_stage, refuse
from urc.config.part import Findings, Part
from urc.expressions import Template, compile_template
from urc.model import sequence
from urc.model.codec import ReadSpec
from urc.model.flow import Stage
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
"""Verb → the keys that may accompany it."""
VERBS: Final = tuple(_BESIDE)
_OF_REQUESTS: Final = ("match", "stages", "resend", "extend")
_NEVER: Final = compile_template("")
_NO_PATTERN: Final = "^$"


class StepContext(NamedTuple):
    """The surroundings of steps."""

    transport: str
    """Whose steps these are, or the only one there is; "" when each must say it."""
    is_named: bool
    """They are a sequence of their own, whose steps may name a transport."""
    forms: FormContext


def parse_steps(part: Part, context: StepContext, findings: Findings) -> tuple[sequence.Step, ...]:
    """Return the steps in the list at `part`, branches included."""
    steps = _steps(part, context, findings)
    count = sum(1 for _ in sequence.all_steps(steps))
    if count > sequence.MAX_STEPS:
        findings.error(
            part,
            "too-many-steps",
            f"there are {count} steps, branches included; {sequence.MAX_STEPS} fit",
        )
    most = sequence.most_steps(steps)
    if most > sequence.MAX_STEPS_DONE:
        findings.error(
            part,
            "too-many-steps",
            f"with all rounds of 'repeat' it would do {most} steps;"
            f" {sequence.MAX_STEPS_DONE} are allowed",
            hint="make 'times' smaller",
        )
    return steps


def _steps(
    part: Part | None, context: StepContext, findings: Findings
) -> tuple[sequence.Step, ...]:
    if part is None:
        return ()
    found = [_step(inner, context, findings) for inner in part.items()]
    return tuple(step for step in found if step is not None)


def _step(part: Part, context: StepContext, findings: Findings) -> sequence.Step | None:
    verbs = [verb for verb in VERBS if verb in part.data]
    if len(verbs) != 1:
        findings.error(
            part,
            "two-verbs" if verbs else "missing-verb",
            f"'{verbs[0]}' and '{verbs[1]}' are two steps" if verbs else "nothing says what to do",
            at=verbs[1] if verbs else "",
            key=True,
            hint="write one step after the other" if verbs else f"use one of: {', '.join(VERBS)}",
        )
        return None
    verb = verbs[0]
    for key in part.data:
        if key != verb and key not in _BESIDE[verb]:
            text = f"'{key}' means nothing beside '{verb}'"
            findings.error(part, "misplaced-key", text, at=key, key=True)
    if not context.is_named:
        refuse(part, ("to", "from"), "is for sequences: this is about one transport", findings)
    return _one(verb, part, context, findings)


def _one(verb: str, part: Part, context: StepContext, findings: Findings) -> sequence.Step | None:
    inner = part.must(verb)
    match verb:
        case "send":
            send = parse_write(inner, findings, context.forms)
            transport = part.text("to", context.transport)
            return sequence.SendStep(transport, send, part.flag("redact", default=False))
        case "expect":
            return _expect(part, inner, context, findings)
        case "prompt":
            return _prompt(part, inner, context, findings)
        case "wait":
            return _wait(part, inner, context, findings)
        case "repeat":
            return _repeat(part, inner, context, findings)
        case "run":
            return sequence.RunStep(str(inner.data), _values(part.named("args"), findings))
        case "set":
            return sequence.SetStep(_values(inner.entries(), findings))
        case "if":
            return _if(part, inner, context, findings)
        case _:
            text = findings.template(inner)
            return sequence.FailStep(text or _NEVER)


def _expect(
    part: Part, inner: Part, context: StepContext, findings: Findings
) -> sequence.ExpectStep | None:
    transport = part.text("from", context.transport)
    framing = None
    if isinstance(inner.data, dict):
        refuse(inner, _OF_REQUESTS, "means nothing for a step", findings)
        refuse(inner, ("timeout",), "stands beside 'expect', not in it", findings)
        framing, forms = parse_own_framing(inner, findings, context.forms)
        stage = parse_stage(inner, findings, forms)
    else:
        pattern = findings.pattern(inner)
        if pattern is None:
            return None
        stage = Stage(ReadSpec("regex", {"pattern": pattern}, pattern.groups))
    otherwise, text = _else(part, context, findings)
    return sequence.ExpectStep(
        transport,
        stage.read,
        stage.errors,
        stage.faults,
        _timeout_s(part, findings),
        otherwise,
        text,
        framing,
    )


def _prompt(
    part: Part, inner: Part, context: StepContext, findings: Findings
) -> sequence.PromptStep | None:
    pattern = findings.pattern(inner)
    if pattern is None:
        return None
    otherwise, text = _else(part, context, findings)
    transport = part.text("from", context.transport)
    return sequence.PromptStep(transport, pattern, _timeout_s(part, findings), otherwise, text)


def _wait(
    part: Part, inner: Part, context: StepContext, findings: Findings
) -> sequence.Step | None:
    if not isinstance(inner.data, dict):
        refuse(part, ("else",), "means nothing for a plain wait", findings)
        return sequence.WaitStep(findings.duration(part, "wait", 0.0, most=sequence.MAX_STEP_S))
    condition = findings.expression(inner.must("until"))
    otherwise, text = _else(part, context, findings)
    timeout_s = findings.duration(inner, "timeout", 0.0, most=sequence.MAX_STEP_S)
    return None if condition is None else sequence.UntilStep(condition, timeout_s, otherwise, text)


def _repeat(
    part: Part, inner: Part, context: StepContext, findings: Findings
) -> sequence.Step | None:
    times = part.integer("times")
    if times is None:
        findings.error(
            part,
            "missing-key",
            "'times' is missing: nothing says how often at most",
            key=True,
            hint="write times: 10, and until: CONDITION to end earlier",
        )
    until = part.get("until")
    if until is None:
        refuse(part, ("else",), "means nothing without 'until'", findings)
    otherwise, text = _else(part, context, findings)
    return sequence.RepeatStep(
        _steps(inner, context, findings),
        times or 1,
        findings.expression(until) if until else None,
        otherwise,
        text,
    )


def _timeout_s(part: Part, findings: Findings) -> float | None:
    return findings.duration(part, "timeout", 0.0, most=sequence.MAX_STEP_S) or None


def _else(
    part: Part, context: StepContext, findings: Findings
) -> tuple[tuple[sequence.Step, ...] | None, str]:
    """Return what to do when it does not come: steps, or what to say."""
    inner = part.get("else")
    if inner is None:
        return None, ""
    if isinstance(inner.data, list):
        return _steps(inner, context, findings), ""
    return None, "" if inner.data == "fail" else str(inner.data)


def _if(
    part: Part, inner: Part, context: StepContext, findings: Findings
) -> sequence.IfStep | None:
    condition = findings.expression(inner)
    then = _steps(part.get("then"), context, findings)
    otherwise, text = _else(part, context, findings)
    if text:
        findings.error(
            part.must("else"),
            "wrong-type",
            "'else' of an 'if' is a list of steps",
            hint="write else: [{ fail: … }] to end here",
        )
    if "then" not in part.data and "else" not in part.data:
        findings.error(part, "missing-key", "'then' is missing: this step does nothing", key=True)
    return None if condition is None else sequence.IfStep(condition, then, otherwise or ())


def _values(parts: dict[str, Part], findings: Findings) -> dict[str, Template | Value]:
    """Return plain values, and templates where text has an expression in it."""
    values: dict[str, Template | Value] = {}
    for name, inner in parts.items():
        if isinstance(inner.data, str):
            template = findings.template(inner)
            if template is not None:
                values[name] = template
        else:
            values[name] = inner.data
    return values
