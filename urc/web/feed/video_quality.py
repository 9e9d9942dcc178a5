"""Which images of a video one page receives: all, those of the low stream, or keyframes only.

Layer 5. Pure. The page's line decides. An image is late if it begins to leave long after its
arrival, or if images before it were skipped. After a single stall, the page catches up. If it
cannot, or if images are late again soon, the quality falls. It rises by one level after a calm
time, which doubles each time the line did not bear the higher level.
"""

from typing import Final, Literal

__all__ = ["CALM_S", "LATE_S", "VideoQuality", "VideoLevel"]

VideoLevel = Literal["all", "low", "keyframes"]

LATE_S: Final = 0.3
"""Wait before its first byte at which an image is late, in seconds."""
BEGIN_S: Final = 3.0
"""Time in which a page must have caught up after the old keyframe with which it began, in seconds.
"""
STALL_S: Final = 0.5
"""Time in which a page must have caught up after a stall, in seconds."""
CAUGHT_UP_S: Final = 0.1
"""Wait before the first byte at which a page has caught up, in seconds."""
AGAIN_S: Final = 10.0
"""Time after a stall in which a second one lowers the quality, in seconds."""
CALM_S: Final = 10.0
"""Time without late images before the first attempt at a higher level, in seconds."""
LONGEST_CALM_S: Final = 300.0
STEADY_S: Final = 60.0
"""Time after which a level counts as borne, in seconds; earlier falls double the calm time."""
TRY_S: Final = 60.0
"""Calm time after which a higher level is tried even on a line that seemed too slow."""
MARGIN: Final = 1.2
"""Required rate of the line, as a multiple of the rate of the videos."""


class VideoQuality:
    """The level of one video on one page."""

    def __init__(self, now_s: float, *, has_low: bool) -> None:
        self._levels: tuple[VideoLevel, ...] = (
            ("all", "low", "keyframes") if has_low else ("all", "keyframes")
        )
        self._place = 0
        self.changed_s = now_s
        """Time of the last change of the level."""
        self._behind_until_s: float | None = now_s + BEGIN_S
        """Time at which the page must have caught up; None if it has."""
        self._stalled_s = float("-inf")
        self._late_s = now_s
        self._rose_s = float("-inf")
        self._calm_s = CALM_S

    @property
    def level(self) -> VideoLevel:
        """The present level."""
        return self._levels[self._place]

    @property
    def has_low(self) -> bool:
        """Whether the video has a low stream."""
        return "low" in self._levels

    @property
    def higher(self) -> VideoLevel | None:
        """The next higher level; None at the highest."""
        return self._levels[self._place - 1] if self._place else None

    def begin(self, now_s: float) -> None:
        """Note that the page begins with an old keyframe, and has to catch up."""
        self._behind_until_s = now_s + BEGIN_S

    def takes(self, arrived_s: float, now_s: float, *, is_skip: bool) -> bool:
        """Return whether the page takes an image at this level; if not, the level has fallen.

        The lowest level takes every image.

        Args:
            arrived_s: time at which the image arrived.
            now_s: time at which the image begins to leave.
            is_skip: whether images of this level before it were skipped.
        """
        lag_s, until_s = now_s - arrived_s, self._behind_until_s
        if until_s is None:
            is_late = lag_s >= LATE_S or is_skip
        else:
            is_late = now_s >= until_s and lag_s >= LATE_S
        if lag_s < CAUGHT_UP_S or (until_s is not None and now_s >= until_s):
            self._behind_until_s = None
        if not is_late:
            return True
        self._late_s = now_s
        if self._place == len(self._levels) - 1:
            return True
        if until_s is None and now_s - self._stalled_s > AGAIN_S:
            self._stalled_s, self._behind_until_s = now_s, now_s + STALL_S
            return True
        self._fall(now_s)
        return False

    def rises(self, rate: float, needed: float, now_s: float) -> bool:
        """Return whether the level has risen by one, which is asked at each keyframe.

        Args:
            rate: bytes a second that the line has borne; 0 while unknown.
            needed: bytes a second of all videos at the higher level; 0 if unknown.
            now_s: the present time.
        """
        calm_s = now_s - max(self.changed_s, self._late_s)
        if not self._place or calm_s < self._calm_s:
            return False
        if rate and rate < MARGIN * needed and calm_s < max(TRY_S, self._calm_s):
            return False
        self._place -= 1
        self.changed_s = self._rose_s = now_s
        self.begin(now_s)
        return True

    def _fall(self, now_s: float) -> None:
        is_early = now_s - self._rose_s < STEADY_S
        self._calm_s = min(LONGEST_CALM_S, 2 * self._calm_s) if is_early else CALM_S
        self._place += 1
        self.changed_s = now_s
        self.begin(now_s)
