"""Conditions of commands: what must hold before one is sent, and come true after it.

Floor 3, pure.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from urc.expressions import ExpressionError
from urc.model.driver import Command
from urc.model.flow import Verify
from urc.model.values import Value
from urc.protocol.exchange import Exchange, LineEvent, Outcome
from urc.protocol.known import Known
from urc.protocol.steps import Sink

__all__ = ["CommandRun", "Verifications", "why_not_allowed"]

_MOST: Final = 256
"""Commands that may wait at a time for something to come true."""


def why_not_allowed(
    command: Command, known: Known, values: Mapping[str, object], now: float
) -> str:
    """Return the first thing that a command requires and that does not hold, or ""."""
    for one in command.requires:
        try:
            if not one.condition.evaluate(known.view(now, values)):
                return one.text
        except ExpressionError as error:
            return f"{one.text} ({error})"
    return ""


class _Waiting(NamedTuple):
    run: "CommandRun"
    since: float
    due: float
    outcome: Outcome


class Verifications:
    """Commands that are answered, and wait for what they say to come true."""

    def __init__(self, known: Known) -> None:
        self._known = known
        self._waiting: list[_Waiting] = []
        self.has_news = False
        """A reading came in, so it is worth to look."""

    @property
    def is_full(self) -> bool:
        """Whether no more may wait."""
        return len(self._waiting) >= _MOST

    @property
    def deadline(self) -> float | None:
        """When the first of them has failed."""
        return min((one.due for one in self._waiting), default=None)

    def add(self, run: "CommandRun", outcome: Outcome, since: float, now: float) -> None:
        """Wait for `run` to come true by readings made `since` it was sent."""
        if run.verify is not None:
            due = now + run.verify.within_s
            self._waiting.append(_Waiting(run, since, due, outcome))
            self.has_news = True

    def look(self, now: float) -> list[LineEvent]:
        """Return what to tell of those that have come true."""
        events: list[LineEvent] = []
        if not self.has_news:
            return events
        self.has_news = False
        for one in tuple(self._waiting):
            verify = one.run.verify
            if verify is not None and self._known.holds(
                verify.condition, now, one.run.values, since=one.since
            ):
                self._waiting.remove(one)
                events += one.run.sink(one.outcome, now)
        return events

    def tick(self, now: float) -> list[LineEvent]:
        """Return what to tell of those whose time is over."""
        events = self.look(now)
        for one in tuple(self._waiting):
            if one.due <= now and one.run.verify is not None:
                self._waiting.remove(one)
                source, within_s = one.run.verify.condition.source, one.run.verify.within_s
                text = f"{source!r} did not come true within {within_s:g} s"
                events += one.run.sink(Outcome("not-verified", text), now)
        return events


class CommandRun:
    """One run of a command."""

    def __init__(
        self,
        verify: Verify | None,
        values: Mapping[str, Value],
        sink: Sink,
        verifications: Verifications,
    ) -> None:
        """Prepare; `sink` takes the outcome once it has been answered, and verified."""
        self.verify = verify
        self.values = values
        self.sink = sink
        self._verifications = verifications

    def ended(self, exchange: Exchange, outcome: Outcome, now: float) -> list[LineEvent]:
        """Tell the outcome, or wait for it to come true."""
        if outcome.code or self.verify is None:
            return self.sink(outcome, now)
        self._verifications.add(self, outcome, exchange.sent_at, now)
        return []
