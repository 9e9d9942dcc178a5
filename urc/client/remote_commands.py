"""The commands that a program sends to a server, and their pending replies.

Layer 5. The server sends exactly one reply to each command. If the connection is lost, a pending
command's outcome is unknown, so the command fails and is never repeated.
"""

import asyncio
from itertools import count
from typing import Any, Final, TypeVar

from urc.client.robot_socket import RobotSocket
from urc.runtime.command_failed import CommandFailed
from urc.wire.client_messages import ApprovalRequest, Arguments, CommandRequest
from urc.wire.server_messages import ReplyMessage, TokenMessage

__all__ = ["RemoteCommands"]

_MOST_PENDING: Final = 64
_MISSING: Final = "a confirmation is missing"
_Answer = TypeVar("_Answer")


class RemoteCommands:
    """Sends commands to a server's robot, and waits for the replies."""

    def __init__(self, socket: RobotSocket) -> None:
        """Initialise without pending commands; nothing is sent."""
        self._socket = socket
        self._numbers = count(1)
        self._replies: dict[int, asyncio.Future[ReplyMessage]] = {}
        self._tokens: dict[int, asyncio.Future[str]] = {}

    async def run(self, name: str, arguments: Arguments, stops: int | None) -> ReplyMessage:
        """Run a command and return its reply.

        Args:
            name: the command's name.
            arguments: its arguments.
            stops: number of STOPs that the program knows of; None to skip the check.

        Raises:
            CommandFailed: the connection is down, was lost before the reply, or has too many
                pending commands.
        """
        reply = await self._run(name, arguments, stops, "")
        if reply.code == "not-confirmed" and reply.message.startswith(_MISSING):
            # The program's call is the confirmation; the server requests a second person's
            # approval.
            token = await self._token(name, arguments, stops)
            reply = await self._run(name, arguments, stops, token)
        return reply

    def handle(self, message: ReplyMessage | TokenMessage) -> None:
        """Pass a reply or a confirmation token from the server to the call that waits for it."""
        if isinstance(message, ReplyMessage):
            _resolve(self._replies.get(message.id), message)
        else:
            _resolve(self._tokens.get(message.id), message.token)

    def lost(self, reason: str) -> None:
        """Make all pending commands fail for the given reason."""
        failed = CommandFailed("disconnected", f"{reason}; the outcome is unknown")
        waiting: list[asyncio.Future[Any]] = [*self._replies.values(), *self._tokens.values()]
        for pending in waiting:
            if not pending.done():
                pending.set_exception(failed)

    async def _run(
        self, name: str, arguments: Arguments, stops: int | None, token: str
    ) -> ReplyMessage:
        number = next(self._numbers)
        request = CommandRequest(number, name, arguments, token, stops)
        return await self._answer(self._replies, number, request)

    async def _token(self, name: str, arguments: Arguments, stops: int | None) -> str:
        number = next(self._numbers)
        request = ApprovalRequest(number, name, arguments, stops)
        return await self._answer(self._tokens, number, request)

    async def _answer(
        self,
        pending: "dict[int, asyncio.Future[_Answer]]",
        number: int,
        request: CommandRequest | ApprovalRequest,
    ) -> _Answer:
        if len(pending) >= _MOST_PENDING:
            raise CommandFailed("busy", f"{_MOST_PENDING} commands are still running")
        answer: asyncio.Future[_Answer] = asyncio.get_running_loop().create_future()
        pending[number] = answer
        try:
            if not self._socket.send(request):
                raise CommandFailed("disconnected", "no connection to the server")
            return await answer
        finally:
            del pending[number]


def _resolve(answer: "asyncio.Future[_Answer] | None", value: _Answer) -> None:
    if answer is not None and not answer.done():
        answer.set_result(value)
