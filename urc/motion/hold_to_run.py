"""One held command: what is written while it is held, and that it stops.

Theory of operation. A `HoldToRun` is idle, moving or stopping. It moves only while *ticks of
sampled input* come: each renews a short lease and replaces what waits to be written, so what goes
out is always the newest value, never a queue. When the lease runs out, the hold is released, or
somebody stops it, the stop frame that was rendered when the control was armed goes out before
anything else; then there is silence, because repeated zeros would fight whoever else drives.

It never resumes by itself. After every stop but a release it is not armed any more, and ticks that
go on coming are refused: whoever drives lets go, makes a new gesture, and arms it anew.

A mover whose line is cut while the robot may still be moving owes a stop: that is the first thing
written when the line is back. Nothing else that waited is kept.
"""

from typing import Final, Literal, NamedTuple

from urc.model.payload import FrameVariants, Numbered, Payload
from urc.motion.rate_limiter import RateLimiter

__all__ = ["LEASE_S", "LONGEST_LEASE_S", "SHORTEST_LEASE_S", "HoldToRun", "HoldTerms"]

SHORTEST_LEASE_S: Final = 0.1
LEASE_S: Final = 0.25
LONGEST_LEASE_S: Final = 1.0
STOP_EVERY_S: Final = 0.05
"""How often a stop is repeated on lines that may lose it."""
STOP_FOR_S: Final = 0.5
"""For how long."""

Reason = Literal["released", "expired", "stopped", "revoked"]


class HoldTerms(NamedTuple):
    """What is agreed when a control is armed; nothing in it but the stop changes while it moves."""

    stop: Payload
    """Written to stop the motion, framing included; no bytes where the robot moves in steps, each
    of which ends by itself: then nothing is written, and all else holds."""
    period_s: float
    """Mean time between two writes, at least."""
    lease_s: float = LEASE_S
    """How long the motion lasts after the last tick, 0.1 to 1.0."""
    is_lossy: bool = False
    """The line may lose what is written (datagrams, serial, topics): a stop is repeated there."""
    stops: tuple[Numbered, ...] = ()
    """The stop with each number that it may have when it leaves; none: it carries no number."""

    def stopped_by(self, stop: Payload | FrameVariants) -> "HoldTerms":
        """Return the same terms with another stop."""
        if isinstance(stop, FrameVariants):
            return self._replace(stop=stop.frames[0].data, stops=stop.frames)
        return self._replace(stop=stop, stops=())


class HoldToRun:
    """One held command at work."""

    def __init__(self, terms: HoldTerms) -> None:
        """Prepare for `terms`; nothing moves.

        Raises:
            ValueError: a lease or period out of range: without them nothing would ever stop.
        """
        if not SHORTEST_LEASE_S <= terms.lease_s <= LONGEST_LEASE_S:
            raise ValueError(f"a lease lasts 0.1 to 1.0 s, not {terms.lease_s:g}")
        self.terms = terms
        self.state: Literal["idle", "moving", "stopping"] = "idle"
        self.is_armed = False
        """Whether ticks are taken."""
        self.reason: Reason | None = None
        """Why it stopped last."""
        self.is_told = True
        """Whether whoever it concerns was told of that stop; kept for the owner of the line."""
        self.owes_stop = False
        """The line was cut before the robot can have had the stop."""
        self._rate_limiter = RateLimiter(terms.period_s, is_strict=terms.stop == b"")
        self._waiting: Payload | None = None
        self._expires_at = 0.0
        self._stop_at = 0.0
        self._stop_until = 0.0

    @property
    def is_waiting(self) -> bool:
        """Whether there is a value that was not written yet."""
        return self._waiting is not None

    def must_stop(self, now: float) -> bool:
        """Return whether it is being stopped, or its lease has run out."""
        return self.state == "stopping" or (self.state == "moving" and now >= self._expires_at)

    @property
    def deadline(self) -> float | None:
        """When `due` has something to say at the latest; None while idle."""
        if self.state == "moving":
            if self._waiting is None:
                return self._expires_at
            return min(self._expires_at, self._rate_limiter.free_at)
        return self._stop_at if self.state == "stopping" else None

    def renew(self, terms: HoldTerms) -> None:
        """Take other terms, when it is armed anew; what is owed stays so, and so does the rate.

        Raises:
            ValueError: as above.
        """
        fresh = HoldToRun(terms)
        if terms.period_s != self.terms.period_s:
            self._rate_limiter = fresh._rate_limiter
        self.terms = terms

    def arm(self) -> None:
        """Take ticks from now on; nothing moves before the first of them."""
        self.is_armed = True

    def tick(self, data: Payload | None, now: float) -> bool:
        """Take a tick of sampled input: it renews the lease, and `data` is the newest value.

        None renews the lease, and nothing is written: the value cannot be sent as it is.

        Returns:
            Whether it was taken; False when the control is to be armed anew.
        """
        if self.state == "moving" and now >= self._expires_at:
            self.stop("expired", now)  # what comes after the lease belongs to no motion any more
        if not self.is_armed or self.owes_stop:
            return False
        self.state = "moving"  # also from the repeats of the stop that a release began
        self._waiting = data
        self._expires_at = now + self.terms.lease_s
        return True

    def forget(self) -> None:
        """Do not write the value that waits; the lease goes on."""
        self._waiting = None

    def stop(self, reason: Reason, now: float) -> None:
        """Stop; only a release asks whether anything moves, because STOP is never refused."""
        if reason == "released" and self.state != "moving":
            return  # nothing moves: there is nothing to stop, and idle is silent
        self.is_armed = self.is_armed and reason == "released"
        self.state = "stopping"
        self.reason = reason
        self.is_told = False
        self._waiting = None
        self._stop_at = now
        is_repeated = self.terms.is_lossy and self.terms.stop != b""
        self._stop_until = now + STOP_FOR_S if is_repeated else now

    def due(self, now: float, *, is_clear: bool) -> Payload | None:
        """Return what is to be written now, or None.

        Args:
            now: the time.
            is_clear: whether the line has no unsent bytes. Motion waits for that and is replaced by
                newer values meanwhile; a stop does not wait.
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
        if now + STOP_EVERY_S > self._stop_until:
            self.state = "idle"
        self._stop_at = now + STOP_EVERY_S
        self.owes_stop = False
        return self.terms.stop

    def cut(self, *, is_doubtful: bool = False) -> None:
        """Take note that the line is gone: nothing that waited is kept, the stop is owed.

        Args:
            is_doubtful: a stop was written, and may have been lost with the line.
        """
        if self.state != "idle" or is_doubtful:
            self.owes_stop = True
        self.is_armed = False
        self.state = "idle"
        self._waiting = None

    def restored(self, now: float) -> None:
        """Take note that the line is back: what is owed goes first."""
        if self.owes_stop:
            self.state = "idle"
            self.stop("revoked", now)
