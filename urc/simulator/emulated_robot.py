"""An emulated robot, which answers received frames according to the profile's simulator rules.

If no rule matches a frame, the driver's declarations define the reply (`urc.simulator.auto`).

The module uses no sockets and no clock. Like the real robot, the emulated robot decodes with the
driver's framing of sent data and encodes with the framing of received data. Each client has a
separate connection, but all connections share the robot's state.
"""

import logging
import math
import weakref
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final, Protocol

from urc.expressions import ExpressionError, Template
from urc.model.driver import Driver, Message, TransportSpec
from urc.model.payload import Payload
from urc.model.profile import Profile, SimulatorRule
from urc.model.values import NOTHING, Reading, Value
from urc.protocol.forms.topics import namespace_of, topic_of
from urc.protocol.framing.base import FrameFault, Framing
from urc.protocol.framing.table import build_framing
from urc.protocol.values.payload import Frame
from urc.simulator.auto import DefaultConnection, DefaultMessage, DefaultResponder, Unanswered
from urc.simulator.fault_injection import inject, mend
from urc.simulator.faults import DelayLine, parse_fault
from urc.simulator.rules import ReadyRule, RuleSet, RunningRule, not_taken
from urc.simulator.simulated_body import SimulatedBody
from urc.simulator.values import Values

__all__ = ["EmulatedRobot", "EmulatedConnection"]


class _ConnectionState(Protocol):
    is_over: bool


class TimedSetters:
    """The assignment of each timed rule to one connection.

    Only the assigned connection changes the robot's state.
    """

    def __init__(self) -> None:
        """Begin without connections."""
        self._lines: dict[int, weakref.ref[_ConnectionState]] = {}

    def sets(self, rule: SimulatorRule, line: _ConnectionState) -> bool:
        """Return whether `line` may change the robot's state for `rule`.

        An unassigned rule is assigned to `line`.
        """
        known = self._lines.get(id(rule))
        before = known() if known is not None else None
        if before is None or before.is_over:
            self._lines[id(rule)] = weakref.ref(line)
            return True
        return before is line


MOST_COURSES: Final = 256
"""Maximum number of delayed replies per connection."""
_LOOKS_S: Final = 0.1
"""Interval at which the condition of a waiting reaction is checked, in seconds."""

log = logging.getLogger(__name__)
"""Logger that receives every fault, with the arguments ``(transport, text)``."""


class EmulatedRobot:
    """One emulated robot. The method `line` creates the robot's side of a connection."""

    def __init__(
        self, profile: Profile, settings: Mapping[str, Value], *, is_plain: bool = False
    ) -> None:
        """Prepare the robot; with `is_plain`, numpy and Pillow are not needed (see `World`)."""
        self._transports = profile.driver.transports
        self._rules = profile.simulator
        self._values = Values(
            profile.driver, settings, profile.emulated, profile.world, is_plain=is_plain
        )
        self._pictures = _pictures(profile.driver, settings, self._values.senses)
        self._videos = _videos(profile.driver)
        self._robot = DefaultResponder(profile.driver, settings, self._values)
        self._setters = TimedSetters()
        self._framings = {
            name: build_framing(spec.framing).reversed() for name, spec in self._transports.items()
        }

    def line(self, transport: str) -> "EmulatedConnection":
        """Return the robot's side of a new connection on `transport`."""
        rules = tuple(rule for rule in self._rules if rule.transport == transport)
        spec, framing = self._transports[transport], self._framings[transport]
        auto = self._robot.line(transport, framing, talks=not any(map(_speaks, rules)))
        ruled = RuleSet(rules, spec, framing, auto, self._values)
        return EmulatedConnection(spec, framing, ruled, auto, self._setters, self._values)

    def picture(self, transport: str, topics: Iterable[str], now_s: float) -> bytes | None:
        """Return the world's current image for one of `topics`; None if no topic has an image.

        The image is b"" while a dropout fault affects the camera.

        Args:
            transport: name of the transport with the subscription.
            topics: topic names to try, because a topic may have several names.
            now_s: current time, in seconds since the epoch.
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

    def video(self, transport: str, now_s: float) -> bytes | None:
        """Return the current image of a camera transport's video, as JPEG or PNG.

        Return None while the robot sends no video, and b"" if the world does not determine the
        image.

        Args:
            transport: name of a transport of type ``camera``.
            now_s: current time, in seconds since the epoch.
        """
        body, faults = self._values.body, self._values.faults
        name = self._videos.get(transport)
        if name is None or faults.is_silent or faults.drops((name,)):
            return None
        if body is None or name not in self._values.senses:
            return b""
        try:
            return body.picture(name, now_s) or None
        except ExpressionError:
            return None  # the condition of the video has no value yet

    @property
    def body(self) -> SimulatedBody | None:
        """The simulated body; None if the robot has no world."""
        return self._values.body

    def prepare(self) -> None:
        """Load the image modules early, so the first image is not delayed; the call may block."""
        if self._values.body is not None:
            self._values.body.prepare()

    @property
    def faults(self) -> tuple[str, ...]:
        """Active faults, in the syntax of `FAULTS`."""
        return tuple(one.text for one in self._values.faults.active.values())

    def inject(self, text: str, now_s: float) -> None:
        """Inject a fault given in the syntax of `FAULTS`.

        Args:
            text: fault to inject, such as ``loss=5%``.
            now_s: current time, in seconds since the epoch.

        Raises:
            UrcError: the fault is unknown or impossible for this robot.
        """
        inject(parse_fault(text), self._values, now_s)

    def mend(self) -> None:
        """Remove all faults. This does not recharge the battery after a low-battery fault."""
        mend(self._values)

    def camera(self, now_s: float) -> bytes | None:
        """Return the camera image (JPEG, or PNG if `is_plain`); None without a working camera.

        `now_s` is the current time, in seconds since the epoch.
        """
        body = self._values.body
        names = (*self._pictures.values(), *self._videos.values())
        name = next((one for one in names if one in self._values.senses), None)
        if body is None or name is None or self._values.faults.drops((name,)):
            return None
        return body.picture(name, now_s)

    def top_view(self, width: int, height: int, now_s: float) -> bytes | None:
        """Return a top view of the world as JPEG; None if the world or Pillow is missing.

        Args:
            width: width of the image in pixels, 16 to 2000.
            height: height of the image in pixels, 16 to 2000.
            now_s: current time, in seconds since the epoch.
        """
        body = self._values.body
        if body is None or "top" in body.world.dropped:
            return None
        body.world.advance(now_s)
        return body.world.top_view(width, height)

    def readings(self, now_s: float) -> Mapping[str, Reading]:
        """Return the values of the robot's signals, with or without a connection.

        `now_s` is the current time, in seconds since the epoch.
        """
        return {name: self._values.of(name, now_s) for name in self._values.driver.signals}


def _topic(driver: Driver, message: Message, settings: Mapping[str, Value]) -> str:
    namespace = namespace_of(driver.transports[message.transport], settings)
    return topic_of(message.read, settings, namespace)


def _pictures(
    driver: Driver, settings: Mapping[str, Value], senses: Iterable[str]
) -> Mapping[tuple[str, str], str]:
    """Return the signals whose values are camera images, keyed by transport and topic."""
    return {
        (message.transport, _topic(driver, message, settings)): name
        for message in driver.messages.values()
        for name in message.read.fields
        if message.read.topic is not None
        and name in senses
        and driver.signals[name].type == "image"
    }


def _videos(driver: Driver) -> Mapping[str, str]:
    """Return the signal with the video of each camera transport, keyed by transport."""
    return {
        message.transport: name
        for message in driver.messages.values()
        for name in message.read.fields
        if driver.transports[message.transport].is_camera
    }


def _speaks(rule: SimulatorRule) -> bool:
    """Return whether a rule replaces the robot's automatic messages."""
    if rule.request:
        return False
    says = any(one.send or one.message for one in rule.reactions)
    return says or not any(one.sets or one.answers for one in rule.reactions)


@dataclass(slots=True)
class _Periodic:
    what: ReadyRule | DefaultMessage
    every_s: float
    left_s: float
    """Time until the rule or the message is due, in seconds."""


class EmulatedConnection:
    """The robot's side of one connection."""

    def __init__(
        self,
        spec: TransportSpec,
        framing: Framing,
        rules: RuleSet,
        auto: DefaultConnection,
        setters: TimedSetters,
        values: Values,
    ) -> None:
        self._body = values.body
        self._flaws = values.faults
        self._late = DelayLine()
        self._name = spec.name
        self._auto = auto
        self._is_greeted = not auto.opening
        self._encoding = spec.encoding
        self._decoder = framing.decoder()
        self._rules = rules
        self._setters = setters
        self._running_rules: list[RunningRule] = []
        self._periodic = [
            _Periodic(rule, rule.what.every_s, rule.what.every_s)
            for rule in rules.periodic
            if rule.what.every_s is not None
        ]
        self._periodic += [_Periodic(one, one.every_s, one.every_s) for one in auto.messages]
        self._now_s = 0.0
        self.is_over = False
        """Whether the robot closes the connection after the client has received all data."""
        self.faults = 0
        """Total number of invalid frames, unmatched frames and failed replies."""
        self.last_fault = ""
        """Description of the latest fault, on one line."""

    @property
    def due_in_s(self) -> float | None:
        """Time until `advance` must be called, in seconds; None while nothing is scheduled."""
        if not self._is_greeted:
            return 0.0
        left = [one.left_s for one in self._periodic]
        left += [one.left_s for one in self._running_rules]
        if self.has_late:
            left.append(self._late.due_s - self._now_s)
        silence = self._decoder.deadline
        if silence is not None:
            left.append(silence - self._now_s)
        return max(0.0, min(left)) if left else None

    def receive(self, data: Payload, now_s: float, limit: int | None = None) -> list[Payload]:
        """Process received data and return the replies. Each reply is a whole frame.

        Args:
            data: any number of bytes from the stream, or an envelope on a message transport.
            now_s: current time in seconds since the epoch, available to templates as ``now``.
            limit: maximum number of replies; further requests are dropped. None for no limit.
        """
        return self._flawed(self._receive(data, now_s, limit, self._answer_or_lose), now_s)

    def request(self, data: Payload, now_s: float) -> list[Payload]:
        """Return the replies without injected faults.

        The caller must delay or drop the replies according to the injected faults.
        """
        return self._receive(data, now_s, None, self._answer)

    def _receive(
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

    def advance(self, dt_s: float, now_s: float) -> list[Payload]:
        """Advance time by `dt_s` seconds; return the robot's unsolicited frames.

        A periodic rule sends at most once per call, so a late call does not cause a burst of
        frames.
        """
        said = self._flawed(self._due(dt_s, now_s), now_s)
        return self._late.pop_due(now_s) + said if self.has_late else said

    def _flawed(self, said: list[Payload], now_s: float) -> list[Payload]:
        """Return the frames to send now. Injected faults delay or drop the remaining frames."""
        if not self._flaws.active:
            return said
        said = self._flaws.apply(said)
        delay_s = self._flaws.delay_s
        if not delay_s:
            return said
        self._late.push(said, now_s + delay_s)
        return []

    @property
    def has_late(self) -> bool:
        """Whether frames that an injected fault has delayed are still queued."""
        return self._late.due_s < math.inf

    @property
    def loses(self) -> bool:
        """Whether an injected fault drops the next reply."""
        return self._flaws.is_silent or self._flaws.loses()

    @property
    def delay_s(self) -> float:
        """Injected delay of every reply, in seconds."""
        return self._flaws.delay_s

    @property
    def is_incomplete(self) -> bool:
        """Whether an injected dropout affects any signal."""
        return bool(self._flaws.dropped)

    def _due(self, dt_s: float, now_s: float) -> list[Payload]:
        said: list[Payload] = []
        self._pass(now_s)
        for frame in self._decoder.tick(now_s):
            if not isinstance(frame, FrameFault):
                said += self._answer_or_lose(frame, now_s)
        if not self._is_greeted:
            self._is_greeted = True
            said += self._try(lambda: [*self._auto.greet(now_s)]) or []
        for running_rule in tuple(self._running_rules):
            running_rule.left_s -= dt_s
            if running_rule.left_s <= 0 and not self.is_over:
                self._running_rules.remove(running_rule)
                said += self._resume(running_rule, now_s)
        for periodic in self._periodic:
            periodic.left_s -= dt_s
            if periodic.left_s <= 0 and not self.is_over:
                periodic.left_s = periodic.every_s - (-periodic.left_s) % periodic.every_s
                said += self._by_itself(periodic.what, now_s)
        return said

    def _pass(self, now_s: float) -> None:
        """Advance the world to the current time, before the inputs change."""
        self._now_s = now_s
        if self._body is not None:
            self._body.world.advance(now_s)

    def _by_itself(self, what: ReadyRule | DefaultMessage, now_s: float) -> list[Payload]:
        if isinstance(what, DefaultMessage):
            answer = what.answer
            return self._try(lambda: [*self._auto.render(answer, now_s)]) or []
        rule = what.what

        def go() -> list[Payload]:
            if not self._rules.holds(rule.when, now_s):
                return []
            sets = self._setters.sets(rule, self)
            return self._resume(RunningRule(what.ready_reactions, NOTHING, sets=sets), now_s)

        return self._try(go) or []

    def _answer_or_lose(self, frame: Payload, now_s: float) -> list[Payload]:
        return [] if self._flaws.loses() else self._answer(frame, now_s)

    def _answer(self, frame: Payload, now_s: float) -> list[Payload]:
        asked = Frame(frame, self._encoding)
        if self._body is not None and self._body.failsafe is not None:
            self._body.note_commands(self._auto.labels(asked), now_s)

        def answer() -> list[Payload] | None:
            running_rule = self._rules.match(asked, now_s)
            if running_rule is not None:
                return self._resume(running_rule, now_s)
            return self._auto.answer(asked, now_s)

        said = self._try(answer)
        if said is None:
            self._fault(not_taken(asked))
        return said or []

    def _resume(self, running_rule: RunningRule, now_s: float) -> list[Payload]:
        """Run the reactions that are due, and schedule the remaining reactions."""
        said: list[Payload] = []
        while running_rule.ready_reactions and not self.is_over:
            reaction = running_rule.ready_reactions[0]
            if reaction.what.after_s > 0 and not running_rule.has_waited:
                self._defer(running_rule, reaction.what.after_s)
                break
            if not self._holds(reaction.what.until, now_s, running_rule.names):
                self._defer(running_rule, _LOOKS_S)
                break
            running_rule.has_waited = False
            running_rule.ready_reactions = running_rule.ready_reactions[1:]
            said += self._try(partial(self._rules.do, reaction, running_rule, now_s)) or []
            self.is_over |= reaction.what.closes
        return said

    def _defer(self, running_rule: RunningRule, left_s: float) -> None:
        if len(self._running_rules) >= MOST_COURSES:
            self._fault(f"{MOST_COURSES} delayed replies are already queued; reply dropped")
            return
        running_rule.left_s, running_rule.has_waited = left_s, True
        self._running_rules.append(running_rule)

    def _try(self, make: Callable[[], list[Payload] | None]) -> list[Payload] | None:
        """Call `make` and return its result. If no reply can be built, count and log a fault."""
        try:
            return make()
        except Unanswered as problem:
            self._fault(str(problem))
            return []

    def _holds(self, until: Template | None, now_s: float, names: Mapping[str, object]) -> bool:
        """Return whether a condition is true. A condition that fails counts as a fault."""
        try:
            return self._rules.holds(until, now_s, names)
        except Unanswered as problem:
            self._fault(str(problem))
            return False

    def _fault(self, text: str) -> None:
        self.faults += 1
        self.last_fault = text
        log.info("transport %s: %s", self._name, text)
