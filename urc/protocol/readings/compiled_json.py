"""Generated JSON decoders: one function per declaration, from bytes to samples.

Pure. A generated decoder supports only JSON documents in which every field is present and has the
declared type. A second generated function supports documents in which fields are missing or null.
The ordinary decoder reads all other documents, as in `urc.protocol.readings.compiled`.
"""

from collections.abc import Iterator, Mapping

from msgspec import UNSET, DecodeError

from urc.model.payload import ReadSpec
from urc.model.values import Sample
from urc.protocol.compile.source import function_of
from urc.protocol.forms.json_types import ExtractionPlan, PathNode
from urc.protocol.readings.compiled_value import Compiled, Value, finish, of_json_type, value_of
from urc.protocol.readings.readings import Readings

__all__ = ["build_fast_json"]


def build_fast_json(
    spec: ReadSpec, plan: ExtractionPlan, readings: Readings, slow: Compiled
) -> Compiled | None:
    """Return a generated function for documents of `spec`; None if `spec` is not supported."""
    names = [name for name in spec.fields if not name.startswith("_")]
    values: dict[str, Value] = {}
    for name in names:
        value = value_of(readings.signals[name], "json", True)
        if value is None:
            return None
        # The decoder accepts only finite numbers, but a product may be infinite.
        values[name] = value._replace(is_finite=value.is_finite or value.convert in ("", "{r}"))
    raws = {name: f"r{place}" for place, name in enumerate(names)}
    lines = ["    try:", "        v = decode(payload)", "    except Otherwise:"]
    lines += ["        return slow(frame, now)", "    try:", "        pass"]
    lines += _picks(plan.want, plan, "v", raws)
    lines += ["    except (AttributeError, IndexError, TypeError):"]
    lines += ["        return careful(v, frame, now)"]
    checks = [of_json_type(values[name].signal.type, raws[name]) for name in names]
    lines += [f"    if not ({' and '.join(checks or ['True'])}):"]
    lines += ["        return careful(v, frame, now)"]
    # A different structure or an invalid document: the closures determine which.
    otherwise = (DecodeError, UnicodeError, RecursionError)
    scope = {
        "AttributeError": AttributeError,
        "Otherwise": otherwise,
        "careful": _careful(values, raws, plan, readings, slow),
        "decode": plan.decode,
        "str": str,
        "type": type,
    }
    return finish([*values.values()], [*raws.values()], lines, readings, scope, slow)


def _picks(
    want: PathNode, plan: ExtractionPlan, variable: str, raws: Mapping[str, str]
) -> Iterator[str]:
    """Yield source lines that read the fields, assuming that every field is present."""
    for field in want.fields:
        if field in raws:
            yield f"        {raws[field]} = {variable}"
    for place, (step, inner) in enumerate(want.steps.items()):
        name = f"{variable}_{place}"
        yield f"        {name} = {variable}{plan.access(want, step)}"
        yield from _picks(inner, plan, name, raws)


def _careful(
    values: Mapping[str, Value],
    raws: Mapping[str, str],
    plan: ExtractionPlan,
    readings: Readings,
    slow: Compiled,
) -> object:
    """Return a function for decoded documents with missing or null fields."""
    lines = [f"    {raw} = UNSET" for raw in raws.values()]
    lines += plan.picking("v", lambda field: f"{raws[field]} = " if field in raws else "")
    scope: dict[str, object] = {
        "UNSET": UNSET, "Sample": Sample, "len": len, "new": tuple.__new__, "slow": slow,
        "float": float, "int": int, "str": str, "type": type,
    }  # fmt: skip
    lines += ["    samples = []"]
    for name, value in values.items():
        raw, alarm = raws[name], "''"
        if readings.has_limits(name):
            scope["alarm"] = readings.alarm
            alarm = f"alarm({name!r}, {{v}}, now)"
        sample = f"samples.append(new(Sample, ({name!r}, {{v}}, now, {alarm})))"
        lines += [f"    if {raw} is None:", f"        {sample.format(v=None)}"]
        lines += [f"    elif {raw} is not UNSET:"]
        lines += [f"        if not {of_json_type(value.signal.type, raw)}:"]
        lines += ["            return slow(frame, now)"]
        lines += [f"        x = {(value.convert or '{r}').format(r=raw)}"]
        checks = [check.format(v="x") for check in value.checks]
        if value.convert and value.convert != "{r}":
            checks.append("x * 0 == 0")  # a product may be infinite
        if checks:
            lines += [f"        if not ({' and '.join(checks)}):"]
            lines += ["            return slow(frame, now)"]
        lines += [f"        {sample.format(v='x')}"]
    missing = " and ".join(f"{raw} is UNSET" for raw in raws.values()) or "True"
    lines += [f"    if {missing}:", "        return slow(frame, now)"]
    if any(readings.keeps(name) for name in values):
        scope["follow"] = readings.follow
        lines += ["    refused = []", "    follow(samples, refused, now)"]
        lines.append("    return samples, refused")
    else:
        lines.append("    return samples, ()")
    return function_of("read_careful", "v, frame, now", lines, scope)
