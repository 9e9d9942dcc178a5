"""Finds the probable cause of a YAML syntax error in the lines at and before the error.

Private to `urc.source`; `urc._yaml_faults` uses the results in messages and hints. All line numbers
and columns are 0-based, except those in hints.
"""

import re
from collections.abc import Sequence
from typing import Final

__all__ = [
    "column_hint",
    "entry_hint",
    "item_hint",
    "missing_comma",
    "open_braces",
    "runaway_quote",
]

_KEY: Final = re.compile(r"[a-z][a-z0-9_-]{0,40}")
_ENTRY: Final = re.compile(r"(?P<key>[a-z][a-z0-9_-]{0,40})(?:\s*=\s*|\s+)(?P<value>\S+)")
_START: Final = re.compile(r" *(?:- +)*")
_ITEM: Final = re.compile(r"-(?P<entry>[a-z][a-z0-9_-]*:(?: .*)?)")
_BEFORE_QUOTE: Final = re.compile(r"(?:^|[:\-,{\[])\s+\Z")
_LONGEST: Final = 500
"""Longest line to be searched for the cause of a YAML error, in characters."""


def entry_hint(text: str) -> str:
    """Return a hint for a line without ``: ``, such as ``type:tcp`` or ``type = tcp``.

    Args:
        text: the line without indentation.
    """
    key, colon, value = text.partition(":")
    if colon and _KEY.fullmatch(key) and not value.startswith("//"):
        return f"put a space after the colon: '{key}: {value}'"
    if _KEY.fullmatch(text):
        return f"put a colon after the key: '{text}:'"
    found = _ENTRY.fullmatch(text)
    if found:
        return f"put a colon after the key: '{found['key']}: {found['value']}'"
    return "write 'key: value', with a space after the colon"


def item_hint(text: str) -> str:
    """Return a hint for a list item without a space, such as ``-every: 1s``; "" for other lines."""
    found = _ITEM.fullmatch(text.strip()) if len(text) <= _LONGEST else None
    return f"put a space after the dash: '- {found['entry']}'" if found else ""


def column_hint(lines: Sequence[str], number: int) -> str:
    """Return a hint with the probable column of a line; "" if the line can start where it does."""
    own = _columns(lines[number])[-1]
    blocks = _open_blocks(lines, number)
    if own in blocks or not blocks:
        return ""
    above = max(blocks)
    nearest = min(blocks, key=lambda one: (abs(one - own), one != above, one))
    return f"start this line in column {nearest + 1}, like line {blocks[nearest] + 1}"


def _open_blocks(lines: Sequence[str], number: int) -> dict[int, int]:
    """Return the columns in which a line may start, each with the nearest line in that column."""
    blocks: dict[int, int] = {}
    least = _LONGEST
    for above in range(number - 1, -1, -1):
        body = lines[above].lstrip()
        if not body or body.startswith("#"):
            continue
        for column in _columns(lines[above]):
            if column < least:
                blocks[column] = above
                least = column
        if least == 0:
            break
    return blocks


def _columns(text: str) -> tuple[int, ...]:
    """Return the column of a line's key, then the columns of its list dashes, right to left."""
    found = _START.match(text)
    start = found[0] if found else ""
    return (len(start), *(at for at in range(len(start) - 1, -1, -1) if start[at] == "-"))


def runaway_quote(lines: Sequence[str], number: int, column: int) -> tuple[int, int, str] | None:
    """Return where the quoted text begins whose missing closing quote caused an error.

    Args:
        lines: lines of the document.
        number: index of the line with the error; a quote in this line ended the text.
        column: 0-based column of the error in that line.

    Returns:
        The line, column and quote of the text; None if no earlier text extends to the error.
    """
    for quote in ('"', "'"):
        if quote not in lines[number][:column]:
            continue
        for above in range(number - 1, -1, -1):
            text = lines[above]
            if quote not in text or len(text) > _LONGEST:
                continue
            start = text.rindex(quote)
            is_odd = (text.count(quote) - text.count(f"\\{quote}")) % 2 == 1
            if is_odd and _BEFORE_QUOTE.search(text[:start]):
                return above, start, quote
            break
    return None


def missing_comma(text: str, column: int) -> int | None:
    """Return the column of a key inside ``{ }`` that lacks a comma before it, or None.

    Args:
        text: content of the line with the error.
        column: column of the error: a second colon, or the key after a quoted text.
    """
    if len(text) > _LONGEST:
        return None
    before, rest = text[:column], text[column:]
    if rest.startswith(":"):
        found = re.search(r"[^\s,{\[]\s+(?P<key>[a-z][\w-]*)\Z", before)
        return found.start("key") if found else None
    is_key = re.match(r"[a-z][\w-]*:\s", rest)
    return column if is_key and re.search(r"[^\s,{\[:]\s+\Z", before) else None


def open_braces(text: str) -> bool:
    """Return whether a line lacks exactly one closing brace or bracket."""
    plain = re.sub(r"'[^']*'|\"(?:[^\"\\]|\\.)*\"|\{\{|\}\}", "", text)
    opened = sum(plain.count(one) for one in "{[")
    return opened - sum(plain.count(one) for one in "}]") == 1
