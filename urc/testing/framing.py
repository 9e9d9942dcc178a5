"""A test helper that passes the same data to a framing's decoder in differently sized pieces."""

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

__all__ = ["feed_three_ways"]

Frame = TypeVar("Frame", covariant=True)


class Feedable(Protocol[Frame]):
    """A decoder that cuts bytes into frames."""

    def feed(self, data: bytes) -> Sequence[Frame]:
        """Return all frames that `data` completes."""


def feed_three_ways(
    decoder: Callable[[], Feedable[Frame]], data: bytes, trailing: bytes = b"\x00trailing"
) -> list[Frame]:
    """Decode `data` in one piece, byte by byte, and with `trailing`; return the frames.

    Args:
        decoder: function that returns a new decoder; it is called three times.
        data: complete frames.
        trailing: bytes that begin an incomplete frame.

    Raises:
        AssertionError: the frames depend on how the data is divided.
    """
    whole = list(decoder().feed(data))
    by_byte: list[Frame] = []
    dripping = decoder()
    for place in range(len(data)):
        by_byte += dripping.feed(data[place : place + 1])
    if by_byte != whole:
        raise AssertionError(f"decoded byte by byte: {by_byte!r}; decoded whole: {whole!r}")
    trailed = list(decoder().feed(data + trailing))
    if trailed != whole:
        raise AssertionError(f"decoded with trailing bytes: {trailed!r}; without: {whole!r}")
    return whole
