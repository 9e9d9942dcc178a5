"""One hold-to-run control: which frames it sends during motion, and when it stops.

Theory of operation. A `HoldToRun` is idle, moving or stopping. The control moves the robot only
while *ticks of sampled input* arrive. Each tick renews a short lease and replaces any unsent value.
Only the newest value is sent; values are never queued. The stop frame is sent before all other data
when the lease expires, the control is released, or a stop is requested. The stop frame is already
rendered when the control is armed. After the stop and its repeats, nothing is sent, because further
stop frames would override other sources of motion.

Motion never resumes automatically. Every stop except a release disarms the control; further ticks
are refused. The operator arms the control again by releasing and pressing it.

If the connection is lost while the robot may be moving, a stop is still due. This stop is the first
frame sent on the restored connection. Values that were unsent when the connection was lost are
dropped.
"""

from math import inf
from typing import Final, Literal, NamedTuple

from urc.model.payload import FrameVariants, Numbered, Payload
from urc.motion.rate_limiter import RateLimiter

__all__ = [
    "LEASE_S",
    "LONGEST_LEASE_S",
    "SHORTEST_LEASE_S",
    "HoldTerms",
    "HoldToRun",
    "StopReport",
]

SHORTEST_LEASE_S: Final = 0.1
LEASE_S: Final = 0.25
LONGEST_LEASE_S: Final = 1.0
STOP_EVERY_S: Final = 0.05
"""Interval between repeated stops on lossy connections, in seconds."""
STOP_FOR_S: Final = 0.5
"""Time for which a stop is repeated on a lossy connection, in seconds."""
LATE_STOP_S: Final = 5.0
"""Time for which the stop after a reconnection is repeated, in seconds, if the robot may connect to
the router later than URC."""
LATE_STOP_EVERY_S: Final = 0.2
"""Interval between these repeats after the first `STOP_FOR_S`, in seconds. It limits the number of
prepared stops for robots with counters."""

Reason = Literal["released", "expired", "stopped", "revoked"]
StopReport = Reason | Literal["lost"]
"""Report about a stop: written for a reason, or written and then lost with the connection."""


class HoldTerms(NamedTuple):
    """The stop frame and the time limits of an armed control.

    Only the stop frame can change during motion.
    """

    stop: Payload
    """Complete frame that stops the motion. Empty for a robot that moves in steps, because its
    steps end without a stop frame."""
    period_s: float
    """Minimum average time between two writes, in seconds."""
    lease_s: float = LEASE_S
    """Time for which motion continues after the last tick, from 0.1 to 1.0 seconds."""
    is_lossy: bool = False
    """Whether the transport may lose frames, as UDP does; if so, the stop is repeated."""
    restored_s: float = STOP_FOR_S
    """Time for which a stop that is still due after a reconnection is repeated on a lossy
    connection, in seconds."""
    stops: tuple[Numbered, ...] = ()
    """Variants of the stop frame for different counter values; empty for a stop without counters.
    """

    def stopped_by(self, stop: Payload | FrameVariants) -> "HoldTerms":
        """Return a copy of these terms with a different stop frame."""
        if isinstance(stop, FrameVariants):
            return self._replace(stop=stop.frames[0].data, stops=stop.frames)
        return self._replace(stop=stop, stops=())


class HoldToRun:
    """The state machine of one hold-to-run control."""

    def __init__(self, terms: HoldTerms) -> None:
        """Create an idle control with `terms`.

        Raises:
            ValueError: the lease or the period is out of range, so the motion might never stop.
        """
        if not SHORTEST_LEASE_S <= terms.lease_s <= LONGEST_LEASE_S:
            raise ValueError(f"a lease lasts 0.1 to 1.0 s, not {terms.lease_s:g}")
        self.terms = terms
        self.state: Literal["idle", "moving", "stopping"] = "idle"
        self.is_armed = False
        """Whether ticks are accepted."""
        self.reason: Reason | None = None
        """Reason for the last stop, such as a release or an expired lease."""
        self.is_told = True
        """Whether the last stop was reported; set by the owner of the connection."""
        self.owes_stop = False
        """Whether the connection was lost before the stop could reach the robot."""
        self._rate_limiter = RateLimiter(terms.period_s, is_strict=terms.stop == b"")
        self._waiting: Payload | None = None
        self._expires_at = 0.0
        self._stop_at = 0.0
        self._often_until = 0.0
        self._stop_until = 0.0

    @property
    def is_waiting(self) -> bool:
        """Whether a value is waiting to be written."""
        return self._waiting is not None

    def must_stop(self, now: float) -> bool:
        """Return whether the control is being stopped or its lease has expired."""
        return self.state == "stopping" or (self.state == "moving" and now >= self._expires_at)

    @property
    def deadline(self) -> float | None:
        """Latest time for the next call to `due`; None while idle."""
        if self.state == "moving":
            if self._waiting is None:
                return self._expires_at
            return min(self._expires_at, self._rate_limiter.free_at)
        return self._stop_at if self.state == "stopping" else None

    def renew(self, terms: HoldTerms) -> None:
        """Replace the terms, but keep a pending stop. A new period resets the rate limiter.

        Raises:
            ValueError: the lease or the period is out of range.
        """
        fresh = HoldToRun(terms)
        if terms.period_s != self.terms.period_s:
            self._rate_limiter = fresh._rate_limiter
        self.terms = terms

    def arm(self) -> None:
        """Accept ticks from now on; the first tick begins the motion."""
        self.is_armed = True

    def tick(self, data: Payload | None, now: float, until: float = inf) -> bool:
        """Accept a tick of sampled input: renew the lease, and store `data` as the newest value.

        Args:
            data: the newest value. None renews the lease but drops any unsent value, because the
                new input value cannot be sent.
            now: the time of the sample.
            until: time at which the lease ends at the latest, because the operator's image is then
                too old.

        Returns:
            Whether the tick was accepted. After a refusal, the control must be armed again.
        """
        if self.state == "moving" and now >= self._expires_at:
            self.stop("expired", now)  # a tick after the lease belongs to no motion
        if not self.is_armed or self.owes_stop:
            return False
        self.state = "moving"  # also during the repeated stops after a release
        self._waiting = data
        self._expires_at = min(now + self.terms.lease_s, until)
        return True

    def forget(self) -> None:
        """Drop the unsent value but keep the lease."""
        self._waiting = None

    def stop(self, reason: Reason, now: float) -> None:
        """Stop the motion.

        A release has no effect unless the control is moving the robot. All stops for other reasons
        always take effect.
        """
        if reason == "released" and self.state != "moving":
            return  # nothing moves, and an idle control is silent
        self.is_armed = self.is_armed and reason == "released"
        self.state = "stopping"
        self.reason = reason
        self.is_told = False
        self._waiting = None
        self._stop_at = now
        is_repeated = self.terms.is_lossy and self.terms.stop != b""
        self._often_until = now + STOP_FOR_S
        self._stop_until = self._often_until if is_repeated else now

    def due(self, now: float, *, is_clear: bool) -> Payload | None:
        """Return the frame to write now; None if no frame is due.

        Args:
            now: the current time.
            is_clear: whether all bytes on the connection have been sent. A motion frame waits for a
                clear connection; meanwhile, newer values replace the waiting value. A stop frame
                never waits.
        """
        if self.state == "moving" and now >= self._expires_at:
            self.stop("expired", now)
        if self.state == "stopping":
            return self._next_stop(now)
        if self._waiting is None or not is_clear or not self._rate_limiter.allow(now):
            return None
        data, self._waiting = self._waiting, None
        return data

    def _next_stop(self, now: float) -> Payload | None:
        if now < self._stop_at:
            return None
        every_s = STOP_EVERY_S if now < self._often_until else LATE_STOP_EVERY_S
        if now + every_s > self._stop_until:
            self.state = "idle"
        self._stop_at = now + every_s
        self.owes_stop = False
        return self.terms.stop

    def cut(self, *, is_doubtful: bool = False) -> None:
        """Record the loss of the connection: drop the unsent value and mark a required stop as due.

        Args:
            is_doubtful: whether a written stop may have been lost with the connection.
        """
        if self.state != "idle" or is_doubtful:
            self.owes_stop = True
        self.is_armed = False
        self.state = "idle"
        self._waiting = None

    def restored(self, now: float) -> None:
        """Record that the connection is restored; a stop that is still due is sent first."""
        if self.owes_stop:
            self.stop("revoked", now)
            if self._stop_until > now:
                self._stop_until = now + self.terms.restored_s

    def shorten(self, now: float) -> None:
        """End the repeats of a stop after the usual time, because the connection will be closed."""
        self._stop_until = min(self._stop_until, now + STOP_FOR_S)
