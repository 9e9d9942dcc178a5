"""The newest group of pictures of each video signal, encoded once for all pages.

Layer 5. Other than an image, an access unit is useless without the units before it. The feed
therefore keeps each group from its keyframe. A new page starts with this keyframe. A page that
falls behind continues with the newest group, so no page delays another one.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

from urc.model.values import Sample
from urc.motion.driving_lock import SentImages
from urc.runtime.clock import Clock
from urc.runtime.hub import Hub
from urc.video import VideoUnit, arrival_s, read_unit
from urc.web.wire.picture import NUMBERS, as_frame, encode_video

__all__ = ["GROUP_BYTES", "GROUP_UNITS", "VideoFeed", "VideoGroup", "VideoSubscription"]

GROUP_BYTES: Final = 16_777_216
GROUP_UNITS: Final = 1500
"""Maximum number of access units in a group: 25 s at 60 images a second."""
SHARED_FOR_S: Final = 0.05
"""Maximum age at which an encoded unit is reused, in seconds, as for images."""
_UNRECORDED: Final = SentImages()


@dataclass(slots=True)
class _Kept:
    """An access unit, with its frame for the socket."""

    number: int
    unit: VideoUnit
    time_s: float
    """Time of arrival, in seconds."""
    frame: bytes = b""
    made_s: float = float("-inf")


class VideoGroup:
    """The newest group of pictures of one signal, with bounded size."""

    def __init__(self) -> None:
        self.units: list[_Kept] = []
        """Units in order, from a keyframe; empty before the first keyframe and after an overflow.
        """
        self._bytes = 0
        self._number = 0

    def add(self, unit: VideoUnit, time_s: float) -> bool:
        """Add the next unit; return whether the group has exceeded a limit and is now empty.

        Units after an overflow are dropped until the next keyframe.
        """
        self._number += 1
        if unit.is_key:
            self.units.clear()
            self._bytes = 0
        elif not self.units:
            return False
        self._bytes += len(unit.data)
        if self._bytes > GROUP_BYTES or len(self.units) >= GROUP_UNITS:
            self.units.clear()
            return True
        self.units.append(_Kept(self._number, unit, time_s))
        return False

    def after(self, number: int) -> _Kept | None:
        """Return the unit that a page needs after the unit `number`; None if it has all units."""
        units = self.units
        if not units or number >= units[-1].number:
            return None
        place = number + 1 - units[0].number
        return units[place if place > 0 else 0]


@dataclass(slots=True)
class VideoSubscription:
    """The videos that one page decodes, and the number of the last unit sent of each."""

    names: tuple[str, ...] = ()
    seen: dict[str, int] = field(default_factory=dict)
    turn: int = 0
    """Round-robin position, so that a camera with large images does not block others."""

    def show(self, names: Iterable[str]) -> None:
        """Set the videos that the page shows; a newly shown video starts with a keyframe."""
        self.names = tuple(dict.fromkeys(names))
        self.seen = {name: number for name, number in self.seen.items() if name in self.names}


class VideoFeed:
    """The groups of one session, shared by all its pages."""

    def __init__(self, hub: Hub, clock: Clock) -> None:
        """Create the feed of the video signals of `hub`; `take` receives their readings."""
        self._hub = hub
        self._clock = clock
        signals = hub.signals.items()
        self.groups = {name: VideoGroup() for name, one in signals if one.type == "video"}
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
                self.overflows += group.add(unit, arrival_s(unit, sample.time_s))
                if self.heard is not None:
                    self.heard(sample.signal, sample.value, unit)

    def next_frame(
        self, subscription: VideoSubscription, images: SentImages = _UNRECORDED
    ) -> bytes | None:
        """Return the frame with the page's next access unit, and mark it as sent; None if none.

        `images` records the unit as sent to the page.
        """
        count = len(subscription.names)
        for step in range(count):
            name = subscription.names[(subscription.turn + step) % count]
            group = self.groups.get(name)
            kept = group.after(subscription.seen.get(name, 0)) if group is not None else None
            if kept is not None:
                subscription.turn = (subscription.turn + step + 1) % count
                subscription.seen[name] = kept.number
                images.sent(name, kept.number % NUMBERS, kept.time_s, self._clock.now())
                return self._frame(name, kept)
        return None

    def _frame(self, name: str, kept: _Kept) -> bytes:
        now_s = self._clock.now()
        if now_s - kept.made_s > SHARED_FOR_S:
            age_ms, index = round((now_s - kept.time_s) * 1000), self._hub.index[name]
            message = encode_video(index, kept.unit, kept.number, age_ms, round(now_s * 1000))
            kept.frame, kept.made_s = as_frame(message), now_s
        return kept.frame
