"""The number of viewers of each image, such as pages, recordings and programs.

Layer 4. Each reader that needs an image counts itself here. `urc.runtime.image_demand` pauses the
topics of images without viewers.
"""

import asyncio
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager

__all__ = ["GLANCE_S", "ImageViewers", "low_stream"]

GLANCE_S = 15.0
"""Time for which a glance counts as a viewer, in seconds. A menu asks for each card's image every
few seconds, and a program may ask for single images."""


_LOW = "#low"


def low_stream(name: str) -> str:
    """Return the key of the viewers of a video's low stream; no signal has this name."""
    return name + _LOW


class ImageViewers:
    """Counts of viewers, keyed by signal."""

    def __init__(self) -> None:
        self._counts: Counter[str] = Counter()
        self._of_all = 0
        self._glances: dict[str, float] = {}
        """Monotonic time until which a glance counts, keyed by signal."""
        self.changed = asyncio.Event()
        """Event that is set when a viewer comes or leaves."""

    def add(self, names: Iterable[str]) -> None:
        """Count one more viewer of each signal."""
        self._counts.update(names)
        self.changed.set()

    def remove(self, names: Iterable[str]) -> None:
        """Count one viewer less of each signal."""
        self._counts.subtract(names)
        self._counts = +self._counts
        self.changed.set()

    def glance(self, name: str, now_s: float) -> None:
        """Count a viewer of a signal for `GLANCE_S` seconds; `name` is a signal of the driver."""
        self._glances[name] = now_s + GLANCE_S
        self.changed.set()

    @contextmanager
    def viewing(self, names: Collection[str] | None = None) -> Iterator[None]:
        """Count a viewer while the context is open; None means all signals."""
        if names is None:
            self._of_all += 1
        else:
            self.add(names)
        self.changed.set()
        try:
            yield
        finally:
            if names is None:
                self._of_all -= 1
                self.changed.set()
            else:
                self.remove(names)

    def sees(self, names: Iterable[str], now_s: float) -> bool:
        """Return whether one of the streams has a viewer; a viewer of all sees no low stream."""
        return any(
            name in self._counts
            or self._glances.get(name, now_s) > now_s
            or (self._of_all and not name.endswith(_LOW))
            for name in names
        )
