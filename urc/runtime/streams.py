"""Signals of which each reading counts: what came lately, with numbers that run on.

Floor 4. Of most signals the newest reading is all that anybody wants. A line that a robot says is
another matter: who was away gets every one that is still kept, and can tell how many are not.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from typing import Final

from urc.model.values import Sample

__all__ = ["STREAM_KEPT", "Streams"]

STREAM_KEPT: Final = 500
"""Readings of each such signal."""


class Streams:
    """The latest readings of some signals, each with the hub's revision that brought it."""

    def __init__(self) -> None:
        self._kept: dict[str, deque[tuple[int, Sample]]] = {}
        self._counts: dict[str, int] = {}
        """Readings that there ever were."""

    def __bool__(self) -> bool:
        return bool(self._kept)

    def keep(self, names: Iterable[str]) -> None:
        """Keep each reading of these signals from now on."""
        for name in names:
            self._kept.setdefault(name, deque(maxlen=STREAM_KEPT))
            self._counts.setdefault(name, 0)

    def put(self, samples: Iterable[Sample], revision: int) -> None:
        """Take what came with a revision."""
        for sample in samples:
            name = sample[0]
            kept = self._kept.get(name)
            if kept is not None:
                kept.append((revision, sample))
                self._counts[name] += 1

    def filled(self, newest: Iterable[Sample], since: int) -> Sequence[Sample]:
        """Return the newest readings, and those after a revision that they have hidden."""
        found: list[Sample] = []
        for sample in newest:
            rows: list[Sample] = []
            for revision, one in reversed(self._kept.get(sample[0], ())):
                if revision <= since:
                    break
                rows.append(one)
            found += reversed(rows or [sample])
        return found

    def firsts(self, names: Sequence[str]) -> dict[str, int]:
        """Return the number of the first reading of each signal, where the last is its newest."""
        counts = self._counts
        return {name: counts[name] - names.count(name) + 1 for name in counts if name in names}
