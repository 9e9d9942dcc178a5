"""Repeated requests: polls and keepalives. Pure."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial

from urc.model.driver import Driver, Poll
from urc.model.exchange import Keepalive
from urc.protocol.events import Violation
from urc.protocol.requests.condition_scope import SignalState
from urc.protocol.requests.conversation import Conversation
from urc.protocol.requests.encode import BadArgument
from urc.protocol.requests.exchange import (
    CompiledRequest,
    Exchange,
    ExchangeOutcome,
    LineEvent,
    expires_at,
)
from urc.protocol.requests.request_compiler import RequestCompiler
from urc.protocol.sequences.sequence_runner import Sink

__all__ = ["KeepaliveState", "PollState", "PollSchedule"]

Run = Callable[[str, Mapping[str, object], Sink, float], list[LineEvent]]
"""Function that runs a command, with the parameters name, arguments, sink and time."""


class PollState:
    """The schedule of one poll: the time of its next request, and its missing replies."""

    def __init__(
        self, poll: Poll, ask: CompiledRequest, line: Conversation, known: SignalState
    ) -> None:
        self.poll = poll
        self.due: float | None = None
        """Time of the next request, in seconds; None while disconnected."""
        self._ask = ask
        self._line = line
        self._known = known
        self._names = {**known.names, **poll.arguments}
        self._misses = 0
        self._is_offline = False

    def start(self, now: float) -> None:
        """Start polling on a ready connection."""
        self._misses, self._is_offline = 0, False
        self.due = now + self.poll.phase_s

    def stop(self) -> None:
        """Stop polling on a lost connection."""
        self.due = None

    def submit_if_due(self, now: float) -> list[LineEvent]:
        """Submit the request if it is due, unless the previous request is still pending."""
        if self.due is None or self.due > now:
            return []
        every_s = self.poll.every_s
        if self._is_offline and self.poll.offline is not None:
            every_s = self.poll.offline.retry_s
        # Requests keep to a fixed grid of times, so that polls neither drift nor bunch up after a
        # pause.
        self.due += ((now - self.due) // every_s + 1) * every_s
        if self.due <= now:  # the period is below the clock's resolution
            self.due = now + every_s
        if self._line.has(self._ask.label):
            return []
        when = self.poll.when
        if when is not None and not self._known.holds(when, now, self.poll.arguments):
            return []
        return _submit(self._line, self._ask, self, self._names, now)

    def ended(self, exchange: Exchange, outcome: ExchangeOutcome, now: float) -> list[LineEvent]:
        """Count missing replies, up to the poll's `offline` limit, and report refusals."""
        if outcome.code == "timed-out" and self.poll.offline is not None:
            self._misses += 1
            if self._misses >= self.poll.offline.after:
                self._is_offline = True
                if self.due is not None:
                    self.due = max(self.due, now + self.poll.offline.retry_s)
        elif outcome.code in ("", "refused"):
            self._misses = 0
            if self._is_offline and self.due is not None:
                self.due = now + self.poll.every_s
            self._is_offline = False
        # The next poll follows anyway, so only refusals are reported.
        if outcome.code in ("refused", "bad-argument"):
            text = f"{self._ask.label}: {outcome.message}"
            return [Violation(self.poll.transport, outcome.code, text)]
        return []


class KeepaliveState:
    """The keepalive of one connection."""

    def __init__(
        self,
        keepalive: Keepalive,
        line: Conversation,
        ask: CompiledRequest | None,
        known: SignalState,
    ) -> None:
        """Initialise the keepalive.

        Args:
            keepalive: the declaration.
            line: conversation on the connection to keep open.
            ask: request for the keepalive; None if the keepalive runs a command.
            known: state of the robot, used in the keepalive's templates.
        """
        self._keepalive = keepalive
        self._line = line
        self._ask = ask
        self._known = known
        self._is_asked = False
        self._spoke_at = float("-inf")

    @property
    def deadline(self) -> float | None:
        """Time of the next keepalive; None while a keepalive is pending or while disconnected."""
        if not self._line.is_ready or self._is_asked:
            return None
        # A refused keepalive is not retried immediately.
        return max(self._line.last_sent, self._spoke_at) + self._keepalive.every_s

    def forget(self) -> None:
        """Reset the keepalive for a new connection."""
        self._is_asked = False

    def speak(self, run: Callable[[str], list[LineEvent]], now: float) -> list[LineEvent]:
        """Send a keepalive if it is due. The function `run` runs a command and calls `done`."""
        due = self.deadline
        if due is None or due > now:
            return []
        self._is_asked, self._spoke_at = True, now
        if self._ask is None:
            return run(self._keepalive.run)
        return _submit(self._line, self._ask, self, self._known.names, now)

    def ended(self, exchange: Exchange, outcome: ExchangeOutcome, now: float) -> list[LineEvent]:
        """Record the outcome of the keepalive request."""
        return self.done(outcome, now)

    def done(self, outcome: ExchangeOutcome, now: float) -> list[LineEvent]:
        """Record that the keepalive request or command has ended; ignore its outcome."""
        self._is_asked = False
        return []


class PollSchedule:
    """All polls and keepalives of one driver."""

    def __init__(self, driver: Driver, builder: RequestCompiler, known: SignalState) -> None:
        self._lines = builder.lines
        self._polls = [
            PollState(poll, builder.poll(poll, poll.name), self._lines[poll.transport], known)
            for poll in driver.polls
        ]
        self._kept_alive: dict[str, KeepaliveState] = {}
        for name, spec in driver.transports.items():
            if spec.keepalive is not None:
                send = spec.keepalive.send
                ask = builder.plain(f"{name}.keepalive", name, send) if send else None
                self._lines[name].counting = _counting(spec.keepalive, driver)
                self._kept_alive[name] = KeepaliveState(
                    spec.keepalive, self._lines[name], ask, known
                )

    @property
    def keeps_alive(self) -> bool:
        """Whether any connection has a keepalive."""
        return bool(self._kept_alive)

    @property
    def next_poll(self) -> float | None:
        """Time of the next poll; None if no poll is scheduled."""
        first: float | None = None
        for poll in self._polls:
            due = poll.due
            if due is not None and (first is None or due < first):
                first = due
        return first

    @property
    def next_words(self) -> list[float | None]:
        """Times of the next keepalives, one for each connection with a keepalive."""
        return [one.deadline for one in self._kept_alive.values()]

    def start(self, now: float) -> None:
        """Start the polls of per-request connections."""
        for poll in self._polls:
            if self._lines[poll.poll.transport].is_per_request:
                poll.start(now)

    def up(self, line: Conversation, now: float) -> None:
        """Start the polls and the keepalive of a ready connection."""
        name = line.spec.name
        if name in self._kept_alive:
            self._kept_alive[name].forget()
        if not line.is_per_request:
            for poll in self._polls:
                if poll.poll.transport == name:
                    poll.start(now)

    def down(self, line: Conversation) -> None:
        """Stop the polls of a lost connection."""
        if not line.is_per_request:
            for poll in self._polls:
                if poll.poll.transport == line.spec.name:
                    poll.stop()

    def stop(self) -> None:
        """Stop all polls."""
        for poll in self._polls:
            poll.stop()

    def submit_due(self, run: Run, now: float) -> Iterator[list[LineEvent]]:
        """Submit each due poll and keepalive, and yield the resulting events before the next."""
        for poll in self._polls:
            if poll.due is not None and poll.due <= now:
                yield poll.submit_if_due(now)
        for one in self._kept_alive.values():
            if one.deadline is not None and one.deadline <= now:
                yield one.speak(partial(_run_for, run, one, now), now)


def _counting(keepalive: Keepalive, driver: Driver) -> frozenset[str] | None:
    """Return the labels of requests that keep the connection open; None if all do."""
    if not keepalive.after:
        return None
    named = {*keepalive.after, keepalive.run}
    return frozenset((*named, *(poll.name for poll in driver.polls if poll.run in named)))


def _run_for(run: Run, one: KeepaliveState, now: float, command: str) -> list[LineEvent]:
    return run(command, {}, one.done, now)


def _submit(
    line: Conversation,
    ask: CompiledRequest,
    owner: PollState | KeepaliveState,
    names: Mapping[str, object],
    now: float,
) -> list[LineEvent]:
    try:
        data = ask.render(names)
    except BadArgument as error:
        return [Violation(line.spec.name, "bad-argument", f"{ask.label}: {error}")]
    return line.submit(Exchange(ask, owner, names, data, expires_at(ask, now)), now)
