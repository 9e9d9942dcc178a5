"""Encoding of occupancy grids in a thread, because a large grid would hold up the event loop.

Theory of operation. One grid of the process is encoded at a time. Each robot has at most one grid
in a thread, and one waiting grid for each signal. A newer grid replaces the waiting grid. Signals
take turns, so a fast costmap cannot delay a map for ever. The time of an image is the time at which
the message arrived, so pages show the age of the data. A value without a grid, such as “not
available”, is published at once. Older grids of its signal are then dropped.
"""

import asyncio
import logging
from collections.abc import Callable, Sequence
from functools import partial
from threading import Lock
from typing import Final, cast

from urc._daemon import in_daemon
from urc.model.values import Sample
from urc.protocol.values.occupancy_grid import Grid, UnencodedGrid, encode_grid

__all__ = ["GridEncoder"]

_TURN: Final = Lock()
"""Lock that lets one thread encode at a time, so that large maps leave a processor free."""

log = logging.getLogger(__name__)


class GridEncoder:
    """The grids of one robot, encoded one after another."""

    def __init__(
        self,
        publish: Callable[[list[Sample]], None],
        encode: Callable[[Grid], bytes] = encode_grid,
    ) -> None:
        """Create an encoder without grids.

        Args:
            publish: function that publishes encoded samples, called on the event loop.
            encode: function that returns the image of a grid, called in the thread.
        """
        self._publish = publish
        self._encode = encode
        self._waiting: dict[str, Sample] = {}
        """Newest sample of each signal that waits for the thread, in the order of their turns."""
        self._images: dict[str, tuple[Grid, bytes]] = {}
        """Newest grid of each signal with its image, because many robots repeat their map."""
        self._overtaken = False
        """Whether a newer value was published for the signal whose grid is in the thread."""
        self._running = ""
        """Signal whose grid is in the thread, or ""."""
        self._task: asyncio.Task[None] | None = None

    def take(self, samples: Sequence[Sample]) -> list[Sample]:
        """Keep the samples with grids to encode, and return all others."""
        others = []
        for sample in samples:
            value: object = sample.value
            if isinstance(value, UnencodedGrid):
                self._add(sample, value.grid)
            else:
                others.append(sample)
                self._overtake(sample.signal)
        return others

    def close(self) -> None:
        """Drop all grids; nothing is published afterwards."""
        self._waiting.clear()
        self._images.clear()
        if self._task is not None:
            self._task.cancel()

    def _add(self, sample: Sample, grid: Grid) -> None:
        known = self._images.get(sample.signal)
        is_busy = self._running == sample.signal or sample.signal in self._waiting
        if known is not None and known[0] is grid and not is_busy:
            self._publish([sample._replace(value=known[1])])
            return
        self._waiting[sample.signal] = sample
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._run())

    def _encoded(self, grid: Grid) -> bytes:
        with _TURN:
            return self._encode(grid)

    def _overtake(self, signal: str) -> None:
        self._waiting.pop(signal, None)
        self._overtaken |= signal == self._running

    async def _run(self) -> None:
        """Encode all waiting grids."""
        while self._waiting:
            signal = next(iter(self._waiting))
            sample = self._waiting.pop(signal)
            grid = cast("UnencodedGrid", sample.value).grid
            self._running, self._overtaken = signal, False
            try:
                image = await in_daemon(partial(self._encoded, grid), "urc-grid")
            except Exception:  # supervisor: the other grids must go on
                log.exception("the grid of %s cannot be encoded", signal)
                continue
            finally:
                self._running = ""
            if not self._overtaken:
                self._images[signal] = grid, image
                self._publish([sample._replace(value=image)])
