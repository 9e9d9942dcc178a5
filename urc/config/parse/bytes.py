"""Parser for bytes: names of control characters, numbers, lists of names and numbers, or text."""

import re
from typing import Final

from urc.config.node import Node, Problems
from urc.config.values import shown

__all__ = ["CONTROL_NAMES", "parse_bytes"]

_NAMES = (
    "NUL SOH STX ETX EOT ENQ ACK BEL BS TAB LF VT FF CR SO SI DLE DC1 DC2 DC3 DC4 NAK SYN ETB CAN"
    " EM SUB ESC FS GS RS US"
)
CONTROL_NAMES: Final = {name: bytes((place,)) for place, name in enumerate(_NAMES.split())} | {
    "HT": b"\t",
    "DEL": b"\x7f",
    "CRLF": b"\r\n",
}
"""Bytes of the control characters, by name."""
_HEX = re.compile(r"0x((?:[0-9A-Fa-f]{2})+)")
_TEMPLATE = re.compile(r"\{\{.*?\}\}")
_BACKSLASH = re.compile(r"\\(?:x[0-9A-Fa-f]{2}|[abefnrtv0])")
_SPELT = {r"\r": "CR", r"\n": "LF", r"\t": "TAB", r"\0": "NUL", r"\e": "ESC", r"\x1b": "ESC"}


def parse_bytes(part: Node | None, encoding: str, problems: Problems) -> bytes | None:
    """Return the bytes at `part`, or b"" without a `part`; None after a reported problem."""
    if part is None:
        return b""
    if isinstance(part.data, list):
        pieces = [parse_bytes(inner, encoding, problems) for inner in part.items()]
        return None if None in pieces else b"".join(piece for piece in pieces if piece)
    if not isinstance(part.data, str):
        return _byte(part, problems)
    text: str = part.data
    if text in CONTROL_NAMES:
        return CONTROL_NAMES[text]
    in_hex = _HEX.fullmatch(text)
    if in_hex:
        return bytes.fromhex(in_hex[1])
    return _literal(text, part, encoding, problems)


def _byte(part: Node, problems: Problems) -> bytes | None:
    number = part.data
    if isinstance(number, int) and not isinstance(number, bool) and 0 <= number <= 255:
        return bytes((number,))
    text = f"expected bytes as text, or a whole number from 0 to 255, found {shown(number)}"
    problems.error(part, "does-not-fit", text)
    return None


def _literal(text: str, part: Node, encoding: str, problems: Problems) -> bytes | None:
    template = _TEMPLATE.search(text)
    if template is not None:
        problems.error(
            part,
            "bad-template",
            "these bytes are constant and cannot contain templates",
            offset=template.start(),
            length=len(template[0]),
            hint="write constant bytes; settings are available only in sent frames",
        )
        return None
    backslash = _BACKSLASH.search(text)
    if backslash is not None:
        names = [_SPELT.get(escape, escape) for escape in _BACKSLASH.findall(text)]
        spelt = names[0] if len(names) == 1 else "[" + ", ".join(names) + "]"
        spelt = {"[CR, LF]": "CRLF"}.get(spelt, spelt)
        problems.error(
            part,
            "literal-backslash",
            f"this text consists of the {len(text)} characters {text}, not of a control character",
            offset=backslash.start(),
            length=len(backslash[0]),
            hint=f'write {spelt}, or "{text}" in double quotes',
        )
        return None
    words = text.replace(",", " ").replace("+", " ").split()
    if words and all(word.upper() in CONTROL_NAMES for word in words):
        spelt = ", ".join(word.upper() for word in words)
        spelt = f"[{spelt}]" if len(words) > 1 else spelt
        problems.error(
            part,
            "bad-delimiter",
            f"{text!r} is not the name of a control character",
            hint=f"write {spelt}",
        )
        return None
    try:
        return text.encode(encoding)
    except UnicodeEncodeError:
        problems.error(part, "bad-delimiter", f"{text!r} cannot be encoded as {encoding}")
        return None
