"""A dashboard with pages that look at it: what one delivery costs the server, in processor time."""

import asyncio
import json
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

from starlette.types import ASGIApp

from urc.web.app import serve

__all__ = ["Tally", "cost_s", "serving", "ticking"]

READY_S = 20.0
Tally = list[tuple[int, int]]
"""Messages and bytes of each page."""


@asynccontextmanager
async def serving(app: ASGIApp) -> AsyncIterator[int]:
    """Serve an application in this loop; give its port."""
    ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    task = asyncio.create_task(serve(app, port=0, on_ready=ready.set_result))
    try:
        address = await asyncio.wait_for(ready, READY_S)
        yield int(address.rstrip("/").rpartition(":")[2])
    finally:
        task.cancel()
        await asyncio.wait((task,), timeout=READY_S)


async def cost_s(
    app: ASGIApp, path: str, clients: int, shown: list[str], play: Callable[[], Awaitable[None]]
) -> tuple[float, Tally]:
    """Return the processor time of `play` in this process, and what each page got of it."""
    async with serving(app) as port:
        command = (sys.executable, "-m", "bench.viewers", str(port), path, str(clients), *shown)
        viewers = await asyncio.create_subprocess_exec(
            *command, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE
        )
        assert viewers.stdin is not None
        assert viewers.stdout is not None
        try:
            said = await asyncio.wait_for(viewers.stdout.readline(), READY_S)
            if said.strip() != b"ready":
                raise SystemExit("bench: the pages did not come up")
            await asyncio.sleep(0.2)  # what every page is told at first
            began_s = time.process_time()
            await play()
            spent_s = time.process_time() - began_s
            viewers.stdin.close()
            told = await asyncio.wait_for(viewers.stdout.readline(), READY_S)
        finally:
            if viewers.returncode is None:
                viewers.kill()
            await viewers.wait()
    return spent_s, [(int(messages), int(size)) for messages, size in json.loads(told)]


async def ticking(tell: Callable[[int], None], ticks: int, rate_hz: float) -> None:
    """Call `tell` at a rate, as a robot's line does when something came: in no task of its own."""
    loop = asyncio.get_running_loop()
    done = loop.create_future()

    def step(tick: int) -> None:
        if tick == ticks:
            done.set_result(None)
        else:
            loop.call_later(1 / rate_hz, step, tick + 1)
            tell(tick)

    step(0)
    await done
