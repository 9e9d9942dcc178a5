"""What a transport must not leave behind: tasks, threads, sockets, files."""

import asyncio
import gc
import os
import sys
import threading
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

__all__ = ["nothing_left"]

SETTLED_WITHIN_S = 20.0
"""The other side of a socket in this process, and a thread that was told to end, take a moment."""


@asynccontextmanager
async def nothing_left() -> AsyncIterator[None]:
    """Fail when there is more of anything after the block than before it."""
    gc.collect()
    before = _inventory()
    yield
    loop = asyncio.get_running_loop()
    until = loop.time() + SETTLED_WITHIN_S
    while True:
        gc.collect()
        more = _inventory() - before
        if not more or loop.time() > until:
            break
        await asyncio.sleep(0.02)
    assert not more, f"left behind: {', '.join(sorted(more))}"


def _inventory() -> Counter[str]:
    things = [f"task {task.get_coro()}" for task in asyncio.all_tasks()]
    # The loop's pool keeps its threads, whoever used it first.
    things += [
        f"thread {thread.name}"
        for thread in threading.enumerate()
        if not thread.name.startswith("asyncio_")
    ]
    return Counter(things) + _files()


def _files() -> Counter[str]:
    if sys.platform != "linux":
        return Counter()
    found: Counter[str] = Counter()
    for number in os.listdir("/proc/self/fd"):
        try:
            target = os.readlink(f"/proc/self/fd/{number}")
        except OSError:  # the one that lists the folder
            continue
        found[f"file {target.partition(':')[0]}"] += 1  # by kind: numbers are used again
    return found
