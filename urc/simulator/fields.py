"""Raw fields for a frame of the emulated robot, and the subsets that a frame can carry.

Pure.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

__all__ = ["Fields"]


class Fields(NamedTuple):
    """The known fields for one frame."""

    numbers: dict[str, object]
    others: dict[str, object]
    own: dict[str, object]
    """The document's own fields: constants of ``when``, and echoes of the request."""
    unknown: tuple[str, ...] = ()
    """The document's own fields without any known value."""

    def attempts(self, fits: Callable[[dict[str, object]], bool]) -> Iterator[dict[str, object]]:
        """Yield fields to encode, from all to the fewest; the encoder decides."""
        whole = {name: _rounded(raw) for name, raw in self.numbers.items()}
        yield self.numbers | self.others | self.own
        yield whole | self.others | self.own
        # Some exclude each other: add them one by one while a frame with all of them exists.
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
