"""Interprets unquoted scalars according to the core schema of YAML 1.2.

Private to `urc.source`. In the core schema, ``on``, ``yes``, ``12:30:00`` and dates are text, 010
is ten, and 1e3 is a number.
"""

import re
from collections.abc import Callable
from typing import Final

__all__ = ["DIGITS_MAX", "resolve_plain"]

DIGITS_MAX: Final = 40
"""Maximum number of characters in a number. Python converts long numbers in quadratic time, and
refuses numbers with thousands of digits."""
_SCALAR = re.compile(
    r"""(?P<null>~|null|Null|NULL|)
    |(?P<true>true|True|TRUE)|(?P<false>false|False|FALSE)
    |(?P<oct>0o[0-7]+)|(?P<hex>0x[0-9a-fA-F]+)|(?P<int>[-+]?[0-9]+)
    |(?P<float>[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?)
    |(?P<inf>[-+]?\.(?:inf|Inf|INF))|(?P<nan>\.(?:nan|NaN|NAN))""",
    re.VERBOSE | re.ASCII,
)
_SCALAR_STARTS = frozenset("~nNtTfF0123456789+-.")


def resolve_plain(text: str) -> object:
    """Return the value of an unquoted scalar in the core schema of YAML 1.2.

    Raises:
        ValueError: a number has more than `DIGITS_MAX` characters.
    """
    if text and text[0] not in _SCALAR_STARTS:
        return text
    found = _SCALAR.fullmatch(text)
    if found is None:
        return text
    kind = found.lastgroup
    if kind in ("oct", "hex", "int", "float") and len(text) > DIGITS_MAX:
        raise ValueError(f"a number of {len(text)} characters")
    return _MEANINGS[kind or "null"](text)


_MEANINGS: dict[str, Callable[[str], object]] = {
    "null": lambda _: None,
    "true": lambda _: True,
    "false": lambda _: False,
    "oct": lambda text: int(text[2:], 8),
    "hex": lambda text: int(text[2:], 16),
    "int": int,
    "float": float,
    "inf": lambda text: float(text.replace(".", "")),
    "nan": lambda _: float("nan"),
}
