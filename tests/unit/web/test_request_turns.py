"""Turns for requests: a crowd does not fill an iteration of the event loop."""

import asyncio
from functools import partial

import pytest

from urc.web.serve.request_turns import RequestTurns

pytestmark = pytest.mark.anyio


class Crowd:
    """Connections whose requests are read in turn."""

    def __init__(self, turns: RequestTurns) -> None:
        self.turns = turns
        self.read: list[int] = []
        """Numbers of the connections, in the order of their turns."""

    def arrive(self, *numbers: int) -> None:
        """Let a request arrive on each connection."""
        for number in numbers:
            is_read = self.turns.take(number, partial(self.read.append, number))
            assert is_read == (number in self.read)


async def test_a_request_alone_is_read_at_once() -> None:
    crowd = Crowd(RequestTurns(most=2))
    crowd.arrive(1)
    assert crowd.read == [1]


async def test_a_crowd_is_read_in_several_iterations_in_the_order_of_arrival() -> None:
    crowd = Crowd(RequestTurns(most=2))
    crowd.arrive(1, 2, 3, 4, 5)
    sizes = [len(crowd.read)]
    while len(crowd.read) < 5:
        await asyncio.sleep(0)
        sizes.append(len(crowd.read))
    assert sizes == [2, 4, 5]
    assert crowd.read == [1, 2, 3, 4, 5]


async def test_who_comes_later_does_not_overtake() -> None:
    crowd = Crowd(RequestTurns(most=1))
    crowd.arrive(1, 2, 3)
    await asyncio.sleep(0)
    crowd.arrive(4)
    for _ in range(3):
        await asyncio.sleep(0)
    assert crowd.read == [1, 2, 3, 4]


async def test_a_waiting_connection_has_one_place() -> None:
    crowd = Crowd(RequestTurns(most=1))
    crowd.arrive(1, 2, 2, 2, 3)
    for _ in range(5):
        await asyncio.sleep(0)
    assert crowd.read == [1, 2, 3]


async def test_a_lost_connection_leaves_the_queue() -> None:
    crowd = Crowd(RequestTurns(most=1))
    crowd.arrive(1, 2, 3)
    crowd.turns.remove(2)
    for _ in range(3):
        await asyncio.sleep(0)
    assert crowd.read == [1, 3]


async def test_an_error_of_one_request_does_not_end_the_turns_of_others() -> None:
    """A fault in one connection must not leave all others unread."""
    loop = asyncio.get_running_loop()
    told: list[dict[str, object]] = []
    loop.set_exception_handler(lambda _, context: told.append(context))
    crowd = Crowd(RequestTurns(most=1))

    def fail() -> None:
        raise ValueError("broken")

    crowd.arrive(1)
    crowd.turns.take(2, fail)
    crowd.arrive(3)
    for _ in range(3):
        await asyncio.sleep(0)
    assert crowd.read == [1, 3]
    assert len(told) == 1
