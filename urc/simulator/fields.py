"""Raw fields of a frame that the emulated robot says, and what of them a frame can carry.

Pure.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

__all__ = ["Fields"]


class Fields(NamedTuple):
    """What is known for one frame."""

    numbers: dict[str, object]
    others: dict[str, object]
    own: dict[str, object]
    """Those of the document: constants of ``when``, and what correlates with the request."""
    unknown: tuple[str, ...] = ()
    """Those of the document that nothing says anything about."""

    def attempts(self, fits: Callable[[dict[str, object]], bool]) -> Iterator[dict[str, object]]:
        """Yield fields to write, from all to the least; the frame decides what it can carry."""
        whole = {name: _rounded(raw) for name, raw in self.numbers.items()}
        yield self.numbers | self.others | self.own
        yield whole | self.others | self.own
        # Some exclude each other: one by one, as long as there is a frame with all of them.
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
