"""The survey of a ROS robot without a profile, behind each kind of connection."""

import asyncio
import json
from pathlib import Path

import pytest
from websockets.asyncio.server import ServerConnection, serve

from tests.e2e.ports import free_port
from tests.e2e.transports.ros_bases import BASES, STAMPED, TOPICS, open_base
from urc.problems import UrcError
from urc.runtime.registries import built_in_catalog
from urc.runtime.ros_profile import candidates
from urc.runtime.ros_survey import survey
from urc.transports.ros.topic_list import MAX_TOPICS, short_type

pytestmark = pytest.mark.anyio

TABLE = built_in_catalog().transports
PARTS = ("odom", "scan", "camera", "battery", "map")


@pytest.mark.parametrize("line", BASES)
async def test_the_parts_of_a_base_are_found(line: str, tmp_path: Path) -> None:
    async with open_base(line, tmp_path) as base:
        found = await survey(TABLE, "127.0.0.1", base.port)
    assert (found.via, found.port, found.topics.version) == (line, base.port, 2)
    parts = candidates(found.topics)
    assert parts["cmd_vel"] == [("/cmd_vel", short_type(STAMPED))]
    assert [parts[name][0][0] for name in PARTS] == list(TOPICS)


async def test_an_address_where_nothing_answers_is_named() -> None:
    port = free_port()
    with pytest.raises(UrcError, match=f"nothing listens on 127.0.0.1:{port}"):
        await survey(TABLE, "127.0.0.1", port)


@pytest.mark.parametrize("has_rosapi", [True, False])
async def test_a_hostile_bridge_costs_bounded_time_and_memory(has_rosapi: bool) -> None:
    """100,000 topics with strange names, or no list at all."""
    names = [f"/t{n}" for n in range(100_000)]
    names[:3] = ["/<b>x</b>\x1b[2J", "/" + "x" * 9000, "/odom{{ 7 }}"]
    calls: list[str] = []

    async def behave(client: ServerConnection) -> None:
        async for frame in client:
            said = json.loads(frame)
            if said["op"] != "call_service":
                continue
            calls.append(said["service"])
            values: object = {"topics": names, "types": ["nav_msgs/Odometry"] * len(names)}
            if not said["service"].endswith("/topics"):
                values = {said["service"].rpartition("/")[2]: ["/n"] * 1000}
            reply = {"op": "service_response", "id": said["id"], "service": said["service"]}
            await client.send(json.dumps({**reply, "values": values, "result": has_rosapi}))

    async with serve(behave, "127.0.0.1", 0) as server, asyncio.timeout(30):
        port = next(iter(server.sockets)).getsockname()[1]
        if not has_rosapi:
            with pytest.raises(UrcError, match="cannot list topics: start rosapi"):
                await survey(TABLE, "127.0.0.1", port)
            return
        found = (await survey(TABLE, "127.0.0.1", port)).topics
    assert (len(found.rows) <= MAX_TOPICS, found.total) == (True, 100_000)
    assert len(calls) < 1000
    assert max(len(row.name) for row in found.rows) <= 256
    offered = candidates(found)["odom"]
    assert 0 < len(offered) <= 50
    assert all(name.replace("/", "").isalnum() for name, _ in offered)
