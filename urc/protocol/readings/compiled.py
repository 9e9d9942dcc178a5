"""Generated decoders of text frames: one function per declaration, from text to samples.

A generated decoder handles only the common case, in which every field is present and valid. In all
other cases, the ordinary decoder (`slow`) reads the frame again. Tests compare the generated
decoders with the ordinary decoder.
"""

from typing import TYPE_CHECKING, Final, cast

from urc.model.payload import ReadSpec
from urc.model.text import FieldKind, PatternField
from urc.patterns import Pattern, is_plain_group, literal_prefix
from urc.protocol.readings.compiled_value import Compiled, Value, finish, value_of
from urc.protocol.readings.readings import Readings
from urc.protocol.values.payload import PayloadReader

if TYPE_CHECKING:
    from urc.protocol.forms.json_paths import JsonReader

__all__ = ["build_fast_read"]

_KEEPS_ASCII: Final = frozenset(("utf-8", "ascii", "latin-1"))
"""Encodings in which ASCII characters have the same bytes as in ASCII."""


def build_fast_read(
    spec: ReadSpec,
    reader: PayloadReader,
    readings: Readings,
    slow: Compiled,
    encoding: str = "utf-8",
) -> Compiled | None:
    """Return a generated function for frames of `spec`; None if `spec` is not supported."""
    if spec.conversions or spec.sets or spec.when or spec.lines or spec.collects:
        return None
    if spec.form == "regex":
        return _of_regex(cast("Pattern", spec.options["pattern"]), encoding, readings, slow)
    if spec.form == "pattern":
        holes = cast("tuple[PatternField, ...]", spec.options["holes"])
        if any(hole.width for hole in holes):
            return None
        return _of_pattern(holes, cast("str", spec.options["tail"]), encoding, readings, slow)
    if spec.form == "struct":
        from urc.protocol.readings.compiled_struct import build_fast_struct

        return build_fast_struct(spec, encoding, readings, slow)
    if spec.form == "json":
        from urc.protocol.readings.compiled_json import build_fast_json

        plan = cast("JsonReader", reader).plan
        return None if plan is None else build_fast_json(spec, plan, readings, slow)
    return None


def _head_check(prefix: str, encoding: str) -> list[str]:
    """Return source lines that reject most of the frames that do not begin with `prefix`.

    Frames with leading blanks or non-ASCII bytes pass the generated check, because the decoder may
    skip blanks or report undecodable bytes.
    """
    if not prefix or encoding not in _KEEPS_ASCII:
        return []
    return [
        f"    if not payload.startswith({prefix.encode(encoding)!r}):",
        "        if payload[:1] > b' ' and payload.isascii():",
        "            return None",
    ]


def _of_regex(
    pattern: Pattern, encoding: str, readings: Readings, slow: Compiled
) -> Compiled | None:
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
        *_head_check(literal_prefix(pattern), encoding),
        "    try:",
        f"        text = payload.decode({encoding!r})",
        "    except UnicodeDecodeError:",
        "        return slow(frame, now)",
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


def _of_pattern(
    holes: tuple[PatternField, ...], tail: str, encoding: str, readings: Readings, slow: Compiled
) -> Compiled | None:
    """Return a generated function for a pattern of whole words, each a field or a literal."""
    words = _words(holes, tail)
    kinds = {word.kind for word in words or () if isinstance(word, PatternField)}
    if words is None or "hex" in kinds or encoding not in _KEEPS_ASCII:
        return None
    checks = ["payload.isascii()", f"len(parts) == {len(words)}"]
    head = _head_check(words[0], encoding) if words and isinstance(words[0], str) else []
    lines = [*head, "    parts = payload.split(b' ')"]
    literals: dict[int, str | bytes] = {
        place: word.encode(encoding) for place, word in enumerate(words) if isinstance(word, str)
    }
    if "word" in kinds:
        # Only fields that stay text need decoding.
        lines = [*head, "    if not payload.isascii():", "        return slow(frame, now)"]
        lines += ["    text = payload.decode()", "    parts = text.split(' ')"]
        literals = {place: word for place, word in enumerate(words) if isinstance(word, str)}
        checks[0] = "text.isprintable()"
    checks += [f"parts[{place}] == {word!r}" for place, word in literals.items()]
    if "integer" in kinds:
        checks.append("len(payload) <= 400")  # the maximum number of digits in a pattern
    if kinds - {"word"}:
        checks.append("95 not in payload")  # an underscore, which only Python accepts in numbers
    lines += [f"    if not ({' and '.join(checks)}):", "        return slow(frame, now)"]
    values: list[Value] = []
    raws: list[str] = []
    skipped: list[str] = []
    for place, word in enumerate(words):
        if not isinstance(word, PatternField):
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


def _words(holes: tuple[PatternField, ...], tail: str) -> list[str | PatternField] | None:
    """Return the fields and literal words of a pattern; None if a field is only part of a word."""
    words: list[str | PatternField] = []
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
    """Return source text that checks a skipped field and rejects non-matching frames."""
    return {"integer": f"int({raw})", "number": f"float({raw})"}.get(kind, f"{raw}[0]")
