"""Videos whose picture stands still, although the encoder sends new data.

Layer 4. Pure. `standing_pictures.js` contains the same rule for pages that decode the video.

Theory of operation. An encoder that gets the same picture again and again sends different data. Its
rate control changes the quality, and images between keyframes accumulate differences. A keyframe
depends only on the picture and the quality, and an encoder has few qualities. The keyframes of a
standing picture therefore repeat: not each time, and not always in the whole image. The images of a
real sensor never repeat, because of its noise. Only areas without noise do, such as a white sky.

A keyframe consists of small blocks. If nearly all blocks of a keyframe equal blocks at the same
places of earlier keyframes, the picture has stood still since then.
"""

import math
from collections import deque
from collections.abc import Sequence
from typing import Final, NamedTuple

__all__ = ["MOST_KEYFRAMES", "NEW_SHARE", "StandingPictures"]

MOST_KEYFRAMES: Final = 128
"""Number of remembered keyframes. An encoder at constant bit rate needs about ten to repeat one."""
NEW_SHARE: Final = 1 / 8
"""Maximum share of new blocks in a keyframe of a standing picture. With the noise of a sensor, more
than a fifth is new, even at a very low bit rate."""
_ENDS_AFTER: Final = 2
"""Number of new keyframes in sequence that end a standstill; one may have a new quality."""


class _Block(NamedTuple):
    first_s: float
    """Time of the first keyframe with this block."""
    keyframe: int
    """Number of the newest keyframe with this block."""


class StandingPictures:
    """The newest keyframes of one video, and since when its picture stands still."""

    def __init__(self, after_s: float) -> None:
        """Begin without keyframes.

        Args:
            after_s: time in seconds after which equal images count as one; the key `frozen_after`.
        """
        self._after_s = after_s
        self._blocks: dict[int, _Block] = {}
        self._keyframes: deque[Sequence[int]] = deque()
        self._count = 0
        self._since_s: float | None = None
        self._new = 0
        """Number of new keyframes in sequence."""

    def add_keyframe(self, blocks: Sequence[int], time_s: float) -> None:
        """Compare a keyframe with the earlier ones.

        Args:
            blocks: checksum of each block, which includes the place of the block.
            time_s: time of arrival of the keyframe, in seconds.
        """
        self._count += 1
        firsts = []
        for one in blocks:
            known = self._blocks.get(one)
            firsts.append(time_s if known is None else known.first_s)
            self._blocks[one] = _Block(firsts[-1], self._count)
        self._keyframes.append(blocks)
        if len(self._keyframes) > MOST_KEYFRAMES:
            self._forget_oldest()
        self._judge(sorted(firsts), time_s)

    def first_s(self, time_s: float) -> float | None:
        """Return the time of the image that the camera repeats; None for a current image.

        Args:
            time_s: time of arrival of a decoded image, in seconds.
        """
        since_s = self._since_s
        return since_s if since_s is not None and time_s - since_s >= self._after_s else None

    def _judge(self, firsts: Sequence[float], time_s: float) -> None:
        """Decide whether the picture stands still, from the time of each block's first keyframe."""
        since_s = firsts[math.ceil(len(firsts) * (1 - NEW_SHARE)) - 1] if firsts else time_s
        if since_s < time_s:
            self._new = 0
            if self._since_s is None or since_s < self._since_s:
                self._since_s = since_s
            return
        self._new += 1
        if self._new >= _ENDS_AFTER:
            self._since_s = None

    def _forget_oldest(self) -> None:
        number = self._count - MOST_KEYFRAMES
        for one in self._keyframes.popleft():
            if one in self._blocks and self._blocks[one].keyframe == number:
                del self._blocks[one]
