"""The Foxglove protocol of one connection, without a socket."""

import json
import math
from collections.abc import Mapping
from typing import Any

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
    session.arrived(b"\x01" + (1).to_bytes(4, "little") + (7).to_bytes(8, "little") + b"{}")
    refuse(session)
    assert subscribed(session) == []
