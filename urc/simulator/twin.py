"""The emulated robot: frames in, bytes out, by the rules a profile carries about itself.

What no rule takes is answered by the driver's own declarations (`urc.simulator.auto`).

Pure: no socket, no clock. The framing is the driver's own, turned round, so what it says is cut and
joined exactly as the real robot would. Each client has a line of its own; what the robot knows of
itself is the same for all of them.
"""

import logging
import math
import weakref
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

from urc.model.codec import Payload
from urc.model.driver import Driver, TransportSpec
from urc.model.profile import Profile, SimulatorRule
from urc.model.values import NOTHING, Reading, Value
from urc.protocol.codec import Frame
from urc.protocol.framing import build_framing
from urc.protocol.framings.base import FrameFault, Framing
from urc.protocol.topics import topic_of
from urc.simulator.auto import AutoLine, AutoMessage, AutoRobot, Unanswered
from urc.simulator.embodied import Embodied
from urc.simulator.faults import Late, parse_fault
from urc.simulator.flaws import inject, mend
from urc.simulator.rules import Course, Ruled, Rules, not_taken
from urc.simulator.values import Values

__all__ = ["Twin", "TwinLine"]


class _Line(Protocol):
    is_over: bool


class Setters:
    """Rule → the line that does what it sets, while that line is there."""

    def __init__(self) -> None:
        """Begin without any line."""
        self._lines: dict[int, weakref.ref[_Line]] = {}

    def sets(self, rule: SimulatorRule, line: _Line) -> bool:
        """Return whether `line` is the one that does what `rule` sets; the first to ask is."""
        known = self._lines.get(id(rule))
        before = known() if known is not None else None
        if before is None or before.is_over:
            self._lines[id(rule)] = weakref.ref(line)
            return True
        return before is line


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
        self._values = Values(profile.driver, settings, profile.emulated, profile.world)
        self._pictures = _pictures(profile.driver, settings, self._values.senses)
        self._robot = AutoRobot(profile.driver, settings, self._values)
        self._setters = Setters()
        self._framings = {
            name: build_framing(spec.framing).reversed() for name, spec in self._transports.items()
        }

    def line(self, transport: str) -> "TwinLine":
        """Return the robot's side of a new connection on `transport`."""
        rules = tuple(rule for rule in self._rules if rule.transport == transport)
        spec, framing = self._transports[transport], self._framings[transport]
        auto = self._robot.line(transport, framing, talks=not any(map(_speaks, rules)))
        ruled = Rules(rules, spec, framing, auto, self._values)
        return TwinLine(spec, framing, ruled, auto, self._setters, self._values)

    def picture(self, transport: str, topics: Iterable[str], now_s: float) -> bytes | None:
        """Return the picture of the robot's world that is listened to by one of `topics`, or None.

        It is b"" while it has dropped out.

        Args:
            transport: on which it is listened to.
            topics: names under which it may be known there.
            now_s: seconds since the epoch.
        """
        body = self._values.body
        for topic in topics:
            name = self._pictures.get((transport, topic))
            if name is not None and body is not None:
                faults = self._values.faults
                return (
                    b"" if faults.is_silent or faults.drops((name,)) else body.picture(name, now_s)
                )
        return None

    @property
    def body(self) -> Embodied | None:
        """What moves in its world; None where it has none."""
        return self._values.body

    def prepare(self) -> None:
        """Load what looking at the world needs, so that the first look does not wait; may block."""
        if self._values.body is not None:
            self._values.body.prepare()

    @property
    def faults(self) -> tuple[str, ...]:
        """What is wrong on demand, as it was written."""
        return tuple(one.text for one in self._values.faults.active.values())

    def inject(self, text: str, now_s: float) -> None:
        """Let something go wrong from now on, written like one of `FAULTS`.

        Args:
            text: such as ``loss=5%``.
            now_s: seconds since the epoch.

        Raises:
            UrcError: there is no such fault, or not with this robot; one line.
        """
        inject(parse_fault(text), self._values, now_s)

    def mend(self) -> None:
        """Let nothing be wrong any more; a battery that is nearly empty stays so."""
        mend(self._values)

    def camera(self, now_s: float) -> bytes | None:
        """Return what the robot's camera sees, as JPEG; None where it tells no picture of a world.

        Args:
            now_s: seconds since the epoch.
        """
        body = self._values.body
        name = next(iter(self._pictures.values()), None)
        return None if body is None or name is None else body.picture(name, now_s)

    def top_view(self, width: int, height: int, now_s: float) -> bytes | None:
        """Return the robot in its world from above, as JPEG; None where it has no world.

        Args:
            width: points, 16 to 2000.
            height: points, 16 to 2000.
            now_s: seconds since the epoch.
        """
        body = self._values.body
        if body is None:
            return None
        body.world.advance(now_s)
        return body.world.top_view(width, height)

    def readings(self, now_s: float) -> Mapping[str, Reading]:
        """Return what the robot's signals are, for who looks at it without a line.

        Args:
            now_s: seconds since the epoch.
        """
        return {name: self._values.of(name, now_s) for name in self._values.driver.signals}


def _pictures(
    driver: Driver, settings: Mapping[str, Value], senses: Iterable[str]
) -> Mapping[tuple[str, str], str]:
    """Return transport and topic → signal, for pictures that the world gives."""
    return {
        (message.transport, topic_of(message.read, settings)): name
        for message in driver.messages.values()
        for name in message.read.fields
        if message.read.topic is not None
        and name in senses
        and driver.signals[name].type == "image"
    }


def _speaks(rule: SimulatorRule) -> bool:
    """Return whether a rule says that the robot speaks otherwise than the driver declares."""
    if rule.request:
        return False
    says = any(one.send or one.message for one in rule.reactions)
    return says or not any(one.sets or one.answers for one in rule.reactions)


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
        setters: Setters,
        values: Values,
    ) -> None:
        """Made by `Twin.line`."""
        self._body = values.body
        self._flaws = values.faults
        self._late = Late()
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
        if self.has_late:
            left.append(self._late.due_s - self._now_s)
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
        return self._flawed(self._heard(data, now_s, limit, self._answer_or_lose), now_s)

    def ask(self, data: Payload, now_s: float) -> list[Payload]:
        """Return the replies at once, for servers that reply to each message separately."""
        return self._heard(data, now_s, None, self._answer)

    def _heard(
        self,
        data: Payload,
        now_s: float,
        limit: int | None,
        answer: Callable[[Payload, float], list[Payload]],
    ) -> list[Payload]:
        answers: list[Payload] = []
        self._pass(now_s)
        if not isinstance(data, bytes):
            return [] if self.is_over else answer(data, now_s)
        for frame in self._decoder.feed(data, now_s):
            if self.is_over or (limit is not None and len(answers) >= limit):
                break
            if isinstance(frame, FrameFault):
                self._fault(frame.message)
            else:
                answers += answer(frame, now_s)
        return answers

    def step(self, dt_s: float, now_s: float) -> list[Payload]:
        """Let `dt_s` seconds pass and return what the robot says by itself.

        A rule that was due several times speaks once: a pause is not made up for.
        """
        said = self._flawed(self._due(dt_s, now_s), now_s)
        return self._late.take(now_s) + said if self.has_late else said

    def _flawed(self, said: list[Payload], now_s: float) -> list[Payload]:
        """Return what can be said at once of what the robot says; the rest is late, or lost."""
        if not self._flaws.active:
            return said
        said = self._flaws.said(said)
        delay_s = self._flaws.delay_s
        if not delay_s:
            return said
        self._late.put(said, now_s + delay_s)
        return []

    @property
    def has_late(self) -> bool:
        """Whether something waits that should have been said before."""
        return self._late.due_s < math.inf

    @property
    def loses(self) -> bool:
        """Whether the next answer is lost, or nothing is said at all."""
        return self._flaws.is_silent or self._flaws.loses()

    @property
    def delay_s(self) -> float:
        """How late everything is said on demand."""
        return self._flaws.delay_s

    @property
    def is_incomplete(self) -> bool:
        """Whether some signal has dropped out on demand."""
        return bool(self._flaws.dropped)

    def _due(self, dt_s: float, now_s: float) -> list[Payload]:
        said: list[Payload] = []
        self._pass(now_s)
        for frame in self._decoder.tick(now_s):
            if not isinstance(frame, FrameFault):
                said += self._answer_or_lose(frame, now_s)
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

    def _pass(self, now_s: float) -> None:
        """Let the world go on to the present before anything changes in it."""
        self._now_s = now_s
        if self._body is not None:
            self._body.world.advance(now_s)

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

    def _answer_or_lose(self, frame: Payload, now_s: float) -> list[Payload]:
        return [] if self._flaws.loses() else self._answer(frame, now_s)

    def _answer(self, frame: Payload, now_s: float) -> list[Payload]:
        asked = Frame(frame, self._encoding)
        if self._body is not None and self._body.failsafe is not None:
            self._body.hear(self._auto.labels(asked), now_s)

        def answer() -> list[Payload] | None:
            course = self._rules.find(asked, now_s)
            if course is not None:
                return self._go_on(course, now_s)
            return self._auto.answer(asked, now_s)

        said = self._made(answer)
        if said is None:
            self._fault(not_taken(asked))
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
