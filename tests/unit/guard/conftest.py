"""Guards of one line, ended after each test."""

import asyncio
from collections.abc import AsyncIterator

import pytest

from tests.unit.guard.lines import Bench, CountedWire, Rig


@pytest.fixture
async def rigs() -> AsyncIterator[list[Rig]]:
    made: list[Rig] = []
    yield made
    for rig in made:
        finishing = asyncio.ensure_future(rig.guard.finish())
        while not finishing.done():
            await rig.clock.advance(0.1)


@pytest.fixture
async def rig(rigs: list[Rig]) -> Rig:
    rigs.append(Rig(CountedWire()))
    return rigs[-1]


@pytest.fixture
async def benches() -> AsyncIterator[list[Bench]]:
    made: list[Bench] = []
    yield made
    for bench in made:
        finishing = asyncio.ensure_future(bench.host.finish())
        while not finishing.done():
            await bench.clock.advance(0.1)
