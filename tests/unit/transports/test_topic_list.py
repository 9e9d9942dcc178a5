"""The list of a robot's topics, as each kind of ROS connection reports it."""

import asyncio
import json
from collections.abc import Mapping
from typing import Any

import msgspec

from urc.model.payload import Envelope
from urc.transports.base import TOPICS
from urc.transports.ros.foxglove_frames import AdvertisedChannel
from urc.transports.ros.foxglove_session import FoxgloveSession
from urc.transports.ros.foxglove_topics import MAX_GRAPH, FoxgloveTopics, TopicWish
from urc.transports.ros.graph import TopicGraph
from urc.transports.ros.rosapi_topics import MAX_ASKED, RosapiTopics
from urc.transports.ros.topic_list import (
    MAX_TOPICS,
    QUIET_S,
    TopicRow,
    answer_of,
    list_of,
    request_for,
    wanted_of,
)
from urc.transports.ros.zenoh_names import token_of
from urc.transports.ros.zenoh_topics import answer_from
from urc.transports.topic_queue import TopicReceiveQueue

TWIST, STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
ODOMETRY = "nav_msgs/msg/Odometry"


class Rosapi:
    """The calls that a client makes, and the replies."""

    def __init__(self, topics: Mapping[str, str], nodes: Mapping[str, Any]) -> None:
        self.topics, self.nodes = topics, nodes
        self.asked: list[str] = []
        self.is_quiet = True

    async def ask(self, service: str, arguments: Mapping[str, object]) -> Mapping[str, Any] | None:
        self.asked.append(service.rpartition("/")[2])
        if service == "/rosapi/topics":
            return {"topics": list(self.topics), "types": list(self.topics.values())}
        which = service.rpartition("/")[2]
        found: Mapping[str, Any] | None = self.nodes.get(f"{which} {arguments['topic']}")
        return None if found is None else {which: found}

    def topics_of(self) -> RosapiTopics:
        return RosapiTopics(self.ask, lambda: self.is_quiet)


def test_a_list_survives_the_encoding_to_another_process() -> None:
    """With names that no encoder accepts, and names that would garble a terminal."""
    row = TopicRow("/a\ud800\x1b[2J", (TWIST,), None, ("/n\u202e",), (), 3)
    long = TopicRow("/" + "x" * 300)
    answer = answer_of([row, long, TopicRow("/b")], 3, 2, is_all=True)
    sent = msgspec.msgpack.decode(msgspec.msgpack.encode(answer.body))
    found = list_of(answer._replace(body=sent))
    assert found.rows == (
        TopicRow("/a?\\x1b[2J", (TWIST,), None, ("/n\\u202e",), (), 3),
        TopicRow("/b"),
    )
    assert found[1:] == (3, 2, True, True)


def test_a_list_is_bounded() -> None:
    rows = [TopicRow(f"/t{n}", ("a/B",) * 99, None, ("/n",) * 99) for n in range(100_000)]
    found = list_of(answer_of(rows, 100_000, None))
    assert len(found.rows) == MAX_TOPICS
    assert found.total == 100_000
    assert len(found.rows[0].carries or ()) == len(found.rows[0].publishers or ()) == 16


def test_a_request_from_elsewhere_is_bounded() -> None:
    names, is_all = wanted_of(Envelope(TOPICS, {"names": ["/a", 3, *["/b"] * 500], "all": 1}))
    assert (len(names), names[:2], is_all) == (64, ["/a", "/b"], False)
    assert wanted_of(Envelope(TOPICS)) == ([], False)


def test_rosapi_names_the_nodes_of_the_wanted_topics_alone() -> None:
    nodes = {"publishers /odom": ["/base"], "subscribers /odom": [], "subscribers /cmd_vel": []}
    rosapi = Rosapi({"/odom": ODOMETRY, "/other": "a/msg/B"}, nodes)
    request = request_for(["/odom", "/cmd_vel"], is_all=False)
    answer = asyncio.run(rosapi.topics_of().answer(request, {"/odom": 7}))
    assert answer is not None
    found = list_of(answer)
    assert found.rows == (
        TopicRow("/odom", (ODOMETRY,), (ODOMETRY,), ("/base",), (), 7),
        TopicRow("/cmd_vel", None, None, None, (), None),
    )
    assert (found.total, found.version, found.is_known) == (2, 2, True)
    assert len(rosapi.asked) == 5


def test_rosapi_lists_all_topics_but_asks_for_some() -> None:
    """Of 100,000 topics, and the whole list is fetched only once."""
    rosapi = Rosapi({f"/t{n}": "a/B" for n in range(100_000)}, {})
    topics = rosapi.topics_of()
    for _ in range(2):
        answer = asyncio.run(topics.answer(request_for(["/x"], is_all=True), {}))
        assert answer is not None
        found = list_of(answer)
        assert (len(found.rows), found.total, found.version) == (MAX_TOPICS, 100_000, 1)
        assert found.rows[0].name == "/x"
    assert rosapi.asked.count("topics") == 1
    assert len(rosapi.asked) == 1 + 2 * 2 * MAX_ASKED


def test_rosapi_is_left_alone_as_soon_as_a_message_is_published() -> None:
    rosapi = Rosapi({"/odom": ODOMETRY}, {})
    rosapi.is_quiet = False
    request = request_for(["/odom"], is_all=True)
    assert asyncio.run(rosapi.topics_of().answer(request, {})) is None
    assert rosapi.asked == ["topics"]


def test_a_bridge_without_rosapi_knows_nothing() -> None:
    async def ask(service: str, arguments: Mapping[str, object]) -> None:
        return None

    topics = RosapiTopics(ask, lambda: True)
    answer = asyncio.run(topics.answer(request_for(["/odom"], is_all=True), {}))
    assert answer is not None
    assert list_of(answer) == ((), 0, None, False, True)


def channel(number: int, topic: str, kind: str) -> AdvertisedChannel:
    return AdvertisedChannel(number, topic, "cdr", kind, "ros2msg", "")


def test_a_foxglove_bridge_names_types_and_nodes() -> None:
    topics = FoxgloveTopics()
    channels = [channel(1, "/odom", ODOMETRY), channel(2, "/cmd_vel", STAMPED)]
    (row,) = list_of(topics.answer(request_for(["/cmd_vel"], is_all=False), channels, {})).rows
    assert row == TopicRow("/cmd_vel", (STAMPED,), (STAMPED,), None, None, None)
    topics.update({
        "publishedTopics": [{"name": "/odom", "publisherIds": ["/base"]}, "odd", {"name": 3}],
        "subscribedTopics": [{"name": "/cmd_vel", "subscriberIds": ["/base", "/log"]}],
    })  # fmt: skip
    found = list_of(topics.answer(request_for([], is_all=True), channels, {"/odom": 2}))
    assert found.rows == (
        TopicRow("/cmd_vel", (STAMPED,), (STAMPED,), (), ("/base", "/log"), None),
        TopicRow("/odom", (ODOMETRY,), (ODOMETRY,), ("/base",), (), 2),
    )
    topics.update({"removedTopics": ["/cmd_vel"]})
    assert topics.subscribers_of("/cmd_vel") == ()


def test_urcs_own_publisher_is_not_taken_for_the_robots() -> None:
    """A robot that takes Twist before URC publishes does so afterwards."""
    twist = channel(1, "/cmd_vel", TWIST)
    for before, after in (((), None), ((twist,), (TWIST,))):
        topics = FoxgloveTopics()
        topics.announced("/cmd_vel", "geometry_msgs/Twist", before)
        (row,) = list_of(topics.answer(request_for(["/cmd_vel"], is_all=False), [twist], {})).rows
        assert row.takes == after


def test_a_hostile_connection_graph_is_bounded() -> None:
    topics = FoxgloveTopics()
    many: list[Any] = [
        {"name": f"/t{n}", "subscriberIds": [str(k) for k in range(99)]} for n in range(9999)
    ]
    many += [{"name": "/" + "x" * 300, "subscriberIds": ["/n"]}]
    many[1]["subscriberIds"] = [f"{k}-" * 999 for k in range(99)]
    topics.update({"subscribedTopics": many, "publishedTopics": 3, "removedTopics": "x"})
    found = list_of(topics.answer(request_for([], is_all=True), (), {}))
    assert found.total == MAX_GRAPH
    stored = topics.subscribers_of("/t1") or ()
    assert (len(stored), max(map(len, stored))) == (16, 256)


def test_a_foxglove_session_answers_only_while_it_publishes_nothing() -> None:
    now_s = [100.0]
    answered: list[str] = []

    class Queue(TopicReceiveQueue):
        def answer(self, envelope: Envelope, size_bytes: int = 0) -> None:
            answered.append(envelope.verb)

    session = FoxgloveSession(
        Queue(),
        (TopicWish("/odom"),),
        TopicGraph(lambda _: None, 2),
        call_at=lambda _, __: None,
        clock=lambda: now_s[0],
        published={},
    )
    info = {"op": "serverInfo", "capabilities": ["clientPublish"], "supportedEncodings": ["json"]}
    session.arrived(json.dumps(info).encode())

    def answers() -> int:
        session.perform(request_for(["/odom"], is_all=False))
        found = answered.count(TOPICS)
        answered.clear()
        return found

    assert answers() == 1
    session.perform(Envelope("publish", {"topic": "/cmd_vel", "type": TWIST}, {}))
    assert answers() == 0
    now_s[0] += QUIET_S
    assert answers() == 1


def test_the_tokens_of_zenoh_tell_who_takes_which_type() -> None:
    """A joystick that sends another type than the base takes."""

    def token(kind: str, node: str, topic: str, name: str) -> str:
        return f"@ros2_lv/0/aa/0/1/{kind}/%/%/{node}/%{topic}/{name}/RIHS01_0/::,10:,:,:,,"

    twist, stamped = "geometry_msgs::msg::dds_::Twist_", "geometry_msgs::msg::dds_::TwistStamped_"
    tokens = [
        token_of(token("MP", "joy", "cmd_vel", twist)),
        token_of(token("MS", "base", "cmd_vel", stamped)),
        token_of(token("MS", "log", "rosout", "rcl_interfaces::msg::dds_::Log_")),
    ]
    request = request_for(["cmd_vel", "/odom"], is_all=False)
    found = list_of(answer_from([one for one in tokens if one], request, {"/odom": 0}))
    assert found.rows == (
        TopicRow("cmd_vel", (TWIST,), (STAMPED,), ("/joy",), ("/base",), None),
        TopicRow("/odom", None, None, (), (), 0),
    )
    assert (found.total, found.version) == (2, 2)
