"""The receive buffer of one connection and the budget for rescanning bytes.

Pure. The decoders in `urc.protocol.framing` use both classes.
"""

from typing import Final

__all__ = ["RescanBudget", "ReceiveBuffer"]


class ReceiveBuffer:
    """The bytes received on one connection and not yet consumed."""

    __slots__ = ("at", "data")

    def __init__(self, data: bytearray | None = None) -> None:
        self.data = bytearray() if data is None else data
        self.at = 0
        """Offset of the first unconsumed byte."""

    def __len__(self) -> int:
        return len(self.data) - self.at

    def push(self, data: bytes) -> None:
        """Append received bytes and discard consumed bytes."""
        if self.at:
            del self.data[: self.at]
            self.at = 0
        self.data += data


class RescanBudget:
    """A limit on the bytes that a decoder may scan again; each consumed byte raises the limit.

    The total number of scanned bytes is at most (`RATE` + 1) · stream size + `MOST`.
    """

    RATE: Final = 8
    MOST: Final = 1 << 16

    def __init__(self) -> None:
        self._left = self.MOST

    @property
    def is_full(self) -> bool:
        """Whether the budget has its maximum, `MOST` bytes."""
        return self._left >= self.MOST

    def earn(self, count: int) -> None:
        """Increase the budget by `RATE` bytes for each of `count` consumed bytes."""
        if self._left < self.MOST:
            self._left = min(self.MOST, self._left + self.RATE * count)

    def spend(self, count: int) -> bool:
        """Return whether `count` bytes may be rescanned; if so, reduce the budget."""
        if self._left < count:
            return False
        self._left -= count
        return True
