"""The emulated robot: frames in, bytes out, by the rules a profile carries about itself.

Pure: no socket, no clock. The framing is the driver's own, turned round, so what it says is cut and
joined exactly as the real robot would. Each client has a line of its own.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from urc.expressions import ExpressionError
from urc.model.driver import TransportSpec
from urc.model.profile import Profile, SimulatorRule
from urc.model.values import Value
from urc.protocol.framing import FrameFault, Framing, FramingError, build_framing

__all__ = ["Twin", "TwinLine"]


class Twin:
    """One emulated robot; `line` makes its side of a connection."""

    def __init__(self, profile: Profile, settings: Mapping[str, Value]) -> None:
        """Prepare the rules of `profile`, whose templates see `settings`."""
        self._transports = profile.driver.transports
        self._rules = profile.simulator
        self._settings = dict(settings)
        self._framings = {
            name: build_framing(spec.framing).reversed() for name, spec in self._transports.items()
        }

    def line(self, transport: str) -> "TwinLine":
        """Return the robot's side of a new connection on `transport`."""
        rules = tuple(rule for rule in self._rules if rule.transport == transport)
        spec, framing = self._transports[transport], self._framings[transport]
        return TwinLine(spec, framing, rules, self._settings)


@dataclass(slots=True)
class _Periodic:
    rule: SimulatorRule
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
    ) -> None:
        """Made by `Twin.line`."""
        self._encoding = spec.encoding
        self._framing = framing
        self._decoder = framing.decoder()
        self._rules = tuple(rule for rule in rules if rule.pattern is not None)
        self._settings = settings
        self._periodic = [
            _Periodic(rule, rule.every_s)
            for rule in rules
            if rule.pattern is None and rule.every_s is not None
        ]
        self.faults = 0
        """Frames that were none, that no rule took, or whose answer could not be made."""
        self.last_fault = ""
        """One line about the newest of them."""

    @property
    def due_in_s(self) -> float | None:
        """Seconds until `step` has something to say; None when it never has."""
        return min((periodic.left_s for periodic in self._periodic), default=None)

    def receive(self, data: bytes, now_s: float, limit: int | None = None) -> list[bytes]:
        """Take bytes of the client and return the answers, each a whole frame.

        Args:
            data: any piece of the stream.
            now_s: seconds since the epoch, the templates' ``now``.
            limit: most answers to give; what the client sent beyond them is dropped. None: all.
        """
        answers: list[bytes] = []
        for frame in self._decoder.feed(data):
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
        for periodic in self._periodic:
            periodic.left_s -= dt_s
            if periodic.left_s <= 0:
                every_s = periodic.rule.every_s or dt_s
                periodic.left_s = every_s - (-periodic.left_s) % every_s
                said += self._say(periodic.rule, {}, now_s)
        return said

    def _answer(self, frame: bytes, now_s: float) -> list[bytes]:
        try:
            text = frame.decode(self._encoding)
        except UnicodeDecodeError:
            self._fault(f"a frame is not {self._encoding} text")
            return []
        for rule in self._rules:
            found = rule.pattern.search(text) if rule.pattern is not None else None
            if found is not None:
                return self._say(rule, found, now_s)
        self._fault(f"no rule takes {text[:60]!r}")
        return []

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
