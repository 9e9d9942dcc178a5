"""Parser for the reply to a request: mapping → `Reply`, with stages and error replies."""

from urc.config.form_table import READ_FORMS
from urc.config.node import Node, Problems
from urc.config.parse.form import FormContext, parse_read
from urc.config.parse.form_options import parse_lines
from urc.config.parse.framing import parse_framing
from urc.model.driver import FramingSpec, Reply
from urc.model.exchange import ErrorReply, ProvisionalReplies, Stage
from urc.model.payload import NUMBERED, ReadSpec, WriteSpec
from urc.patterns import Pattern

__all__ = [
    "implied_reply",
    "parse_errors",
    "parse_own_framing",
    "parse_reply",
    "parse_stage",
    "refuse",
]

_OF_THE_WHOLE = ("match", "stages", "framing")
"""Keys that are valid for a whole reply but not for one of its stages."""
_BESIDE_SILENCE = (
    "fields", "head", "set", "when", "lines", "match", "timeout", "framing", "resend", "extend",
)  # fmt: skip
_MOST_BUSY_S = 600.0
"""Default for ``within``: maximum total time for a delayed reply, in seconds."""


def parse_reply(part: Node | None, problems: Problems, context: FormContext) -> Reply | None:
    """Return the reply at `part`; None without a `part`."""
    if part is None:
        return None
    own, context = parse_own_framing(part, problems, context)
    stages = part.listed("stages")
    for inner in stages:
        refuse(inner, _OF_THE_WHOLE, "must be a key of 'reply', not of a stage", problems)
    if stages:
        beside = (
            *READ_FORMS,
            "fields",
            "set",
            "when",
            "lines",
            "timeout",
            "silence",
            "resend",
            "extend",
        )
        refuse(part, beside, "must be a key of a stage, not of 'reply'", problems)
    first, *others = [parse_stage(inner, problems, context) for inner in stages or [part]]
    errors, faults = parse_errors(part, problems, context) if stages else ((), ())
    match = part.get("match")
    return Reply(
        read=first.read,
        errors=first.errors,
        faults=first.faults,
        timeout_s=first.timeout_s,
        match=problems.expression(match) if match else None,
        stages=tuple(others),
        framing=own,
        asides=first.asides,
    ).with_errors(errors, faults)


def implied_reply(send: WriteSpec) -> Reply | None:
    """Return the implied reply to a request if its protocol always replies; otherwise None.

    The reply is needed to detect a refusal: without it, a request would be complete as soon as it
    is sent.
    """
    return Reply(ReadSpec("any")) if send.options.get("verb") in NUMBERED else None


def parse_stage(part: Node, problems: Problems, context: FormContext) -> Stage:
    """Return one stage of a reply."""
    errors, faults = parse_errors(part, problems, context)
    if "silence" in part.data:
        return _silence(part, errors, faults, problems)
    return Stage(
        read=_read(part, problems, context),
        errors=errors,
        faults=faults,
        timeout_s=problems.duration(part, "timeout", 0.0, most=3600) or None,
        asides=_asides(part, problems, context),
    )


def _silence(
    part: Node,
    errors: tuple[Pattern, ...],
    faults: tuple[ErrorReply, ...],
    problems: Problems,
) -> Stage:
    """Return the stage of a reply that treats silence as success."""
    beside = (*READ_FORMS, *_BESIDE_SILENCE)
    refuse(part, beside, "has no effect with 'silence', because silence is the reply", problems)
    read, within_s = ReadSpec("silence"), problems.duration(part, "silence", 0.3, most=60)
    return Stage(read=read, errors=errors, faults=faults, timeout_s=within_s)


def _asides(part: Node, problems: Problems, context: FormContext) -> ProvisionalReplies:
    """Return the provisional replies under ``resend:`` and ``extend:``."""
    extend, extend_s = part.get("extend"), _MOST_BUSY_S
    if extend is not None and isinstance(extend.data, dict):
        extend_s = problems.duration(extend, "within", _MOST_BUSY_S, most=3600)
        if extend_s < problems.duration(part, "timeout", 0.0, most=3600):
            problems.error(
                extend,
                "wrong-order",
                "'within' is shorter than the timeout of the reply",
                at="within",
                hint="'timeout' limits the wait for each frame, and 'within' limits the total wait",
            )
    resend = part.get("resend")
    if resend is not None and isinstance(resend.data, dict):
        refuse(resend, ("within",), "belongs to 'extend'", problems)
    return ProvisionalReplies(
        _aside(resend, problems, context), _aside(extend, problems, context), extend_s
    )


def _aside(part: Node | None, problems: Problems, context: FormContext) -> ReadSpec | None:
    """Return the declaration of a frame in any form; plain text is a pattern."""
    if part is None:
        return None
    if isinstance(part.data, dict):
        return parse_read(part, problems, context)
    pattern = problems.pattern(part)
    return ReadSpec("regex", {"pattern": pattern}, pattern.groups) if pattern else None


def parse_errors(
    part: Node, problems: Problems, context: FormContext
) -> tuple[tuple[Pattern, ...], tuple[ErrorReply, ...]]:
    """Return the patterns under ``errors:`` and the error replies in other forms."""
    patterns: list[Pattern] = []
    faults: list[ErrorReply] = []
    for inner in part.listed("errors"):
        if isinstance(inner.data, dict):
            text = inner.get("text")
            read = parse_read(inner, problems, context)
            faults.append(ErrorReply(read, problems.template(text) if text else None))
        else:
            pattern = problems.pattern(inner)
            if pattern is not None:
                patterns.append(pattern)
    return tuple(patterns), tuple(faults)


def refuse(part: Node, keys: tuple[str, ...], why: str, problems: Problems) -> None:
    """Report each of `keys` that `part` contains, with the reason `why`."""
    for key in keys:
        if key in part.data:
            problems.error(part, "misplaced-key", f"'{key}' {why}", at=key, key=True)


def parse_own_framing(
    part: Node, problems: Problems, context: FormContext
) -> tuple[FramingSpec | None, FormContext]:
    """Return the reply's own framing, if any, and the context for the reply's forms."""
    inner = part.get("framing")
    if inner is None:
        return None, context
    if context.catalog is None:
        return None, context  # the missing transports are already reported
    spec = parse_framing(inner, context.encoding, problems, context.catalog)
    return spec, context._replace(framing=None)


def _read(part: Node, problems: Problems, context: FormContext) -> ReadSpec:
    lines = parse_lines(part.get("lines"), problems)
    return parse_read(part, problems, context)._replace(lines=lines)
