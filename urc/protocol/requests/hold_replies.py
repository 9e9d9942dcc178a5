"""Replies to motion frames: acknowledgements and refusals.

Pure. Motion frames bypass the connection's queue and have no `PendingReply`. This module matches
the replies of robots that reply to every motion frame. An acknowledgement is expected, and a
refusal ends the motion. An unsolicited refusal, for example because a safety door is open, also
ends the motion.

In half-duplex mode, motion frames wait for a pending reply, and queued requests wait for replies to
motion frames. The wait for a reply to a motion frame is short, because a lost reply must not
prevent motion. A stop never waits for replies.

A held command expects replies from its first frame until the reply timeout of its newest frame.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

from urc.expressions import ExpressionError, Template
from urc.protocol.requests.reply_match import CompiledReply, Expectation, Fields, MatchResult
from urc.protocol.values.payload import Frame
from urc.protocol.values.wire_text import WireText

__all__ = ["LONGEST_WAIT_S", "HoldReplies", "HoldRejected"]

LONGEST_WAIT_S: Final = 0.1
"""Maximum wait for a pending reply in half-duplex mode, in seconds."""
_NOTHING: Mapping[str, object] = {}


class HoldRejected(NamedTuple):
    """The robot has refused a held command."""

    command: str
    offer: MatchResult


class _Listening:
    """The expected replies to the newest frame of one held command."""

    __slots__ = ("_match", "expectation", "names", "until_s")

    def __init__(self, answer: CompiledReply, match: Template | None) -> None:
        self.expectation = Expectation(answer)
        # Many frames are pending, so a number cannot be assigned to a specific frame. Every number
        # therefore matches.
        self._match = None if match is None or "seq" in match.names else match
        self.names = _NOTHING
        self.until_s = float("-inf")

    def is_mine(self, fields: Fields) -> bool:
        """Return whether a frame with `fields` belongs to this command."""
        if self._match is None:
            return True
        names: dict[str, object] = dict(self.names)
        names |= {
            name: WireText(raw) if isinstance(raw, str) else raw for name, raw in fields.items()
        }
        try:
            return bool(self._match.evaluate(names))
        except ExpressionError:
            return False


class HoldReplies:
    """The held commands on one connection that expect replies."""

    def __init__(self) -> None:
        self._all: dict[str, _Listening] = {}
        self._until_s = float("-inf")
        self.owed_until_s = float("-inf")
        """Time until which other frames wait for a reply to a motion frame, in seconds."""
        self._waits_since_s: float | None = None

    def add(self, command: str, answer: CompiledReply, match: Template | None) -> None:
        """Register the expected reply to a held command."""
        self._all[command] = _Listening(answer, match)

    def gave(self, command: str, names: Mapping[str, object], now: float) -> None:
        """Record that a frame with the values `names` was sent for a command."""
        one = self._all.get(command)
        if one is not None:
            self.owed_until_s = now + min(one.expectation.answer.timeout_s, LONGEST_WAIT_S)
            one.names = names
            one.until_s = now + one.expectation.answer.timeout_s
            self._until_s = max(self._until_s, one.until_s)

    def forget(self) -> None:
        """Discard the state of a closed connection."""
        self._until_s = self.owed_until_s = float("-inf")
        self._waits_since_s = None
        for one in self._all.values():
            one.until_s = float("-inf")

    def must_wait(self, now: float, *, is_owed: bool) -> bool:
        """Return whether a motion frame must wait in half-duplex mode.

        Args:
            now: current time, in seconds.
            is_owed: whether the reply to a queued request is still pending.
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
        """Return whether a reply to a motion frame may still arrive."""
        return now < self._until_s

    def refusals(self, frame: Frame, now: float) -> list[HoldRejected]:
        """Return the held commands to which the frame may be a refusal."""
        found = [
            HoldRejected(name, offer)
            for name, one in self._listening(now)
            if (offer := one.expectation.beside(frame, one.is_mine)) is not None and offer.refusal
        ]
        if found:
            self.owed_until_s = float("-inf")
        return found

    def refuse(self, frame: Frame, reason: str, now: float) -> list[HoldRejected]:
        """Return the refusals in an error response, with the driver's text if declared."""
        plain = [
            HoldRejected(name, MatchResult(refusal=reason)) for name, _ in self._listening(now)
        ]
        return self.refusals(frame, now) or plain

    def accepted(self, frame: Frame, now: float) -> tuple[CompiledReply, MatchResult] | None:
        """Return the match result for a motion acknowledgement; None for other frames."""
        for _, one in self._listening(now):
            offer = one.expectation.offer(frame, one.is_mine)
            if offer is not None:
                self.owed_until_s = float("-inf")
                return one.expectation.answer, offer
        return None

    def _listening(self, now: float) -> list[tuple[str, _Listening]]:
        return [(name, one) for name, one in self._all.items() if now < one.until_s]
