"""The emulated robot: frames in, bytes out, by the rules a profile carries about itself.

What no rule takes is answered by the driver's own declarations (`urc.simulator.auto`).

Pure: no socket, no clock. The framing is the driver's own, turned round, so what it says is cut and
joined exactly as the real robot would. Each client has a line of its own.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from urc.expressions import ExpressionError
from urc.model.driver import TransportSpec
from urc.model.profile import Profile, SimulatorRule
from urc.model.values import Value
from urc.protocol.forms import BadText, Frame
from urc.protocol.framing import FrameFault, Framing, FramingError, build_framing
from urc.simulator.auto import AutoLine, AutoMessage, AutoRobot, Unanswered

__all__ = ["Twin", "TwinLine"]


class Twin:
    """One emulated robot; `line` makes its side of a connection."""

    def __init__(self, profile: Profile, settings: Mapping[str, Value]) -> None:
        """Prepare the rules of `profile`, whose templates see `settings`."""
        self._transports = profile.driver.transports
        self._rules = profile.simulator
        self._settings = dict(settings)
        self._robot = AutoRobot(profile.driver, self._settings)
        self._framings = {
            name: build_framing(spec.framing).reversed() for name, spec in self._transports.items()
        }

    def line(self, transport: str) -> "TwinLine":
        """Return the robot's side of a new connection on `transport`."""
        rules = tuple(rule for rule in self._rules if rule.transport == transport)
        spec, framing = self._transports[transport], self._framings[transport]
        auto = self._robot.line(transport, framing, talks=not rules)
        return TwinLine(spec, framing, rules, self._settings, auto)


@dataclass(slots=True)
class _Periodic:
    what: SimulatorRule | AutoMessage
    every_s: float
    left_s: float
    """Seconds until it is due."""


class TwinLine:
    """The robot's side of one connection."""

    def __init__(
        self,
        spec: TransportSpec,
        framing: Framing,
        rules: tuple[SimulatorRule, ...],
        settings: Mapping[str, Value],
        auto: AutoLine,
    ) -> None:
        """Made by `Twin.line`."""
        self._auto = auto
        self._is_greeted = not auto.opening
        self._encoding = spec.encoding
        self._framing = framing
        self._decoder = framing.decoder()
        self._rules = tuple(rule for rule in rules if rule.pattern is not None)
        self._settings = settings
        self._periodic = [
            _Periodic(rule, rule.every_s, rule.every_s)
            for rule in rules
            if rule.pattern is None and rule.every_s is not None
        ]
        self._periodic += [_Periodic(one, one.every_s, one.every_s) for one in auto.messages]
        self._now_s = 0.0
        self.faults = 0
        """Frames that were none, that no rule took, or whose answer could not be made."""
        self.last_fault = ""
        """One line about the newest of them."""

    @property
    def due_in_s(self) -> float | None:
        """Seconds until `step` has something to say; None when it never has."""
        if not self._is_greeted:
            return 0.0
        silence = self._decoder.deadline
        if silence is not None:
            left_s = max(0.0, silence - self._now_s)
            return min((left_s, *(periodic.left_s for periodic in self._periodic)))
        return min((periodic.left_s for periodic in self._periodic), default=None)

    def receive(self, data: bytes, now_s: float, limit: int | None = None) -> list[bytes]:
        """Take bytes of the client and return the answers, each a whole frame.

        Args:
            data: any piece of the stream.
            now_s: seconds since the epoch, the templates' ``now``.
            limit: most answers to give; what the client sent beyond them is dropped. None: all.
        """
        answers: list[bytes] = []
        self._now_s = now_s
        for frame in self._decoder.feed(data, now_s):
            if limit is not None and len(answers) >= limit:
                break
            if isinstance(frame, FrameFault):
                self._fault(frame.message)
            else:
                answers += self._answer(frame, now_s)
        return answers

    def step(self, dt_s: float, now_s: float) -> list[bytes]:
        """Let `dt_s` seconds pass and return what the robot says by itself.

        A rule that was due several times speaks once: a pause is not made up for.
        """
        said: list[bytes] = []
        self._now_s = now_s
        for frame in self._decoder.tick(now_s):
            if not isinstance(frame, FrameFault):
                said += self._answer(frame, now_s)
        if not self._is_greeted:
            self._is_greeted = True
            said += self._answers(lambda: self._auto.greet(now_s)) or []
        for periodic in self._periodic:
            periodic.left_s -= dt_s
            if periodic.left_s <= 0:
                periodic.left_s = periodic.every_s - (-periodic.left_s) % periodic.every_s
                what = periodic.what
                if isinstance(what, SimulatorRule):
                    said += self._say(what, {}, now_s)
                else:
                    said += self._message(what, now_s)
        return said

    def _message(self, message: AutoMessage, now_s: float) -> list[bytes]:
        return self._answers(lambda: self._auto.say(message.answer, now_s)) or []

    def _answers(self, make: Callable[[], list[bytes] | None]) -> list[bytes] | None:
        try:
            return make()
        except Unanswered as problem:
            self._fault(str(problem))
            return []

    def _answer(self, frame: bytes, now_s: float) -> list[bytes]:
        asked = Frame(frame, self._encoding)
        found = self._by_rule(asked, now_s)
        if found is None:
            found = self._answers(lambda: self._auto.answer(asked, now_s))
        if found is None:
            self._fault(_not_taken(asked))
        return found or []

    def _by_rule(self, frame: Frame, now_s: float) -> list[bytes] | None:
        """Return what the first rule that takes the frame says, or None when none does."""
        try:
            text = frame.text if self._rules else ""
        except BadText:
            return None
        for rule in self._rules:
            found = rule.pattern.search(text) if rule.pattern is not None else None
            if found is not None:
                return self._say(rule, found, now_s)
        return None

    def _say(
        self, rule: SimulatorRule, groups: Mapping[str, str | None], now_s: float
    ) -> list[bytes]:
        if rule.send is None:
            return []
        namespace: dict[str, object] = {"now": now_s, "settings": self._settings, **groups}
        try:
            payload = rule.send.render(namespace).encode(self._encoding)
            return [self._framing.encode(payload)]
        except (ExpressionError, FramingError, UnicodeEncodeError) as problem:
            self._fault(str(problem))
            return []

    def _fault(self, text: str) -> None:
        self.faults += 1
        self.last_fault = text


def _not_taken(frame: Frame) -> str:
    try:
        shown = repr(frame.text[:60])
    except BadText:
        return f"a frame is not {frame.encoding} text"
    return f"no rule takes {shown}, and the driver never sends it"
