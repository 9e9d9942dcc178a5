"""Samples of a Zenoh subscription are collected on the event loop, in bounded turns."""

import asyncio
from collections import deque
from typing import Any

import pytest
import zenoh

from urc.transports.zenoh_options import ZenohOptions
from urc.transports.zenoh_session import Inbox, ZenohSession

uvloop = pytest.importorskip("uvloop")


class Subscriber:
    """A subscriber of the library, with waiting samples."""

    def __init__(self, count: int) -> None:
        self.waiting = deque(range(count))
        self.is_over = False

    def try_recv(self) -> int | None:
        if self.is_over:
            raise zenoh.ZError
        return self.waiting.popleft() if self.waiting else None


def test_samples_arrive_in_order_and_a_flood_takes_several_turns() -> None:
    """The event loop has other work than one subscription."""
    subscriber, taken = Subscriber(100), list[int]()
    inbox = Inbox(subscriber, taken.append)
    assert inbox.collect()
    assert 0 < len(taken) < 100
    while inbox.collect():
        pass
    assert taken == list(range(100))
    assert not inbox.collect()


def test_the_end_of_the_connection_ends_the_collection() -> None:
    """The relay reports why it has ended."""
    subscriber, taken = Subscriber(5), list[int]()
    subscriber.is_over = True
    assert not Inbox(subscriber, taken.append).collect()
    assert not taken


async def flooded() -> list[int]:
    """Return what a session receives in several turns, while more data arrives."""
    stream: Any = None
    session, taken = ZenohSession(ZenohOptions("127.0.0.1", 7447), stream), list[int]()
    session._session = object()
    session.receive(lambda handler: Subscriber(100), taken.append)
    session._collect()
    assert len(taken) < 100
    session._collect_soon()
    for _ in range(10):
        await asyncio.sleep(0)
    return taken


def test_more_data_does_not_end_the_collection_of_a_flood() -> None:
    assert asyncio.Runner(loop_factory=uvloop.new_event_loop).run(flooded()) == list(range(100))
