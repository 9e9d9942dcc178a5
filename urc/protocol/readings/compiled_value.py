"""Conversion of a raw field to a sample, shared by the generated decoders.

Each engine builds the source text for field conversions, checks and samples once. If a value has
the wrong type or is out of range, the ordinary decoder (`slow`) reads the frame again.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from urc.model.values import Sample, Signal
from urc.protocol.compile.source import function_of
from urc.protocol.readings.readings import Readings
from urc.protocol.values.convert import divisor_of
from urc.protocol.values.payload import Frame

__all__ = ["Compiled", "Taken", "Value", "finish", "of_json_type", "value_of"]

Taken = tuple[list[Sample], Sequence[str]]
Compiled = Callable[[Frame, float], "Taken | None"]
"""Function that takes a frame and the time. It returns the samples and the rejected values, or None
if the frame does not match."""

_BEGIN: Final = (
    "    payload = frame.payload",
    "    if type(payload) is not bytes:",
    "        return slow(frame, now)",
)
_GIVE_UP: Final = "        return slow(frame, now)"
_WHOLE: Final = "(type({r}) is int and -9223372036854775808 <= {r} <= 9223372036854775807)"
_JSON_TYPES: Final = {
    "number": "(type({r}) is float or " + _WHOLE + ")",
    "integer": _WHOLE,
    "string": "type({r}) is str",
}


class Value(NamedTuple):
    """Source text that converts one field to a sample."""

    signal: Signal
    convert: str
    """Source text of the expression that converts the raw text; "" means no conversion."""
    checks: tuple[str, ...]
    """Conditions that a valid value meets, as source text; ``{v}`` stands for the value."""
    raw_checks: tuple[str, ...] = ()
    """Conditions that the raw text of a valid value meets; ``{r}`` stands for the raw text."""
    is_finite: bool = True
    """Whether the value is always finite, or `checks` reject infinity and not-a-number."""


def of_json_type(type_name: str, raw: str) -> str:
    """Return source text that checks the JSON type and the supported range of a raw value."""
    return _JSON_TYPES[type_name].format(r=raw)


def value_of(signal: Signal, kind: str, is_plain: bool) -> Value | None:
    """Return the conversion of raw text to a value of `signal`; None if it is not supported."""
    conversion = signal.conversion
    if signal.deadband or signal.debounce_s:
        return None
    if conversion.base or conversion.not_available or conversion.points or conversion.states:
        return None
    raw_checks = () if is_plain else ("{r}.isascii()", "'_' not in {r}")
    if signal.states or signal.type not in ("integer", "number", "string"):
        return None
    if signal.type == "string":
        if kind not in ("text", "word", "json"):
            return None
        return Value(signal, "", (), ("{r}",) if kind == "word" else ())
    if signal.type == "integer" and conversion.polynomial:
        return None
    if kind == "json":
        expression = "{r}"
    elif kind == "word" or (signal.type == "integer" and kind == "number"):
        return None
    else:
        cast_to = "int" if "integer" in (kind, signal.type) else "float"
        expression = f"{cast_to}({{r}})"
    if conversion.polynomial:
        scaled = _scaled(conversion.polynomial, expression)
        if scaled is None:
            return None
        expression = scaled
    low, high = signal.min, signal.max
    checks: tuple[str, ...] = ()
    if low is not None and high is not None:
        checks = (f"{low!r} <= {{v}} <= {high!r}",)
    elif low is not None:
        checks = (f"{low!r} <= {{v}}",)
    elif high is not None:
        checks = (f"{{v}} <= {high!r}",)
    is_finite = signal.type == "integer" or (low is not None and high is not None)
    return Value(signal, expression, checks, raw_checks, is_finite)


def _scaled(coefficients: tuple[float, ...], number: str) -> str | None:
    """Return source text for a scale and offset, with the same arithmetic as `values.convert`."""
    if len(coefficients) != 2:
        return None
    offset, scale = coefficients
    divisor = divisor_of(scale)
    if not divisor:
        return f"{number} * {scale!r} + {offset!r}" if offset else f"{number} * {scale!r}"
    shift = offset * divisor
    if shift != round(shift):
        return None  # the closures check whether this is only a rounding error
    return f"({number} + {round(shift)}) / {divisor}" if shift else f"{number} / {divisor}"


def finish(
    values: Sequence[Value],
    raws: Sequence[str],
    lines: list[str],
    readings: Readings,
    scope: Mapping[str, object],
    slow: Compiled,
    skipped: Sequence[str] = (),
) -> Compiled:
    """Add conversions, checks and samples to `lines`; return the compiled function."""
    names: dict[str, Any] = {
        **scope, "slow": slow, "bytes": bytes, "type": type, "float": float, "int": int,
        "new": tuple.__new__, "Sample": Sample,
        "TypeError": TypeError, "ValueError": ValueError, "OverflowError": OverflowError,
        "IndexError": IndexError,
    }  # fmt: skip
    shown = [
        raw if one.convert in ("", "{r}") and raw.isidentifier() else f"v{place}"
        for place, (one, raw) in enumerate(zip(values, raws, strict=True))
    ]
    tried = [f"        {one}" for one in (*skipped, *_conversions(values, raws, shown))]
    if tried:
        failures = "(IndexError, OverflowError, TypeError, ValueError)"
        lines += ["    try:", *tried, f"    except {failures}:", _GIVE_UP]
    checks = _checks(values, raws, shown)
    if checks:
        lines += [f"    if not ({' and '.join(checks)}):", _GIVE_UP]
    lines += _samples(values, shown, readings, names)
    return function_of("read", "frame, now", [*_BEGIN, *lines], names)


def _conversions(values: Sequence[Value], raws: Sequence[str], shown: Sequence[str]) -> list[str]:
    """Return source lines that convert the raw texts; the lines may raise exceptions."""
    lines = [
        f"{name} = {(one.convert or '{r}').format(r=raw)}"
        for one, raw, name in zip(values, raws, shown, strict=True)
        if name != raw
    ]
    open_ended = [name for one, name in zip(values, shown, strict=True) if not one.is_finite]
    if open_ended:
        # Infinity and not-a-number times zero are not zero.
        lines.append(f"is_finite = ({' + '.join(open_ended)}) * 0 == 0")
    return lines


def _checks(values: Sequence[Value], raws: Sequence[str], shown: Sequence[str]) -> list[str]:
    """Return source lines that check the values."""
    checks = [] if all(one.is_finite for one in values) else ["is_finite"]
    for one, raw, name in zip(values, raws, shown, strict=True):
        checks += [check.format(r=raw) for check in one.raw_checks]
        checks += [check.format(v=name) for check in one.checks]
        if not one.convert:
            checks.append(f"{name} is not None")
    return checks


def _samples(
    values: Sequence[Value], shown: Sequence[str], readings: Readings, names: dict[str, Any]
) -> list[str]:
    """Return source lines that create and return the samples; add helpers to `names`."""
    samples = []
    for one, value in zip(values, shown, strict=True):
        name, alarm = one.signal.name, "''"
        if readings.has_limits(name):
            names["alarm"] = readings.alarm
            alarm = f"alarm({name!r}, {value}, now)"
        samples.append(f"new(Sample, ({name!r}, {value}, now, {alarm}))")
    lines = [f"    samples = [{', '.join(samples)}]"]
    if not any(readings.keeps(one.signal.name) for one in values):
        return [*lines, "    return samples, ()"]
    names["follow"] = readings.follow
    return [*lines, "    refused = []", "    follow(samples, refused, now)",
            "    return samples, refused"]  # fmt: skip
