"""A dashboard and its watching pages, for measuring the server's processor time for each update."""

import asyncio
import json
import socket
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager

from starlette.types import ASGIApp

from urc.web.app import serve

__all__ = ["Robot", "Tally", "cost_s", "serving", "speaking"]

READY_S = 20.0
Tally = list[tuple[int, int]]
"""Number of messages and bytes received by each page."""


@asynccontextmanager
async def serving(app: ASGIApp) -> AsyncIterator[int]:
    """Serve an application in this event loop; yield the server's port."""
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
    """Return this process's processor time during `play`, and the data received by each page."""
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
                raise SystemExit("bench: the pages did not connect")
            await asyncio.sleep(0.2)  # the first state of every page
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


class Robot:
    """A process that sends data at a fixed rate, like a robot."""

    def __init__(self, line: socket.socket, ticks: int) -> None:
        self._line = line
        self._ticks = ticks

    async def heard(self, tell: Callable[[int], None]) -> None:
        """Start the robot; call `tell` for each received chunk of data, until the robot ends."""
        loop = asyncio.get_running_loop()
        done = loop.create_future()
        tick = 0

        def come() -> None:
            nonlocal tick
            if self._line.recv(1):
                tell(tick)
                tick += 1
            elif not done.done():
                done.set_result(None)

        loop.add_reader(self._line, come)
        try:
            self._line.send(b"!")
            async with asyncio.timeout(READY_S):
                await done
        finally:
            loop.remove_reader(self._line)
        if tick != self._ticks:
            raise SystemExit("bench: the robot stopped sending")


@asynccontextmanager
async def speaking(ticks: int, rate_hz: float) -> AsyncIterator[Robot]:
    """Start a robot, which waits until it receives data.

    Like a real robot, the process wakes the server by making a socket readable. A timer in the
    server's process would use several times as much processor time and distort the measurement.
    """
    ours, theirs = socket.socketpair()
    with ours, theirs:
        ours.setblocking(False)
        number = str(theirs.fileno())
        command = (sys.executable, "-m", "bench.robot", number, str(ticks), str(rate_hz))
        robot = await asyncio.create_subprocess_exec(*command, pass_fds=(theirs.fileno(),))
        theirs.close()
        try:
            yield Robot(ours, ticks)
        finally:
            if robot.returncode is None:
                robot.kill()
            await robot.wait()
