"""Runs blocking work in a daemon thread, without delaying the event loop or the process's exit.

A closing event loop waits for the threads of `asyncio.to_thread`. With `asyncio.to_thread`, a
repository that does not respond for two minutes would delay Ctrl-C by two minutes.
"""

import asyncio
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

__all__ = ["in_daemon"]

_T = TypeVar("_T")


def in_daemon(work: Callable[[], _T], name: str) -> "asyncio.Future[_T]":
    """Start `work` in a new thread; return a future for the result or exception.

    Cancelling the future discards the thread's result but does not stop the thread.
    """
    loop = asyncio.get_running_loop()
    future: asyncio.Future[_T] = loop.create_future()

    def settle(result: _T | None, fault: BaseException | None) -> None:
        if future.done():
            return
        if fault is not None:
            future.set_exception(fault)
        else:
            future.set_result(result)  # type: ignore[arg-type]  # a result is set

    def run() -> None:
        result: _T | None = None
        fault: BaseException | None = None
        try:
            result = work()
        except BaseException as error:
            fault = error
        with suppress(RuntimeError):  # the loop has closed
            loop.call_soon_threadsafe(settle, result, fault)

    threading.Thread(target=run, name=name, daemon=True).start()
    return future
