"""Parser for byte stuffing: escaped bytes and their replacements."""

from collections.abc import Mapping
from typing import Any

from urc.config.node import Node, Problems
from urc.config.parse.bytes import parse_bytes
from urc.model.framing import EscapeSpec, FrameLayout

__all__ = ["parse_escape"]


def parse_escape(
    part: Node, layout: FrameLayout, options: Mapping[str, Any], encoding: str, problems: Problems
) -> EscapeSpec | None:
    """Return the byte stuffing under ``escape``; None if it is missing or invalid."""
    if "escape" not in part.data:
        return None
    inner = part.must("escape")
    given = [key for key in ("xor", "table", "double", "after") if key in inner.data]
    if len(given) != 1:
        text = "'xor', 'table', 'double' or 'after' is missing"
        if given:
            text = f"'{given[0]}' and '{given[1]}' both define the escape sequences"
        where = {"at": given[1]} if given else {}
        problems.error(inner, "two-forms" if given else "missing-key", text, key=True, **where)
        return None
    before = len(problems.problems)
    is_of_payload = inner.text("of", "frame") == "payload"
    if given[0] == "after":
        spec = _inserted(inner, encoding, problems)
    else:
        marks = () if is_of_payload else _marks(part, layout, options)
        spec = _escaped(inner, given[0], marks, encoding, problems)
    if spec is None or len(problems.problems) > before:
        return None
    return spec._replace(is_of_payload=is_of_payload)


def _marks(part: Node, layout: FrameLayout, options: Mapping[str, Any]) -> tuple[bytes, ...]:
    ends = (options.get("tx", layout.end), options.get("rx", layout.end))
    is_measured = part.text("type") == "length"
    return (layout.start, *(() if is_measured else ends))


def _one(part: Node, encoding: str, problems: Problems) -> int | None:
    """Return the single byte at `part`."""
    found = parse_bytes(part, encoding, problems)
    if found is None or len(found) == 1:
        return None if found is None else found[0]
    problems.error(part, "wrong-size", f"expected one byte, found {len(found)}")
    return None


def _inserted(part: Node, encoding: str, problems: Problems) -> EscapeSpec | None:
    after = parse_bytes(part.must("after"), encoding, problems)
    insert_part = part.get("insert")
    if after == b"":
        problems.error(part, "empty-mark", "'after' is empty, so it matches no bytes", at="after")
    if insert_part is None:
        text = "'insert' is missing: the byte to insert after the sequence"
        problems.error(part, "missing-key", text, at="after", key=True)
        return None
    insert = _one(insert_part, encoding, problems)
    for key in ("byte", "bytes"):
        if key in part.data:
            text = f"'{key}' has no effect with 'after'"
            problems.error(part, "misplaced-key", text, at=key, key=True)
    return None if after is None or insert is None else EscapeSpec(after=after, insert=insert)


def _escaped(
    part: Node, way: str, marks: tuple[bytes, ...], encoding: str, problems: Problems
) -> EscapeSpec | None:
    byte_part = part.get("byte")
    if byte_part is None:
        text = "'byte' is missing: the escape byte"
        problems.error(part, "missing-key", text, at=way, key=True)
        return None
    byte = _one(byte_part, encoding, problems)
    if "insert" in part.data:
        text = f"'insert' has no effect with '{way}'"
        problems.error(part, "misplaced-key", text, at="insert", key=True)
    if byte is None:
        return None
    if way == "double" and part.flag("double", default=False):
        _check_doubled(part, byte, marks, problems)
        return EscapeSpec(byte, {byte: byte})
    if way == "table":
        return _table(part, byte, marks, encoding, problems)
    xor = part.integer("xor") or 0
    others = part.get("bytes")
    more = parse_bytes(others, encoding, problems) if others is not None else b""
    hidden = {byte, *(one for mark in marks for one in mark), *(more or b"")}
    table = {one: one ^ xor for one in sorted(hidden)}
    _check_hidden(part, "xor", table, problems)
    return EscapeSpec(byte, table, xor)


def _table(
    part: Node, byte: int, marks: tuple[bytes, ...], encoding: str, problems: Problems
) -> EscapeSpec | None:
    table: dict[int, int] = {}
    for key, inner in part.must("table").entries().items():
        second = _one(inner, encoding, problems)
        if second is not None:
            table[int(key, 0)] = second
    needed = {byte, *(one for mark in marks for one in mark[:1])}
    missing = sorted(needed - table.keys())
    if missing:
        text = f"{missing[0]:02X} is not in the table, and would not be escaped"
        problems.error(part, "missing-key", text, at="table")
        return None
    if len(set(table.values())) < len(table):
        text = "two bytes of the table have the same replacement"
        problems.error(part, "duplicate-name", text, at="table")
        return None
    _check_hidden(part, "table", table, problems)
    return EscapeSpec(byte, table)


def _check_hidden(part: Node, at: str, table: Mapping[int, int], problems: Problems) -> None:
    """Report a byte in the replacements that would itself have to be escaped."""
    wrong = next((one for one in table.values() if one in table), None)
    if wrong is not None:
        text = f"{wrong:02X} replaces an escaped byte, but must be escaped itself"
        problems.error(part, "overlap", text, at=at)


def _check_doubled(part: Node, byte: int, marks: tuple[bytes, ...], problems: Problems) -> None:
    for mark in marks:
        if mark and mark[0] != byte:
            shown = mark.hex(" ")
            text = f"the mark {shown} does not start with {byte:02X}, and would not be escaped"
            problems.error(part, "does-not-fit", text, at="byte")
            return
        if len(mark) > 1 and mark[1] == byte:
            text = f"the mark {mark.hex(' ')} looks like a doubled escape byte"
            problems.error(part, "overlap", text, at="double")
            return
