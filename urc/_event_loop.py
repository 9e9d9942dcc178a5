"""Event loop for processes that move robots: uvloop, if installed."""

import asyncio
import sys
from collections.abc import Callable, Coroutine
from typing import Any, TypeVar

__all__ = ["run"]

_Result = TypeVar("_Result")


def run(work: Coroutine[Any, Any, _Result]) -> _Result:
    """Run `work` to completion, like `asyncio.run`, but on the fastest available event loop."""
    with asyncio.Runner(loop_factory=_fastest()) as runner:
        return runner.run(work)


def _fastest() -> Callable[[], asyncio.AbstractEventLoop] | None:
    """Return the factory of the fastest available event loop; None for Python's default."""
    if sys.platform == "win32":  # Windows' default loop cannot watch the pipe to the guard
        return asyncio.SelectorEventLoop
    try:
        import uvloop
    except ImportError:
        return None
    make: Callable[[], asyncio.AbstractEventLoop] = uvloop.new_event_loop
    return make
