"""The receive buffer of one connection, and the budget for scanning bytes again.

Pure; for `urc.protocol.framing.table`.
"""

from typing import Final

__all__ = ["RescanBudget", "ReceiveBuffer"]


class ReceiveBuffer:
    """The received bytes of one connection that no frame has consumed yet."""

    __slots__ = ("at", "data")

    def __init__(self, data: bytearray | None = None) -> None:
        self.data = bytearray() if data is None else data
        self.at = 0
        """Offset of the first unconsumed byte."""

    def __len__(self) -> int:
        return len(self.data) - self.at

    def push(self, data: bytes) -> None:
        """Append bytes, and discard the consumed ones."""
        if self.at:
            del self.data[: self.at]
            self.at = 0
        self.data += data


class RescanBudget:
    """Budget of bytes that may be scanned a second time; it grows with each consumed byte.

    The total work is thus at most `RATE` + 1 times the bytes of the stream, plus `MOST` once.
    """

    RATE: Final = 8
    MOST: Final = 1 << 16

    def __init__(self) -> None:
        self._left = self.MOST

    @property
    def is_full(self) -> bool:
        """Whether the budget is at its maximum."""
        return self._left >= self.MOST

    def earn(self, count: int) -> None:
        """Increase the budget for `count` consumed bytes."""
        if self._left < self.MOST:
            self._left = min(self.MOST, self._left + self.RATE * count)

    def spend(self, count: int) -> bool:
        """Return whether `count` bytes may be scanned again, and reduce the budget."""
        if self._left < count:
            return False
        self._left -= count
        return True
