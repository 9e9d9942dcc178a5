"""The bytes of one connection while they are cut, and how often they may be looked at.

Floor 3, pure; for `urc.protocol.framing`.
"""

from typing import Final

__all__ = ["Credit", "Stream"]


class Stream:
    """The bytes of one connection that no frame has taken yet."""

    __slots__ = ("at", "data")

    def __init__(self, data: bytearray | None = None) -> None:
        self.data = bytearray() if data is None else data
        self.at = 0
        """Where the bytes begin that are not taken yet."""

    def __len__(self) -> int:
        return len(self.data) - self.at

    def push(self, data: bytes) -> None:
        """Add bytes at the end, and let go of those that are taken."""
        if self.at:
            del self.data[: self.at]
            self.at = 0
        self.data += data


class Credit:
    """How many bytes may be looked at a second time: a few for each that the stream moves on.

    So all work together is at most `RATE` + 1 times the bytes of the stream, and `MOST` once.
    """

    RATE: Final = 8
    MOST: Final = 1 << 16

    def __init__(self) -> None:
        self._left = self.MOST

    @property
    def is_full(self) -> bool:
        """Whether nothing more can be earned."""
        return self._left >= self.MOST

    def earn(self, count: int) -> None:
        """Take note that the stream has moved on by `count` bytes."""
        if self._left < self.MOST:
            self._left = min(self.MOST, self._left + self.RATE * count)

    def spend(self, count: int) -> bool:
        """Return whether `count` bytes may be looked at again, and take them off."""
        if self._left < count:
            return False
        self._left -= count
        return True
