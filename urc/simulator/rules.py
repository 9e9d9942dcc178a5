"""The simulator rules of a document, compiled for one transport.

The module is pure: it does not use sockets or clocks.
"""

from collections.abc import Mapping
from typing import NamedTuple

from urc.expressions import COUNTERS, ExpressionError, Template
from urc.model.driver import TransportSpec
from urc.model.payload import Envelope, Payload, ReadSpec, traffic_of
from urc.model.profile import Reaction, SimulatorRule
from urc.model.values import NOTHING
from urc.protocol.forms.table import build_reader, build_writer
from urc.protocol.forms.topics import context_of, frame_of
from urc.protocol.framing.base import Framing, FramingError
from urc.protocol.framing.table import build_framing
from urc.protocol.requests.rate import Counters
from urc.protocol.values.convert import Unusable
from urc.protocol.values.payload import (
    BadText,
    Frame,
    NotWritable,
    PayloadReader,
    PayloadWriter,
)
from urc.simulator.auto import (
    DefaultConnection,
    ReceivedRequest,
    SimulatedReply,
    Unanswered,
    numbered,
)
from urc.simulator.values import Names, Unsettable, Values

__all__ = ["RunningRule", "ReadyRule", "RuleSet", "not_taken"]


class ReadyReaction(NamedTuple):
    """A compiled reaction."""

    what: Reaction
    writer: PayloadWriter | None
    framing: Framing
    message: SimulatedReply | None


class ReadyRule(NamedTuple):
    """A compiled rule."""

    what: SimulatorRule
    reader: PayloadReader | None
    ready_reactions: tuple[ReadyReaction, ...]


class RunningRule:
    """The reactions of a triggered rule that are not complete yet."""

    __slots__ = ("asked", "frame", "has_waited", "left_s", "names", "ready_reactions", "sets")

    def __init__(
        self,
        ready_reactions: tuple[ReadyReaction, ...],
        names: Mapping[str, object],
        asked: ReceivedRequest | None = None,
        frame: Frame | None = None,
        *,
        sets: bool = True,
    ) -> None:
        self.ready_reactions = ready_reactions
        """Pending reactions."""
        self.names = names
        """Values that the rule reads from the frame, keyed by name."""
        self.asked = asked
        """The declared request that triggered the rule; None for other frames."""
        self.frame = frame
        """The received frame; None for a periodic rule."""
        self.sets = sets
        """Whether the reactions may change the robot's state."""
        self.left_s = 0.0
        """Time until the first reaction in `ready_reactions` is due, in seconds."""
        self.has_waited = False


class RuleSet:
    """The rules of one transport, in document order.

    Args:
        rules: the rules.
        spec: the transport.
        framing: framing of data sent and received by the robot.
        auto: source of automatic replies to declared requests.
        values: signal values and state of the robot.
    """

    def __init__(
        self,
        rules: tuple[SimulatorRule, ...],
        spec: TransportSpec,
        framing: Framing,
        auto: DefaultConnection,
        values: Values,
    ) -> None:
        self._context = context_of(spec, values.settings)
        self._framing = framing
        self._auto = auto
        self._values = values
        self._counters = Counters()
        ready = [self._ready(rule) for rule in rules]
        self.asked = tuple(rule for rule in ready if rule.what.every_s is None)
        """Rules triggered by received frames."""
        self.periodic = tuple(rule for rule in ready if rule.what.every_s is not None)

    def _ready(self, rule: SimulatorRule) -> ReadyRule:
        is_form = isinstance(rule.match, ReadSpec)
        reader = build_reader(rule.match, self._context) if is_form else None  # type: ignore[arg-type]  # as told
        framing = self._auto.framing_of(rule.request) if rule.request else self._framing
        return ReadyRule(
            rule, reader, tuple(self._reaction(one, framing) for one in rule.reactions)
        )

    def _reaction(self, what: Reaction, framing: Framing) -> ReadyReaction:
        if what.framing is not None:
            framing = build_framing(what.framing).reversed()
        return ReadyReaction(
            what,
            build_writer(what.send, self._context) if what.send is not None else None,
            framing,
            self._auto.message(what.message) if what.message else None,
        )

    def match(self, frame: Frame, now_s: float) -> RunningRule | None:
        """Return the reactions of the first rule that matches the frame; None if no rule matches.

        Raises:
            Unanswered: a condition or field of a rule has no value.
        """
        for rule in self.asked:
            asked: ReceivedRequest | None = None
            names: Mapping[str, object] | None
            if rule.what.request:
                asked = self._auto.asked(frame, rule.what.request)
                names = None if asked is None else asked.arguments
            else:
                names = _names_in(rule, frame)
            running_rule = self._running_rule(rule, names, asked, frame, now_s)
            if running_rule is not None:
                return running_rule
        # The first request with these bytes has no rule, but another request with the same bytes
        # may have one.
        for rule in self.asked:
            asked = self._auto.asked_too(frame, rule.what.request) if rule.what.request else None
            names = None if asked is None else asked.arguments
            running_rule = self._running_rule(rule, names, asked, frame, now_s)
            if running_rule is not None:
                return running_rule
        return None

    def _running_rule(
        self,
        rule: ReadyRule,
        names: Mapping[str, object] | None,
        asked: ReceivedRequest | None,
        frame: Frame,
        now_s: float,
    ) -> RunningRule | None:
        """Return the reactions to a frame with values `names`; None if the rule does not apply."""
        for name, value in (names or NOTHING).items():
            if isinstance(value, Unusable):
                raise Unanswered(f"{name}: {value.why}")
        if names is None or not self.holds(rule.what.when, now_s, names):
            return None
        if asked is not None:
            self._values.remember(asked.arguments)
        return RunningRule(rule.ready_reactions, names, asked, frame)

    def holds(
        self, condition: Template | None, now_s: float, names: Mapping[str, object] = NOTHING
    ) -> bool:
        """Return whether the rule's condition is true; raise `Unanswered` if evaluation fails."""
        if condition is None:
            return True
        try:
            return bool(condition.evaluate(Names(self._values, now_s, names)))
        except ExpressionError as error:
            raise Unanswered(str(error)) from None

    def do(self, reaction: ReadyReaction, running_rule: RunningRule, now_s: float) -> list[Payload]:
        """Perform one reaction and return its frames; raise `Unanswered` on failure."""
        what = reaction.what
        said: list[Payload] = []
        try:
            if running_rule.sets:
                self._set(what, running_rule, now_s)
            if what.answers:
                asked = running_rule.asked
                if asked is None and running_rule.frame is not None:
                    asked = self._auto.asked(running_rule.frame)
                if asked is None:
                    raise Unanswered("the driver never sends this frame and declares no reply")
                said += self._auto.answers(asked, now_s)
            if what.refuses:
                said.append(_refusal(running_rule.frame))
            if reaction.message is not None:
                said += self._auto.render(reaction.message, now_s)
            if reaction.writer is not None and not self._is_dropped(what):
                said.append(self._written(reaction, reaction.writer, running_rule, now_s))
        except (ExpressionError, FramingError, NotWritable, Unsettable) as problem:
            if self._wants_dropped(what):
                return said
            raise Unanswered(str(problem)) from None
        return said

    def _is_dropped(self, what: Reaction) -> bool:
        """Return whether the reply contains a signal that has dropped out."""
        return what.send is not None and self._values.faults.drops(what.send.names)

    def _wants_dropped(self, what: Reaction) -> bool:
        """Return whether a failed sensor may have caused a reaction to fail."""
        body = self._values.body
        names = {
            name for one in what.sets.values() if isinstance(one, Template) for name in one.names
        }
        if what.send is not None:
            names |= what.send.names
        return body is not None and bool(body.world.dropped) and "world" in names

    def _set(self, what: Reaction, running_rule: RunningRule, now_s: float) -> None:
        names = Names(self._values, now_s, running_rule.names)
        values = {
            name: one.evaluate(names) if isinstance(one, Template) else one
            for name, one in what.sets.items()
        }
        for name, value in values.items():  # all expressions use the old values
            self._values.set(name, value)

    def _written(
        self,
        reaction: ReadyReaction,
        writer: PayloadWriter,
        running_rule: RunningRule,
        now_s: float,
    ) -> Payload:
        draw = self._counters.draw()
        names = Names(self._values, now_s, {**running_rule.names, COUNTERS: draw})
        payload = writer.write(names)
        self._counters.count(draw)
        said = reaction.framing.encode(payload) if isinstance(payload, bytes) else payload
        if isinstance(said, Envelope) and said.verb == "publish":  # a message to subscribers
            said = Envelope("message", {"topic": said.attributes.get("topic")}, said.body)
        return said if running_rule.frame is None else numbered(said, running_rule.frame)


def _names_in(rule: ReadyRule, came: Frame) -> Mapping[str, object] | None:
    """Return the values that the rule reads from the frame, by name; None without a match."""
    frame = came if isinstance(came.payload, bytes) else frame_of(came.payload, came.encoding)
    try:
        if rule.reader is not None:
            return rule.reader.read(frame)
        match = rule.what.match
        return None if match is None or isinstance(match, ReadSpec) else match.search(frame.text)
    except BadText:
        return None


def not_taken(frame: Frame) -> str:
    """Return the fault message about a frame that no rule matches."""
    if not isinstance(frame.payload, bytes):
        shown = traffic_of(frame.payload).decode("utf-8", "replace")[:60]
        return f"no rule matches {shown!r}, and the driver never sends it"
    try:
        shown = repr(frame.text[:60])
    except BadText:
        return f"received a frame that is not valid {frame.encoding} text"
    return f"no rule matches {shown}, and the driver never sends it"


def _refusal(asked: Frame | None) -> Payload:
    """Return the report of a failure; raise `Unanswered` if the frame cannot be refused."""
    if asked is None or not isinstance(asked.payload, Envelope):
        raise Unanswered("only a call or a goal of ROS can be refused")
    said = {"id": asked.payload.attributes.get("id"), "ok": False, "reason": "the robot refused it"}
    return Envelope("response", said, {"reason": said["reason"]})
