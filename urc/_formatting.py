"""Formats values as text for templates, joined lists, paths, topics and messages.

Private to expressions. Equal numbers have the same text, so 20 and 20.0 both become ``20``. Each
number has the fewest digits that identify it. Numbers have no exponents, because few robots can
parse exponents.
"""

import json
from collections.abc import Mapping

from urc.problems import printable

__all__ = ["quoted", "spelt"]

_ENDS = {"\n": "\\n", "\r": "\\r", "\t": "\\t"}
"""Short escape sequences for line feed, carriage return and tab, by character."""


def spelt(value: object) -> str:
    """Return `value` as text: ``20``, ``0.0000001``, ``true``, ``[1, 2]``; "" for None."""
    if isinstance(value, str):
        return value
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return _decimal(repr(value))
    if isinstance(value, list | tuple | Mapping):
        return _json(value)
    return bytes(value).hex(" ") if isinstance(value, bytes | bytearray) else str(value)


def quoted(value: object, most: int = 40) -> str:
    """Return a value as text for a message to a person: text in quotes, bytes as hex digits.

    Each control character is escaped once, so a value cannot control the terminal.

    Args:
        value: any value from a robot, a page or a document.
        most: maximum length of the result in characters; a longer result is truncated.
    """
    if value is None:
        return "“not available”"
    if not isinstance(value, str):
        is_long = isinstance(value, float) and not 1e-6 < abs(value) < 1e16 and value != 0
        text = f"{value:g}" if is_long else spelt(value)
        text = f"hex {text}" if isinstance(value, bytes | bytearray) else text
        return text if len(text) <= most else text[: most - 3] + "..."
    mark = '"' if "'" in value and '"' not in value else "'"
    if len(value) > most:
        value = value[: most - 3] + "..."
    for sign, name in _ENDS.items():
        value = value.replace(sign, name)
    return f"{mark}{printable(value)}{mark}"


def _json(value: object) -> str:
    """Return a list or mapping as JSON, with numbers formatted by `spelt`."""
    if isinstance(value, Mapping):
        parts = (
            f"{json.dumps(str(key), ensure_ascii=False)}: {_json(one)}"
            for key, one in value.items()
        )
        return f"{{{', '.join(parts)}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_json, value))}]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    return "null" if value is None else spelt(value)


def _decimal(text: str) -> str:
    """Return a float's text without an exponent; a whole number also has no decimal point."""
    digits, _, exponent = text.partition("e")
    if exponent:
        sign = "-" if digits[0] == "-" else ""
        whole, _, broken = digits.lstrip("-").partition(".")
        place = len(whole) + int(exponent)
        figures = whole + broken
        if place <= 0:
            return f"{sign}0.{'0' * -place}{figures}"
        text = f"{sign}{figures[:place].ljust(place, '0')}.{figures[place:] or '0'}"
    if text.endswith(".0"):
        text = text[:-2]
    return "0" if text == "-0" else text
