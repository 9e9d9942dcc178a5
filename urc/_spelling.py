"""How values become text: in templates, in lists that are joined, in paths and topics.

Floor 1, private to expressions. The same number is always spelt the same, whether it came as 20 or
as 20.0: plain decimal digits, as few as tell it from its neighbours, and never an exponent, which
few robots read.
"""

__all__ = ["spelt"]


def spelt(value: object) -> str:
    """Return `value` as text: ``20``, ``0.0000001``, ``true``; nothing for None."""
    if isinstance(value, str):
        return value
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return _decimal(repr(value)) if isinstance(value, float) else str(value)


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
