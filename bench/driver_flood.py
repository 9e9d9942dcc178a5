"""Processor time for a flood of lines over a real socket, compared with a hand-written driver.

The benchmark measures the CPU time of this process, from the request until each signal's newest
value is stored.
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

LINES = 60_000
WARM_UP = 1000


class Driver(Protocol):
    """The interface that URC's driver and the hand-written driver share."""

    async def flood(self, count: int) -> None:
        """Request `count` lines, and wait until all lines have arrived."""


async def _measure(driver: Driver) -> float:
    await driver.flood(WARM_UP)
    began = time.process_time()
    await driver.flood(LINES)
    return time.process_time() - began


async def _by_hand(port: int) -> float:
    driver = await StreamDriver.connect(port)
    try:
        taken = await _measure(driver)
        assert len(driver.latest) == 14
        assert not driver.faults
        return taken
    finally:
        await driver.close()


def run(*, full: bool = False) -> Sequence[Result]:
    """Measure `LINES` lines."""
    loaded = profile()

    async def ours(port: int) -> float:
        async with declared(loaded, port) as driver:
            taken = await _measure(driver)
            hub = driver.hub
            assert len(hub.changed_since(0)) == 14
            assert not hub.links["wire"].faults
            return taken

    def seconds(work: Callable[[int], Coroutine[Any, Any, float]], port: int) -> float:
        return asyncio.run(work(port))

    with robot(is_beside=False) as port:
        return compare_all(
            [
                (
                    Goal("driver_flood: 60 000 lines, CPU / hand split on StreamReader", 1.5),
                    partial(seconds, _by_hand, port),
                ),
            ],
            partial(seconds, ours, port),
            rounds=25 if full else 9,
            versions={"python": platform.python_version()},
        )
