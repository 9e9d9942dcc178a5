"""The connection of one transport: when it is up, when it is usable, and what ends with it.

Floor 3, pure. See `urc.protocol.line` for the theory of operation.
"""

from collections.abc import Callable
from typing import Literal

from urc.model.driver import TransportSpec
from urc.protocol.answer import Matcher
from urc.protocol.events import Close, Fault, Ready
from urc.protocol.exchange import Ended, Exchange, Leaving, LineEvent, Outcome
from urc.protocol.flights import Flights
from urc.protocol.framing import build_framing
from urc.protocol.framings.base import Framing
from urc.protocol.gate import Counters
from urc.protocol.held_replies import HeldReplies
from urc.protocol.inbox import Inbox
from urc.protocol.outbox import Outbox

__all__ = ["Connection"]


class Connection:
    """What a line is made of, and what becomes of it when the transport comes and goes."""

    def __init__(self, spec: TransportSpec, messages: list[Matcher]) -> None:
        self.spec = spec
        self.is_per_request = spec.connection == "per_request"
        """Whether each request brings its own connection."""
        self.framing: Framing = build_framing(spec.framing)
        self.state: Literal["closed", "opening", "open"] = "closed"
        self.is_ready = False
        """Whether anybody may talk here; else only those who make it so, or say good-bye."""
        self.last_sent = float("-inf")
        """When something was last sent that counts."""
        self.counting: frozenset[str] | None = None
        """Names of requests that count as a word to the robot; None: all do."""
        self.counters = Counters()
        self.learnt: dict[str, object] = {}
        """What the steps of this connection have read: ``_name`` → value."""
        self.on_ready: Callable[[], None] | None = None
        """Called when anybody may talk here; must not call the line back."""
        self.on_refused: Callable[[str, str], None] | None = None
        """Told a held command and why the robot refuses it; must not call the line back."""
        self._flights = Flights()
        self._outbox = Outbox(spec, self._flights, self._size_of)
        self.inbox = Inbox(spec, self.framing, messages)
        self.held = HeldReplies()
        """Of the commands that move the robot for as long as they are held."""
        self.is_behind = False
        """Whether something that came in waits for `go_on`."""
        self._askers: dict[object, object] = {}
        """Numbers of requests that steps have made → who expects the answer, if anybody."""
        self._is_leaving = False
        self._misses = 0
        """Answers in a row that did not come."""
        self._silent_at: float | None = None
        """When the line has said nothing for too long."""

    @property
    def is_open(self) -> bool:
        """Whether the transport is connected."""
        return self.state == "open"

    @property
    def is_silent(self) -> bool:
        """Whether the robot has said nothing for longer than `stale_after` allows."""
        return self.is_open and self.spec.stale_after_s is not None and self._silent_at is None

    def opened(self, now: float) -> list[LineEvent]:
        """Take note that the transport is connected, with nothing received on it yet."""
        events = self._lose("the line was connected anew") if self.state == "open" else []
        self._reset("open")
        self.last_sent = now
        self._hear(now)
        if not self.spec.on_connect:
            self._get_ready()
        return events + self._pump(now)

    def ready(self, now: float) -> list[LineEvent]:
        """Let everybody talk: the connection is as it must be."""
        self._get_ready()
        return [Ready(self.spec.name), *self._pump(now)]

    def _get_ready(self) -> None:
        self.is_ready = True
        if self.on_ready is not None:
            self.on_ready()

    def closed(self, reason: str, now: float) -> list[LineEvent]:
        """Take note that the transport is not connected (any more)."""
        if self.state == "closed":
            return []
        events: list[LineEvent] = []
        was_open, pending = self.state == "open", self.inbox.decoder.pending
        if was_open and pending:
            text = f"the connection ended in the middle of a frame ({pending} bytes)"
            events.append(Fault(self.spec.name, "cut-frame", text))
        events += self._lose(reason or "the robot hung up")
        return events + self._pump(now)

    def give_up(self, reason: str, now: float) -> list[LineEvent]:
        """Close the connection for a reason; what waits for it fails."""
        if self.state == "closed":
            return []
        reason = self.inbox.secrets.hide(reason)
        events = self._lose(reason)
        events.append(Close(self.spec.name, reason))
        return events + self._pump(now)

    def leave(self, now: float) -> list[LineEvent]:
        """Begin to close in good order: say good-bye where that is declared, else close at once."""
        if self.state != "open":
            return []
        if self.spec.on_close:
            lost = self._lost()
            self.is_ready, self._is_leaving = False, True
            return [*_disconnected(lost, "the line is being closed"), Leaving(self.spec.name)]
        return self.shut(now)

    def shut(self, now: float) -> list[LineEvent]:
        """Close after the good-bye."""
        events = self._lose("the line was closed")
        return [*events, Close(self.spec.name), *self._pump(now)]

    def _lose(self, reason: str) -> list[LineEvent]:
        """Forget the connection; fail what it was for."""
        lost = self._lost()
        for exchange in tuple(self._outbox):
            if exchange.is_privileged:
                self._outbox.remove(exchange)
        self._reset("closed")
        return _disconnected(lost, self.inbox.secrets.hide(reason))

    def _lost(self) -> list[Exchange]:
        """Take out the requests that end with this connection."""
        lost = self._flights.drain()
        if not self.is_per_request:
            return lost + self._outbox.drain()
        if not (self.is_ready or self._is_leaving):
            for exchange in list(self._outbox)[:1]:  # it could not be made usable for this one
                self._outbox.remove(exchange)
                lost.append(exchange)
        return lost

    def _reset(self, state: Literal["closed", "open"]) -> None:
        self.state = state
        self.is_ready = self._is_leaving = False
        self._flights.clear()
        self.held.forget()
        self.inbox.reset(is_new=state == "open")
        self._misses = 0
        self._silent_at = None
        self.is_behind = False
        self.learnt = {}
        self._askers.clear()
        if state == "open":
            self.counters.begin()

    def _hear(self, now: float) -> None:
        if self.spec.stale_after_s is not None:
            self._silent_at = now + self.spec.stale_after_s

    def _size_of(self, exchange: Exchange) -> int:
        """Return how many bytes a request takes on the wire."""
        raise NotImplementedError

    def _pump(self, now: float) -> list[LineEvent]:
        """Do what a change of the connection allows or asks for."""
        raise NotImplementedError


def _disconnected(lost: list[Exchange], reason: str) -> list[LineEvent]:
    outcome = Outcome("disconnected", reason)
    return [Ended(exchange, outcome) for exchange in lost]
