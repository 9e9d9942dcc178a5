"""What is asked again and again: polls, and what keeps a line alive.

Floor 3, pure.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial

from urc.model.driver import Driver, Poll
from urc.model.flow import Keepalive
from urc.protocol.asking import Builder
from urc.protocol.encode import BadArgument
from urc.protocol.events import Fault
from urc.protocol.exchange import Ask, Exchange, LineEvent, Outcome, expires_at
from urc.protocol.known import Known
from urc.protocol.line import Line
from urc.protocol.steps import Sink

__all__ = ["KeptAlive", "PollState", "Schedule"]

Run = Callable[[str, Mapping[str, object], Sink, float], list[LineEvent]]
"""Runs a command: its name, its arguments, who has the outcome, and the time."""


class PollState:
    """One poll at work."""

    def __init__(self, poll: Poll, ask: Ask, line: Line, known: Known) -> None:
        self.poll = poll
        self.due: float | None = None
        """When it is next asked; None while its line is not up."""
        self._ask = ask
        self._line = line
        self._known = known
        self._names = {**known.names, **poll.arguments}
        self._misses = 0
        self._is_offline = False

    def begin(self, now: float) -> None:
        """Take note that its line is up."""
        self._misses, self._is_offline = 0, False
        self.due = now + self.poll.phase_s

    def stop(self) -> None:
        """Take note that its line is down."""
        self.due = None

    def ask(self, now: float) -> list[LineEvent]:
        """Ask if it is due. One that still waits for its turn is not asked twice."""
        if self.due is None or self.due > now:
            return []
        every_s = self.poll.every_s
        if self._is_offline and self.poll.offline is not None:
            every_s = self.poll.offline.retry_s
        # Kept on its own grid of times, so that polls neither drift nor bunch up after a pause.
        self.due += ((now - self.due) // every_s + 1) * every_s
        if self.due <= now:  # a period too small for the digits of the clock
            self.due = now + every_s
        if self._line.has(self._ask.label):
            return []
        when = self.poll.when
        if when is not None and not self._known.holds(when, now, self.poll.arguments):
            return []
        return _submit(self._line, self._ask, self, self._names, now)

    def ended(self, exchange: Exchange, outcome: Outcome, now: float) -> list[LineEvent]:
        """Count misses; tell of a robot that refuses."""
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
        # A poll comes again by itself, so only a robot that refuses it is worth a line.
        if outcome.code in ("refused", "bad-argument"):
            text = f"{self._ask.label}: {outcome.message}"
            return [Fault(self.poll.transport, outcome.code, text)]
        return []


class KeptAlive:
    """What is said on one line when nothing else has been said for a while."""

    def __init__(self, keepalive: Keepalive, line: Line, ask: Ask | None, known: Known) -> None:
        """Prepare.

        Args:
            keepalive: as declared.
            line: whose it is.
            ask: None when a command is run.
            known: the names of its templates.
        """
        self._keepalive = keepalive
        self._line = line
        self._ask = ask
        self._known = known
        self._is_asked = False
        self._spoke_at = float("-inf")

    @property
    def deadline(self) -> float | None:
        """When it must speak; None while it has, or the line is not up."""
        if not self._line.is_ready or self._is_asked:
            return None
        # One that could not be sent, because it is not allowed, is not tried again at once.
        return max(self._line.last_sent, self._spoke_at) + self._keepalive.every_s

    def forget(self) -> None:
        """Take note that the line is up anew."""
        self._is_asked = False

    def speak(self, run: Callable[[str], list[LineEvent]], now: float) -> list[LineEvent]:
        """Speak if it is due; `run` runs a command and calls `done`."""
        due = self.deadline
        if due is None or due > now:
            return []
        self._is_asked, self._spoke_at = True, now
        if self._ask is None:
            return run(self._keepalive.run)
        return _submit(self._line, self._ask, self, self._known.names, now)

    def ended(self, exchange: Exchange, outcome: Outcome, now: float) -> list[LineEvent]:
        """Take note that it has been said."""
        return self.done(outcome, now)

    def done(self, outcome: Outcome, now: float) -> list[LineEvent]:
        """Take note that the command has been run; a failure of it shows by itself."""
        self._is_asked = False
        return []


class Schedule:
    """All polls of one driver, and what keeps its lines alive."""

    def __init__(self, driver: Driver, builder: Builder, known: Known) -> None:
        self._lines = builder.lines
        self._polls = [
            PollState(poll, builder.poll(poll, poll.name), self._lines[poll.transport], known)
            for poll in driver.polls
        ]
        self._kept_alive: dict[str, KeptAlive] = {}
        for name, spec in driver.transports.items():
            if spec.keepalive is not None:
                send = spec.keepalive.send
                ask = builder.plain(f"{name}.keepalive", name, send) if send else None
                self._lines[name].counting = _counting(spec.keepalive, driver)
                self._kept_alive[name] = KeptAlive(spec.keepalive, self._lines[name], ask, known)

    @property
    def keeps_alive(self) -> bool:
        """Whether any line is kept alive."""
        return bool(self._kept_alive)

    @property
    def next_poll(self) -> float | None:
        """When the next poll is due."""
        first: float | None = None
        for poll in self._polls:
            due = poll.due
            if due is not None and (first is None or due < first):
                first = due
        return first

    @property
    def next_words(self) -> list[float | None]:
        """When each line is spoken to at the latest, to keep it alive."""
        return [one.deadline for one in self._kept_alive.values()]

    def begin(self, now: float) -> None:
        """Begin the polls that bring their own connections."""
        for poll in self._polls:
            if self._lines[poll.poll.transport].is_per_request:
                poll.begin(now)

    def up(self, line: Line, now: float) -> None:
        """Take note that a line is usable."""
        name = line.spec.name
        if name in self._kept_alive:
            self._kept_alive[name].forget()
        if not line.is_per_request:
            for poll in self._polls:
                if poll.poll.transport == name:
                    poll.begin(now)

    def down(self, line: Line) -> None:
        """Take note that a line is not usable any more."""
        if not line.is_per_request:
            for poll in self._polls:
                if poll.poll.transport == line.spec.name:
                    poll.stop()

    def stop(self) -> None:
        """Poll no more."""
        for poll in self._polls:
            poll.stop()

    def ask(self, run: Run, now: float) -> Iterator[list[LineEvent]]:
        """Submit what is due, one after the other: what comes of one is settled before the next."""
        for poll in self._polls:
            if poll.due is not None and poll.due <= now:
                yield poll.ask(now)
        for one in self._kept_alive.values():
            if one.deadline is not None and one.deadline <= now:
                yield one.speak(partial(_run_for, run, one, now), now)


def _counting(keepalive: Keepalive, driver: Driver) -> frozenset[str] | None:
    """Return the names of requests that keep a line alive; None for all."""
    if not keepalive.after:
        return None
    named = {*keepalive.after, keepalive.run}
    return frozenset((*named, *(poll.name for poll in driver.polls if poll.run in named)))


def _run_for(run: Run, one: KeptAlive, now: float, command: str) -> list[LineEvent]:
    return run(command, {}, one.done, now)


def _submit(
    line: Line, ask: Ask, owner: PollState | KeptAlive, names: Mapping[str, object], now: float
) -> list[LineEvent]:
    try:
        data = ask.made(names)
    except BadArgument as error:
        return [Fault(line.spec.name, "bad-argument", f"{ask.label}: {error}")]
    return line.submit(Exchange(ask, owner, names, data, expires_at(ask, now)), now)
