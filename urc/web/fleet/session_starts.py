"""Turns in which the robots of one server start their sessions.

Layer 5. The start of a session compiles the driver, which blocks the event loop for up to 40 ms.
It also launches a guard, which needs a processor for 0.1 to 0.3 s. Twenty guards that start
together leave the server too little processor time for the ticks of driven robots. Decision record:
docs/decisions/0052-sessions-start-in-turns.md.
"""

import asyncio
import os
from contextlib import AbstractAsyncContextManager, AsyncExitStack
from typing import Final, Protocol, TypeVar

__all__ = ["START_TIMEOUT_S", "SessionStarts"]

START_TIMEOUT_S: Final = 2.0
"""Maximum time for which a guard's start delays other starts, in seconds."""


class _Starting(Protocol):
    async def started(self) -> None: ...


_Session = TypeVar("_Session", bound=_Starting)


class SessionStarts:
    """The starts of sessions on one server, in the order of requests."""

    def __init__(self, *, at_once: int | None = None, timeout_s: float = START_TIMEOUT_S) -> None:
        """Begin without starts.

        Args:
            at_once: maximum number of guards that start at the same time; None for the number of
                processors.
            timeout_s: maximum time for which a guard's start delays other starts, in seconds.
        """
        self._at_once = (os.cpu_count() or 1) if at_once is None else at_once
        self._timeout_s = timeout_s
        self._starting = 0
        """Number of guards that are starting."""
        self._waiting: dict[object, asyncio.Future[None]] = {}
        """The robots that wait for their turn, oldest first."""
        self._blocking = asyncio.Lock()
        self._watched: set[asyncio.Task[None]] = set()

    async def enter(
        self,
        stack: AsyncExitStack,
        context: AbstractAsyncContextManager[_Session],
        robot: object,
        *,
        is_urgent: bool = False,
    ) -> _Session:
        """Wait for a turn, enter a session's context on `stack`, and return the session.

        The session is returned before its guard has started.

        Args:
            stack: the stack, which closes the session.
            context: context that opens the session.
            robot: key of the robot for `hurry`.
            is_urgent: whether the session starts without a turn, because it must send a stop.
        """
        await self._take_turn(robot, is_urgent=is_urgent)
        try:
            async with self._blocking:
                session = await stack.enter_async_context(context)
                await asyncio.sleep(0)  # handles the input of driven robots between two starts
        except BaseException:
            self._end_turn()
            raise
        task = asyncio.get_running_loop().create_task(self._end_turn_after(session))
        self._watched.add(task)
        task.add_done_callback(self._watched.discard)
        return session

    def hurry(self, robot: object) -> None:
        """Start a waiting robot's session now; for any other robot, do nothing."""
        turn = self._waiting.pop(robot, None)
        if turn is not None and not turn.cancelled():
            self._starting += 1
            turn.set_result(None)

    async def _take_turn(self, robot: object, *, is_urgent: bool) -> None:
        if is_urgent or self._starting < self._at_once:
            self._starting += 1
            return
        turn = self._waiting[robot] = asyncio.get_running_loop().create_future()
        try:
            await turn
        except asyncio.CancelledError:
            self._waiting.pop(robot, None)
            if not turn.cancelled():  # granted in the moment of the cancellation
                self._end_turn()
            raise

    def _end_turn(self) -> None:
        self._starting -= 1
        while self._waiting and self._starting < self._at_once:
            self.hurry(next(iter(self._waiting)))

    async def _end_turn_after(self, session: _Starting) -> None:
        try:
            async with asyncio.timeout(self._timeout_s):
                await session.started()
        except TimeoutError:
            pass
        finally:
            self._end_turn()
