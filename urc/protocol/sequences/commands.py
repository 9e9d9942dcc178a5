"""Conditions for commands: requirements, confirmations, and verification after the reply. Pure."""

from collections.abc import Mapping
from functools import partial
from typing import Final, NamedTuple

from urc.expressions import ExpressionError
from urc.model.driver import STOPPED, Command
from urc.model.exchange import Confirm, Verify
from urc.model.values import Reading
from urc.protocol.requests.condition_scope import SignalState
from urc.protocol.requests.exchange import (
    CompiledRequest,
    Exchange,
    ExchangeOutcome,
    LineEvent,
    ReplySink,
    expires_at,
)
from urc.protocol.sequences.sequence_runner import Sink

__all__ = [
    "VerifiedRun",
    "UnverifiedRun",
    "Verifications",
    "exchange_of",
    "is_guarded",
    "questions",
    "why_not_allowed",
    "why_refused",
]

_MOST: Final = 256
"""Maximum number of commands waiting for verification."""
_BOTH: Final = 2
"""Number of people who must confirm a command under the two-person rule."""


def why_not_allowed(
    command: Command,
    known: SignalState,
    values: Mapping[str, object],
    now: float,
    *,
    stops: int | None = None,
) -> str:
    """Return the text of the first unmet requirement of a command; "" if all are met.

    Args:
        command: the declared command.
        known: state of the robot, used in conditions.
        values: checked arguments, keyed by name.
        now: current time, in seconds.
        stops: number of stops when the command was requested; None for a new request.
    """
    is_of_before = stops is not None and stops != known.stops
    if (known.latched or is_of_before) and command.moves_with(values):
        return known.latched or STOPPED
    for one in command.requires:
        try:
            if not one.condition.evaluate(known.view(now, values)):
                return one.text
        except ExpressionError as error:
            return f"{one.text} ({error})"
    return ""


def questions(command: Command, values: Mapping[str, object]) -> tuple[Confirm, ...]:
    """Return the confirmation questions for `command` with these arguments.

    Args:
        command: the declared command.
        values: arguments, including defaults, keyed by name; each element of an array may
            require its own confirmation.
    """
    asked = [] if command.confirm is None else [command.confirm]
    for name, argument in command.arguments.items():
        if argument.confirm:
            value = values.get(name, argument.default)
            elements = value if isinstance(value, (list, tuple)) else (value,)
            asked += [
                one for one in map(argument.confirm.get, map(_written, elements)) if one is not None
            ]
    return tuple(dict.fromkeys(asked))


def is_guarded(command: Command) -> bool:
    """Return whether `why_refused` may refuse the command."""
    asked = [one for argument in command.arguments.values() for one in argument.confirm.values()]
    asked += [] if command.confirm is None else [command.confirm]
    return command.moves or bool(command.requires) or any(one.is_two_person for one in asked)


def why_refused(
    command: Command,
    known: SignalState,
    values: Mapping[str, object],
    confirmed_by: tuple[str, ...],
    now: float,
) -> ExchangeOutcome | None:
    """Return the failure for an unmet requirement or missing confirmation, or None."""
    why_not = why_not_allowed(command, known, values, now)
    if why_not:
        return ExchangeOutcome("not-allowed", why_not)
    people = set(confirmed_by) - {""}
    asked = next((one for one in questions(command, values) if one.is_two_person), None)
    if asked is None or len(people) >= _BOTH:
        return None
    text = f"{asked.text}: two people must confirm {command.name}, but only {len(people)} did"
    return ExchangeOutcome("not-confirmed", text)


def exchange_of(
    command: Command,
    ask: CompiledRequest,
    values: Mapping[str, Reading],
    sink: Sink,
    now: float,
    known: SignalState,
    verifications: "Verifications",
) -> Exchange:
    """Return an exchange that runs a command, for the transport's queue.

    Args:
        command: the command, which must not be a sequence.
        ask: compiled request of the command.
        values: checked arguments, keyed by name.
        sink: function that receives the outcome.
        now: current time, in seconds.
        known: state of the robot, used in conditions.
        verifications: the commands that wait for verification; this command is added if it needs
            verification.

    Raises:
        BadArgument: the frame cannot be encoded with these arguments.
    """
    names = values if ask.is_local else {**known.names, **values}
    exchange = Exchange(
        ask,
        (sink if type(sink) is ReplySink else UnverifiedRun(sink))
        if command.verify is None
        else VerifiedRun(command.verify, values, sink, verifications),
        names,
        ask.render(names),
        expires_at(ask, now),
    )
    if isinstance(sink, ReplySink):
        exchange.on_sent = sink.on_sent
    if command.requires or command.moves:
        exchange.condition = partial(why_not_allowed, command, known, values, stops=known.stops)
    return exchange


def _written(value: object) -> str:
    """Return an argument value as text, in the form that it has as a key of a document."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:g}" if isinstance(value, float) else str(value)


class _PendingVerification(NamedTuple):
    run: "VerifiedRun"
    since: float
    due: float
    outcome: ExchangeOutcome


class Verifications:
    """Commands that have received their reply and are waiting for verification."""

    def __init__(self, known: SignalState) -> None:
        self._known = known
        self._waiting: list[_PendingVerification] = []
        self.has_news = False
        """Whether new samples have arrived, so that the waiting commands must be checked again."""

    @property
    def is_waiting(self) -> bool:
        """Whether any command is waiting for verification."""
        return bool(self._waiting)

    @property
    def is_full(self) -> bool:
        """Whether the number of waiting commands has reached the maximum."""
        return len(self._waiting) >= _MOST

    @property
    def deadline(self) -> float | None:
        """Time of the first verification timeout; None if no command is waiting."""
        return min((one.due for one in self._waiting), default=None)

    def add(self, run: "VerifiedRun", outcome: ExchangeOutcome, since: float, now: float) -> None:
        """Add a run to verify with samples received after `since`, the time of sending."""
        if run.verify is not None:
            due = now + run.verify.within_s
            self._waiting.append(_PendingVerification(run, since, due, outcome))
            self.has_news = True

    def check(self, now: float) -> list[LineEvent]:
        """Return the events for all newly verified commands."""
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
        """Return the events for verified commands and verification timeouts."""
        events = self.check(now)
        for one in tuple(self._waiting):
            if one.due <= now and one.run.verify is not None:
                self._waiting.remove(one)
                source, within_s = one.run.verify.condition.source, one.run.verify.within_s
                text = f"{source!r} did not become true within {within_s:g} s"
                events += one.run.sink(ExchangeOutcome("not-verified", text), now)
        return events


class UnverifiedRun:
    """The owner of a command's request, for a command that needs no verification."""

    __slots__ = ("_sink",)

    def __init__(self, sink: Sink) -> None:
        """Initialise the run with a `sink` for the outcome."""
        self._sink = sink

    def ended(self, exchange: Exchange, outcome: ExchangeOutcome, now: float) -> list[LineEvent]:
        """Report the outcome."""
        return self._sink(outcome, now)


class VerifiedRun:
    """The execution of a command with verification."""

    __slots__ = ("_verifications", "sink", "values", "verify")

    def __init__(
        self,
        verify: Verify | None,
        values: Mapping[str, Reading],
        sink: Sink,
        verifications: Verifications,
    ) -> None:
        """Initialise the run with a `sink` for the outcome after reply and verification."""
        self.verify = verify
        self.values = values
        self.sink = sink
        self._verifications = verifications

    def ended(self, exchange: Exchange, outcome: ExchangeOutcome, now: float) -> list[LineEvent]:
        """Report a failure immediately; otherwise, wait for the verification."""
        if outcome.code or self.verify is None:
            return self.sink(outcome, now)
        self._verifications.add(self, outcome, exchange.sent_at, now)
        return []
