"""The alarms of one robot over its sessions: samples in, records, events and changes out."""

from collections.abc import Iterator, Mapping, Sequence

import pytest

from urc.alarms.alarm_list import AlarmActor
from urc.alarms.record import AlarmEvent, AlarmRecord
from urc.expressions import compile_expression
from urc.model.driver import Driver
from urc.model.values import Alarm, AlarmAttributes, AlarmLimits, Reading, Sample, Signal
from urc.runtime.hub import Hub, LinkStatus
from urc.runtime.robot_alarms import RobotAlarms
from urc.testing.clock import FakeClock

pytestmark = pytest.mark.anyio

ADA = AlarmActor("Ada", "p1")
START = 1_000_000.0


def suppressed(expression: str, priority: str = "medium") -> AlarmAttributes:
    return AlarmAttributes(priority, suppressed_when=compile_expression(expression))  # type: ignore[arg-type]


DOCKED = suppressed("docked and volts > settings.least")
SIGNALS = {
    "battery": Signal(
        "battery", limits=AlarmLimits(lolo=10, low=20, attributes=(("low", DOCKED),)),
        stale_after_s=3,
    ),
    "mode": Signal(
        "mode", "string", stale_after_s=3,
        limits=AlarmLimits(
            states=("stopped", "fault"), attributes=(("fault", AlarmAttributes("high")),)
        ),
    ),
    "docked": Signal("docked", "boolean", stale_after_s=3),
    "volts": Signal("volts", stale_after_s=3),
    "speed": Signal("speed", stale_after_s=3),
}  # fmt: skip


class Memory:
    """A store in memory."""

    def __init__(self) -> None:
        self.records: dict[str, AlarmRecord] = {}
        self.events: list[AlarmEvent] = []

    def load(self, robot: str) -> list[AlarmRecord]:
        assert robot == "rover"
        return [*self.records.values()]

    def save(
        self, robot: str, records: Mapping[str, AlarmRecord | None], events: Sequence[AlarmEvent]
    ) -> None:
        assert robot == "rover"
        self.events += events
        for name, record in records.items():
            self.records.pop(name, None)
            if record is not None:
                self.records[name] = record

    def settle(self, timeout_s: float = 0) -> bool:
        return True


class Desk:
    """One robot with a fake clock."""

    def __init__(self) -> None:
        self.clock = FakeClock()
        self.memory = Memory()
        self.hub = Hub(SIGNALS)
        self.changes = 0
        self.alarms = self.made()

    def made(self, signals: Mapping[str, Signal] = SIGNALS) -> RobotAlarms:
        made = RobotAlarms(
            driver(signals),
            self.clock,
            self.utc,
            key="rover",
            memory=self.memory,  # type: ignore[arg-type]
        )
        made.on_change = self.count
        return made

    def count(self) -> None:
        self.changes += 1

    def utc(self) -> float:
        return START + self.clock.now()

    def sample(self, name: str, value: Reading, alarm: Alarm = "") -> Sample:
        return Sample(name, value, self.clock.now(), alarm)

    def publish(self, *samples: tuple[str, Reading] | tuple[str, Reading, Alarm]) -> None:
        self.hub.publish([self.sample(*one) for one in samples])

    def is_known(self, name: str) -> bool:
        return self.alarms.list.records[name].is_known

    def states(self) -> dict[str, str]:
        return {name: one.state for name, one in self.alarms.list.records.items()}

    def kinds(self) -> list[str]:
        found = [f"{one.signal} {one.kind}" for one in self.memory.events]
        self.memory.events.clear()
        return found


def driver(signals: Mapping[str, Signal]) -> Driver:
    return Driver(signals=dict(signals))


SETTINGS = {"settings": {"least": 5}}


@pytest.fixture
def desk() -> Desk:
    return Desk()


@pytest.fixture
def attended(desk: Desk) -> Iterator[Desk]:
    with desk.alarms.attending(desk.hub, SETTINGS):
        desk.publish(("docked", False), ("volts", 12))
        yield desk


async def test_only_changes_are_judged_stored_and_announced(attended: Desk) -> None:
    for value in range(100):
        attended.publish(("battery", 50 + value / 10), ("speed", value))
    assert (attended.changes, attended.memory.events) == (0, [])
    for value in range(100):
        attended.publish(("battery", 15 - value / 100, "low"))
    assert attended.changes == 1
    assert attended.kinds() == ["battery raised"]
    assert attended.memory.records == attended.alarms.list.records
    attended.publish(("battery", 50))
    assert attended.kinds() == ["battery returned"]


async def test_an_alarm_between_two_flushes_of_the_pages_is_not_lost(attended: Desk) -> None:
    """All in one turn of the loop: a page would only see the last value."""
    attended.publish(("battery", 15, "low"))
    attended.publish(("battery", 50))
    assert attended.kinds() == ["battery raised", "battery returned"]
    assert attended.states() == {"battery": "returned"}


async def test_another_word_of_the_same_severity_is_another_alarm(attended: Desk) -> None:
    attended.publish(("mode", "stopped", "minor"))
    attended.publish(("mode", "stopped", "minor"))
    attended.publish(("mode", "fault", "major"))
    assert attended.kinds() == ["mode raised", "mode raised"]
    assert attended.alarms.list.records["mode"].condition == "fault"


async def test_a_session_that_ends_leaves_its_alarms_in_the_list(desk: Desk) -> None:
    with desk.alarms.attending(desk.hub, SETTINGS):
        desk.publish(("docked", False), ("battery", 15, "low"), ("volts", 12))
    assert desk.states() == {"battery": "unacknowledged"}
    assert not desk.is_known("battery")
    desk.hub = Hub(SIGNALS)
    with desk.alarms.attending(desk.hub, SETTINGS):
        desk.publish(("battery", 15, "low"), ("docked", False), ("volts", 12))
        assert desk.is_known("battery")
        desk.publish(("battery", 60))
    assert desk.kinds() == ["battery raised", "battery unknown", "battery returned"]


@pytest.mark.parametrize("is_link_lost", [False, True])
async def test_an_old_value_is_unknown(desk: Desk, is_link_lost: bool) -> None:
    slow = {**SIGNALS, "battery": SIGNALS["battery"]._replace(stale_after_s=600)}
    desk.alarms = desk.made(slow if is_link_lost else SIGNALS)
    desk.alarms._sources = {"battery": ("wire",)}
    desk.alarms.start()
    with desk.alarms.attending(desk.hub, SETTINGS):
        desk.hub.set_link(LinkStatus("wire", "live", "tcp x:1", 0.0))
        desk.publish(("battery", 15, "low"), ("docked", False), ("volts", 12))
        await desk.clock.advance(2)
        assert desk.is_known("battery")
        if is_link_lost:
            desk.hub.set_link(LinkStatus("wire", "lost", "tcp x:1", 0.0))
        await desk.clock.advance(3)
        assert not desk.is_known("battery")
        assert desk.states() == {"battery": "unacknowledged"}
        desk.publish(("battery", 15, "low"))
        assert desk.is_known("battery")
    desk.alarms.stop()
    assert desk.kinds()[:2] == ["battery raised", "battery unknown"]


async def test_not_available_is_neither_normal_nor_an_alarm(attended: Desk) -> None:
    attended.publish(("battery", None))
    attended.publish(("battery", 15, "low"))
    attended.publish(("battery", None))
    attended.publish(("battery", None))
    assert attended.kinds() == ["battery raised", "battery unknown"]
    assert attended.states() == {"battery": "unacknowledged"}


async def test_suppression_is_evaluated_before_the_alarm_of_the_same_frame(
    attended: Desk,
) -> None:
    attended.publish(("battery", 15, "low"), ("docked", True), ("volts", 12))
    assert attended.states() == {"battery": "suppressed"}
    attended.publish(("docked", False))
    assert attended.states() == {"battery": "unacknowledged"}
    attended.publish(("docked", True))
    assert attended.states() == {"battery": "suppressed"}
    assert attended.kinds() == [
        "battery raised", "battery unsuppressed", "battery raised", "battery suppressed",
    ]  # fmt: skip


async def test_an_old_input_suppresses_nothing(desk: Desk) -> None:
    desk.alarms.start()
    with desk.alarms.attending(desk.hub, SETTINGS):
        desk.publish(("battery", 15, "low"), ("docked", True), ("volts", 12))
        for _ in range(5):
            await desk.clock.advance(1)
            desk.publish(("battery", 15, "low"), ("volts", 12))
        assert desk.states() == {"battery": "unacknowledged"}
    desk.alarms.stop()


async def test_an_alarm_waits_for_the_first_values_of_its_suppression(desk: Desk) -> None:
    """Values arrive one by one: the battery first, the dock later, or never."""
    desk.alarms.start()
    with desk.alarms.attending(desk.hub, SETTINGS):
        desk.publish(("battery", 15, "low"))
        assert desk.states() == {"battery": "suppressed"}
        for _ in range(6):
            await desk.clock.advance(1)
            desk.publish(("battery", 15, "low"))
        assert desk.states() == {"battery": "unacknowledged"}
    desk.alarms.stop()


async def test_a_shelf_ends_without_a_session(desk: Desk) -> None:
    desk.alarms.start()
    with desk.alarms.attending(desk.hub, SETTINGS):
        desk.publish(("battery", 15, "low"), ("docked", False), ("volts", 12))
        assert [one.signal for one in desk.alarms.shelve(["battery"], 60, ADA)] == ["battery"]
    await desk.clock.advance(59)
    assert desk.states() == {"battery": "shelved"}
    await desk.clock.advance(2)
    assert desk.states() == {"battery": "unacknowledged"}
    desk.alarms.stop()


async def test_a_restart_continues_with_the_stored_alarms(desk: Desk) -> None:
    with desk.alarms.attending(desk.hub, SETTINGS):
        desk.publish(("docked", False), ("volts", 12))
        desk.publish(("battery", 15, "low"), ("mode", "fault", "major"))
        seen = {"battery": desk.alarms.list.records["battery"].raised}
        assert len(desk.alarms.acknowledge(seen, ADA)) == 1
    desk.alarms = desk.made()
    assert desk.states() == {"battery": "acknowledged", "mode": "unacknowledged"}
    assert desk.alarms.list.records["battery"].acknowledged_by == "Ada"
    desk.alarms = desk.made({name: SIGNALS[name] for name in ("battery", "docked", "volts")})
    assert desk.states() == {"battery": "acknowledged"}
    assert [*desk.memory.records] == ["battery"]


async def test_a_new_document_judges_anew(attended: Desk) -> None:
    attended.publish(("battery", 15, "low"), ("mode", "fault", "major"))
    attended.alarms.renew(driver({"battery": SIGNALS["speed"]._replace(name="battery")}))
    assert attended.states() == {}


async def test_a_lost_connection_of_a_monitored_robot_is_an_alarm(desk: Desk) -> None:
    """It begins after 30 s, also between attempts, and ends with the connection."""
    plain = {"battery": SIGNALS["battery"]._replace(limits=AlarmLimits(low=20))}
    desk.alarms.renew(driver(plain), is_monitored=True)
    desk.alarms.start()

    def link(state: str) -> None:
        desk.hub.set_link(LinkStatus("wire", state, "tcp x:1", desk.clock.now()))  # type: ignore[arg-type]

    with desk.alarms.attending(desk.hub):
        link("live")
        await desk.clock.advance(60)
        assert desk.states() == {}
        for state in ("lost", "connecting", "lost"):
            link(state)
            await desk.clock.advance(9)
        assert desk.states() == {}, "a short loss is none"
        link("connecting")
        await desk.clock.advance(6)
        assert desk.states() == {"connection": "unacknowledged"}
        record = desk.alarms.list.records["connection"]
        assert (record.condition, record.priority) == ("lost", "medium")
        assert desk.alarms.signals["connection"].title == "Connection"
        link("live")
        await desk.clock.advance(1)
        assert desk.states() == {"connection": "returned"}
    desk.alarms.renew(driver(plain))
    assert desk.states() == {}, "a robot that is not monitored has no such alarm"
    desk.alarms.stop()


async def test_a_signal_of_the_robot_keeps_its_name(desk: Desk) -> None:
    """A document may declare a signal of the same name."""
    own = {"connection": SIGNALS["battery"]._replace(name="connection")}
    desk.alarms.renew(driver(own), is_monitored=True)
    assert desk.alarms.signals["connection"].title == ""


async def test_a_listener_that_fails_ends_nothing(
    attended: Desk, caplog: pytest.LogCaptureFixture
) -> None:
    attended.alarms.on_change = _fail
    attended.publish(("battery", 15, "low"))
    assert attended.states() == {"battery": "unacknowledged"}
    assert "was not announced" in caplog.text


def _fail() -> None:
    raise RuntimeError("a bug")
