"""Work that may stall, in a thread that holds up neither the loop nor the end of the process.

Floor 5. `asyncio.to_thread` is waited for when the loop ends; a repository that stalls for two
minutes must not hold up Ctrl-C for two minutes.
"""

import asyncio
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import TypeVar

__all__ = ["in_daemon"]

_T = TypeVar("_T")


def in_daemon(work: Callable[[], _T], name: str) -> "asyncio.Future[_T]":
    """Start `work` in a thread of its own; return the future of what it returns or raises.

    Who cancels the future is not waited for: the thread goes on to its own end, unheard.
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
        with suppress(RuntimeError):  # the loop has ended meanwhile
            loop.call_soon_threadsafe(settle, result, fault)

    threading.Thread(target=run, name=name, daemon=True).start()
    return future
