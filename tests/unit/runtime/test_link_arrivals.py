"""A transport that answers by itself: its own envelopes do not make a silent robot live."""

import asyncio
from pathlib import Path

import pytest

from tests.unit.runtime.test_link import state_of, value_of
from urc.config.load import load_profile
from urc.model.payload import Envelope, Payload
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session
from urc.testing.clock import FakeClock
from urc.testing.transport import table_of
from urc.transports.base import NOTICE, PeerClosed

pytestmark = pytest.mark.anyio

ROBOT = """
urc: 1
kind: robot
name: rover
transports:
  wire: { type: ros, host: robot, via: foxglove, LIMIT, reconnect: { initial: 100ms } }
signals: { x: {}, names: { type: string } }
messages:
  odom: { subscribe: { topic: /odom, throttle: 5s }, json: { x: x } }
polls:
  - { every: 1s, send: { call: { service: /rosapi/topics } }, reply: { json: { names: name } } }
"""


class Bridge:
    """A transport that answers each call itself, and counts only what the robot has sent."""

    address = "bridge"

    def __init__(self) -> None:
        self.opens = 0
        self.count = 0
        self.queue: asyncio.Queue[Payload] = asyncio.Queue()

    def arrivals(self) -> int:
        return self.count

    async def open(self, timeout_s: float) -> None:
        self.opens += 1
        self.count = 0
        self.queue = asyncio.Queue()

    async def receive(self) -> Payload:
        return await self.queue.get()

    async def send(self, data: Payload) -> None:
        if not isinstance(data, Envelope):
            raise PeerClosed("bytes")
        if data.verb == "call":
            attributes = {"id": data.attributes["id"], "ok": True}
            self.queue.put_nowait(Envelope("response", attributes, {"name": "own"}))

    async def close(self) -> None:
        pass

    def say(self, x: int, *, is_late: bool = False) -> None:
        """Act as the robot, whose message may have been held back by a throttle."""
        self.count += not is_late
        self.queue.put_nowait(Envelope("message", {"topic": "/odom"}, {"x": x}))


def session_of(line: Bridge, clock: FakeClock, limit: str, folder: Path) -> Session:
    path = folder / "rover.yaml"
    path.write_text(ROBOT.replace("LIMIT", limit))
    profile = load_profile(path, built_in_catalog())
    return Session(profile, {}, table_of(ros=line), clock=clock, random=lambda: 0.0)


async def test_robot_behind_a_transport_that_answers_by_itself_becomes_silent(
    tmp_path: Path,
) -> None:
    clock, line = FakeClock(), Bridge()
    async with session_of(line, clock, "stale_after: 3s", tmp_path) as session:
        await clock.advance(0)
        line.say(1)
        await clock.advance(2)
        assert state_of(session) == ("live", "")
        assert value_of(session, "names") == "own"
        line.say(2, is_late=True)
        await clock.advance(1.5)
        assert value_of(session, "x") == 2
        assert state_of(session) == ("silent", "nothing received for 3 s")
        await clock.advance(5)
        assert state_of(session)[0] == "silent", "its own answers do not end the silence"
        line.say(3)
        await clock.advance(0)
        assert state_of(session) == ("live", "")


async def test_transport_that_answers_by_itself_is_opened_anew_after_the_idle_time(
    tmp_path: Path,
) -> None:
    clock, line = FakeClock(), Bridge()
    async with session_of(line, clock, "timeouts: { idle: 4s }", tmp_path):
        await clock.advance(0)
        line.say(1)
        await clock.advance(3.5)
        line.say(2)
        await clock.advance(3.9)
        assert line.opens == 1
        await clock.advance(0.3)
        assert line.opens == 2


async def test_message_that_came_before_a_notice_counts(tmp_path: Path) -> None:
    """The notice is delivered first, but the message has arrived by then."""
    clock, line = FakeClock(), Bridge()
    async with session_of(line, clock, "stale_after: 3s", tmp_path) as session:
        await clock.advance(0)
        line.say(1)
        await clock.advance(2)
        line.queue.put_nowait(Envelope(NOTICE, {}, "a topic has no publisher"))
        line.say(2)
        await clock.advance(2)
        assert state_of(session) == ("live", "")
