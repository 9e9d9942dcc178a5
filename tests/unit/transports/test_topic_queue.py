"""What waits on a line of topics: bounded, in order, the newest of each topic kept."""

import asyncio

from urc.model.payload import LOST, Envelope
from urc.transports.topic_queue import (
    ALL_BYTES,
    ANSWERS,
    MESSAGES,
    TOPIC_BYTES,
    TOPIC_MESSAGES,
    TopicReceiveQueue,
)


def message(topic: str, number: int) -> Envelope:
    return Envelope("message", {"topic": topic}, number)


def taken(queue: TopicReceiveQueue, count: int) -> list[object]:
    async def take() -> list[object]:
        return [(await queue.pop()).body for _ in range(count)]

    return asyncio.run(take())


def filled(*arrivals: tuple[str, int, int]) -> TopicReceiveQueue:
    queue = TopicReceiveQueue()
    for topic, number, size in arrivals:
        queue.message(topic, message(topic, number), size)
    return queue


def test_messages_come_in_the_order_of_their_arrival() -> None:
    """Across topics, and answers among them."""
    queue = filled(("a", 1, 10), ("b", 2, 10))
    queue.answer(Envelope("response", {"id": 1}, 3))
    queue.message("a", message("a", 4), 10)
    assert taken(queue, 4) == [1, 2, 3, 4]
    assert queue.dropped == 0


def test_oldest_of_a_busy_topic_go_and_a_quiet_one_keeps_its_own() -> None:
    """The newest always is there."""
    many = TOPIC_MESSAGES + 10
    queue = filled(("quiet", -1, 10), *(("busy", number, 10) for number in range(many)))
    assert queue.dropped == 10
    assert taken(queue, TOPIC_MESSAGES + 1) == [-1, *range(10, many)]


def test_answers_count_by_their_size() -> None:
    """Feedback that nobody takes does not fill the memory; a single large answer is let in."""
    queue = TopicReceiveQueue()
    for number in range(10):
        queue.answer(Envelope("feedback", {"id": 1}, number), ALL_BYTES // 4)
    assert queue.dropped == 6
    assert taken(queue, 4) == [0, 1, 2, 3]
    queue.answer(Envelope("response", {"id": 1}, "all"), ALL_BYTES * 2)
    assert taken(queue, 1) == ["all"]


def test_large_messages_count_by_their_size() -> None:
    """An image larger than all that a topic may hold waits alone."""
    queue = filled(*(("camera", number, TOPIC_BYTES * 2) for number in range(5)))
    assert taken(queue, 1) == [4]
    assert queue.dropped == 4


def test_any_number_of_topics_is_bounded() -> None:
    """Behind a wildcard there may be topics without end."""
    queue = filled(*((f"t/{number}", number, 1) for number in range(MESSAGES + 5)))
    assert queue.dropped == 5
    assert taken(queue, 1) == [5]
    large = ALL_BYTES // 4
    queue = filled(*((f"t/{number}", number, large) for number in range(10)))
    assert taken(queue, 4) == [6, 7, 8, 9]


def test_answers_are_never_given_up_for_messages() -> None:
    """Nobody says them twice; beyond their bound the newest is lost."""
    queue = TopicReceiveQueue()
    for number in range(ANSWERS + 1):
        queue.answer(Envelope("response", {"id": number}, number))
    queue.message("a", message("a", -1), 1)
    assert queue.dropped == 1
    assert taken(queue, ANSWERS + 1) == [*range(ANSWERS), -1]


def lost(queue: TopicReceiveQueue, count: int) -> list[tuple[object, bool]]:
    async def take() -> list[tuple[object, bool]]:
        found = [await queue.pop() for _ in range(count)]
        return [(one.body, bool(one.attributes.get(LOST))) for one in found]

    return asyncio.run(take())


def test_a_video_is_told_of_each_loss_and_other_topics_are_not() -> None:
    queue = TopicReceiveQueue()
    queue.keep_groups("film")
    for number in range(3):
        queue.message("film", message("film", number), 100)
        queue.message("odom", message("odom", number), 100)
    assert lost(queue, 6) == [(0, True), *[(n, False) for n in (0, 1, 1, 2, 2)]]
    for number in range(3, 3 + TOPIC_MESSAGES + 2):
        queue.message("film", message("film", number), 100)
    assert lost(queue, 3) == [(5, True), (6, False), (7, False)]
    queue.keep_groups("film")  # a pause and a new subscription
    assert lost(queue, 2) == [(8, True), (9, False)]


def test_a_video_whose_messages_are_larger_than_the_queue_is_told_too() -> None:
    queue = TopicReceiveQueue()
    queue.keep_groups("film")
    queue.message("film", message("film", 0), TOPIC_BYTES)
    assert lost(queue, 1) == [(0, True)]
    for number in (1, 2):
        queue.message("film", message("film", number), TOPIC_BYTES)
    assert lost(queue, 1) == [(2, True)]
