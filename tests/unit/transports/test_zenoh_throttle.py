"""The throttle of ROS topics over Zenoh, on the event loop of the server."""

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest
import zenoh

from urc.transports.ros.graph import TopicGraph
from urc.transports.ros.zenoh_client import _RosNode
from urc.transports.ros.zenoh_options import Ros2Options, Ros2Topic
from urc.transports.topic_queue import TopicReceiveQueue
from urc.transports.zenoh_options import ZenohOptions

uvloop = pytest.importorskip("uvloop")
KEY = "0/a/std_msgs::msg::dds_::Int64_/RIHS01_00"


def sample(body: bytes) -> Any:
    """Return a received message, as the library does."""
    payload = SimpleNamespace(to_bytes=lambda: body)
    kind = zenoh.SampleKind.PUT
    return SimpleNamespace(kind=kind, key_expr=KEY, payload=payload, attachment=None)


async def delivered() -> list[object]:
    """Return what the engine receives of two messages, of which the second is hardly too early."""
    queue = TopicReceiveQueue()
    session: Any = SimpleNamespace(queue=queue, library=SimpleNamespace(zid=lambda: "abcdef"))
    options = Ros2Options(ZenohOptions("127.0.0.1", 7447), (Ros2Topic("/a", throttle_s=60.0),))
    node = _RosNode(options, session, TopicGraph(lambda _: None, 2), {})
    one = node._subscriptions["/a"]
    loop = asyncio.get_running_loop()
    faults = list[object]()
    loop.set_exception_handler(lambda _, context: faults.append(context))
    node._sample(one, sample(b"1"))
    one.due_s = loop.time() + 0.0004  # the loop of the server counts whole milliseconds
    node._sample(one, sample(b"2"))
    async with asyncio.timeout(5):
        bodies = [(await queue.pop()).body for _ in range(3)]
    one.due_s = loop.time() + 60
    node._sample(one, sample(b"3"))
    await asyncio.sleep(0)
    node.end()
    assert not faults
    return bodies


def test_a_message_that_is_due_within_a_millisecond_is_delivered() -> None:
    """Later messages of the topic too: an error here would end all of them."""
    assert asyncio.Runner(loop_factory=uvloop.new_event_loop).run(delivered()) == ["", b"1", b"2"]
