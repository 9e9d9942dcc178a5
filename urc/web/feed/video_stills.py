"""JPEG images of the videos that some page of a session cannot decode.

Layer 5. One process for each of these videos serves all pages, and ends with the last of them.
"""

import asyncio
from collections.abc import Callable, Collection
from typing import Final

from urc.model.values import Sample
from urc.runtime.clock import Clock
from urc.runtime.hub import Hub, LogEntry
from urc.runtime.still_maker import StillMaker
from urc.runtime.still_process import Still
from urc.video import VideoUnit
from urc.web.feed.image_cache import ImageCache
from urc.web.feed.video_feed import VideoFeed

__all__ = ["VideoStills"]

_REASON: Final = (
    "a page cannot decode this video and receives at most 10 JPEG images a second; the page needs"
    " HTTPS, and the camera H.264"
)
_LATE_S: Final = 60.0
"""Longest credible time between the arrival of an image and its JPEG file, in seconds."""


class VideoStills:
    """The makers of JPEG images of one session, started and stopped as pages need them."""

    def __init__(
        self,
        hub: Hub,
        feed: VideoFeed,
        cache: ImageCache,
        changed: Callable[[], None],
        clock: Clock,
    ) -> None:
        """Create the makers' owner, without processes.

        Args:
            hub: the values of the session; its log tells about each new maker.
            feed: source of the access units.
            cache: destination of the images.
            changed: function that schedules a flush to the pages.
            clock: source of time.
        """
        self._hub = hub
        self._feed = feed
        self._cache = cache
        self._changed = changed
        self._clock = clock
        self._wanted: dict[int, frozenset[str]] = {}
        """Videos that a page cannot decode, by the identity of the page's position."""
        self._makers: dict[str, StillMaker] = {}
        self._stopping: set[asyncio.Task[None]] = set()

    def show(self, page: object, names: Collection[str]) -> None:
        """Set the videos of which a page needs JPEG images; () for a page that has left."""
        if names:
            self._wanted[id(page)] = frozenset(names)
        elif self._wanted.pop(id(page), None) is None:
            return
        wanted = frozenset[str]().union(*self._wanted.values())
        for name in wanted - self._makers.keys():
            self._begin(name)
        for name in self._makers.keys() - wanted:
            self._end(name)
        self._feed.heard = self._heard if self._makers else None

    async def close(self) -> None:
        """Stop all processes."""
        self._wanted.clear()
        self._feed.heard = None
        for name in list(self._makers):
            self._end(name)
        await asyncio.gather(*self._stopping, return_exceptions=True)

    def _begin(self, name: str) -> None:
        after_s = self._hub.signals[name].frozen_after_s
        maker = self._makers[name] = StillMaker(name, self._made, after_s)
        maker.start()
        self._hub.log(LogEntry(self._clock.now(), "info", name, _REASON))

    def _end(self, name: str) -> None:
        task = asyncio.create_task(self._makers.pop(name).stop())
        self._stopping.add(task)
        task.add_done_callback(self._stopping.discard)
        self._cache.stills.pop(name, None)
        self._cache.repeated.discard(name)

    def _heard(self, name: str, value: bytes, unit: VideoUnit) -> None:
        maker = self._makers.get(name)
        if maker is not None:
            maker.take(value, is_key=unit.is_key)

    def _made(self, name: str, still: Still) -> None:
        if name in self._makers:
            age_s = self._clock.now() - still.time_s
            is_credible = age_s >= 0 and (age_s <= _LATE_S or still.is_repeated)
            at_s = still.time_s if is_credible else self._clock.now()
            self._cache.stills[name] = Sample(name, still.image, at_s)
            change = self._cache.repeated.add if still.is_repeated else self._cache.repeated.discard
            change(name)
            self._changed()
