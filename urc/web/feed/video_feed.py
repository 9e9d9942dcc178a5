"""The newest group of pictures of each video signal, encoded once for all pages.

Layer 5. Other than an image, an access unit is useless without the units before it. The feed
therefore keeps each group from its keyframe. A new page starts with this keyframe. A page that
falls behind continues with the newest group, so no page delays another one.

If the page has a socket for images, `VideoQuality` decides which images its line bears. A camera
may have a second stream for slow lines.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

from urc.model.values import Sample
from urc.motion.driving_lock import SentImages
from urc.runtime.clock import Clock
from urc.runtime.hub import Hub
from urc.runtime.image_viewers import low_stream
from urc.video import VideoUnit, arrival_s, read_unit
from urc.web.feed.delivery_window import DeliveryWindow
from urc.web.feed.video_quality import VideoQuality
from urc.web.wire.picture import FIRST_LOW, NUMBERS, as_frame, encode_video

__all__ = ["GROUP_BYTES", "GROUP_UNITS", "VideoFeed", "VideoGroup", "VideoSubscription"]

GROUP_BYTES: Final = 16_777_216
GROUP_UNITS: Final = 1500
"""Maximum number of access units in a group: 25 s at 60 images a second."""
SHARED_FOR_S: Final = 0.05
"""Maximum age at which an encoded unit is reused, in seconds, as for images."""
RECENT_S: Final = 1.0
"""Age up to which a page begins with the present keyframe of the low stream, in seconds."""
LOST_S: Final = 5.0
"""Time without images after which the low stream counts as lost, in seconds."""
_UNRECORDED: Final = SentImages()


@dataclass(slots=True)
class _Kept:
    """An access unit, with its frame for the socket."""

    number: int
    unit: VideoUnit
    time_s: float
    """Time of the image, in seconds."""
    added_s: float
    """Time at which the server could send the unit, in seconds."""
    frame: bytes = b""
    made_s: float = float("-inf")


class VideoGroup:
    """The newest group of pictures of one stream, with bounded size."""

    def __init__(self, first: int = 0) -> None:
        """Create an empty group; the numbers of its units are higher than `first`."""
        self.units: list[_Kept] = []
        """Units in order, from a keyframe; empty before the first keyframe and after an overflow.
        """
        self.rate = 0.0
        """Bytes a second of the last complete group; 0 while unknown."""
        self.newest_s = float("-inf")
        """Time at which the newest unit was added."""
        self._bytes = 0
        self._number = first

    def add(self, unit: VideoUnit, time_s: float, now_s: float) -> bool:
        """Add the next unit; return whether the group has exceeded a limit and is now empty.

        Units after an overflow are dropped until the next keyframe.
        """
        self._number += 1
        if unit.is_key:
            if self.units and now_s > self.units[0].added_s:
                self.rate = self._bytes / (now_s - self.units[0].added_s)
            self.units.clear()
            self._bytes = 0
        elif not self.units:
            return False
        self._bytes += len(unit.data)
        if self._bytes > GROUP_BYTES or len(self.units) >= GROUP_UNITS:
            self.units.clear()
            return True
        self.units.append(_Kept(self._number, unit, time_s, now_s))
        self.newest_s = now_s
        return False

    def after(self, number: int) -> _Kept | None:
        """Return the unit that a page needs after the unit `number`; None if it has all units."""
        units = self.units
        if not units or number >= units[-1].number:
            return None
        place = number + 1 - units[0].number
        return units[place if place > 0 else 0]

    def key_after(self, number: int) -> _Kept | None:
        """Return the keyframe of the group; None if it is not newer than the unit `number`."""
        return self.units[0] if self.units and self.units[0].number > number else None

    def begins_since(self, time_s: float) -> bool:
        """Return whether the group began at `time_s` or later."""
        return bool(self.units) and self.units[0].added_s >= time_s


@dataclass(slots=True)
class _Shown:
    """A video on one page."""

    quality: VideoQuality
    is_low: bool = False
    """Whether the page receives the low stream."""
    number: int = 0
    """Number of the last unit sent, of the stream that the page receives."""


@dataclass(slots=True)
class VideoSubscription:
    """The videos that one page decodes, and the number of the last unit sent of each."""

    names: tuple[str, ...] = ()
    line: DeliveryWindow | None = None
    """The page's line, if it has a socket for images; its speed then decides about the quality."""
    shown: dict[str, _Shown] = field(default_factory=dict)
    turn: int = 0
    """Round-robin position, so that a camera with large images does not block others."""

    def show(self, names: Iterable[str]) -> None:
        """Set the videos that the page shows; a newly shown video starts with a keyframe."""
        self.names = tuple(dict.fromkeys(names))
        self.shown = {name: one for name, one in self.shown.items() if name in self.names}

    def restart(self, line: DeliveryWindow | None) -> None:
        """Start each video again with a keyframe, over another line."""
        self.line = line
        self.shown.clear()

    def streams(self) -> list[str]:
        """Return the streams that the page needs, as in `urc.runtime.image_viewers`."""
        found = []
        for name in self.names:
            shown = self.shown.get(name)
            is_all = shown is None or shown.quality.level == "all"
            if is_all or (shown is not None and not shown.is_low):
                found.append(name)
            if shown is not None and shown.quality.has_low and (shown.is_low or not is_all):
                found.append(low_stream(name))
        return found


class VideoFeed:
    """The groups of one session, shared by all its pages."""

    def __init__(self, hub: Hub, clock: Clock) -> None:
        """Create the feed of the video signals of `hub`; `take` receives their readings."""
        self._hub = hub
        self._clock = clock
        signals = hub.signals.items()
        self.groups = {name: VideoGroup() for name, one in signals if one.type == "video"}
        lows = (name for names in hub.low_streams.values() for name in names)
        self.lows = {name: VideoGroup(FIRST_LOW) for name in lows}
        """Groups of the low streams, of signals that have one."""
        self.heard: Callable[[str, bytes, VideoUnit], None] | None = None
        """Function that receives the name, the value and the content of each access unit."""
        self.overflows = 0
        """Number of groups that have exceeded a limit."""

    def take(self, samples: Sequence[Sample]) -> None:
        """Add the access units among the samples of a hub revision."""
        for sample in samples:
            group = self.groups.get(sample.signal)
            if group is not None and isinstance(sample.value, bytes):
                unit = read_unit(sample.value)
                if unit is None:
                    continue
                time_s = arrival_s(unit, sample.time_s)
                self.overflows += group.add(unit, time_s, self._clock.now())
                if self.heard is not None:
                    self.heard(sample.signal, sample.value, unit)

    def take_low(self, name: str, value: bytes) -> None:
        """Add an access unit of the low stream of a signal."""
        unit, now_s = read_unit(value), self._clock.now()
        if unit is not None:
            self.overflows += self.lows[name].add(unit, arrival_s(unit, now_s), now_s)

    def next_frame(
        self, subscription: VideoSubscription, images: SentImages = _UNRECORDED
    ) -> bytes | None:
        """Return the frame with the page's next access unit, and mark it as sent; None if none.

        `images` records the unit as sent to the page.
        """
        count, now_s = len(subscription.names), self._clock.now()
        for step in range(count):
            name = subscription.names[(subscription.turn + step) % count]
            if name not in self.groups:
                continue
            shown = subscription.shown.get(name)
            if shown is None:
                quality = VideoQuality(now_s, has_low=name in self.lows)
                shown = subscription.shown[name] = _Shown(quality)
            kept, is_sparse = self._next(name, shown, subscription, now_s)
            if kept is not None:
                subscription.turn = (subscription.turn + step + 1) % count
                shown.number = kept.number
                images.sent(name, kept.number % NUMBERS, kept.time_s, now_s)
                return self._frame(name, kept, is_low=shown.is_low, is_sparse=is_sparse)
        return None

    def _next(
        self, name: str, shown: _Shown, subscription: VideoSubscription, now_s: float
    ) -> tuple[_Kept | None, bool]:
        """Return the next unit of a video, and whether only keyframes are sent."""
        line = subscription.line
        if line is None:
            return self.groups[name].after(shown.number), False
        quality = shown.quality
        while True:
            is_sparse = self._choose(name, shown, now_s)
            group = self.lows[name] if shown.is_low else self.groups[name]
            kept = (group.key_after if is_sparse else group.after)(shown.number)
            if kept is None:
                return None, is_sparse
            if kept.unit.is_key and quality.higher is not None:
                needed = self._needed(subscription, name)
                if quality.rises(line.rate, needed, now_s):
                    continue
            if quality.level == "low" and not shown.is_low:
                return kept, is_sparse  # until the low stream is open
            is_skip = not is_sparse and 0 < shown.number < kept.number - 1
            if quality.takes(kept.added_s, now_s, is_skip=is_skip):
                return kept, is_sparse

    def _choose(self, name: str, shown: _Shown, now_s: float) -> bool:
        """Change between the streams of a video at a keyframe; return whether to send no others."""
        level, low = shown.quality.level, self.lows.get(name)
        if low is None:
            return level == "keyframes"
        changed_s = shown.quality.changed_s
        if level == "all":
            if shown.is_low and self.groups[name].begins_since(changed_s):
                self._change(shown, is_low=False, now_s=now_s)
            return False
        is_lost = now_s - low.newest_s > LOST_S
        if shown.is_low and is_lost:
            self._change(shown, is_low=False, now_s=now_s)
        elif not (shown.is_low or is_lost) and low.begins_since(changed_s - RECENT_S):
            self._change(shown, is_low=True, now_s=now_s)
        return level == "keyframes" or not shown.is_low

    def _change(self, shown: _Shown, *, is_low: bool, now_s: float) -> None:
        shown.is_low, shown.number = is_low, 0
        shown.quality.begin(now_s)

    def _needed(self, subscription: VideoSubscription, raised: str) -> float:
        """Return the rate of all videos of a page if `raised` had the next higher level."""
        rates = []
        for name, shown in subscription.shown.items():
            quality = shown.quality
            level = quality.higher if name == raised else quality.level
            low = self.lows.get(name)
            if level == "all" or (level == "low" and low is not None):
                group = self.groups[name] if level == "all" or low is None else low
                rates.append(group.rate)
        return sum(rates)

    def _frame(self, name: str, kept: _Kept, *, is_low: bool, is_sparse: bool) -> bytes:
        now_s = self._clock.now()
        if now_s - kept.made_s <= SHARED_FOR_S and not is_sparse:
            return kept.frame
        age_ms, index = round((now_s - kept.time_s) * 1000), self._hub.index[name]
        frame = as_frame(
            encode_video(
                *(index, kept.unit, kept.number, age_ms, round(now_s * 1000)),
                is_low=is_low,
                is_sparse=is_sparse,
            )
        )
        if not is_sparse:
            kept.frame, kept.made_s = frame, now_s
        return frame
