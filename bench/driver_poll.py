"""Processor time for a request and its reply over a socket, compared with a hand-written driver.

The benchmark measures the CPU time of this process; all drivers use the same robot in another
process. Each round opens a new connection, and sends `TIMES` requests after a warm-up.
"""

import asyncio
import platform
import time
from collections.abc import Callable, Coroutine, Sequence
from functools import partial
from typing import Any, Protocol

from bench.driver_hand import StreamDriver
from bench.driver_robot import robot
from bench.driver_urc import declared, profile
from bench.harness import Goal, Result, compare_all

TIMES = 1500
WARM_UP = 100
ANSWER = {"x": 1.25, "y": -0.337, "heading": 90.5}


class Driver(Protocol):
    """The interface of the compared drivers."""

    async def drive(self, vx: float, wz: float) -> dict[str, object]:
        """Send a speed, and return the robot's reply."""


async def _measure(driver: Driver) -> float:
    for _ in range(WARM_UP):
        assert await driver.drive(0.25, -1.5) == ANSWER
    began = time.process_time()
    for _ in range(TIMES):
        await driver.drive(0.25, -1.5)
    return time.process_time() - began


async def _by_hand(port: int) -> float:
    driver = await StreamDriver.connect(port)
    try:
        return await _measure(driver)
    finally:
        await driver.close()


def run(*, full: bool = False) -> Sequence[Result]:
    """Compare the drivers' processor times for a command and its reply."""
    loaded = profile()

    async def ours(port: int) -> float:
        async with declared(loaded, port) as driver:
            return await _measure(driver)

    def seconds(work: Callable[[int], Coroutine[Any, Any, float]], port: int) -> float:
        return asyncio.run(work(port))

    with robot(is_beside=True) as port:
        return compare_all(
            [
                (
                    Goal("driver_poll: command and reply over TCP, CPU / hand StreamReader", 1.2),
                    partial(seconds, _by_hand, port),
                ),
            ],
            partial(seconds, ours, port),
            rounds=25 if full else 9,
            versions={"python": platform.python_version()},
        )
