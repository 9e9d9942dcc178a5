"""The keys beside a form of reading: fields, set, when, and the lines of a reply."""

from urc.config.conversion import parse_conversion, parse_states
from urc.config.part import Findings, Part
from urc.expressions import Template
from urc.model.codec import ReadSpec
from urc.model.values import Conversion
from urc.patterns import Pattern

__all__ = ["beside_form", "parse_lines"]


def beside_form(part: Part, spec: ReadSpec, findings: Findings) -> ReadSpec:
    """Return `spec` with what stands beside its form in the reply or message at `part`."""
    conversions = {
        name: _conversion(inner, findings) for name, inner in part.named("fields").items()
    }
    sets = {name: findings.expression(inner) for name, inner in part.named("set").items()}
    for name, inner in part.named("set").items():
        if name in spec.fields:
            text = f"the frame gives {name!r} already"
            hint = f"call the field _{name}, and write it so in the expression"
            findings.error(inner, "duplicate-name", text, key=True, hint=hint)
    when = part.get("when")
    return spec._replace(
        fields=(*spec.fields, *sets),
        conversions=conversions,
        sets=_compiled(sets),
        when=findings.expression(when) if when else None,
    )


def _compiled(sets: dict[str, Template | None]) -> dict[str, Template]:
    return {name: one for name, one in sets.items() if one is not None}


def _conversion(part: Part, findings: Findings) -> Conversion:
    conversion = parse_conversion(part, findings)
    return conversion._replace(states=parse_states(part, "", findings))


def parse_lines(part: Part | None, findings: Findings) -> int | Pattern | None:
    """Return how many frames a reply is, or what the last of them matches."""
    if part is None:
        return None
    if isinstance(part.data, dict):
        return findings.pattern(part.must("until"))
    return int(part.data)
