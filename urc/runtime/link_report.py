"""The published status of one transport: state, counters, and a rate-limited log."""

from dataclasses import dataclass
from typing import Literal

from urc.model.payload import Envelope, Payload, traffic_of
from urc.protocol.events import Noted, Violation
from urc.runtime.clock import Clock, Timer
from urc.runtime.hub import TRANSPORT, Hub, LinkState, LinkStatus, LogEntry, Traffic
from urc.runtime.redaction import REDACTED
from urc.transports.base import TOPICS

__all__ = ["REDACTED", "LinkReport", "LogRateLimiter"]

NOTES_BURST = 50
"""Number of log entries from messages of the robot before the rate limit applies."""
NOTES_REFILL_S = 0.1
"""Minimum interval between log entries from messages after the first entries, in seconds."""
BURST = 4
"""Number of log entries of one kind before the rate limit applies."""
REFILL_S = 10.0
"""Minimum interval between log entries of one kind after the first entries, in seconds."""
HELD_S = 0.3
"""Maximum time to hold back data that may be the beginning of a secret, in seconds."""
KINDS = 64
"""Maximum number of kinds of log entries with their own rate limit; all further kinds share one
limit."""


@dataclass(slots=True)
class _Kind:
    tokens: float
    told_s: float
    untold: int = 0


class LogRateLimiter:
    """A token bucket that limits each kind of log entry."""

    def __init__(self, clock: Clock, burst: int = BURST, refill_s: float = REFILL_S) -> None:
        self._clock = clock
        self._burst = burst
        self._refill_s = refill_s
        self._kinds: dict[str, _Kind] = {}

    def admit(self, kind: str) -> int | None:
        """Return the number of suppressed entries of this kind, or None to suppress this entry."""
        now = self._clock.now()
        if kind not in self._kinds:
            kind = kind if len(self._kinds) < KINDS else ""
            self._kinds.setdefault(kind, _Kind(self._burst, now))
        known = self._kinds[kind]
        known.tokens = min(self._burst, known.tokens + (now - known.told_s) / self._refill_s)
        known.told_s = now
        if known.tokens < 1:
            known.untold += 1
            return None
        known.tokens -= 1
        untold, known.untold = known.untold, 0
        return untold


class LinkReport:
    """The published state of one transport, sent to the hub."""

    def __init__(self, transport: str, address: str, hub: Hub, clock: Clock) -> None:
        self._transport = transport
        self._source = f"{TRANSPORT}{transport}"
        self._address = address
        self._hub = hub
        self._clock = clock
        self._since_s = clock.now()
        self._detail = ""
        self._is_ready = False
        self._is_changed = True
        self._limiter = LogRateLimiter(clock)
        self._notes_limiter = LogRateLimiter(clock, NOTES_BURST, NOTES_REFILL_S)
        self._telling: Timer | None = None
        self.state: LinkState = "idle"
        self.attempts = 0
        """Number of failed attempts since the last valid frame."""
        self.faults = 0
        self.publish()

    @property
    def is_well(self) -> bool:
        """Whether the state is live without a failure, so that a valid frame does not change it."""
        return self.state == "live" and not self.attempts and not self._detail

    def show(self, state: LinkState, detail: str = "", *, is_ready: bool = False) -> None:
        """Set the state. A new state is also logged; a new detail is only published.

        Args:
            state: the new state.
            detail: reason for the state, in one line; "" for a normal state.
            is_ready: whether the login of a connecting link has ended; a live or silent link is
                always ready.
        """
        is_ready = is_ready or state in ("live", "silent")
        if (state, detail, is_ready) == (self.state, self._detail, self._is_ready):
            return
        self._is_ready = is_ready
        if state != self.state:
            self.state = state
            self._since_s = self._clock.now()
            self._note_state(state, detail)
        self._detail = detail
        self._is_changed = True

    def fail(self, state: LinkState, detail: str) -> None:
        """Count a failed attempt."""
        self.attempts += 1
        self._is_changed = True
        self.show(state, detail)

    def count(self, fault: Violation) -> None:
        """Count a protocol violation and log it at a limited rate."""
        self.faults += 1
        self._is_changed = True
        if self.state == "connecting" and self._detail:
            # Connected without a valid frame: the violation is the most helpful detail.
            self._detail = f"connected; {fault.message}"
        if fault.code == "no-data" and self.state != "silent":
            return  # the following change of state reports the same
        self.log("warning", f"fault {fault.code}", f"{fault.code}: {fault.message}")

    def log(self, level: Literal["info", "warning", "error"], kind: str, text: str) -> None:
        """Add a log entry, within the rate limit for its kind."""
        untold = self._limiter.admit(kind)
        if untold is None:
            return
        more = f" (and {untold} more like it)" if untold else ""
        self._hub.log(LogEntry(self._clock.now(), level, self._source, text + more))

    def note(self, entry: Noted) -> None:
        """Add a log entry that a message of the robot contains, within the rate limit."""
        untold = self._notes_limiter.admit("")
        if untold is None:
            return
        more = f" (after {untold} entries that are not shown)" if untold else ""
        self._hub.log(LogEntry(self._clock.now(), entry.level, self._source, entry.text + more))

    def saw(self, direction: Literal["sent", "received"], data: Payload) -> None:
        """Record traffic while the hub has traffic readers; requests for topics are left out."""
        envelope = data if isinstance(data, Envelope) else None
        if self._hub.traffic_watchers and (envelope is None or envelope.verb != TOPICS):
            shown, now = traffic_of(data), self._clock.now()
            self._hub.saw(Traffic(now, self._transport, direction, shown, envelope))
            if self._hub.holds_back:
                if self._telling is not None:
                    self._telling.cancel()
                self._telling = self._clock.call_at(now + HELD_S, self._tell_rest)

    def _tell_rest(self) -> None:
        self._telling = None
        self._hub.tell_rest(self._clock.now())

    def publish(self) -> None:
        """Publish the link state if the state has changed."""
        if not self._is_changed:
            return
        self._is_changed = False
        self._hub.set_link(
            LinkStatus(
                transport=self._transport,
                state=self.state,
                address=self._address,
                since_s=self._since_s,
                detail=self._detail,
                attempts=self.attempts,
                faults=self.faults,
                is_ready=self._is_ready,
            )
        )

    def _note_state(self, state: LinkState, detail: str) -> None:
        level: Literal["info", "warning"] = "warning" if state in ("silent", "lost") else "info"
        if state == "connecting":
            text = f"connecting to {self._address}"  # the only entry with the address
        else:
            text = f"{state}: {detail}" if detail else state
        self.log(level, f"state {state}", text)
