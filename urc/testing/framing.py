"""A test of a framing with data split in several ways."""

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

__all__ = ["feed_three_ways"]

Frame = TypeVar("Frame", covariant=True)


class Feedable(Protocol[Frame]):
    """A decoder of bytes into frames."""

    def feed(self, data: bytes) -> Sequence[Frame]:
        """Return the frames that `data` completes."""


def feed_three_ways(
    decoder: Callable[[], Feedable[Frame]], data: bytes, trailing: bytes = b"\x00trailing"
) -> list[Frame]:
    """Decode `data` whole, byte by byte, and followed by `trailing` bytes; return the frames.

    Args:
        decoder: returns a new decoder for each way.
        data: complete frames.
        trailing: beginning of an incomplete frame.

    Raises:
        AssertionError: two ways gave different frames.
    """
    whole = list(decoder().feed(data))
    by_byte: list[Frame] = []
    dripping = decoder()
    for place in range(len(data)):
        by_byte += dripping.feed(data[place : place + 1])
    if by_byte != whole:
        raise AssertionError(f"byte by byte gave {by_byte!r}, whole gave {whole!r}")
    trailed = list(decoder().feed(data + trailing))
    if trailed != whole:
        raise AssertionError(f"with trailing bytes gave {trailed!r}, whole gave {whole!r}")
    return whole
