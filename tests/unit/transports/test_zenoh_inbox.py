"""Samples of a Zenoh subscription are collected on the event loop, in bounded turns."""

from collections import deque

import zenoh

from urc.transports.zenoh_session import Inbox


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
