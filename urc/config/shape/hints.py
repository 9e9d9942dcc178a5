"""Hints for documents that do not match their schema."""

import re
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any, Final

from urc.config.renames import renamed_hint
from urc.config.spelling_suggestions import did_you_mean
from urc.source import Document, Path

__all__ = [
    "example_of",
    "inner_key_hint",
    "key_hint",
    "mapping_hint",
    "number_hint",
    "text_hint",
    "type_hint",
    "word_hint",
]

_DELIMITERS: Final = ("LF", "CR", "CRLF", "NUL", "ETX")
_OTHER_WORDS: Final = {
    "interval": ("every",),
    "period": ("every",),
    "rate": ("every",),
    "on": ("from", "to"),
    "transport": ("from", "to"),
    "widget": ("use",),
    "arguments": ("args",),
    "terminator": ("tx", "rx"),
    "delimiter": ("tx", "rx"),
    "pattern": ("regex", "match"),
    "value": ("default",),
    "start": ("first",),
    "begin": ("first", "start"),
    "loop": ("repeat",),
    "count": ("times",),
    "sleep": ("wait",),
    "delay": ("wait",),
    "description": ("text",),
    "message": ("text",),
    "license": ("licence",),
    "msg": ("type",),
    "msg_type": ("type",),
    "message_type": ("type",),
    "messageType": ("type",),
    "baud_rate": ("baud",),
    "minimum": ("min",),
    "maximum": ("max",),
}
"""URC keys, by the corresponding key in another tool."""
_SAME_TYPES: Final = {
    "float": "number",
    "double": "number",
    "real": "number",
    "decimal": "number",
    "str": "string",
    "text": "string",
    "flag": "boolean",
    "list": "array",
    "dict": "object",
    "map": "object",
    "picture": "image",
    "h264": "video",
    "costmap": "occupancy_grid",
    "pointcloud": "point_cloud",
    "PointCloud2": "point_cloud",
    "tf": "transform_tree",
    "bytes": "blob",
}
"""URC type names, by the corresponding type name in another tool."""
_URL: Final = re.compile(r"[a-z]+://(?P<host>[^/:?#]+)(?::(?P<port>[0-9]+))?(?P<path>/[^?#]+)?")
_SPAN: Final = re.compile(
    r"(?P<number>[0-9]{1,6}(?:\.[0-9]{1,6})?)\s*"
    r"(?P<unit>hz|ms|msec|milli(?:s|second)s?|s|secs?|seconds?|m|mins?|minutes?|h|hours?)",
    re.IGNORECASE,
)
"""Pattern for a duration or rate in the notation of other programs."""
_QUANTITY: Final = re.compile(
    r"(?P<number>[-+]?[0-9]{1,15}(?:\.[0-9]{1,15})?)\s*(?P<unit>[^\s0-9]\S{0,15})"
)
_COMMA: Final = re.compile(r"[-+]?[0-9]{1,15},[0-9]{1,15}")
_UNITS: Final = "a duration has the unit ms, s, m (minutes) or h"
_NUMBERS: Final = {"integer", "number"}
_FRAMING: Final = "framing: { type: delimiter, tx: LF, rx: LF }"
_ELSEWHERE: Final = {
    ("reply_to", "leaves"): "polls run automatically in these steps; put the replies under 'feed'",
    ("signal", "command"): "bind an input to the name of a signal, such as level: battery;"
    " only an output has 'command'",
}
"""Hints for misplaced keys, by the misplaced key and a key that the mapping may have."""


def key_hint(key: str, known: Mapping[str, Any], value: object = None, path: Path = ()) -> str:
    """Return a hint with the probable meaning of an unknown key."""
    renamed = renamed_hint(path, key, known)
    if renamed:
        return renamed
    name, colon, _ = key.partition(":")
    if colon and name in known:
        return f"put a space after the colon: '{name}: '"
    if {"id", "const", "pad"} <= known.keys() and isinstance(value, str) and value.isalnum():
        return f"write the type first: {value} {key}"
    for (other, beside), hint in _ELSEWHERE.items():
        if key == other and beside in known:
            return hint
    if key in ("url", "uri", "address") and {"host", "port"} <= known.keys():
        return _place_hint(value, known)
    others = [word for word in _OTHER_WORDS.get(key, ()) if word in known]
    if others:
        return f"use the key '{others[0]}'"
    return did_you_mean(key, known, "keys")


def _place_hint(value: object, known: Mapping[str, Any]) -> str:
    """Return a hint that gives a URL's host and port as keys of a transport."""
    found = _URL.match(value) if isinstance(value, str) else None
    if found is None:
        return "write 'host' and 'port', such as host: robot.local, port: 9090"
    host = f'"{found["host"]}"' if "{" in found["host"] else found["host"]
    written = [f"host: {host}"]
    written += [f"port: {found['port']}"] if found["port"] else []
    written += [f"path: {found['path']}"] if found["path"] and "path" in known else []
    # The hint quotes both names, so a missing 'host' is not reported again.
    return f"write 'host' and 'port': {', '.join(written)}"


def word_hint(word: str, words: Sequence[str]) -> str:
    """Return a hint with the probable meaning of an unknown word; "" if no word is similar."""
    if word == "watch" and "drive" in words:
        return (
            "visitors with the role 'watch' cannot send commands;"
            " the lowest role for a command is 'drive'"
        )
    other = _SAME_TYPES.get(word.lower(), "")
    if other in words:
        return f"use the word '{other}'"
    near = did_you_mean(word, words)
    return near if near.startswith("did you") else ""


def example_of(document: Document, path: Path, schema: Mapping[str, Any], key: str) -> str:
    """Return an example for a missing key; "" if the schema has no example."""
    inner = schema.get("properties", {}).get(key, {})
    examples = inner.get("examples") or ()
    if key == "urc":
        return "write 'urc: 1' in the first line"
    if key == "name" and not path:
        return f"for example 'name: {_plain_name(PurePath(document.file).stem) or 'my-robot'}'"
    if key == "framing":
        return f"for most text protocols: {_FRAMING}"
    if not examples or isinstance(examples[0], (dict, list)):
        return ""
    text = str(examples[0])
    return f"for example '{key}: " + (f'"{text}"' if "{" in text else text) + "'"


def mapping_hint(document: Document, path: Path, value: object, schema: Mapping[str, Any]) -> str:
    """Return a hint with the schema's first example of a mapping; `value` becomes its delimiter."""
    if _is_filled_in(document, path):
        return ""
    if path[-1] == "reply" and isinstance(value, str) and "equals" in schema.get("properties", ()):
        is_pattern = value[:1] == "^" or value[-1:] == "$"
        inner = f"regex: '{value}'" if is_pattern else f"equals: {_quoted(value)}"
        return f"write a mapping, such as {{ {inner} }}"
    example = next((one for one in schema.get("examples", ()) if isinstance(one, dict)), None)
    if example is None or any(isinstance(one, list) for one in example.values()):
        return ""
    text = value.upper() if isinstance(value, str) else ""
    if {"tx", "rx"} <= example.keys() and text in _DELIMITERS:
        example = {**example, "tx": text, "rx": text}
    if path[-2:] == ("hold", "release"):
        return (
            f"a held command stops with its own values: write a mapping, such as {_flow(example)}"
        )
    return f"write a mapping, such as {_flow(example)}"


def _flow(example: Mapping[str, Any]) -> str:
    pairs = (
        f"{key}: {_flow(one) if isinstance(one, dict) else _quoted(one)}"
        for key, one in example.items()
    )
    return f"{{ {', '.join(pairs)} }}"


def _quoted(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return f'"{value}"' if isinstance(value, str) and not value.isalnum() else str(value)


def number_hint(document: Document, path: Path, text: str) -> str:
    """Return a hint for a number with a unit or a decimal comma; "" for other text."""
    if _COMMA.fullmatch(text):
        return f"write the number with a point: {text.replace(',', '.')}"
    found = _QUANTITY.fullmatch(text)
    if found is None:
        return ""
    unit = _unit_above(document, path)
    if unit and unit != found["unit"]:
        return f"write the number alone, in the unit {unit}"
    return f"write the number alone: {found['number']}"


def _unit_above(document: Document, path: Path) -> str:
    """Return the unit of the signal or argument that contains the value; "" without a unit."""
    inner = _mappings_above(document, path)[-2:]
    return str(next((one["unit"] for one in reversed(inner) if "unit" in one), ""))


def inner_key_hint(document: Document, path: Path, known: Mapping[str, Any]) -> str:
    """Return a hint for entries that should be indented below the preceding key, or "".

    Args:
        document: the document.
        path: path of the key without a value, or of the first entry below it.
        known: keys that a mapping in this place may have.
    """
    above = _mappings_above(document, path)
    keys = list(above[-1]) if above else []
    if not path or path[-1] not in keys:
        return ""
    place = keys.index(path[-1])
    first = place if above[-1][keys[place]] is None else place - 1
    if first < 0 or first + 1 >= len(keys) or above[-1][keys[first]] is not None:
        return ""
    outer, inner = keys[first], keys[first + 1]
    if inner not in known:
        return ""
    return f"indent '{inner}' by two more spaces, to put it inside '{outer}'"


def _mappings_above(document: Document, path: Path) -> list[Mapping[str | int, Any]]:
    """Return the existing mappings on the path to a value, starting at the root."""
    found: list[Mapping[str | int, Any]] = []
    inner: Any = document.data
    for part in path:
        if isinstance(inner, dict):
            found.append(inner)
        try:
            inner = inner[part]
        except (KeyError, IndexError, TypeError):  # an option of a widget is checked by itself
            break
    return found


def type_hint(
    document: Document, path: Path, value: object, types: Sequence[str], *, is_duration: bool
) -> str:
    """Return a hint for converting a value to one of `types`; "" if no hint is suitable."""
    if value is None:
        return "give the key a value, or remove the key"
    if is_duration and isinstance(value, (int, float)) and not isinstance(value, bool):
        return f"write the unit: {value}s, or {value}ms"
    if "string" in types and isinstance(value, (bool, int, float)):
        return f'quote it: "{_written(document, path) or value}"'
    if isinstance(value, str):
        if _is_filled_in(document, path):
            return 'only text that consists of a single name in braces becomes a value: "{i}"'
        if _NUMBERS & set(types):
            if _looks_like_number(value):
                return f"remove the quotes: {value}"
            if hint := number_hint(document, path, value):
                return hint
        if "boolean" in types:
            return "yes, no, on and off are text in YAML 1.2; write true or false"
        if "object" in types:
            return "indent the inner keys, or write { key: value }"
    if "string" in types and isinstance(value, list) and path[-1:] == ("grid",):
        return "write the rows below 'grid: |', without '- '"
    if "object" in types and isinstance(value, list) and _is_of_entries(value):
        return "write the entries without '- '"
    if "array" in types:
        return "write a list: '- ' before each item, or [a, b]"
    return ""


def text_hint(document: Document, path: Path, value: str, schema: Mapping[str, Any]) -> str:
    """Return a hint for text that does not match its schema's pattern; "" without a hint."""
    if schema.get("title") == "duration":
        found = _SPAN.fullmatch(value.strip())
        if found is None:
            return ""
        return f"write {_duration(float(found['number']), found['unit'])}; {_UNITS}"
    if _NUMBERS & {*_listed(schema.get("type", ()))} and not _is_filled_in(document, path):
        if value.isascii() and value.isdecimal():
            return f"remove the quotes: {value}"
        if hint := number_hint(document, path, value):
            return hint
    if path == ("name",):
        rule = "a name may have only lower-case letters, digits and '-'"
        plain = _plain_name(value)
        return f"write {plain}; {rule}" if plain else ""
    return ""


def _plain_name(text: str) -> str:
    """Return a valid document name that resembles a text, or ""."""
    plain = re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")
    return plain if plain[:1].isalpha() else ""


def _is_of_entries(value: Sequence[object]) -> bool:
    """Return whether a list looks like the entries of a mapping: each item has exactly one key."""
    return bool(value) and all(isinstance(one, dict) and len(one) == 1 for one in value)


def _listed(types: object) -> Sequence[str]:
    return (types,) if isinstance(types, str) else tuple(types) if isinstance(types, list) else ()


def _duration(number: float, unit: str) -> str:
    """Return a duration in document notation, from a number and a unit of another program."""
    if unit.lower() == "hz":
        return f"{1000 / number:.0f}ms" if number > 0 else "1s"
    plain = unit.lower()
    if plain.startswith("m") and plain not in ("m", "min", "mins", "minute", "minutes"):
        return f"{number:g}ms"
    return f"{number:g}{plain[0]}"


def _written(document: Document, path: Path) -> str:
    """Return the text of a scalar as written in the document; "" for several lines."""
    mark = document.at(path)
    if mark is None or mark.span.line != mark.span.end_line:
        return ""
    lines = document.source_of(path).lines
    return lines[mark.span.line - 1][mark.span.column - 1 : mark.span.end_column - 1]


def _is_filled_in(document: Document, path: Path) -> bool:
    mark = document.at(path)
    return mark is not None and mark.written is not None


def _looks_like_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
