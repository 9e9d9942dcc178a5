"""The Foxglove protocol of one connection, without a socket."""

import asyncio
import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from urc.model.payload import LOST, Envelope
from urc.transports.base import NOTICE, TOPICS
from urc.transports.ros.foxglove_session import MAX_RETRIES, FoxgloveSession, TopicWish
from urc.transports.ros.graph import TopicGraph
from urc.transports.topic_queue import TopicReceiveQueue

ODOM = {
    "id": 3,
    "topic": "/odom",
    "encoding": "json",
    "schemaName": "nav_msgs/msg/Odometry",
    "schema": "",
}


MESSAGE = b"\x01" + (1).to_bytes(4, "little") + (7).to_bytes(8, "little") + b"{}"


def greeted() -> FoxgloveSession:
    """Return a session of a driver with one topic, which the robot has announced."""
    session = FoxgloveSession(
        TopicReceiveQueue(),
        (TopicWish("/odom"),),
        TopicGraph(lambda _: None, 2),
        call_at=lambda _, __: None,
        clock=lambda: math.inf,
        published={},
    )
    hear(session, {"op": "advertise", "channels": [ODOM]})
    return session


def hear(session: FoxgloveSession, said: Mapping[str, Any]) -> None:
    session.arrived(json.dumps(said).encode())


def subscribed(session: FoxgloveSession) -> list[Any]:
    """Return the channels of the next subscriptions."""
    session.reconcile()
    said = [json.loads(frame) for frame, _ in session.written()]
    return [one["channelId"] for op in said for one in op.get("subscriptions", ())]


def refuse(session: FoxgloveSession, text: str = "Unknown channel ID: 3") -> None:
    """As the server of the Foxglove SDK refuses a channel that it has just announced."""
    hear(session, {"op": "status", "level": 2, "message": text})


def test_a_refused_subscription_is_repeated() -> None:
    session = greeted()
    assert subscribed(session) == [3]
    assert subscribed(session) == []
    refuse(session)
    assert subscribed(session) == [3]


def test_a_subscription_that_is_always_refused_is_given_up() -> None:
    session = greeted()
    tries = 0
    while subscribed(session):
        tries += 1
        refuse(session)
    assert tries == 1 + MAX_RETRIES


def test_other_errors_repeat_nothing() -> None:
    session = greeted()
    subscribed(session)
    for text in ("Unknown channel ID: 4", "Unknown service ID: 3", ""):
        refuse(session, text)
    assert subscribed(session) == []


def test_a_topic_with_messages_was_not_refused() -> None:
    """The same number may be the number of a channel of this client."""
    session = greeted()
    subscribed(session)
    session.arrived(MESSAGE)
    refuse(session)
    assert subscribed(session) == []


def test_only_frames_of_the_bridge_are_arrivals() -> None:
    """Neither messages that the throttle delivers later, nor the answers of URC itself."""
    queue, late = TopicReceiveQueue(), list[Callable[[], None]]()
    session = FoxgloveSession(
        queue,
        (TopicWish("/odom", "", 0.5),),
        TopicGraph(lambda _: None, 2),
        call_at=lambda _, work: late.append(work),
        clock=lambda: 1.0,
        published={},
    )
    hear(session, {"op": "advertise", "channels": [ODOM]})
    session.reconcile()
    session.arrived(MESSAGE)
    session.arrived(MESSAGE)
    assert queue.arrivals == 3
    bodies = [asyncio.run(queue.pop()).verb for _ in range(2)]
    assert bodies == ["definition", "message"]
    late.pop()()
    session.perform(Envelope("call", {"id": 1, "service": "/rosapi/topics"}))
    session.perform(Envelope("call", {"id": 2, "service": "/none"}))
    session.perform(Envelope(TOPICS, {"topics": []}))
    session.tell("a notice")
    delivered = [asyncio.run(queue.pop()).verb for _ in range(5)]
    assert delivered == ["message", "response", "response", TOPICS, NOTICE]
    assert queue.arrivals == 3


def test_the_throttle_delivers_the_newest_message_later() -> None:
    """The messages in between are dropped."""
    queue, late = TopicReceiveQueue(), list[Callable[[], None]]()
    session = FoxgloveSession(
        queue,
        (TopicWish("/odom", "", 0.5),),
        TopicGraph(lambda _: None, 2),
        call_at=lambda _, work: late.append(work),
        clock=lambda: 1.0,
        published={},
    )
    hear(session, {"op": "advertise", "channels": [ODOM]})
    session.reconcile()
    for body in (b"1", b"2", b"3"):
        session.arrived(MESSAGE[:-2] + body)
    assert len(late) == 1
    late.pop()()
    assert [asyncio.run(queue.pop()).body for _ in range(3)] == ["", b"1", b"3"]
    assert not queue.dropped


OWN = {"id": 9, "topic": "/odom", "encoding": "cdr", "schemaName": "my_msgs/msg/Own"}


def published(session: FoxgloveSession) -> list[tuple[str, bool]]:
    """Send a message with the definition of an earlier connection; return its form."""
    said = {"topic": "/go", "type": "my_msgs/Own", "encoding": "cdr", "data": b"\0\1\0\0\5"}
    envelope = Envelope("publish", {**said, "stamps": [], "definition": "int8 x"}, {"x": 5})
    session.perform(envelope)
    told = [frame for frame, is_text in session.written() if not is_text]
    return [(frame[5:].decode("latin1"), frame.endswith(b"\5")) for frame in told]


def test_an_earlier_definition_counts_only_until_the_robot_announces_another_one() -> None:
    """Bytes of another version of the type could mean anything."""
    binary, text = [("\0\1\0\0\5", True)], [('{"x":5}', False)]
    session = greeted()
    assert published(session) == binary
    hear(session, {"op": "advertise", "channels": [{**OWN, "schema": "int8 x"}]})
    assert published(session) == binary
    hear(session, {"op": "advertise", "channels": [{**OWN, "schema": "int8 y\nint8 x"}]})
    assert published(session) == text


def test_a_video_is_told_of_each_subscription() -> None:
    """A pause leaves out messages, without which the next ones cannot be decoded."""
    session = FoxgloveSession(
        TopicReceiveQueue(),
        (TopicWish("/film"), TopicWish("/odom")),
        TopicGraph(lambda _: None, 2),
        call_at=lambda _, __: None,
        clock=lambda: math.inf,
        published={},
    )
    film = {**ODOM, "id": 4, "topic": "/film", "schemaName": "foxglove.CompressedVideo"}
    hear(session, {"op": "advertise", "channels": [film, ODOM]})

    async def lost(number: int) -> bool:
        session.arrived(MESSAGE[:1] + number.to_bytes(4, "little") + MESSAGE[5:])
        while (told := await session.queue.pop()).verb != "message":
            pass  # the definitions
        return LOST in told.attributes

    async def play() -> list[bool]:
        assert set(subscribed(session)) == {3, 4}
        found = [await lost(number) for number in (1, 1, 2, 2)]
        session.perform(Envelope("unsubscribe", {"topic": "/film"}))
        assert subscribed(session) == []
        session.perform(Envelope("subscribe", {"topic": "/film"}))
        assert subscribed(session) == [4]
        return [*found, *[await lost(number) for number in (3, 3, 2)]]

    assert asyncio.run(play()) == [True, False, False, False, True, False, False]
