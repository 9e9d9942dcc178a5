"""Parser for the keys next to a received form: `fields`, `set`, `when` and `lines`."""

from urc.config.node import Node, Problems
from urc.config.parse.conversion import parse_conversion, parse_states
from urc.expressions import Template
from urc.model.payload import Collect, ReadSpec
from urc.model.values import NOTHING, Conversion, Value
from urc.patterns import Pattern

_DURATIONS = ("throttle", "every")

__all__ = ["beside_form", "parse_lines", "with_collected"]


def beside_form(part: Node, spec: ReadSpec, problems: Problems) -> ReadSpec:
    """Return `spec` with the additional keys of the reply or message at `part`."""
    conversions = {
        name: _conversion(inner, problems) for name, inner in part.named("fields").items()
    }
    sets = {
        name: problems.expression(inner, allows_bytes=True)
        for name, inner in part.named("set").items()
    }
    for name, inner in part.named("set").items():
        if name in spec.fields:
            text = f"the frame already sets {name!r}"
            hint = f"rename the field to _{name}, and use this name in the expression"
            problems.error(inner, "duplicate-name", text, key=True, hint=hint)
    heads = part.named("head") if "head" in part.data else {}
    for name, inner in heads.items():
        if name in spec.fields:
            text = f"the frame already sets {name!r}"
            problems.error(
                inner,
                "duplicate-name",
                text,
                key=True,
                hint="rename the field or the name under 'head'",
            )
    when, subscribe = part.get("when"), part.get("subscribe")
    topic = problems.template(subscribe.must("topic")) if subscribe else None
    if topic is not None and any(sign in topic.source for sign in "+#*"):
        spec = spec._replace(fields=(*spec.fields, "_topic"))
    head = {name: str(inner.data).lower() for name, inner in heads.items()}
    spec = spec._replace(head=head, fields=(*spec.fields, *head))
    return spec._replace(
        topic=topic,
        listen=_listening(subscribe, problems) if subscribe else NOTHING,
        fields=(*spec.fields, *sets),
        conversions=conversions,
        sets=_compiled(sets),
        when=problems.expression(when) if when else None,
    )


def with_collected(part: Node, spec: ReadSpec, problems: Problems) -> ReadSpec:
    """Return `spec` with the values that the message at `part` collects over several frames."""
    found: dict[str, Collect] = {}
    for name, inner in part.named("collect").items():
        if name in spec.fields:
            text = f"the frame already sets {name!r}"
            hint = f"rename the field to _{name}, and collect the renamed field"
            problems.error(inner, "duplicate-name", text, key=True, hint=hint)
        begin, end = inner.get("begin"), inner.get("end")
        if begin is None and end is None:
            text = "'begin' or 'end' is missing"
            hint = "give a condition for the first frame (begin), or for the last frame (end)"
            problems.error(inner, "missing-key", text, key=True, hint=hint)
        value = problems.expression(inner.must("value"), allows_bytes=True)
        if value is not None:
            found[name] = Collect(
                value,
                problems.expression(begin) if begin else None,
                problems.expression(end) if end else None,
                inner.integer("max") or Collect(value).max,
            )
    return spec._replace(fields=(*spec.fields, *found), collects=found) if found else spec


def _listening(part: Node, problems: Problems) -> dict[str, Value]:
    return {
        name: problems.duration(part, name, 0.0, least=0.0)
        if name in _DURATIONS
        else part.scalar(name)
        for name in part.data
        if name != "topic"
    }


def _compiled(sets: dict[str, Template | None]) -> dict[str, Template]:
    return {name: one for name, one in sets.items() if one is not None}


def _conversion(part: Node, problems: Problems) -> Conversion:
    conversion = parse_conversion(part, problems)
    return conversion._replace(states=parse_states(part, "", problems))


def parse_lines(part: Node | None, problems: Problems) -> int | Pattern | None:
    """Return the number of frames in a reply, or the pattern of the last frame."""
    if part is None:
        return None
    if isinstance(part.data, dict):
        return problems.pattern(part.must("until"))
    return int(part.data)
