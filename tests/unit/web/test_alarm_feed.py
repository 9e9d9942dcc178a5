"""Pages get all alarms once, then only changes, at a bounded rate."""

import json
from typing import Any

import pytest

from urc.alarms.alarm_list import AlarmActor
from urc.model.driver import Driver
from urc.model.values import Alarm, AlarmAttributes, AlarmLimits, Sample, Signal
from urc.runtime.hub import Hub
from urc.runtime.robot_alarms import RobotAlarms
from urc.testing.clock import FakeClock
from urc.web.feed.alarm_feed import AlarmFeed, AlarmPlace

pytestmark = pytest.mark.anyio

LOW = AlarmAttributes("high", "It is used.", "Dock.")
SIGNALS = {
    f"s{number}": Signal(f"s{number}", limits=AlarmLimits(low=20, attributes=(("low", LOW),)))
    for number in range(200)
}


class Desk:
    """A robot with 200 limits, and a page."""

    def __init__(self) -> None:
        self.clock = FakeClock()
        self.alarms = RobotAlarms(
            Driver(signals=SIGNALS), self.clock, lambda: 1e9 + self.clock.now()
        )
        self.feed = AlarmFeed(self.alarms, self.clock)
        self.hub = Hub(SIGNALS)
        self.wakes = 0
        self.place = self.feed.join(self.wake)
        self.got: dict[str, Any] = {}
        self.messages = 0

    def wake(self) -> None:
        self.wakes += 1

    def publish(self, number: int, value: float = 15, alarm: Alarm = "low") -> None:
        self.hub.publish([Sample(f"s{number}", value, self.clock.now(), alarm)])

    def read(self, place: AlarmPlace) -> list[dict[str, Any]]:
        return [json.loads(text) for text in self.feed.news(place)]


@pytest.fixture
def desk() -> Desk:
    return Desk()


async def test_a_page_gets_everything_and_then_changes(desk: Desk) -> None:
    assert desk.read(desk.place) == [], "nothing to tell"
    with desk.alarms.attending(desk.hub):
        desk.publish(1)
        desk.publish(2)
        await desk.clock.advance(0)
        (first,) = desk.read(desk.place)
        assert [row["signal"] for row in first["rows"]] == ["s1", "s2"]
        assert "full" not in first
        row = first["rows"][0]
        assert (row["cause"], row["action"], row["priority"]) == ("It is used.", "Dock.", "high")
        assert (row["state"], row["value"], row["active"]) == ("unacknowledged", "15", True)
        assert desk.read(desk.place) == []
        (newcomer,) = desk.read(desk.feed.join(desk.wake))
        assert newcomer["full"]
        assert len(newcomer["rows"]) == 2
        seen = {"s1": desk.alarms.list.records["s1"].raised}
        desk.publish(1, 50, "")
        desk.alarms.acknowledge(seen, AlarmActor("Ada"))
        await desk.clock.advance(1)
        (change,) = desk.read(desk.place)
        assert (change["rows"], change["gone"]) == ([], ["s1"])


async def test_a_burst_costs_a_page_five_messages_a_second(desk: Desk) -> None:
    """200 alarms in 10 s: every one arrives, and no message comes for each."""
    known: set[str] = set()
    messages = 0
    with desk.alarms.attending(desk.hub):
        for number in range(200):
            desk.publish(number)
            await desk.clock.advance(0.05)
            for message in desk.read(desk.place):
                messages += 1
                known |= {row["signal"] for row in message["rows"]}
        await desk.clock.advance(1)
        for message in desk.read(desk.place):
            messages += 1
            known |= {row["signal"] for row in message["rows"]}
            assert message["flood"]
    assert known == SIGNALS.keys()
    assert messages <= 53
    assert desk.wakes <= 53


async def test_a_new_document_sends_everything_again(desk: Desk) -> None:
    with desk.alarms.attending(desk.hub):
        desk.publish(1)
        await desk.clock.advance(1)
        desk.read(desk.place)
        changed = {"s1": SIGNALS["s1"]._replace(limits=AlarmLimits(low=20))}
        desk.alarms.renew(Driver(signals=changed))
        (message,) = desk.read(desk.place)
        assert message["full"]
        assert message["rows"][0].get("action", "") == ""


async def test_a_page_that_left_is_not_woken(desk: Desk) -> None:
    desk.feed.leave(desk.wake)
    with desk.alarms.attending(desk.hub):
        desk.publish(1)
        await desk.clock.advance(1)
    assert desk.wakes == 0
    (message,) = desk.read(desk.feed.join(desk.wake))
    assert message["full"]
