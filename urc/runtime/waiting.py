"""Commands that wait for their answers: how many may, and how long at most.

The engine answers every command in time. Should it ever fail to, the wait ends nevertheless. One
alarm for all of them: hardly any command gets as far, and each would pay for its own.
"""

import asyncio
from collections.abc import Callable

from urc.protocol.events import Failed, Replied, Request
from urc.runtime.clock import Alarm, Clock

__all__ = ["MAX_WAITING", "Answer", "Waiting"]

MAX_WAITING = 256
"""Commands that may wait for their answer at a time; one more is refused."""

Answer = Replied | Failed


class Waiting:
    """A future for each command that waits."""

    def __init__(self, clock: Clock, limit_s: Callable[[str], float]) -> None:
        """Begin with none.

        Args:
            clock: the time.
            limit_s: command → seconds after which nobody waits for it any longer.
        """
        self._clock = clock
        self._limit_s = limit_s
        self._limits_s: dict[str, float] = {}
        self._all: dict[int, tuple[asyncio.Future[Answer], float, str]] = {}
        """Number of the request → who waits, until when, and for which command."""
        self._alarm: Alarm | None = None
        self._alarm_s = 0.0

    @property
    def is_full(self) -> bool:
        """Whether no more may wait."""
        return len(self._all) >= MAX_WAITING

    def add(self, request: Request, answer: asyncio.Future[Answer], now: float) -> None:
        """Let `answer` wait for the end of a request that is made `now`."""
        name = request.command
        limit_s = self._limits_s.get(name)
        if limit_s is None:
            limit_s = self._limits_s[name] = self._limit_s(name)
        due_s = now + limit_s
        self._all[request.id] = (answer, due_s, name)
        if self._alarm is None or due_s < self._alarm_s:
            self._arm(due_s)

    def settle(self, answer: Answer) -> None:
        """Give the answer to whoever waits for it, if anybody does."""
        found = self._all.pop(answer.id, None)
        if found is not None and not found[0].done():
            found[0].set_result(answer)

    def forget(self, number: int) -> None:
        """Nobody waits for the answer to this request any more."""
        self._all.pop(number, None)

    def close(self, reason: str) -> None:
        """Fail all that wait, and leave no alarm behind."""
        if self._alarm is not None:
            self._alarm.cancel()
            self._alarm = None
        for number in list(self._all):
            self.settle(Failed(number, "", "disconnected", reason))

    def _arm(self, due_s: float) -> None:
        if self._alarm is not None:
            self._alarm.cancel()
        self._alarm_s = due_s
        self._alarm = self._clock.call_at(due_s, self._ring)

    def _ring(self) -> None:
        """Fail those that are overdue. The alarm may have been set for one that is over."""
        self._alarm = None
        now = self._clock.now()
        for number, (_, due_s, name) in list(self._all.items()):
            if due_s <= now:
                text = f"no outcome within {self._limits_s[name]:g} s"
                self.settle(Failed(number, name, "timed-out", text))
        first_s = min((due_s for _, due_s, _ in self._all.values()), default=None)
        if first_s is not None:
            self._arm(first_s)
