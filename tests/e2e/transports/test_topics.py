"""The topics of a robot behind each kind of ROS connection, and what is wrong with a profile."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest

import urc
from tests.e2e.dashboards import until
from tests.e2e.ports import free_port
from tests.e2e.transports.ros_bases import BASES, STAMPED, TOPICS, open_base
from urc.config.load import load_profile
from urc.model.values import Value
from urc.runtime.open_profile import open_document
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Motion, Session
from urc.runtime.settings import resolve_settings
from urc.runtime.topic_check import find_mismatches, topic_uses
from urc.simulator.server import serve
from urc.transports.ros.topic_list import TopicList, short_type

pytestmark = pytest.mark.anyio

ROBOTS = Path(__file__).resolve().parents[3] / "robots"
WAIT_S = 30.0
REPEAT_S = 0.1
STOP_S = 1.0
ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
settings:
  port: { type: port, required: true }
  line: { type: string, required: true }
transports: { ros: { type: ros, via: "{{ settings.line }}", host: 127.0.0.1, port: "{{ settings.port }}", version: auto } }
signals: { x: {}, y: {}, z: {} }
messages:
  odom: { subscribe: { topic: /odom, type: nav_msgs/Odometry }, json: { x: pose.pose.position.x } }
  scan: { subscribe: { topic: /scan, type: nav_msgs/Path }, json: { y: header.frame_id } }
  gone: { subscribe: { topic: /gone, type: std_msgs/Float32 }, json: { z: data } }
commands:
  drive:
    args: { speed: { type: number, min: -1, max: 1, default: 0 } }
    send: { publish: { topic: /cmd_vel, type: geometry_msgs/Twist, json: { linear: { x: "{{ speed }}" } } } }
    hold: { repeat: 100ms, release: { speed: 0 }, watchdog: 500ms }
  shout:
    send: { publish: { topic: /nobody, type: std_msgs/Empty, json: {} } }
tests: [{ name: x, feed: { ros: { message: { topic: /odom, json: { pose: { pose: { position: { x: 1 } } } } } } }, expect: { x: 1 } }]
"""  # noqa: E501


async def listed(session: Session, is_good: Callable[[TopicList], bool]) -> TopicList:
    """Request all topics until the list is complete, as ROS announces them gradually."""
    names = ["/odom", "/scan", "/gone", "/cmd_vel", "/nobody"]
    async with asyncio.timeout(WAIT_S):
        while True:
            session.ask_topics("ros", names, is_all=True)
            await asyncio.sleep(0.3)
            found = session.hub.topic_lists.get("ros")
            if found is not None and is_good(found):
                return found


@pytest.mark.parametrize("motion", ["here", "guarded"])
@pytest.mark.parametrize("line", BASES)
async def test_the_topics_of_a_robot_and_the_mistakes_of_a_profile(
    line: str, motion: Motion, tmp_path: Path
) -> None:
    """Types, nodes and received messages, in the process of URC and through the guard."""
    file = tmp_path / "rover.yaml"
    file.write_text(ROVER)
    profile = load_profile(str(file), built_in_catalog())
    transports = built_in_catalog().transports
    async with open_base(line, tmp_path) as base:
        settings: dict[str, Value] = {"port": base.port, "line": line}
        async with Session(profile, settings, transports, motion=motion) as session:

            def is_good(found: TopicList) -> bool:
                rows = {one.name: one for one in found.rows}
                return (
                    TOPICS.keys() <= rows.keys()
                    and bool(rows["/cmd_vel"].subscribers)
                    and (rows["/odom"].received or 0) > 0
                )

            found = await listed(session, is_good)
            rows = {one.name: one for one in found.rows}
            for topic, kind in TOPICS.items():
                types = rows[topic].carries or ()
                assert [short_type(one) for one in types] == [short_type(kind)], topic
                assert rows[topic].publishers, topic
            assert [short_type(one) for one in rows["/cmd_vel"].takes or ()] == [
                short_type(STAMPED)
            ]
            assert rows["/map"].received is None
            assert found.version == 2
            uses = topic_uses(profile.driver, settings)
            told = find_mismatches(uses, session.hub.topic_lists, {"ros": "auto"})
            assert {(one.use.topic, one.code, one.found) for one in told} == {
                ("/scan", "carries-type", "sensor_msgs/LaserScan"),
                ("/gone", "no-publisher", ""),
                ("/cmd_vel", "takes-type", "geometry_msgs/TwistStamped"),
                ("/nobody", "no-subscriber", ""),
            }
        assert session.hub.topic_lists == {}


@pytest.mark.parametrize("line", BASES)
async def test_requests_for_topics_never_delay_motion_or_its_stop(
    line: str, tmp_path: Path
) -> None:
    """A hundred requests a second; while the robot is driven, none is answered."""
    file = tmp_path / "rover.yaml"
    file.write_text(ROVER.replace("geometry_msgs/Twist,", "geometry_msgs/Twist, stamped: true,"))
    async with (
        open_base(line, tmp_path) as base,
        urc.connect(urc.load(file), port=base.port, line=line) as robot,
    ):
        await listed(robot.session, lambda found: bool(found.rows))
        asking = asyncio.create_task(ask(robot.session))
        try:
            async with robot.drive("drive") as stick:
                clock = asyncio.get_running_loop().time
                async with asyncio.timeout(WAIT_S):
                    while not any(base.speeds):  # ROS connects a new publisher gradually
                        await stick.hold(0.1, speed=0.5)
                before, began_s = robot.session.hub.topic_lists["ros"], clock()
                count = len(base.speeds)
                await stick.hold(2.0, speed=0.5)
                lasted_s = clock() - began_s
                assert robot.session.hub.topic_lists["ros"] is before
                assert len(base.speeds) - count >= 0.8 * lasted_s / REPEAT_S
            async with asyncio.timeout(STOP_S):
                await until(lambda: base.speeds[-1] == 0)
            await until(lambda: robot.session.hub.topic_lists["ros"] is not before)
            assert base.speeds[-1] == 0
        finally:
            asking.cancel()


async def ask(session: Session) -> None:
    while True:
        session.ask_topics("ros", ["/cmd_vel"], is_all=True)
        await asyncio.sleep(0.01)


async def test_a_bridge_of_ros_1_is_named_for_a_profile_of_ros_2() -> None:
    one, two = (open_document(ROBOTS / f"generic-ros{version}.yaml") for version in (1, 2))
    port = free_port()
    settings, _ = resolve_settings(one, {"port": str(port)})
    mine, _ = resolve_settings(two, {"port": str(port), "bridge": "rosbridge"})
    transports = built_in_catalog().transports
    async with serve(one, settings), Session(two, mine, transports) as session:
        uses = topic_uses(two.driver, mine)
        async with asyncio.timeout(WAIT_S):
            while "ros" not in session.hub.topic_lists:
                session.ask_topics("ros", [use.topic for use in uses], is_all=False)
                await asyncio.sleep(0.2)
        told = find_mismatches(uses, session.hub.topic_lists, {"ros": 2})
    assert {one.use.topic for one in told} >= {"/cmd_vel", "/odom", "/scan"}
    assert {(one.code, one.found, one.wanted) for one in told} == {("ros-version", "1", "2")}
