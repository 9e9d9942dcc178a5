"""The unsent access units of one video for one client.

Layer 5. Pure. A client can decode an access unit only after all units before it, from the keyframe
on. The queue therefore starts with a keyframe, and drops whole groups of pictures.
"""

from collections import deque
from typing import Final

from urc.model.values import Sample
from urc.video import read_unit

__all__ = ["LATE_UNITS", "MOST_BYTES", "MOST_UNITS", "add_unit"]

LATE_UNITS: Final = 12
"""Number of unsent units that the next keyframe replaces, as in the decoder of a page."""
MOST_UNITS: Final = 300
"""Number of unsent units at which all are dropped until the next keyframe."""
MOST_BYTES: Final = 16_777_216


def add_unit(waiting: deque[Sample], sample: Sample, *, needs_key: bool) -> tuple[int, bool]:
    """Add a reading of a video to the unsent ones.

    Args:
        waiting: the unsent readings, oldest first.
        sample: a reading of the video; other values than access units are ignored.
        needs_key: whether only a keyframe may follow.

    Returns:
        the number of dropped readings, and whether only a keyframe may follow now.
    """
    unit = read_unit(sample.value) if isinstance(sample.value, bytes) else None
    if unit is None or (needs_key and not unit.is_key):
        return 0, needs_key
    dropped = 0
    if unit.is_key and len(waiting) > LATE_UNITS:
        dropped = len(waiting)
        waiting.clear()
    size = sum(len(one.value) for one in waiting if isinstance(one.value, bytes))
    if len(waiting) >= MOST_UNITS or size + len(unit.data) > MOST_BYTES:
        dropped += len(waiting) + 1
        waiting.clear()
        return dropped, True
    waiting.append(sample)
    return dropped, False
