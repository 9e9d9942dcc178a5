"""Hints for documents that do not match their schema."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, Final

from urc.config.renames import renamed_hint
from urc.config.spelling_suggestions import did_you_mean
from urc.source import Document, Path

__all__ = ["example_of", "key_hint", "mapping_hint", "type_hint", "word_hint"]

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
}
"""Keys of URC, by the corresponding key of another tool."""
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
    "bytes": "blob",
}
"""Type names of URC, by the corresponding type name of another tool."""
_URL: Final = re.compile(r"[a-z]+://(?P<host>[^/:?#]+)(?::(?P<port>[0-9]+))?(?P<path>/[^?#]+)?")
_FRAMING: Final = "framing: { type: delimiter, tx: LF, rx: LF }"
_ELSEWHERE: Final = {
    ("reply_to", "leaves"): "polls run automatically in these steps; 'feed' gives their replies",
    ("signal", "command"): "bind an input to the name of a signal, such as level: battery;"
    " only an output takes 'command'",
}
"""Hints, by misplaced key and another valid key of the same mapping."""


def key_hint(key: str, known: Mapping[str, Any], value: object = None, path: Path = ()) -> str:
    """Return a hint with the known key that an unknown key probably means."""
    renamed = renamed_hint(path, key, known)
    if renamed:
        return renamed
    name, colon, _ = key.partition(":")
    if colon and name in known:
        return f"put a space after the colon: '{name}: '"
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
    """Return a hint with the host and port of a URL, in the keys of a transport."""
    found = _URL.match(value) if isinstance(value, str) else None
    if found is None:
        return "write 'host' and 'port', such as host: robot.local, port: 9090"
    written = [f"host: {found['host']}"]
    written += [f"port: {found['port']}"] if found["port"] else []
    written += [f"path: {found['path']}"] if found["path"] and "path" in known else []
    # The quoted names keep a missing 'host' from being reported a second time.
    return f"write 'host' and 'port': {', '.join(written)}"


def word_hint(word: str, words: Sequence[str]) -> str:
    """Return a hint with the known word that an unknown word probably means, or ""."""
    if word == "watch" and "drive" in words:
        return "visitors with the role 'watch' give no commands; the lowest role is 'drive'"
    other = _SAME_TYPES.get(word.lower(), "")
    if other in words:
        return f"use the word '{other}'"
    near = did_you_mean(word, words)
    return near if near.startswith("did you") else ""


def example_of(schema: Mapping[str, Any], key: str) -> str:
    """Return the schema's example of a missing key, or ""."""
    inner = schema.get("properties", {}).get(key, {})
    examples = inner.get("examples") or ()
    if key == "framing":
        return f"for most text protocols: {_FRAMING}"
    if not examples or isinstance(examples[0], (dict, list)):
        return ""
    text = str(examples[0])
    return f"for example '{key}: " + (f'"{text}"' if "{" in text else text) + "'"


def mapping_hint(document: Document, path: Path, value: object, schema: Mapping[str, Any]) -> str:
    """Return the schema's first example of a mapping, with `value` in place of its delimiter."""
    if _is_filled_in(document, path):
        return ""
    example = next((one for one in schema.get("examples", ()) if isinstance(one, dict)), None)
    if example is None or any(isinstance(one, list) for one in example.values()):
        return ""
    text = value.upper() if isinstance(value, str) else ""
    if {"tx", "rx"} <= example.keys() and text in _DELIMITERS:
        example = {**example, "tx": text, "rx": text}
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


def type_hint(
    document: Document, path: Path, value: object, types: Sequence[str], *, is_duration: bool
) -> str:
    """Return a hint for the conversion of a value to one of `types`, or ""."""
    if value is None:
        return "give the key a value, or remove the key"
    if is_duration and isinstance(value, (int, float)) and not isinstance(value, bool):
        return f"write the unit: {value}s, or {value}ms"
    if "string" in types and isinstance(value, (bool, int, float)):
        return f'quote it: "{_written(document, path) or value}"'
    if isinstance(value, str):
        if _is_filled_in(document, path):
            return 'only a text that consists of a name in braces becomes a value: "{i}"'
        if {"integer", "number"} & set(types) and _looks_like_number(value):
            return f"remove the quotes: {value}"
        if "boolean" in types:
            return "yes, no, on and off are text in YAML 1.2; write true or false"
        if "object" in types:
            return "indent the inner keys, or write { key: value }"
    if "array" in types:
        return "write a list: '- ' before each item, or [a, b]"
    return ""


def _written(document: Document, path: Path) -> str:
    """Return the source text of a scalar."""
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
