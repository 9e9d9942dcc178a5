"""A double of a line's reins: what it is ticked is written nowhere.

It is the same code, so that a real tick finds it at hand; see `urc.web.drive.rehearsal`.
"""

from collections.abc import Callable
from typing import Final

from urc.guard.lane import Clock
from urc.guard.reins import Reins
from urc.model.codec import Payload
from urc.motion.hold import Terms
from urc.transports.base import Transport

__all__ = ["Double"]

_PERIOD_S: Final = 1e-6
"""A rehearsal need not wait for the rate of the real thing."""


class Double:
    """Of one line."""

    def __init__(self, transport: Transport, clock: Clock) -> None:
        """Prepare; of `transport` only ``touch()`` is used, the way to the line with nothing."""
        nowhere = _Nowhere(getattr(transport, "touch", None))
        self._reins = Reins(
            nowhere,  # type: ignore[arg-type]  # it is neither opened nor read
            _Silent(clock),
            stalled_s=float("inf"),
            is_strict=False,
            told=lambda control, reason, number: None,
            failed=lambda reason: None,
        )
        self._reins.begin()

    def tick(self, control: str, terms: Terms, number: int, data: Payload, at_s: float) -> None:
        """Go the way of a tick."""
        if isinstance(data, bytes):  # else a task would carry it
            reins = self._reins
            reins.arm(control, terms._replace(period_s=_PERIOD_S))
            reins.tick(control, number, data, at_s)
            reins.step()


class _Nowhere:
    """Takes everything."""

    def __init__(self, touch: Callable[[], None] | None) -> None:
        self._touch = touch

    def offer(self, data: bytes) -> bool:
        if self._touch is not None:
            self._touch()
        return True

    def unsent(self) -> int:
        return 0


class _Silent:
    """A clock that never rings: what a double has begun ends with the turn."""

    def __init__(self, clock: Clock) -> None:
        self.now, self.sleep = clock.now, clock.sleep

    def call_at(self, time_s: float, action: Callable[[], None]) -> "_Silent":
        return self

    def cancel(self) -> None:
        """There is nothing to call off."""
