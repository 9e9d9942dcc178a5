"""Blocking work in a thread that delays neither the loop nor the exit of the process.

A closing loop waits for threads of `asyncio.to_thread`, so this module has its own. A repository
that hangs for two minutes must not delay Ctrl-C by two minutes.
"""

import asyncio
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

__all__ = ["in_daemon"]

_T = TypeVar("_T")


def in_daemon(work: Callable[[], _T], name: str) -> "asyncio.Future[_T]":
    """Start `work` in a new thread; return a future of its result or exception.

    A cancelled future does not stop the thread, whose result is then discarded.
    """
    loop = asyncio.get_running_loop()
    future: asyncio.Future[_T] = loop.create_future()

    def settle(result: _T | None, fault: BaseException | None) -> None:
        if future.done():
            return
        if fault is not None:
            future.set_exception(fault)
        else:
            future.set_result(result)  # type: ignore[arg-type]  # without a fault there is one

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
