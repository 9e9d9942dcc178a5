"""Parser for a signal's limits: alarm limits, alarm states and their attributes."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Final

from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import did_you_mean
from urc.config.values import check_within
from urc.expressions import Template
from urc.model.values import AlarmAttributes, AlarmLimits

__all__ = ["NUMERIC_LIMITS", "parse_limits"]

NUMERIC_LIMITS: Final = ("lolo", "low", "high", "hihi")
"""Keys of numeric limits, in ascending order."""
_NUMBERS: Final = ("integer", "number")
_WITH_STATES: Final = ("integer", "boolean", "string")
_Bounds = tuple[float | None, float | None]


def parse_limits(
    part: Node,
    kind: str,
    bounds: _Bounds,
    states: tuple[tuple[str, str], ...],
    problems: Problems,
) -> AlarmLimits:
    """Return the limits of the signal at `part`.

    Args:
        part: the signal.
        kind: type of the signal, or of an array's elements.
        bounds: the signal's ``min`` and ``max``.
        states: the signal's states, as pairs of the text from the robot and the displayed word.
        problems: collector of problems.
    """
    inner = part.get("limits")
    if inner is None:
        return AlarmLimits()
    if kind not in (*_NUMBERS, *_WITH_STATES):
        problems.error(inner, "misplaced-key", f"'limits' has no effect for type {kind}", key=True)
        return AlarmLimits()
    if not {*NUMERIC_LIMITS, "states"} & inner.data.keys():
        hint = f"add one of {', '.join(NUMERIC_LIMITS)}, or 'states' for a boolean or text"
        problems.error(
            inner,
            "missing-key",
            "'limits' has no limit and no state, so no value can cause an alarm",
            key=True,
            hint=hint,
        )
        return AlarmLimits()
    values = _numbers(inner, kind, bounds, problems)
    words = _words(inner, kind, states, problems)
    return AlarmLimits(
        lolo=values["lolo"],
        low=values["low"],
        high=values["high"],
        hihi=values["hihi"],
        hysteresis=_hysteresis(inner, values, problems),
        for_s=problems.duration(inner, "for", 0.0, least=0.0),
        off_delay_s=problems.duration(inner, "off_delay", 0.0, least=0.0),
        states=tuple(words),
        attributes=_attributes(inner, values, words, problems),
    )


def _numbers(part: Node, kind: str, bounds: _Bounds, problems: Problems) -> dict[str, float | None]:
    """Return all limits by name, with None as the value of a missing limit."""
    values: dict[str, float | None] = {name: _limit(part, name) for name in NUMERIC_LIMITS}
    given = [(name, value) for name, value in values.items() if value is not None]
    if kind not in _NUMBERS:
        for name, _ in given:
            text = f"the limit {name!r} has no effect for type {kind}"
            hint = "name the values that cause an alarm under 'states'"
            problems.error(part, "misplaced-key", text, at=name, key=True, hint=hint)
        return dict.fromkeys(NUMERIC_LIMITS)
    for (name, value), (after, more) in pairwise(given):
        if value >= more:
            problems.error(
                part,
                "wrong-order",
                f"{after} {more:g} is not above {name} {value:g}",
                at=after,
                hint=f"swap the two values: {name}: {more:g}, {after}: {value:g}"
                if value > more
                else "the order is lolo < low < high < hihi",
            )
    for name, value in given:
        check_within(value, *bounds, part.must(name), problems)
    return values


def _limit(part: Node, name: str) -> float | None:
    inner = part.get(name)
    if inner is None:
        return None
    return inner.number("at") if isinstance(inner.data, dict) else inner.data


def _words(
    part: Node, kind: str, states: tuple[tuple[str, str], ...], problems: Problems
) -> dict[str, Node]:
    """Return the alarm states with their nodes."""
    given = part.named("states")
    if not given:
        return {}
    if kind not in _WITH_STATES and not states:
        text = f"alarm states have no effect for type {kind}"
        hint = f"write limits, such as {', '.join(NUMERIC_LIMITS)}"
        problems.error(part, "misplaced-key", text, at="states", key=True, hint=hint)
        return {}
    known = ["true", "false"] if kind == "boolean" else [word for _, word in states]
    for word, inner in given.items():
        if known and word not in known:
            text = f"the signal never has the value {word!r}"
            hint = did_you_mean(word, known, "values")
            problems.error(inner, "unknown-word", text, key=True, hint=hint)
        elif kind == "integer" and not states and not word.removeprefix("-").isdecimal():
            text = f"the signal has the type integer, but {word!r} is not an integer"
            problems.error(inner, "wrong-type", text, key=True)
    return given


def _hysteresis(part: Node, values: Mapping[str, float | None], problems: Problems) -> float:
    width = part.number("hysteresis") or 0.0
    if width and all(value is None for value in values.values()):
        text = "'hysteresis' has no effect for alarm states"
        hint = "use 'off_delay' to suppress brief changes"
        problems.error(part, "misplaced-key", text, at="hysteresis", key=True, hint=hint)
        return 0.0
    low = values["low"] if values["low"] is not None else values["lolo"]
    high = values["high"] if values["high"] is not None else values["hihi"]
    if low is not None and high is not None and width >= high - low > 0:
        problems.warn(
            part,
            "wide-hysteresis",
            f"the alarm at {low:g} would end only at {low + width:g}, after the alarm at {high:g}"
            " has started",
            at="hysteresis",
            hint=f"make the hysteresis smaller than {high - low:g}, the distance between the two"
            " limits",
        )
    return width


def _attributes(
    part: Node,
    values: Mapping[str, float | None],
    words: Mapping[str, Node],
    problems: Problems,
) -> tuple[tuple[str, AlarmAttributes], ...]:
    """Return the attributes of limits and alarm states that differ from the default attributes.

    The keys at `part` are the defaults for the keys of each limit or state.
    """
    usual = AlarmLimits()
    found = []
    shared = _suppression(part, problems)
    for name in [name for name, value in values.items() if value is not None] + [*words]:
        inner = words.get(name) or part.must(name)
        own = inner if isinstance(inner.data, dict) else Node(inner.document, inner.path, {})
        base = part.text("priority", usual.attributes_of(name).priority)
        attributes = AlarmAttributes(
            priority=own.text("priority", base),  # type: ignore[arg-type]  # the schema's enum
            cause=own.text("cause", part.text("cause")),
            action=own.text("action", part.text("action")),
            command=own.text("command", part.text("command")),
            suppressed_when=_suppression(own, problems) or shared,
        )
        if attributes != usual.attributes_of(name):
            found.append((name, attributes))
    return tuple(found)


def _suppression(part: Node, problems: Problems) -> Template | None:
    inner = part.get("suppressed_when")
    return problems.expression(inner) if inner is not None else None
