"""How values become text: in templates, in lists that are joined, in paths and topics, in messages.

Floor 1, private to expressions. The same number is always spelt the same, whether it came as 20 or
as 20.0: plain decimal digits, as few as tell it from its neighbours, and never an exponent, which
few robots read.
"""

import json
from collections.abc import Mapping

from urc.problems import printable

__all__ = ["quoted", "spelt"]

_ENDS = {"\n": "\\n", "\r": "\\r", "\t": "\\t"}
"""As people know them."""


def spelt(value: object) -> str:
    """Return `value` as text: ``20``, ``0.0000001``, ``true``, ``[1, 2]``; nothing for None."""
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
    """Return a value for a message to people: texts in quotation marks, bytes as hex digits.

    What acts on a terminal is escaped, once.

    Args:
        value: of any kind that a robot, a page or a document gives.
        most: characters; longer ones are cut.
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
    """Return a list or mapping as JSON has it, its numbers spelt as ever."""
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
    """Return Python's spelling of a float without exponent, and without a point if it is whole."""
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
