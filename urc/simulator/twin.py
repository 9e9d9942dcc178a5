"""The emulated robot: frames in, bytes out, by the rules a profile carries about itself.

What no rule takes is answered by the driver's own declarations (`urc.simulator.auto`).

Pure: no socket, no clock. The framing is the driver's own, turned round, so what it says is cut and
joined exactly as the real robot would. Each client has a line of its own; what the robot knows of
itself is the same for all of them.
"""

import logging
import weakref
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from urc.model.codec import Payload, traffic_of
from urc.model.driver import TransportSpec
from urc.model.profile import Profile, SimulatorRule
from urc.model.values import NOTHING, Value
from urc.protocol.forms import BadText, Frame
from urc.protocol.framing import FrameFault, Framing, build_framing
from urc.simulator.auto import AutoLine, AutoMessage, AutoRobot, Unanswered
from urc.simulator.rules import Course, Ruled, Rules
from urc.simulator.values import Values

__all__ = ["Twin", "TwinLine"]

MOST_COURSES: Final = 256
"""Answers of one line that may wait for their time."""

log = logging.getLogger(__name__)
"""Told of every fault, as ``(transport, text)``."""


class Twin:
    """One emulated robot; `line` makes its side of a connection."""

    def __init__(self, profile: Profile, settings: Mapping[str, Value]) -> None:
        """Prepare the rules of `profile`, whose templates see `settings`."""
        self._transports = profile.driver.transports
        self._rules = profile.simulator
        self._values = Values(profile.driver, settings, profile.emulated)
        self._robot = AutoRobot(profile.driver, settings, self._values)
        self._setters = _Setters()
        self._framings = {
            name: build_framing(spec.framing).reversed() for name, spec in self._transports.items()
        }

    def line(self, transport: str) -> "TwinLine":
        """Return the robot's side of a new connection on `transport`."""
        rules = tuple(rule for rule in self._rules if rule.transport == transport)
        spec, framing = self._transports[transport], self._framings[transport]
        auto = self._robot.line(transport, framing, talks=not any(map(_speaks, rules)))
        ruled = Rules(rules, spec, framing, auto, self._values)
        return TwinLine(spec, framing, ruled, auto, self._setters)


def _speaks(rule: SimulatorRule) -> bool:
    """Return whether a rule says that the robot speaks otherwise than the driver declares."""
    if rule.request:
        return False
    says = any(one.send or one.message for one in rule.reactions)
    return says or not any(one.sets or one.answers for one in rule.reactions)


class _Setters:
    """Which line lets time change the robot: one of its clients, however many there are."""

    def __init__(self) -> None:
        self._lines: dict[int, weakref.ref[TwinLine]] = {}

    def sets(self, rule: SimulatorRule, line: "TwinLine") -> bool:
        """Return whether `line` is the one that does what `rule` sets; the first to ask is."""
        known = self._lines.get(id(rule))
        before = known() if known is not None else None
        if before is None or before.is_over:
            self._lines[id(rule)] = weakref.ref(line)
            return True
        return before is line


@dataclass(slots=True)
class _Periodic:
    what: Ruled | AutoMessage
    every_s: float
    left_s: float
    """Seconds until it is due."""


class TwinLine:
    """The robot's side of one connection."""

    def __init__(
        self,
        spec: TransportSpec,
        framing: Framing,
        rules: Rules,
        auto: AutoLine,
        setters: _Setters,
    ) -> None:
        """Made by `Twin.line`."""
        self._name = spec.name
        self._auto = auto
        self._is_greeted = not auto.opening
        self._encoding = spec.encoding
        self._decoder = framing.decoder()
        self._rules = rules
        self._setters = setters
        self._courses: list[Course] = []
        self._periodic = [
            _Periodic(rule, rule.what.every_s, rule.what.every_s)
            for rule in rules.periodic
            if rule.what.every_s is not None
        ]
        self._periodic += [_Periodic(one, one.every_s, one.every_s) for one in auto.messages]
        self._now_s = 0.0
        self.is_over = False
        """The robot ends the connection, once all that it said is taken."""
        self.faults = 0
        """Frames that were none, that no rule took, or whose answer could not be made."""
        self.last_fault = ""
        """One line about the newest of them."""

    @property
    def due_in_s(self) -> float | None:
        """Seconds until `step` has something to say; None when it never has."""
        if not self._is_greeted:
            return 0.0
        left = [one.left_s for one in self._periodic]
        left += [one.left_s for one in self._courses]
        silence = self._decoder.deadline
        if silence is not None:
            left.append(silence - self._now_s)
        return max(0.0, min(left)) if left else None

    def receive(self, data: Payload, now_s: float, limit: int | None = None) -> list[Payload]:
        """Take what the client says and return the answers, each a whole frame.

        Args:
            data: any piece of the stream, or an envelope on a line that carries messages.
            now_s: seconds since the epoch, the templates' ``now``.
            limit: most answers to give; what the client sent beyond them is dropped. None: all.
        """
        answers: list[Payload] = []
        self._now_s = now_s
        if not isinstance(data, bytes):
            return [] if self.is_over else self._answer(data, now_s)
        for frame in self._decoder.feed(data, now_s):
            if self.is_over or (limit is not None and len(answers) >= limit):
                break
            if isinstance(frame, FrameFault):
                self._fault(frame.message)
            else:
                answers += self._answer(frame, now_s)
        return answers

    def step(self, dt_s: float, now_s: float) -> list[Payload]:
        """Let `dt_s` seconds pass and return what the robot says by itself.

        A rule that was due several times speaks once: a pause is not made up for.
        """
        said: list[Payload] = []
        self._now_s = now_s
        for frame in self._decoder.tick(now_s):
            if not isinstance(frame, FrameFault):
                said += self._answer(frame, now_s)
        if not self._is_greeted:
            self._is_greeted = True
            said += self._made(lambda: [*self._auto.greet(now_s)]) or []
        for course in tuple(self._courses):
            course.left_s -= dt_s
            if course.left_s <= 0 and not self.is_over:
                self._courses.remove(course)
                said += self._go_on(course, now_s)
        for periodic in self._periodic:
            periodic.left_s -= dt_s
            if periodic.left_s <= 0 and not self.is_over:
                periodic.left_s = periodic.every_s - (-periodic.left_s) % periodic.every_s
                said += self._by_itself(periodic.what, now_s)
        return said

    def _by_itself(self, what: Ruled | AutoMessage, now_s: float) -> list[Payload]:
        if isinstance(what, AutoMessage):
            answer = what.answer
            return self._made(lambda: [*self._auto.say(answer, now_s)]) or []
        rule = what.what

        def go() -> list[Payload]:
            if not self._rules.holds(rule.when, now_s):
                return []
            sets = self._setters.sets(rule, self)
            return self._go_on(Course(what.deeds, NOTHING, sets=sets), now_s)

        return self._made(go) or []

    def _answer(self, frame: Payload, now_s: float) -> list[Payload]:
        asked = Frame(frame, self._encoding)

        def answer() -> list[Payload] | None:
            course = self._rules.find(asked, now_s)
            if course is not None:
                return self._go_on(course, now_s)
            return self._auto.answer(asked, now_s)

        said = self._made(answer)
        if said is None:
            self._fault(_not_taken(asked))
        return said or []

    def _go_on(self, course: Course, now_s: float) -> list[Payload]:
        """Do what is due of a course, and keep the rest for later."""
        said: list[Payload] = []
        while course.deeds and not self.is_over:
            deed = course.deeds[0]
            if deed.what.after_s > 0 and not course.has_waited:
                self._keep(course, deed.what.after_s)
                break
            course.has_waited = False
            course.deeds = course.deeds[1:]
            said += self._made(lambda deed=deed: self._rules.do(deed, course, now_s)) or []  # type: ignore[misc]  # of this turn
            self.is_over |= deed.what.closes
        return said

    def _keep(self, course: Course, left_s: float) -> None:
        if len(self._courses) >= MOST_COURSES:
            self._fault(f"{MOST_COURSES} answers wait for their time already; this one is dropped")
            return
        course.left_s, course.has_waited = left_s, True
        self._courses.append(course)

    def _made(self, make: Callable[[], list[Payload] | None]) -> list[Payload] | None:
        """Return what `make` returns; what it cannot answer is counted and told."""
        try:
            return make()
        except Unanswered as problem:
            self._fault(str(problem))
            return []

    def _fault(self, text: str) -> None:
        self.faults += 1
        self.last_fault = text
        log.info("%s: %s", self._name, text)


def _not_taken(frame: Frame) -> str:
    if not isinstance(frame.payload, bytes):
        shown = traffic_of(frame.payload).decode("utf-8", "replace")[:60]
        return f"no rule takes {shown!r}, and the driver never sends it"
    try:
        shown = repr(frame.text[:60])
    except BadText:
        return f"a frame is not {frame.encoding} text"
    return f"no rule takes {shown}, and the driver never sends it"
