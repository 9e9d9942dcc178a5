"""The type of received text in the expressions that match a reply to its request. Pure."""

__all__ = ["WireText"]


class WireText(str):
    """Received text that also equals its numeric value, so ``_id == id`` is true for "3" and 3."""

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
