"""The watcher of a ROS robot's topics: when it asks, and what pages learn."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest

from tests.unit.web.test_fanout import messages_in
from urc.config.load import load_profile
from urc.runtime.hub import Hub, LinkState, LinkStatus
from urc.runtime.registries import built_in_catalog
from urc.testing.clock import FakeClock, settle
from urc.transports.ros.topic_list import TopicList, TopicRow
from urc.web.feed.fanout import Fanout
from urc.web.feed.topic_watch import EVERY_S, FIRST_S, SHOWN_EVERY_S, TopicRates, TopicWatch

pytestmark = pytest.mark.anyio

ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
transports: { ros: { type: ros, host: 127.0.0.1 } }
signals: { x: {} }
messages: { odom: { subscribe: { topic: /odom, type: nav_msgs/Odometry }, json: { x: a } } }
commands:
  drive:
    args: { speed: { type: number, default: 0 } }
    send: { publish: { topic: /cmd_vel, type: geometry_msgs/Twist, json: { linear: { x: "{{ speed }}" } } } }
"""  # noqa: E501


class Source:
    """A session that notes the requests."""

    def __init__(self, hub: Hub) -> None:
        self.hub = hub
        self.asked: list[tuple[list[str], bool]] = []

    def ask_topics(self, transport: str, names: list[str], *, is_all: bool) -> None:
        self.asked.append((names, is_all))


def set_link(hub: Hub, state: LinkState) -> None:
    hub.set_link(LinkStatus("ros", state, "ros 127.0.0.1:9090", 0.0))


@asynccontextmanager
async def watched(tmp_path: Path) -> AsyncIterator[tuple[TopicWatch, Source, FakeClock]]:
    file = tmp_path / "rover.yaml"
    file.write_text(ROVER)
    profile = load_profile(str(file), built_in_catalog())
    clock, source = FakeClock(), Source(Hub(profile.driver.signals))
    watch = TopicWatch(profile, {}, source, clock)
    task = asyncio.create_task(watch.run())
    await settle()
    try:
        yield watch, source, clock
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


async def test_the_topics_of_the_driver_are_requested_at_a_low_rate(tmp_path: Path) -> None:
    """Only on an open connection, and all topics only while a page shows them."""
    async with watched(tmp_path) as (watch, source, clock):
        await clock.advance(60)
        assert source.asked == []
        set_link(source.hub, "live")
        await clock.advance(FIRST_S / 2)
        assert source.asked == []
        await clock.advance(FIRST_S)
        assert source.asked == [(["/odom", "/cmd_vel"], False)]
        await clock.advance(10 * EVERY_S)
        assert 9 <= len(source.asked) <= 11
        source.asked.clear()
        with watch.shown():
            await clock.advance(10 * SHOWN_EVERY_S)
        assert 8 <= len(source.asked) <= 12
        assert source.asked[-1] == (["/odom", "/cmd_vel"], True)
        set_link(source.hub, "lost")
        source.asked.clear()
        await clock.advance(60)
        assert source.asked == []


async def test_pages_learn_each_change_once(tmp_path: Path) -> None:
    async with watched(tmp_path) as (_, source, clock):
        hub = source.hub
        fanout = Fanout(hub, clock=clock)
        place = fanout.join(lambda: None)
        set_link(hub, "live")
        rows = (TopicRow("/odom", publishers=()), TopicRow("/cmd_vel", subscribers=()))
        hub.set_topics("ros", TopicList(rows, 2, 2, True, False))
        await clock.advance(1)
        told = [one for one in messages_in(fanout.frames_for(place)) if one["t"] == "topics"]
        assert told == [{"t": "topics", "mismatches": [
            {"code": "no-publisher", "topic": "/odom", "signals": ["x"]},
            {"code": "no-subscriber", "topic": "/cmd_vel", "commands": ["drive"]},
        ]}]  # fmt: skip
        await clock.advance(60)
        assert not [one for one in messages_in(fanout.frames_for(place)) if one["t"] == "topics"]
        hub.set_topics("ros", None)
        await clock.advance(1)
        told = [one for one in messages_in(fanout.frames_for(place)) if one["t"] == "topics"]
        assert told == [{"t": "topics", "mismatches": []}]


def test_rates_are_measured_between_two_lists() -> None:
    """Only of topics that URC listens to; a new connection counts from zero."""
    rates = TopicRates()
    for count, now_s in ((10, 0.0), (110, 10.0)):
        rows = (TopicRow("/odom", received=count), TopicRow("/other"))
        listed = TopicList(rows, 2, 2, True, True)
        rates.take("ros", listed, now_s)
        rates.take("ros", listed, now_s + 5)
    assert rates.of("ros", "/odom") == 10.0
    assert rates.of("ros", "/other") is None
    rates.take("ros", TopicList((TopicRow("/odom", received=3),), 1, 2, True, True), 20.0)
    assert rates.of("ros", "/odom") == 10.0
    rates.take("ros", TopicList((TopicRow("/odom"),), 1, 2, True, True), 30.0)
    assert rates.of("ros", "/odom") is None
