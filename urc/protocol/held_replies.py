"""What the robot says to frames of motion: taken, or refused.

Floor 3, pure. Frames of motion do not go through the queue of their line, so nothing is in flight
for them, and nobody waits. But a robot that answers each of them does so here: an acknowledgement
is taken and is no stray frame, and a refusal ends the motion. A refusal counts also where the robot
says it by itself, as a controller does whose guard was opened.

Where one side talks at a time, frames of motion wait for an answer that the robot owes, and what
waits in the queue of the line waits for theirs. Both waits are short: an answer that was lost must
not keep a robot from being driven. A stop does not come by here, and waits for nothing.

A command listens from its first frame on, for as long as an answer may take after the newest one.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from urc.expressions import ExpressionError, Template
from urc.protocol.answer import Answer, Ear, Fields, Offer
from urc.protocol.codec import Frame
from urc.protocol.word import Word

__all__ = ["LONGEST_WAIT_S", "HeldReplies", "Refusal"]

LONGEST_WAIT_S: Final = 0.1
"""For an answer that is owed, on a line where one side talks at a time."""
_NOTHING: Mapping[str, object] = {}


class Refusal(NamedTuple):
    """The robot does not do what is held."""

    command: str
    offer: Offer


class _Listening:
    """The newest frame of one held command."""

    __slots__ = ("_match", "ear", "names", "until_s")

    def __init__(self, answer: Answer, match: Template | None) -> None:
        self.ear = Ear(answer)
        # Which of many frames a number belongs to is not known: any of them counts.
        self._match = None if match is None or "seq" in match.names else match
        self.names = _NOTHING
        self.until_s = float("-inf")

    def is_mine(self, fields: Fields) -> bool:
        """Return whether a frame is about this command, by what it carries."""
        if self._match is None:
            return True
        names: dict[str, object] = dict(self.names)
        names |= {name: Word(raw) if isinstance(raw, str) else raw for name, raw in fields.items()}
        try:
            return bool(self._match.evaluate(names))
        except ExpressionError:
            return False


class HeldReplies:
    """The held commands of one line that the robot answers."""

    def __init__(self) -> None:
        self._all: dict[str, _Listening] = {}
        self._until_s = float("-inf")
        self.owed_until_s = float("-inf")
        """Until when the robot may owe an answer to a frame of motion."""
        self._waits_since_s: float | None = None

    def add(self, command: str, answer: Answer, match: Template | None) -> None:
        """Listen for the answers to a command, once it has been given."""
        self._all[command] = _Listening(answer, match)

    def gave(self, command: str, names: Mapping[str, object], now: float) -> None:
        """Take note that a frame of a command goes out, made of `names`."""
        one = self._all.get(command)
        if one is not None:
            self.owed_until_s = now + min(one.ear.answer.timeout_s, LONGEST_WAIT_S)
            one.names = names
            one.until_s = now + one.ear.answer.timeout_s
            self._until_s = max(self._until_s, one.until_s)

    def forget(self) -> None:
        """Forget a connection: what comes on the next one answers nothing of this one."""
        self._until_s = self.owed_until_s = float("-inf")
        self._waits_since_s = None
        for one in self._all.values():
            one.until_s = float("-inf")

    def must_wait(self, now: float, *, is_owed: bool) -> bool:
        """Return whether a frame of motion has to wait, on a line where one side talks at a time.

        Args:
            now: the time.
            is_owed: whether the robot owes an answer to anything else.
        """
        if not is_owed and now >= self.owed_until_s:
            self._waits_since_s = None
            return False
        if self._waits_since_s is None:
            self._waits_since_s = now
        if now - self._waits_since_s < LONGEST_WAIT_S:
            return True
        self._waits_since_s = None
        return False

    def is_listening(self, now: float) -> bool:
        """Return whether an answer to a frame of motion may come."""
        return now < self._until_s

    def refusals(self, frame: Frame, now: float) -> list[Refusal]:
        """Return the commands that a frame refuses: all that it may be about."""
        found = [
            Refusal(name, offer)
            for name, one in self._listening(now)
            if (offer := one.ear.beside(frame, one.is_mine)) is not None and offer.refusal
        ]
        if found:
            self.owed_until_s = float("-inf")
        return found

    def refuse(self, frame: Frame, reason: str, now: float) -> list[Refusal]:
        """Return what an answer refuses that is known as a refusal: in words of the driver."""
        plain = [Refusal(name, Offer(refusal=reason)) for name, _ in self._listening(now)]
        return self.refusals(frame, now) or plain

    def accepted(self, frame: Frame, now: float) -> tuple[Answer, Offer] | None:
        """Return what an acknowledgement says, or None when the frame is none."""
        for _, one in self._listening(now):
            offer = one.ear.offer(frame, one.is_mine)
            if offer is not None:
                self.owed_until_s = float("-inf")
                return one.ear.answer, offer
        return None

    def _listening(self, now: float) -> list[tuple[str, _Listening]]:
        return [(name, one) for name, one in self._all.items() if now < one.until_s]
