"""The two-person rule: a command fails unless a second person approves it.

Layer 5. All pages and devices of one person count as one person and cannot approve that person's
commands. Programs are not people, so a token cannot approve a command. The local user counts as one
person. On a server without sign-in, each page of an unknown visitor counts as a separate person.
The number of pending questions and the time for an answer are limited.

The server represents each confirmation by a token. A token is valid once, for a few seconds, on one
page and for one command with unchanged arguments. The server therefore rejects replayed, changed
and delayed confirmations.
"""

import asyncio
import secrets
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import count
from typing import Final, NamedTuple

import msgspec

from urc.model.driver import STOPPED, Command
from urc.model.exchange import Confirm
from urc.model.role import includes
from urc.model.values import Reading
from urc.protocol.sequences.commands import questions
from urc.runtime.clock import Clock, within
from urc.runtime.session import CommandFailed
from urc.web.drive.control_service import OperatorSession
from urc.web.wire import ask as wire

__all__ = ["TOKEN_S", "WAIT_S", "TwoPersonRule"]

WAIT_S: Final = 30.0
"""Maximum wait for the second person's approval, in seconds."""
TOKEN_S: Final = 5.0
"""How long a token is valid, in seconds."""
_MOST: Final = 8
"""Maximum number of pending questions for each robot, and of tokens for each page."""


@dataclass(slots=True)
class _Question:
    number: int
    run: int
    asker: OperatorSession
    command: str
    confirm: Confirm
    until_s: float
    answer: asyncio.Future[OperatorSession | None]


class _Yes(NamedTuple):
    """A confirmed command with its arguments."""

    asker: OperatorSession
    meant: bytes
    until_s: float


class TwoPersonRule:
    """The pending questions and the valid tokens of one robot."""

    def __init__(self, operators: Callable[[], tuple[OperatorSession, ...]], clock: Clock) -> None:
        """Start with no questions; `operators` returns the sessions of the robot's pages."""
        self._operators = operators
        self._clock = clock
        self._numbers = count(1)
        self._questions: dict[int, _Question] = {}
        self._tokens: dict[str, _Yes] = {}

    def prepare(self, asker: OperatorSession, said: wire.ApprovalRequest) -> str:
        """Return a new token for a confirmation by the page `asker`."""
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
        self,
        asker: OperatorSession,
        run: int,
        known: Command,
        arguments: Mapping[str, Reading],
        token: str,
    ) -> tuple[str, ...]:
        """Return the names of the people who confirmed a command; () if it needs no confirmation.

        Args:
            asker: the page that runs the command.
            run: the page's number for this run of the command.
            known: the command.
            arguments: the command's arguments.
            token: single-use token from `prepare`; "" if the operator confirmed nothing.

        Raises:
            CommandFailed: a confirmation is missing, invalid or for other arguments.
        """
        yes = self._tokens.pop(token, None)
        asks = questions(known, arguments)
        if not asks:
            return ()
        text = asks[0].text or known.title or known.name
        if not token:
            raise CommandFailed("not-confirmed", f"a confirmation is missing: {text}")
        if yes is None or yes.asker is not asker or self._clock.now() >= yes.until_s:
            raise CommandFailed("not-confirmed", f"the confirmation is no longer valid: {text}")
        if yes.meant != _meant(known.name, arguments):
            raise CommandFailed("not-confirmed", f"the confirmation does not match: {text}")
        two = next((one for one in asks if one.is_two_person), None)
        if two is None:
            return (asker.client.name,)
        return (asker.client.name, await self.second(asker, run, known.title or known.name, two))

    async def second(self, asker: OperatorSession, run: int, command: str, confirm: Confirm) -> str:
        """Request approval from all pages that may approve; return the second person's name.

        `run` is the asking page's number for this run of the command.

        Raises:
            CommandFailed: the approval was refused, withdrawn or too late, STOP was pressed, or too
                many questions are pending.
        """
        if len(self._questions) >= _MOST:
            raise CommandFailed(
                "busy", f"{_MOST} questions are already waiting for a second person"
            )
        answer: asyncio.Future[OperatorSession | None] = asyncio.get_running_loop().create_future()
        until_s = self._clock.now() + WAIT_S
        one = _Question(next(self._numbers), run, asker, command, confirm, until_s, answer)
        self._questions[one.number] = one
        for operator in self._operators():
            self._send(operator, one)
        try:
            async with within(self._clock, WAIT_S):
                second = await answer
        except TimeoutError:
            text = f"{confirm.text}: no second person approved within {WAIT_S:g} s"
            raise CommandFailed("not-confirmed", text) from None
        finally:
            del self._questions[one.number]
            for each in self._operators():
                each.notice(f"ask {one.number}", wire.encode_asked(one.number))
        if second is None:
            raise CommandFailed("not-confirmed", f"{confirm.text}: refused by another operator")
        return second.client.name

    def stop(self) -> None:
        """Cancel all questions and revoke all tokens, because STOP was pressed."""
        self._tokens.clear()
        for one in self._questions.values():
            if not one.answer.done():
                one.answer.set_exception(CommandFailed("not-confirmed", STOPPED))

    def welcome(self, operator: OperatorSession) -> None:
        """Send all pending questions to a new page."""
        for one in self._questions.values():
            self._send(operator, one)

    def handle(self, operator: OperatorSession, said: wire.Approval) -> None:
        """Handle a page's answer; ignore answers to questions that have ended."""
        one = self._questions.get(said.n)
        if one is None or one.answer.done() or not includes(operator.client.role, "drive"):
            return
        is_second = _is_second(operator, one.asker)
        if not said.yes and (is_second or operator is one.asker):
            one.answer.set_result(None)
        elif said.yes and is_second:
            one.answer.set_result(operator)

    def _send(self, operator: OperatorSession, one: _Question) -> None:
        may_approve = includes(operator.client.role, "drive")
        may_approve = may_approve and _is_second(operator, one.asker)
        if not may_approve and operator is not one.asker:
            return
        text = wire.encode_ask(
            one.number,
            one.run if operator is one.asker else 0,
            one.asker.client.name,
            one.command,
            one.confirm.text,
            one.confirm.level,
            max(0.0, one.until_s - self._clock.now()),
        )
        operator.notice(f"ask {one.number}", text)


def _is_second(one: OperatorSession, asker: OperatorSession) -> bool:
    """Return whether `one` may count as the second person for the asker's command."""
    if one.client.kind == "program":
        return False
    if one.client.person and asker.client.person:
        return one.client.person != asker.client.person
    return one is not asker


def _meant(command: str, arguments: Mapping[str, Reading]) -> bytes:
    return msgspec.json.encode([command, dict(arguments)], order="deterministic")
