"""The end of an encoding process, without a process."""

import asyncio
from typing import Any

import pytest

from urc.simulator.servers.video_encoder import VideoEncoder
from urc.testing.clock import settle

pytestmark = pytest.mark.anyio


class Process:
    """A process that ends when the test lets it."""

    def __init__(self) -> None:
        self.stdin = None
        self.kills = 0
        self.is_over = asyncio.Event()

    def kill(self) -> None:
        self.kills += 1

    async def wait(self) -> None:
        await self.is_over.wait()


async def test_a_process_is_waited_for_even_if_the_first_wait_is_cancelled() -> None:
    """Otherwise the system keeps it as a zombie."""
    encoder, process = VideoEncoder(), Process()
    made: Any = process
    encoder._process = made
    first = asyncio.create_task(encoder.close())
    await settle()
    first.cancel()
    await asyncio.gather(first, return_exceptions=True)
    second = asyncio.create_task(encoder.close())
    await settle()
    assert not second.done()
    process.is_over.set()
    await second
    assert process.kills == 2
    await encoder.close()
    assert process.kills == 2
