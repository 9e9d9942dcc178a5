"""An event loop in a daemon thread, for programs without ``async``.

Layer 5. The thread never prevents the process from exiting. Every call into the thread has a time
limit.
"""

import asyncio
import threading
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import CancelledError, Future
from contextlib import AbstractAsyncContextManager, contextmanager, suppress
from typing import Any, Final, TypeVar

__all__ = ["LoopThread"]

_CLOSE_S: Final = 15.0
"""Maximum time for closing a robot, in seconds."""

_Result = TypeVar("_Result")
_Entered = TypeVar("_Entered")


class LoopThread:
    """A daemon thread with an event loop; the thread never prevents the process from exiting."""

    def __init__(self, timeout_s: float) -> None:
        self.timeout_s = timeout_s
        self.loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="urc-client", daemon=True)
        self._thread.start()

    def call(self, work: Coroutine[Any, Any, _Result], timeout_s: float | None = None) -> _Result:
        """Run `work` on the loop and return its result.

        Raises:
            TimeoutError: the time limit has passed; `work` was cancelled.
        """
        limit_s = self.timeout_s if timeout_s is None else timeout_s
        found: Future[_Result] = asyncio.run_coroutine_threadsafe(work, self.loop)
        try:
            return found.result(limit_s)
        except TimeoutError:
            if found.done():
                raise  # a time limit inside `work` expired
            found.cancel()
            raise TimeoutError(f"the call took longer than {limit_s:g} s") from None
        except BaseException:  # Ctrl-C: the call must not continue
            found.cancel()
            raise

    @contextmanager
    def entered(
        self, opening: "Callable[[], AbstractAsyncContextManager[_Entered]]"
    ) -> "Iterator[_Entered]":
        """Keep an asynchronous context open; its exit always runs, within a time limit."""
        # One task enters and leaves the context, because time limits inside it belong to a task.
        inside: Future[_Entered] = Future()
        leave = asyncio.Event()

        async def stay() -> None:
            async with opening() as value:
                inside.set_result(value)
                await leave.wait()

        staying = asyncio.run_coroutine_threadsafe(stay(), self.loop)
        staying.add_done_callback(lambda ended: _tell(inside, ended))
        try:
            yield inside.result(self.timeout_s + _CLOSE_S)
        except BaseException:
            if inside.done():
                self._leave(leave)
            else:
                staying.cancel()
            _wait_quietly(staying)
            raise
        self._leave(leave)
        staying.result(_CLOSE_S)

    def _leave(self, leave: asyncio.Event) -> None:
        self.loop.call_soon_threadsafe(leave.set)

    def close(self) -> None:
        """Stop the loop, and wait until the thread has ended."""
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join(_CLOSE_S)

    def _run(self) -> None:
        try:
            self.loop.run_forever()
            for task in asyncio.all_tasks(self.loop):
                task.cancel()
            self.loop.run_until_complete(self.loop.shutdown_asyncgens())
        finally:
            self.loop.close()


def _tell(inside: "Future[_Entered]", ended: "Future[None]") -> None:
    """Report to the caller that a context failed before it was open."""
    if not inside.done():
        fault = None if ended.cancelled() else ended.exception()
        inside.set_exception(fault or TimeoutError("the robot was not opened in time"))


def _wait_quietly(staying: "Future[None]") -> None:
    """Wait until a context whose block raised an error has ended; ignore further errors."""
    with suppress(Exception, CancelledError):
        staying.result(_CLOSE_S)
