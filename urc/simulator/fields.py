"""Raw fields for one of the emulated robot's frames, and sets of fields that fit into the frame.

Pure.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

__all__ = ["Fields"]


class Fields(NamedTuple):
    """The known values of one frame's fields, and the fields without known values."""

    numbers: dict[str, object]
    others: dict[str, object]
    own: dict[str, object]
    """Internal fields of the document: constants from ``when``, and values repeated from the
    request."""
    unknown: tuple[str, ...] = ()
    """Internal fields of the document whose values are unknown."""

    def attempts(self, fits: Callable[[dict[str, object]], bool]) -> Iterator[dict[str, object]]:
        """Yield possible sets of fields for the frame, in the order in which to try them."""
        whole = {name: _rounded(raw) for name, raw in self.numbers.items()}
        yield self.numbers | self.others | self.own
        yield whole | self.others | self.own
        # Some fields exclude each other: add fields one by one, as long as a frame can contain them
        # all.
        most = dict(self.own)
        for name, raw in (self.numbers | self.others).items():
            for value in (raw, whole.get(name, raw)):
                if name not in most and fits(most | {name: value}):
                    most[name] = value
        yield most
        yield self.own
        yield {**dict.fromkeys(self.unknown, 1), **most}


def _rounded(raw: object) -> object:
    if isinstance(raw, float):
        return round(raw)
    if isinstance(raw, (list, tuple)):
        return [_rounded(one) for one in raw]
    return raw
