"""Questions that one person alone may not answer: a second screen says yes, or nobody does.

Floor 5. Until people sign in, a person is a screen that may drive: whoever asks can never be the
second. Everything is bounded: how many questions wait, and for how long.
"""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Final

from urc.model.flow import Confirm
from urc.runtime.clock import Clock, within
from urc.runtime.session import CommandFailed
from urc.web import wire_ask as wire
from urc.web.controls import Seat

__all__ = ["WAIT_S", "Consent"]

WAIT_S: Final = 30.0
"""How long a second person has to say yes."""
_MOST: Final = 8
"""Questions that wait at a time."""


@dataclass(slots=True)
class _Question:
    number: int
    run: int
    asker: Seat
    command: str
    confirm: Confirm
    until_s: float
    answer: asyncio.Future[Seat | None]


class Consent:
    """The questions of one robot."""

    def __init__(self, seats: Callable[[], tuple[Seat, ...]], clock: Clock) -> None:
        """Begin with none; `seats` are the screens that look at the robot now."""
        self._seats = seats
        self._clock = clock
        self._numbers = count(1)
        self._questions: dict[int, _Question] = {}

    async def second(self, asker: Seat, run: int, command: str, confirm: Confirm) -> str:
        """Ask everybody else that may drive; return the name of who said yes.

        Args:
            asker: who gave the command, and has said yes.
            run: number of the command on that screen.
            command: what it is called.
            confirm: the question.

        Raises:
            CommandFailed: nobody did, in time; somebody said no; or the asker took it back.
        """
        if len(self._questions) >= _MOST:
            raise CommandFailed("busy", f"{_MOST} questions wait for a second person already")
        answer: asyncio.Future[Seat | None] = asyncio.get_running_loop().create_future()
        until_s = self._clock.now() + WAIT_S
        one = _Question(next(self._numbers), run, asker, command, confirm, until_s, answer)
        self._questions[one.number] = one
        for seat in self._seats():
            self._tell(seat, one)
        try:
            async with within(self._clock, WAIT_S):
                second = await answer
        except TimeoutError:
            text = f"{confirm.text}: no second person said yes within {WAIT_S:g} s"
            raise CommandFailed("not-confirmed", text) from None
        finally:
            del self._questions[one.number]
            for each in self._seats():
                each.notice(f"ask {one.number}", wire.encode_asked(one.number))
        if second is None:
            raise CommandFailed("not-confirmed", f"{confirm.text}: somebody said no")
        return second.client.name

    def welcome(self, seat: Seat) -> None:
        """Tell a screen that has just come what is asked."""
        for one in self._questions.values():
            self._tell(seat, one)

    def hear(self, seat: Seat, said: wire.Agree) -> None:
        """Take what a screen says to a question; a question that is over is left alone."""
        one = self._questions.get(said.n)
        if one is None or one.answer.done() or seat.client.role == "viewer":
            return
        if not said.yes:
            one.answer.set_result(None)
        elif seat is not one.asker:
            one.answer.set_result(seat)

    def _tell(self, seat: Seat, one: _Question) -> None:
        if seat.client.role == "viewer" and seat is not one.asker:
            return
        text = wire.encode_ask(
            one.number,
            one.run if seat is one.asker else 0,
            one.asker.client.name,
            one.command,
            one.confirm.text,
            one.confirm.level,
            max(0.0, one.until_s - self._clock.now()),
        )
        seat.notice(f"ask {one.number}", text)
