"""The transform tree of one engine: its samples, and values in other coordinate frames.

Pure. Every message updates the tree immediately, so a pose always uses the newest transforms. The
signal of the tree is sampled at most once per period, which is the `throttle` of the subscription.
The value of a tree with many frames is large, and pages only show it. After the last message of a
burst, `tick` returns the missing sample.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

from urc.expressions import Template
from urc.model.values import FrameChange, Sample, Signal
from urc.protocol.values.transform_tree import NotConnected, TransformTree, tree_message
from urc.protocol.values.transforms import transform_points, transform_pose

__all__ = ["STATIC_TOPIC", "TreeReadings", "tree_of"]

STATIC_TOPIC: Final = "tf_static"
"""Last part of the name of a topic with static transforms, as fixed by tf2."""
_PERIOD_S: Final = 0.2
"""Minimum time between two samples of a tree without `throttle`, in seconds."""
_JITTER: Final = 0.9
"""Fraction of the period after which a sample is due, so that messages at the declared rate are not
halved by their jitter."""


class TreeReadings:
    """The transform tree of a driver."""

    def __init__(self, signal: Signal) -> None:
        self.name = signal.name
        self.stale_after_s = signal.stale_after_s
        self.tree = TransformTree()
        self._sampled_s = -math.inf
        self._received_s: float | None = None
        """Time of the newest message that has not been sampled; None after a sample."""
        self._period_s = _PERIOD_S

    def forget(self) -> None:
        """Drop all frames, because the connection has been opened again."""
        self.tree.clear()
        self._sampled_s = -math.inf
        self._received_s = None

    def listen(self, period_s: float) -> None:
        """Set the minimum time between two samples, in seconds."""
        self._period_s = period_s

    def receive(self, raw: object, now: float, *, is_static: bool) -> list[str]:
        """Update the tree with a message; return descriptions of rejected transforms.

        Raises:
            BadValue: the whole message is invalid.
        """
        faults = self.tree.update(tree_message(raw), now, is_static=is_static)
        self._received_s = now
        return faults

    @property
    def deadline(self) -> float | None:
        """Time of the next sample; None if the newest message has been sampled."""
        return None if self._received_s is None else self._sampled_s + self._period_s

    def sample(self, now: float) -> Sample | None:
        """Return a sample of the tree; None before the period has passed, or without a message."""
        if self._received_s is None or now - self._sampled_s < _JITTER * self._period_s:
            return None
        time_s, self._received_s = self._received_s, None
        self._sampled_s = now
        return Sample(self.name, self.tree.value(now), time_s)

    def change(
        self, change: FrameChange, frame: Template, namespace: Mapping[str, Any]
    ) -> tuple[Callable[[object], object], float]:
        """Return the function that changes values to another frame, and the time of the transforms.

        The time is when the oldest used transform was received, in seconds; infinity if only static
        transforms are used. The function raises `BadValue` for a value with the wrong shape.

        Raises:
            NotConnected: the frames are not connected, or a frame has no name.
            ExpressionError: the name of a frame has no value.
        """
        source, target = change.source.evaluate(namespace), frame.evaluate(namespace)
        if not source or not target:
            raise NotConnected("the message does not name its frame")
        transform, time_s = self.tree.lookup(str(target), str(source))
        move = transform_pose if change.shape == "pose" else transform_points
        return lambda value: None if value is None else move(transform, value), time_s


def tree_of(signals: Mapping[str, Signal]) -> TreeReadings | None:
    """Return the transform tree of a driver's signals; None for a driver without a tree."""
    found = (one for one in signals.values() if one.type == "transform_tree")
    signal = next(found, None)
    return None if signal is None else TreeReadings(signal)
