"""Questions that one person alone may not answer: a second screen says yes, or nobody does.

Floor 5. Until people sign in, a person is a screen that may drive: whoever asks can never be the
second. Everything is bounded: how many questions wait, and for how long.

What a screen has said yes to is named by a token of ours. It counts once, for a few seconds, on
that screen, and for just this command with just these arguments, which its bytes are made of: what
was recorded, changed, or held up on its way is no yes.
"""

import asyncio
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import count
from typing import Final, NamedTuple

import msgspec

from urc.model.driver import STOPPED, Command
from urc.model.flow import Confirm
from urc.model.values import Reading
from urc.protocol.commands import questions
from urc.runtime.clock import Clock, within
from urc.runtime.session import CommandFailed
from urc.web.drive.controls import Seat
from urc.web.wire import ask as wire

__all__ = ["TOKEN_S", "WAIT_S", "Consent"]

WAIT_S: Final = 30.0
"""How long a second person has to say yes."""
TOKEN_S: Final = 5.0
"""How long a token counts."""
_MOST: Final = 8
"""Questions that wait at a time, and tokens of one screen."""


@dataclass(slots=True)
class _Question:
    number: int
    run: int
    asker: Seat
    command: str
    confirm: Confirm
    until_s: float
    answer: asyncio.Future[Seat | None]


class _Yes(NamedTuple):
    """What somebody has said yes to."""

    asker: Seat
    meant: bytes
    until_s: float


class Consent:
    """The questions of one robot."""

    def __init__(self, seats: Callable[[], tuple[Seat, ...]], clock: Clock) -> None:
        """Begin with none; `seats` are the screens that look at the robot now."""
        self._seats = seats
        self._clock = clock
        self._numbers = count(1)
        self._questions: dict[int, _Question] = {}
        self._tokens: dict[str, _Yes] = {}

    def prepare(self, asker: Seat, said: wire.Prepare) -> str:
        """Return a token for what somebody at this screen has said yes to."""
        now = self._clock.now()
        self._tokens = {key: yes for key, yes in self._tokens.items() if yes.until_s > now}
        mine = [key for key, yes in self._tokens.items() if yes.asker is asker]
        for key in mine[: len(mine) + 1 - _MOST]:
            del self._tokens[key]
        token = secrets.token_urlsafe(16)
        meant = _meant(said.command, said.arguments)
        self._tokens[token] = _Yes(asker, meant, now + TOKEN_S)
        return token

    async def people(
        self, asker: Seat, run: int, known: Command, arguments: Mapping[str, Reading], token: str
    ) -> tuple[str, ...]:
        """Return who has said yes to a command; nobody has to where nothing is asked.

        Args:
            asker: who gives it.
            run: its number on that screen.
            known: the command.
            arguments: what it is given with.
            token: of `prepare`; used up by this.

        Raises:
            CommandFailed: somebody must, and has not.
        """
        yes = self._tokens.pop(token, None)
        asks = questions(known, arguments)
        if not asks:
            return ()
        text = asks[0].text or known.title or known.name
        if not token:
            raise CommandFailed("not-confirmed", f"nobody was asked first: {text}")
        if yes is None or yes.asker is not asker or self._clock.now() >= yes.until_s:
            raise CommandFailed("not-confirmed", f"the yes is used up or too old: {text}")
        if yes.meant != _meant(known.name, arguments):
            raise CommandFailed("not-confirmed", f"the yes was to something else: {text}")
        two = next((one for one in asks if one.is_two_person), None)
        if two is None:
            return (asker.client.name,)
        return (asker.client.name, await self.second(asker, run, known.title or known.name, two))

    async def second(self, asker: Seat, run: int, command: str, confirm: Confirm) -> str:
        """Ask everybody else that may drive; return the name of who said yes.

        Args:
            asker: who gave the command, and has said yes.
            run: number of the command on that screen.
            command: what it is called.
            confirm: the question.

        Raises:
            CommandFailed: nobody did, in time; somebody said no; the asker took it back; or STOP
                was pressed.
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

    def stop(self) -> None:
        """End every question, and forget every yes: STOP was pressed."""
        self._tokens.clear()
        for one in self._questions.values():
            if not one.answer.done():
                one.answer.set_exception(CommandFailed("not-confirmed", STOPPED))

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


def _meant(command: str, arguments: Mapping[str, Reading]) -> bytes:
    return msgspec.json.encode([command, dict(arguments)], order="deterministic")
