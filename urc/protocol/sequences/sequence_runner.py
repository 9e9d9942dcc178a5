"""Execution of sequences: ordered steps on the connections of one engine.

Pure. Each step becomes a function when the engine is built. A `SequenceRunner` calls the functions
in order, until a step must wait. Steps may wait for a reply, a frame, a prompt, a condition or a
delay. The engine processes the returned events and calls `advance` again. Every loop has a limit
and every wait has a timeout, so every sequence ends.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple, Protocol

from urc.expressions import Template
from urc.protocol.readings.readings import Readings
from urc.protocol.requests.bounds import queue_limit_s
from urc.protocol.requests.condition_scope import SignalState
from urc.protocol.requests.conversation import Conversation
from urc.protocol.requests.exchange import DONE, Exchange, ExchangeOutcome, LineEvent
from urc.protocol.requests.goal_watch import OnGoal
from urc.protocol.requests.reply_match import Expectation, MatchResult
from urc.protocol.sequences.sequence_control import PAUSE_S, SequenceControl

__all__ = ["Action", "SequenceHost", "CompiledSequence", "SequenceRunner", "Sink", "Unless"]

Sink = Callable[[ExchangeOutcome, float], list[LineEvent]]
"""Function that receives an outcome and the time, and returns the resulting events."""
Unless = Callable[[], str]
"""Function that returns why a request is obsolete, or "" if the request is still valid."""


class SequenceHost(Protocol):
    """The interface of the engine that sequences use."""

    lines: Mapping[str, Conversation]
    known: SignalState
    readings: Readings

    def run(
        self,
        command: str,
        arguments: Mapping[str, object],
        sink: Sink,
        now: float,
        *,
        privileged_on: str,
        confirmed_by: tuple[str, ...],
        unless: Unless,
        on_goal: OnGoal | None,
    ) -> list[LineEvent]:
        """Run a command or sequence and report the outcome to `sink`."""

    def may_send_goal(self, command: str) -> bool:
        """Return whether a command sends a goal of a ROS action, or is a sequence, which may."""


Action = Callable[["SequenceRunner", float], list[LineEvent]]
"""A compiled step."""


class CompiledSequence(NamedTuple):
    """A compiled sequence."""

    label: str
    actions: tuple[Action, ...]
    transports: frozenset[str]
    """Names of the transports that the sequence uses."""
    sequence_control: SequenceControl
    """Control state of the sequence, for at most one run at a time."""


class SequenceRunner:
    """The execution of a sequence."""

    def __init__(
        self,
        host: SequenceHost,
        program: CompiledSequence,
        sink: Sink,
        privileged_on: str = "",
        confirmed_by: tuple[str, ...] = (),
        ends_at: float | None = None,
    ) -> None:
        """Initialise a run.

        Args:
            host: the engine.
            program: the compiled sequence.
            sink: function that receives the outcome, exactly once.
            privileged_on: name of the transport of a login or close sequence; "" for other
                sequences.
            confirmed_by: names of the people who have confirmed the sequence and its commands.
            ends_at: deadline of the whole run, in seconds; None means no deadline.
        """
        self.host = host
        self.program = program
        self.privileged_on = privileged_on
        self.confirmed_by = confirmed_by
        self.variables: dict[str, object] = {}
        """Values of private fields and of replies, keyed by ``_name``."""
        self.due: float | None = None
        """End time of the current wait, in seconds; None means no time limit."""
        self.ends_at = ends_at
        self.is_waiting = False
        self._sink: Sink | None = sink
        self._outcome: ExchangeOutcome | None = None
        self._stack: list[Iterator[Action]] = [iter(program.actions)]
        self._listening: tuple[Conversation, Expectation] | None = None
        self._awaited: Template | None = None
        self._began_at = 0.0
        self._otherwise: tuple[Action, ...] | None = None
        self._late_text = ""
        self._logins: list[Conversation] = []
        """Connections that must complete their logins before the first step."""
        self.unless: Unless | None = None
        """Function that returns why the sequence may start no goal now, or ""."""
        self.on_goal: OnGoal | None = None
        """Callback for the goals of the sequence, and of the commands and sequences that it
        runs."""
        program.sequence_control.start()

    @property
    def is_over(self) -> bool:
        """Whether the outcome has been reported."""
        return self._sink is None

    @property
    def can_go_on(self) -> bool:
        """Whether the run no longer waits, so that `advance` can continue it."""
        if self._logins and all(line.is_ready for line in self._logins):
            return not self.is_over
        return not self.is_over and (self._outcome is not None or not self.is_waiting)

    @property
    def deadline(self) -> float | None:
        """Time at which to call `expire` next; None if there is no timeout."""
        if self.due is None or self.ends_at is None:
            return self.ends_at if self.due is None else self.due
        return min(self.due, self.ends_at)

    def advance(self, now: float) -> list[LineEvent]:
        """Run steps until a step must wait, or the sequence is complete."""
        events: list[LineEvent] = []
        if self._logins and all(line.is_ready for line in self._logins):
            self._logins = []
            self._resume()
        self._obey()
        while self._outcome is None and not self.is_waiting:
            is_outermost = len(self._stack) == 1
            if self.program.sequence_control.halts(is_outermost=is_outermost):
                self.sleep(now + PAUSE_S)
                break
            action = next(self._stack[-1], None) if self._stack else None
            if action is not None:
                if is_outermost:
                    self.program.sequence_control.begin_step()
                events += action(self, now)
            elif self._stack:
                self._stack.pop()
            else:
                self._outcome = DONE
        if self._outcome is not None and self._sink is not None:
            sink, self._sink = self._sink, None
            self.program.sequence_control.end(self._outcome.message if self._outcome.code else "")
            events += sink(self._outcome, now)
        return events

    def wait_for_logins(self, now: float) -> None:
        """Wait for the logins of all open connections, up to the time limit for queued commands."""
        lines = (self.host.lines[name] for name in self.program.transports)
        self._logins = [
            line
            for line in lines
            if line.is_open
            and not (line.is_ready or line.is_per_request or line.spec.name == self.privileged_on)
        ]
        if self._logins:
            limit_s = max(queue_limit_s(line.spec, None) for line in self._logins)
            self._late_text = "the login of the connection did not finish in time"
            self.sleep(now + limit_s)

    def _obey(self) -> None:
        """Apply the operator's control requests."""
        sequence_control = self.program.sequence_control
        if sequence_control.is_aborted:
            self.stop("aborted", "ended on request")
        elif sequence_control.goes_on():
            self._resume()

    def expire(self, now: float) -> None:
        """Process the timeout of the current wait."""
        if self.ends_at is not None and self.ends_at <= now:
            self.stop("timed-out", "the sequence took too long")
            return
        if self.program.sequence_control.is_paused:
            self.stop("timed-out", f"the sequence was paused for {PAUSE_S:g} s")
            return
        if self._logins:
            self.stop("timed-out", self._late_text)
            return
        if self._listening is None and self._awaited is None:
            self._resume()
            return
        receiver = self._listening[0].receiver if self._listening else None
        came = (
            ""
            if receiver is None
            else receiver.came_since(self._began_at, "not the expected frame")
        )
        self._stop_listening()
        if self._otherwise is None:
            self.stop("timed-out", self._late_text + came)
            return
        self._stack.append(iter(self._otherwise))
        self._resume()

    def stop(self, code: str, reason: str) -> None:
        """End the run with a failure."""
        self._stop_listening()
        if self._outcome is None:
            self._outcome = ExchangeOutcome(code, reason)

    def why_over(self) -> str:
        """Return why the run must not send further frames; "" if it may continue."""
        return self._outcome.message if self._outcome is not None else ""

    def why_no_goal(self) -> str:
        """Return why the run must not send a goal now; "" if it may."""
        return self.why_over() or (self.unless() if self.unless is not None else "")

    # -- called by the engine

    def check_conditions(self, now: float) -> None:
        """Check the awaited condition, after new samples or at the start of the wait."""
        if self._awaited is not None and self.host.known.holds(self._awaited, now, self.variables):
            self._awaited = None
            self._resume()

    def ended(self, exchange: Exchange, outcome: ExchangeOutcome, now: float) -> list[LineEvent]:
        """Record the outcome of a sent frame."""
        return self.done(outcome, now)

    def done(self, outcome: ExchangeOutcome, now: float) -> list[LineEvent]:
        """Record the outcome of a command run by a step."""
        if outcome.code:
            self.stop(outcome.code, outcome.message)
        self.variables |= {f"_{name}": value for name, value in outcome.values.items()}
        self._resume()
        return []

    def matched(self, expectation: Expectation, offer: MatchResult, now: float) -> None:
        """Process the match result for the expected frame."""
        self._listening = None
        if offer.refusal:
            self.stop("refused", offer.refusal)
            return
        fields = offer.fields or {}
        self.variables |= {name: raw for name, raw in fields.items() if name.startswith("_")}
        self._resume()

    # -- for the actions

    def names(self, now: float) -> Mapping[str, object]:
        """Return the namespace for the steps' expressions: signals, settings and variables."""
        return self.host.known.view(now, self.variables)

    def push(self, actions: Iterator[Action]) -> None:
        """Run `actions` next."""
        self._stack.append(actions)

    def sleep(self, due: float) -> None:
        """Wait until `due`."""
        self.is_waiting, self.due = True, due

    def wait(self) -> None:
        """Let the sequence wait until `done` is called."""
        self.is_waiting = True

    def listen(
        self,
        line: Conversation,
        expectation: Expectation,
        now: float,
        due: float,
        otherwise: tuple[Action, ...] | None,
        text: str,
    ) -> None:
        """Wait from `now` until `due` for a match of `expectation`."""
        self._listening = (line, expectation)
        self._began_at = now
        self._otherwise, self._late_text = otherwise, text
        self.sleep(due)

    def wait_for(
        self, condition: Template, due: float, otherwise: tuple[Action, ...] | None, text: str
    ) -> None:
        """Let the sequence wait until `condition` is true."""
        self._awaited = condition
        self._otherwise, self._late_text = otherwise, text
        self.sleep(due)

    def _resume(self) -> None:
        self.is_waiting, self.due = False, None

    def _stop_listening(self) -> None:
        self._awaited = None
        if self._listening is not None:
            line, expectation = self._listening
            line.receiver.unlisten(expectation)
            self._listening = None
