"""One function made for one kind of frame: text → samples, without anything in between.

Floor 3. As in `urc.protocol.fast_encode`, the function takes the case that happens: every field
there, a value of its signal, within its range. At anything else it turns to the closures (`slow`),
which read the frame again; they are also the oracle of its tests.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple, cast

from urc.model.codec import Payload, ReadSpec
from urc.model.text import FieldKind, Hole
from urc.model.values import Sample, Signal
from urc.patterns import Pattern, is_plain_group, literal_prefix
from urc.protocol.convert import divisor_of
from urc.protocol.forms import Reader
from urc.protocol.generate import function_of
from urc.protocol.readings import Readings

if TYPE_CHECKING:
    from urc.protocol.json_paths import JsonReader

__all__ = [
    "FastRead",
    "Slow",
    "Taken",
    "Value",
    "build_fast_read",
    "finish",
    "of_json_type",
    "prefix_of",
    "value_of",
]

Taken = tuple[list[Sample], Sequence[str]]
Slow = Callable[[Payload, float], "Taken | None"]
"""A frame and the time → samples and refused values, or None for another frame."""
FastRead = Callable[[bytes, float], "Taken | None"]
"""The same, of bytes alone."""


_WHOLE: Final = "(type({r}) is int and -9223372036854775808 <= {r} <= 9223372036854775807)"
_JSON_TYPES: Final = {
    "number": "(type({r}) is float or " + _WHOLE + ")",
    "integer": _WHOLE,
    "string": "type({r}) is str",
}


class Value(NamedTuple):
    """How one field becomes a sample, in source text."""

    signal: Signal
    convert: str
    """Expression over the raw text; "" for text as it is."""
    checks: tuple[str, ...]
    """What must hold of the value, over ``{v}``."""
    raw_checks: tuple[str, ...] = ()
    """What must hold of the raw text, over ``{r}``."""
    is_finite: bool = True
    """Whether `checks` refuse what is infinite or no number."""


def build_fast_read(
    spec: ReadSpec, reader: Reader, readings: Readings, slow: Slow, encoding: str = "utf-8"
) -> FastRead | None:
    """Return the function for frames of `spec`, or None where only `slow` can read them."""
    if spec.conversions or spec.sets or spec.when or spec.lines or spec.collects:
        return None
    if spec.form == "regex":
        return _of_regex(cast("Pattern", spec.options["pattern"]), encoding, readings, slow)
    if spec.form == "pattern":
        holes = cast("tuple[Hole, ...]", spec.options["holes"])
        if any(hole.width for hole in holes):
            return None
        return _of_pattern(holes, cast("str", spec.options["tail"]), encoding, readings, slow)
    if spec.form == "struct":
        from urc.protocol.fast_struct import build_fast_struct

        return build_fast_struct(spec, encoding, readings, slow)
    if spec.form == "json":
        from urc.protocol.fast_json import build_fast_json

        plan = cast("JsonReader", reader).plan
        return None if plan is None else build_fast_json(spec, plan, readings, slow)
    return None


def prefix_of(spec: ReadSpec) -> str:
    """Return the text with which every frame of `spec` begins, blanks aside; "" when unknown."""
    if spec.form == "regex":
        return literal_prefix(cast("Pattern", spec.options["pattern"]))
    if spec.form == "pattern":
        holes = cast("tuple[Hole, ...]", spec.options["holes"])
        first = holes[0].before if holes else cast("str", spec.options["tail"])
        return first.lstrip().partition(" ")[0]
    if spec.form == "equals":
        return cast("str", spec.options["text"])
    return ""


def _of_regex(pattern: Pattern, encoding: str, readings: Readings, slow: Slow) -> FastRead | None:
    if pattern.match is None:
        return None
    values: dict[str, Value] = {}
    for name in pattern.groups:
        if name.startswith("_"):
            continue
        value = value_of(readings.signals[name], "text", is_plain_group(pattern, name))
        if value is None:
            return None
        values[name] = value
    lines = [
        "    try:",
        f"        text = payload.decode({encoding!r})",
        "    except UnicodeDecodeError:",
        "        return slow(payload, now)",
        "    found = match(text)",
        "    if found is None:",
        "        return None",
    ]
    raws = [f"r{place}" for place in range(len(values))]
    places = [pattern.places[name] for name in values]
    if len(values) == 1:
        lines.append(f"    r0 = found[{places[0]}]")
    elif values:
        lines.append(f"    {', '.join(raws)} = found.group({', '.join(map(str, places))})")
    scope = {"match": pattern.match, "UnicodeDecodeError": UnicodeDecodeError}
    return finish(list(values.values()), raws, lines, readings, scope, slow)


def of_json_type(type_name: str, raw: str) -> str:
    """Return the check that a raw value is one of the type, and no larger than it may be."""
    return _JSON_TYPES[type_name].format(r=raw)


def _of_pattern(
    holes: tuple[Hole, ...], tail: str, encoding: str, readings: Readings, slow: Slow
) -> FastRead | None:
    """Return the function for a pattern whose words are either fields or literals."""
    words = _words(holes, tail)
    kinds = {word.kind for word in words or () if isinstance(word, Hole)}
    if words is None or "hex" in kinds or encoding not in ("utf-8", "ascii", "latin-1"):
        return None
    checks = ["payload.isascii()", f"len(parts) == {len(words)}"]
    lines = ["    parts = payload.split(b' ')"]
    literals: dict[int, str | bytes] = {
        place: word.encode(encoding) for place, word in enumerate(words) if isinstance(word, str)
    }
    if "word" in kinds:
        # Only what is kept as text must be made into text.
        lines = ["    if not payload.isascii():", "        return slow(payload, now)"]
        lines += ["    text = payload.decode()", "    parts = text.split(' ')"]
        literals = {place: word for place, word in enumerate(words) if isinstance(word, str)}
        checks[0] = "text.isprintable()"
    checks += [f"parts[{place}] == {word!r}" for place, word in literals.items()]
    if "integer" in kinds:
        checks.append("len(payload) <= 400")  # as many digits as the pattern itself takes
    if kinds - {"word"}:
        checks.append("95 not in payload")  # an underscore, which only Python's numbers take
    lines += [f"    if not ({' and '.join(checks)}):", "        return slow(payload, now)"]
    values: list[Value] = []
    raws: list[str] = []
    skipped: list[str] = []
    for place, word in enumerate(words):
        if not isinstance(word, Hole):
            continue
        if not word.name or word.name.startswith("_"):
            skipped.append(_skipped(word.kind, f"parts[{place}]"))
            continue
        value = value_of(readings.signals[word.name], word.kind, True)
        if value is None:
            return None
        values.append(value)
        raws.append(f"parts[{place}]")
    return finish(values, raws, lines, readings, {"len": len}, slow, skipped)


def _words(holes: tuple[Hole, ...], tail: str) -> list[str | Hole] | None:
    """Return the words of a pattern, or None when a field is only a part of one."""
    words: list[str | Hole] = []
    for place, hole in enumerate(holes):
        before = hole.before.lstrip() if place == 0 else hole.before
        if hole.kind in ("text", "rest") or (before and not before.endswith(" ")):
            return None
        if place and not before.startswith(" "):
            return None
        words += [*before.split(), hole]
    if tail and not tail.startswith(" ") and holes:
        return None
    return [*words, *tail.split()]


def _skipped(kind: FieldKind, raw: str) -> str:
    """Return what must be tried of a field that nobody wants, so that other frames are told."""
    return {"integer": f"int({raw})", "number": f"float({raw})"}.get(kind, f"{raw}[0]")


def value_of(signal: Signal, kind: str, is_plain: bool) -> Value | None:
    """Return how raw text of a field becomes a value of `signal`; None when that is not simple."""
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
    """Return the same arithmetic as `urc.protocol.convert` has for a scale and an offset."""
    if len(coefficients) != 2:
        return None
    offset, scale = coefficients
    divisor = divisor_of(scale)
    if not divisor:
        return f"{number} * {scale!r} + {offset!r}" if offset else f"{number} * {scale!r}"
    shift = offset * divisor
    if shift != round(shift):
        return None  # the closures know whether that is only a matter of rounding
    return f"({number} + {round(shift)}) / {divisor}" if shift else f"{number} / {divisor}"


def finish(
    values: Sequence[Value],
    raws: Sequence[str],
    lines: list[str],
    readings: Readings,
    scope: Mapping[str, object],
    slow: Slow,
    skipped: Sequence[str] = (),
) -> FastRead:
    """Add the conversions, their checks and the samples to `lines`, and make the function."""
    names: dict[str, Any] = {
        **scope, "slow": slow, "float": float, "int": int, "new": tuple.__new__, "Sample": Sample,
        "TypeError": TypeError, "ValueError": ValueError, "OverflowError": OverflowError,
        "IndexError": IndexError,
    }  # fmt: skip
    tried = [f"        {one}" for one in skipped]
    names_of_values: list[str] = []
    for place, one in enumerate(values):
        is_as_it_is = one.convert in ("", "{r}") and raws[place].isidentifier()
        names_of_values.append(raws[place] if is_as_it_is else f"v{place}")
        if not is_as_it_is:
            tried.append(f"        v{place} = {(one.convert or '{r}').format(r=raws[place])}")
    open_ended = [
        name for name, one in zip(names_of_values, values, strict=True) if not one.is_finite
    ]
    if open_ended:
        # Nothing times infinity or not-a-number is zero.
        tried.append(f"        is_finite = ({' + '.join(open_ended)}) * 0 == 0")
    if tried:
        failures = "(IndexError, OverflowError, TypeError, ValueError)"
        lines += [
            "    try:",
            *tried,
            f"    except {failures}:",
            "        return slow(payload, now)",
        ]
    checks = ["is_finite"] if open_ended else []
    for place, (one, raw) in enumerate(zip(values, raws, strict=True)):
        checks += [check.format(r=raw) for check in one.raw_checks]
        checks += [check.format(v=names_of_values[place]) for check in one.checks]
        if not one.convert:
            checks.append(f"{names_of_values[place]} is not None")
    if checks:
        lines += [f"    if not ({' and '.join(checks)}):", "        return slow(payload, now)"]
    samples = []
    for place, one in enumerate(values):
        name, alarm, value = one.signal.name, "''", names_of_values[place]
        if readings.judges(name):
            names["alarm"] = readings.alarm
            alarm = f"alarm({name!r}, {value}, now)"
        samples.append(f"new(Sample, ({name!r}, {value}, now, {alarm}))")
    lines.append(f"    samples = [{', '.join(samples)}]")
    if any(readings.keeps(one.signal.name) for one in values):
        names["follow"] = readings.follow
        lines += ["    refused = []", "    follow(samples, refused, now)"]
        lines.append("    return samples, refused")
    else:
        lines.append("    return samples, ()")
    return function_of("read", "payload, now", lines, names)
