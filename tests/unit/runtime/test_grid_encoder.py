"""Occupancy grids are encoded in a thread: the loop goes on, the newest wins, nothing piles up."""

import asyncio
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.unit.protocol.test_occupancy_grid import PROFILE, grid
from tests.unit.runtime.test_dispatcher import Port
from urc.config.load import load_profile
from urc.model.payload import Envelope
from urc.model.values import Sample
from urc.protocol.engine import Engine
from urc.protocol.values.occupancy_grid import Grid, UnencodedGrid, encode_grid, read_grid
from urc.runtime.clock import LoopClock
from urc.runtime.dispatcher import Dispatcher
from urc.runtime.grid_encoder import GridEncoder
from urc.runtime.hub import Hub
from urc.runtime.registries import built_in_catalog

pytestmark = pytest.mark.anyio

WAIT_S = 10.0


class Gate:
    """Encodes grids only while it is open, and remembers which grids it was given."""

    def __init__(self) -> None:
        self.open = threading.Event()
        self.given: list[Grid] = []

    def encode(self, one: Grid) -> bytes:
        self.given.append(one)
        assert self.open.wait(WAIT_S)
        return encode_grid(one)


def sample(cell: int, signal: str = "floor", at_s: float = 1.0) -> Sample:
    one = Grid(1, 1, 0.05, 0.0, 0.0, 0.0, "map", bytes([cell]))
    return Sample(signal, UnencodedGrid(one), at_s, "")  # type: ignore[arg-type]


def cells(found: list[Sample]) -> list[tuple[str, bytes | None, float]]:
    values = ((one, one.value if isinstance(one.value, bytes) else None) for one in found)
    return [
        (one.signal, None if image is None else read_grid(image).cells, one.time_s)
        for one, image in values
    ]


async def until(is_so: Callable[[], object]) -> None:
    async with asyncio.timeout(WAIT_S):
        while not is_so():  # noqa: ASYNC110 - a thread changes the state
            await asyncio.sleep(0.005)


async def test_the_loop_goes_on_and_of_many_grids_the_newest_is_published() -> None:
    gate, told = Gate(), list[Sample]()
    encoder = GridEncoder(told.extend, gate.encode)
    for number in range(1000):
        assert encoder.take([sample(number % 100, at_s=number)]) == []
        if number == 0:
            await until(lambda: gate.given)
    assert len(gate.given) == 1, "one grid is in the thread, and one waits"
    assert told == []
    gate.open.set()
    await until(lambda: len(told) == 2)
    assert cells(told) == [("floor", b"\0", 0), ("floor", bytes([99]), 999)]
    assert len(gate.given) == 2


async def test_a_fast_costmap_does_not_delay_the_map_for_ever() -> None:
    gate, told = Gate(), list[Sample]()
    encoder = GridEncoder(told.extend, gate.encode)
    encoder.take([sample(1, "costs"), sample(2)])
    await until(lambda: gate.given)
    for number in range(3, 50):
        encoder.take([sample(number, "costs")])
    gate.open.set()
    await until(lambda: len(told) == 3)
    assert [one.signal for one in told] == ["costs", "floor", "costs"]


async def test_a_grid_that_is_not_available_any_more_is_not_overtaken_by_an_older_one() -> None:
    gate, told = Gate(), list[Sample]()
    encoder = GridEncoder(told.extend, gate.encode)
    encoder.take([sample(1)])
    await until(lambda: gate.given)
    encoder.take([sample(2)])
    nothing = Sample("floor", None, 2.0, "")
    assert encoder.take([nothing]) == [nothing]
    encoder.take([sample(3, "costs")])
    gate.open.set()
    await until(lambda: told)
    assert cells(told) == [("costs", bytes([3]), 1.0)]


async def test_a_repeated_grid_is_not_encoded_again_and_keeps_its_own_time() -> None:
    gate, told = Gate(), list[Sample]()
    gate.open.set()
    encoder = GridEncoder(told.extend, gate.encode)
    first = sample(1)
    encoder.take([first])
    await until(lambda: told)
    encoder.take([first._replace(time_s=7.0)])
    assert cells(told) == [("floor", b"\1", 1.0), ("floor", b"\1", 7.0)]
    assert len(gate.given) == 1


async def test_a_grid_that_cannot_be_encoded_does_not_stop_the_others() -> None:
    told: list[Sample] = []

    def encode(one: Grid) -> bytes:
        if one.cells == b"\1":
            raise MemoryError
        return encode_grid(one)

    encoder = GridEncoder(told.extend, encode)
    encoder.take([sample(1), sample(2, "costs")])
    await until(lambda: told)
    encoder.take([sample(3)])
    await until(lambda: len(told) == 2)
    assert cells(told) == [("costs", b"\2", 1.0), ("floor", b"\3", 1.0)]


async def test_a_closed_encoder_publishes_nothing() -> None:
    gate, told = Gate(), list[Sample]()
    encoder = GridEncoder(told.extend, gate.encode)
    encoder.take([sample(1), sample(2, "costs")])
    await until(lambda: gate.given)
    encoder.close()
    gate.open.set()
    await asyncio.sleep(0.1)
    assert told == []
    assert len(gate.given) == 1


class HeardPort(Port):
    """The link of a robot whose frames are valid."""

    def frame_received(self) -> None: ...


async def test_a_map_and_its_updates_reach_the_hub_through_the_thread(tmp_path: Path) -> None:
    """The engine of a session keeps the cells, so an update needs no image before it."""
    path = tmp_path / "mapper.yaml"
    path.write_text(PROFILE)
    driver = load_profile(path, built_in_catalog()).driver
    engine = Engine(driver, {"host": "127.0.0.1"}, is_compiled=True)
    engine.readings.defer_grids()
    hub = Hub(driver.signals)
    gate = Gate()
    encoder = GridEncoder(hub.publish, gate.encode)
    dispatcher = Dispatcher(engine, hub, LoopClock(), driver.commands, lambda _: 1.0, grids=encoder)
    dispatcher.attach("ros", HeardPort())
    dispatcher.start("ros")

    def hear(topic: str, body: object) -> None:
        dispatcher.receive("ros", Envelope("message", {"topic": topic}, body), 5.0)

    hear("/map", grid(2, 1, [0, 0]))
    await until(lambda: gate.given)
    for cell in (1, 2, 3):
        hear("/map_updates", {"x": 1, "y": 0, "width": 1, "height": 1, "data": [cell]})
    gate.open.set()

    def found() -> bytes | None:
        value = hub.latest("floor")
        return read_grid(value.value).cells if value and isinstance(value.value, bytes) else None

    await until(lambda: found() == b"\0\3")
    assert len(gate.given) == 2
    dispatcher.stop("the test is over")
