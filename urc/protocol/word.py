"""Text off the wire in a correlation.

Floor 3, pure.
"""

__all__ = ["Word"]


class Word(str):
    """Text off the wire: equal to a number when it is that number, as ``_id == id`` means it."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        if isinstance(other, (int, float)) and not isinstance(other, bool):
            try:
                return float(self) == other if len(self) <= 40 else False
            except ValueError:
                return False
        return str.__eq__(self, other)

    def __ne__(self, other: object) -> bool:
        return not self == other

    __hash__ = str.__hash__
