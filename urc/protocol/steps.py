"""Sequences at work: ordered steps on the lines of one engine.

Floor 3, pure. Each step becomes a function when the engine is built; a `Runner` calls them one
after the other until one must wait: for an answer, a frame, a prompt, a condition, or time. Whoever
owns the engine's verbs settles what comes of it and calls `advance` again. Every loop has a number
of rounds and every wait an end, so every sequence has one.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple, Protocol

from urc.expressions import Template
from urc.protocol.answer import Ear, Offer
from urc.protocol.bounds import queue_limit_s
from urc.protocol.exchange import DONE, Exchange, LineEvent, Outcome
from urc.protocol.known import Known
from urc.protocol.line import Line
from urc.protocol.readings import Readings
from urc.protocol.reins import PAUSE_S, Reins

__all__ = ["Action", "Host", "Program", "Runner", "Sink", "Unless"]

Sink = Callable[[Outcome, float], list[LineEvent]]
"""Takes the outcome and the time; returns what to tell."""
Unless = Callable[[], str]
"""Returns why what was asked for is not wanted any more, or ""."""


class Host(Protocol):
    """What a sequence needs of its engine."""

    lines: Mapping[str, Line]
    known: Known
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
    ) -> list[LineEvent]:
        """Run a command or sequence; its outcome goes to `sink`."""


Action = Callable[["Runner", float], list[LineEvent]]
"""One step, compiled."""


class Program(NamedTuple):
    """A sequence, compiled."""

    label: str
    actions: tuple[Action, ...]
    transports: frozenset[str]
    """Lines that it talks on by itself."""
    reins: Reins
    """Where it stands, and what people want of it; one run at a time holds them."""


class Runner:
    """One sequence at work."""

    def __init__(
        self,
        host: Host,
        program: Program,
        sink: Sink,
        privileged_on: str = "",
        confirmed_by: tuple[str, ...] = (),
        ends_at: float | None = None,
    ) -> None:
        """Prepare to run.

        Args:
            host: the engine.
            program: what to do.
            sink: takes the outcome, once.
            privileged_on: line whose connection this sequence makes usable or ends; "" for none.
            confirmed_by: people who said yes to it, and so to all that it runs.
            ends_at: when all of it ends, done or not; None: when its last step does.
        """
        self.host = host
        self.program = program
        self.privileged_on = privileged_on
        self.confirmed_by = confirmed_by
        self.variables: dict[str, object] = {}
        """What the robot said, by ``_field``."""
        self.due: float | None = None
        """When the present wait ends."""
        self.ends_at = ends_at
        self.is_waiting = False
        self._sink: Sink | None = sink
        self._outcome: Outcome | None = None
        self._stack: list[Iterator[Action]] = [iter(program.actions)]
        self._listening: tuple[Line, Ear] | None = None
        self._awaited: Template | None = None
        self._began_at = 0.0
        self._otherwise: tuple[Action, ...] | None = None
        self._late_text = ""
        self._logins: list[Line] = []
        """Lines whose logins it waits for before its first step."""
        program.reins.begin()

    @property
    def is_over(self) -> bool:
        """Whether its outcome has been told."""
        return self._sink is None

    @property
    def can_go_on(self) -> bool:
        """Whether `advance` has something to do."""
        if self._logins and all(line.is_ready for line in self._logins):
            return not self.is_over
        return not self.is_over and (self._outcome is not None or not self.is_waiting)

    @property
    def deadline(self) -> float | None:
        """When `expire` must be called."""
        if self.due is None or self.ends_at is None:
            return self.ends_at if self.due is None else self.due
        return min(self.due, self.ends_at)

    def advance(self, now: float) -> list[LineEvent]:
        """Do steps until one must wait or all are done."""
        events: list[LineEvent] = []
        if self._logins and all(line.is_ready for line in self._logins):
            self._logins = []
            self._resume()
        self._obey()
        while self._outcome is None and not self.is_waiting:
            is_outermost = len(self._stack) == 1
            if self.program.reins.halts(is_outermost=is_outermost):
                self.sleep(now + PAUSE_S)
                break
            action = next(self._stack[-1], None) if self._stack else None
            if action is not None:
                if is_outermost:
                    self.program.reins.step()
                events += action(self, now)
            elif self._stack:
                self._stack.pop()
            else:
                self._outcome = DONE
        if self._outcome is not None and self._sink is not None:
            sink, self._sink = self._sink, None
            self.program.reins.end(self._outcome.message if self._outcome.code else "")
            events += sink(self._outcome, now)
        return events

    def wait_for_logins(self, now: float) -> None:
        """Do no step before the connections that are open are usable; a command waits as long."""
        lines = (self.host.lines[name] for name in self.program.transports)
        self._logins = [
            line
            for line in lines
            if line.is_open
            and not (line.is_ready or line.is_per_request or line.spec.name == self.privileged_on)
        ]
        if self._logins:
            limit_s = max(queue_limit_s(line.spec, None) for line in self._logins)
            self._late_text = "the steps of the connection were not done in time"
            self.sleep(now + limit_s)

    def _obey(self) -> None:
        """Do what people want of it."""
        reins = self.program.reins
        if reins.is_aborted:
            self.stop("aborted", "somebody ended it")
        elif reins.goes_on():
            self._resume()

    def expire(self, now: float) -> None:
        """Take note that the wait has ended by itself."""
        if self.ends_at is not None and self.ends_at <= now:
            self.stop("timed-out", "it took too long")
            return
        if self.program.reins.is_paused:
            self.stop("timed-out", f"it was paused for {PAUSE_S:g} s")
            return
        if self._logins:
            self.stop("timed-out", self._late_text)
            return
        if self._listening is None and self._awaited is None:
            self._resume()
            return
        inbox = self._listening[0].inbox if self._listening else None
        came = "" if inbox is None else inbox.came_since(self._began_at, "not what it expects")
        self._stop_listening()
        if self._otherwise is None:
            self.stop("timed-out", self._late_text + came)
            return
        self._stack.append(iter(self._otherwise))
        self._resume()

    def stop(self, code: str, reason: str) -> None:
        """End without success."""
        self._stop_listening()
        if self._outcome is None:
            self._outcome = Outcome(code, reason)

    def why_over(self) -> str:
        """Return why nothing more of it is to be sent, or ""."""
        return self._outcome.message if self._outcome is not None else ""

    # -- told by the engine

    def look(self, now: float) -> None:
        """Take note of what has come true: something was read, or the wait has just begun."""
        if self._awaited is not None and self.host.known.holds(self._awaited, now, self.variables):
            self._awaited = None
            self._resume()

    def ended(self, exchange: Exchange, outcome: Outcome, now: float) -> list[LineEvent]:
        """Take note that what a step sent is sent, or cannot be."""
        return self.done(outcome, now)

    def done(self, outcome: Outcome, now: float) -> list[LineEvent]:
        """Take note of the outcome of what a step has begun."""
        if outcome.code:
            self.stop(outcome.code, outcome.message)
        self.variables |= {f"_{name}": value for name, value in outcome.values.items()}
        self._resume()
        return []

    def heard(self, ear: Ear, offer: Offer, now: float) -> None:
        """Take what was waited for."""
        self._listening = None
        if offer.refusal:
            self.stop("refused", offer.refusal)
            return
        fields = offer.fields or {}
        self.variables |= {name: raw for name, raw in fields.items() if name.startswith("_")}
        self._resume()

    # -- for actions

    def names(self, now: float) -> Mapping[str, object]:
        """Return the namespace of its expressions."""
        return self.host.known.view(now, self.variables)

    def push(self, actions: Iterator[Action]) -> None:
        """Do these next."""
        self._stack.append(actions)

    def sleep(self, due: float) -> None:
        """Wait until `due`."""
        self.is_waiting, self.due = True, due

    def begin(self) -> None:
        """Wait until `done` is called."""
        self.is_waiting = True

    def listen(
        self,
        line: Line,
        ear: Ear,
        now: float,
        due: float,
        otherwise: tuple[Action, ...] | None,
        text: str,
    ) -> None:
        """Wait from `now` until `due` for what `ear` hears."""
        self._listening = (line, ear)
        self._began_at = now
        self._otherwise, self._late_text = otherwise, text
        self.sleep(due)

    def wait_for(
        self, condition: Template, due: float, otherwise: tuple[Action, ...] | None, text: str
    ) -> None:
        """Wait until `condition` is true."""
        self._awaited = condition
        self._otherwise, self._late_text = otherwise, text
        self.sleep(due)

    def _resume(self) -> None:
        self.is_waiting, self.due = False, None

    def _stop_listening(self) -> None:
        self._awaited = None
        if self._listening is not None:
            line, ear = self._listening
            line.inbox.unlisten(ear)
            self._listening = None
