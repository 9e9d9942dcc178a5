"""One flush for all: newest wins, encoded once, nobody waits for anybody."""

import json
from itertools import pairwise
from typing import Any

import pytest

from tests.unit.web.test_client import frames_in
from urc.model.values import Sample, Signal
from urc.runtime.hub import STREAM_KEPT, Hub, LogEntry, SequenceProgress
from urc.runtime.running_goals import RunningGoal
from urc.testing.clock import FakeClock, settle
from urc.web.feed.fanout import Fanout, FanoutPosition, Pacer, Place

pytestmark = pytest.mark.anyio


def messages_in(frames: bytes) -> list[dict[str, Any]]:
    """Return the messages in WebSocket frames."""
    return [json.loads(body) for _, body in frames_in(frames)]


def values_in(frames: bytes) -> list[dict[str, Any]]:
    """Return those with values."""
    return [message for message in messages_in(frames) if message["t"] == "v"]


class Watcher:
    """A client that takes what there is when it is told to, or does not."""

    def __init__(self, fanout: Fanout) -> None:
        self.fanout = fanout
        self.place = fanout.join(self.wake)
        self.woken = 0
        self.is_stuck = False
        self.frames: list[bytes] = []

    def wake(self) -> None:
        self.woken += 1
        if not self.is_stuck:
            self.take()

    def take(self) -> None:
        if frames := self.fanout.frames_for(self.place):
            self.frames.append(frames)

    @property
    def values(self) -> list[dict[str, object]]:
        """Return name → value of each frame."""
        frames = values_in(b"".join(self.frames))
        names = self.fanout.hub.names
        return [
            {names[place]: value for place, value in zip(frame["i"], frame["v"], strict=True)}
            for frame in frames
        ]


def robot(clock: FakeClock) -> tuple[Hub, Fanout]:
    """Return a hub of two signals with its fan-out."""
    hub = Hub({"a": Signal("a"), "b": Signal("b")})
    return hub, Fanout(hub, clock=clock)


def put(hub: Hub, clock: FakeClock, **values: float) -> None:
    """Let readings arrive now."""
    hub.publish([Sample(name, value, clock.now()) for name, value in values.items()])


def test_a_frame_is_encoded_once_for_all_at_the_same_place() -> None:
    """Two clients that are up to date are handed the very same text."""
    clock = FakeClock()
    hub, fanout = robot(clock)
    first, second = Watcher(fanout), Watcher(fanout)
    put(hub, clock, a=1)
    fanout.flush()
    assert first.frames[0] is second.frames[0]
    assert first.values == [{"a": 1}]


def test_a_slow_client_gets_the_newest_values_merged() -> None:
    """It skips the frames in between, sees each signal's last value, and holds up nobody."""
    clock = FakeClock()
    hub, fanout = robot(clock)
    slow, quick = Watcher(fanout), Watcher(fanout)
    slow.is_stuck = True
    for step in range(100):
        put(hub, clock, a=step)
        fanout.flush()
    put(hub, clock, b=7)
    fanout.flush()
    assert len(quick.values) == 101
    slow.take()
    assert slow.values == [{"a": 99, "b": 7}]
    slow.take()
    assert len(slow.values) == 1


def test_what_comes_after_a_flush_waits_for_the_next() -> None:
    """A client that is woken for another reason gets no extra frame."""
    clock = FakeClock()
    hub, fanout = robot(clock)
    client = Watcher(fanout)
    put(hub, clock, a=1)
    fanout.flush()
    put(hub, clock, a=2)
    client.take()
    assert client.values == [{"a": 1}]
    fanout.flush()
    assert client.values == [{"a": 1}, {"a": 2}]


def test_a_newcomer_gets_everything_with_its_age_now() -> None:
    """The frame of somebody who came earlier is not handed out again when its ages are old."""
    clock = FakeClock()
    hub, fanout = robot(clock)
    put(hub, clock, a=1, b=2)
    fanout.flush()
    Watcher(fanout).take()
    clock._now += 5
    late = Watcher(fanout)
    late.take()
    assert late.values == [{"a": 1, "b": 2}]
    assert values_in(late.frames[0])[0]["a"] == 5000


def readings(watcher: Watcher) -> list[tuple[list[object], object]]:
    """Return the values of the first signal in each frame, and the number of the first of them."""
    frames = values_in(b"".join(watcher.frames))
    return [
        ([value for place, value in zip(frame["i"], frame["v"], strict=True) if place == 0],
         frame.get("e"))
        for frame in frames
    ]  # fmt: skip


@pytest.mark.parametrize("at_once", [1, 10, 40], ids=["one by one", "few", "many"])
def test_of_some_signals_every_reading_is_told(at_once: int) -> None:
    """However they come; whoever comes later gets the newest, and then every one as well."""
    clock = FakeClock()
    hub = Hub({"a": Signal("a"), "b": Signal("b")})
    fanout = Fanout(hub, clock=clock, each=["a"])
    put(hub, clock, a=-1, b=0)
    first = Watcher(fanout)
    fanout.flush()
    for begin in range(0, 40, at_once):
        hub.publish([Sample("a", value, clock.now()) for value in range(begin, begin + at_once)])
        hub.publish([Sample("b", begin, clock.now())])
    fanout.flush()
    assert readings(first) == [([-1], {"0": 1}), ([*range(40)], {"0": 2})]
    assert first.values[-1]["b"] == 40 - at_once
    late = Watcher(fanout)
    put(hub, clock, a=40)
    put(hub, clock, a=41)
    fanout.flush()
    put(hub, clock, b=1)
    fanout.flush()
    assert readings(late) == [([40, 41], {"0": 42}), ([], None)]
    newest = Watcher(fanout)
    newest.take()
    assert readings(newest) == [([41], {"0": 43})]


def test_readings_that_are_not_kept_are_missing_in_the_numbers() -> None:
    """A client that takes nothing for long can tell how many it has lost."""
    clock = FakeClock()
    hub = Hub({"a": Signal("a")})
    fanout = Fanout(hub, clock=clock, each=["a"])
    client = Watcher(fanout)
    client.is_stuck = True
    for value in range(STREAM_KEPT + 7):
        put(hub, clock, a=value)
    fanout.flush()
    client.take()
    ((values, numbers),) = readings(client)
    assert (values[0], len(values), numbers) == (7, STREAM_KEPT, {"0": 8})


def test_lines_of_the_log_are_never_lost_silently() -> None:
    """Numbers run on, so a client that missed more than is kept can say how many."""
    clock = FakeClock()
    hub, fanout = robot(clock)
    place = Place()
    for number in range(700):
        hub.log(LogEntry(clock.now(), "info", "wire", f"line {number}"))
    fanout.flush()
    log = messages_in(fanout.frames_for(place))[0]
    assert (log["first"], len(log["lines"])) == (200, 500)
    assert log["lines"][-1]["text"] == "line 699"
    assert not fanout.frames_for(place)


def test_lines_of_the_log_come_while_values_stream() -> None:
    """A client gets them with the next values, not after the stream ends."""
    clock = FakeClock()
    hub, fanout = robot(clock)
    client = Watcher(fanout)
    put(hub, clock, a=1)
    fanout.flush()
    for value in (2, 3):
        hub.log(LogEntry(clock.now(), "warning", "wire", f"line {value}"))
        put(hub, clock, a=value)
        fanout.flush()
    said = [[message["t"] for message in messages_in(frames)] for frames in client.frames]
    assert said == [["v"], ["v", "log"], ["v", "log"]]


def test_pages_are_told_of_all_commands_and_sequences_that_move_the_robot() -> None:
    """From their start to their end, whoever sent them; a newcomer is told, too."""
    clock = FakeClock()
    hub = Hub({})
    fanout = Fanout(hub, clock=clock, movers=["dance"])
    client = Watcher(fanout)

    def told(watcher: Watcher) -> Any:
        fanout.flush()
        watcher.take()
        messages = messages_in(b"".join(watcher.frames))
        return [one["moving"] for one in messages if one["t"] == "progress"][-1]

    goals = [hub.begin_goal(RunningGoal(0, "goto")) for _ in range(2)]
    assert told(client) == ["goto"]
    hub.set_progress(SequenceProgress("log", 1, 2, "running"))
    hub.set_progress(SequenceProgress("dance", 1, 2, "running"))
    assert told(client) == ["dance", "goto"]
    assert told(Watcher(fanout)) == ["dance", "goto"]
    for goal in goals:
        assert "goto" in told(client)
        hub.end_goal(goal)
    hub.set_progress(SequenceProgress("dance", 2, 2, "paused"))
    assert told(client) == ["dance"]
    hub.set_progress(SequenceProgress("dance", 2, 2, "idle"))
    assert told(client) == []


def test_a_client_that_left_is_not_woken() -> None:
    clock = FakeClock()
    hub, fanout = robot(clock)
    client = Watcher(fanout)
    fanout.leave(client.wake, client.place)
    put(hub, clock, a=1)
    fanout.flush()
    assert client.woken == 0


def test_a_newcomer_gets_the_last_lines_of_the_log() -> None:
    """It learns what happened before it came, and the numbers are the session's."""
    clock = FakeClock()
    hub, fanout = robot(clock)
    for number in range(80):
        hub.log(LogEntry(clock.now(), "info", "wire", f"line {number}"))
    log = messages_in(fanout.frames_for(Watcher(fanout).place))[0]
    assert (log["first"], len(log["lines"])) == (30, 50)


async def test_the_first_change_is_flushed_at_once_and_the_rest_at_the_rate() -> None:
    """Leading edge first; then at most the rate, with the last value never lost."""
    clock = FakeClock()
    hub, fanout = robot(clock)
    client = Watcher(fanout)
    import asyncio

    task = asyncio.create_task(fanout.run())
    await settle()
    put(hub, clock, a=0)
    await settle()
    assert client.values == [{"a": 0}]
    for step in range(1, 1001):  # a thousand a second, for one second
        await clock.advance(0.001)
        put(hub, clock, a=step)
        await settle()
    await clock.advance(0.05)
    assert 58 <= len(client.values) <= 63
    assert client.values[-1] == {"a": 1000}
    task.cancel()


@pytest.mark.parametrize("rate_hz", [10.0, 60.0])
def test_a_source_at_just_the_rate_is_never_held_back(rate_hz: float) -> None:
    """With jitter and a stall, every message still goes when it comes."""
    pacer = Pacer(rate_hz)
    period_s = 1 / rate_hz
    now_s = 100.0
    for step in range(500):
        now_s = 100.0 + step * period_s + (0.4 * period_s if step % 2 else 0.0)
        assert pacer.free_s - now_s <= 1e-9
        pacer.went(now_s)


def test_a_flood_is_let_through_at_the_rate() -> None:
    """However fast they come, no second has more than one above the rate."""
    pacer = Pacer(60.0)
    times = []
    now_s = 0.0
    while now_s < 5.0:
        now_s = max(now_s, pacer.free_s)
        pacer.went(now_s)
        times.append(now_s)
        now_s += 0.0005
    for start in times:
        assert sum(start <= each < start + 1 for each in times) <= 61
    assert all(later >= earlier for earlier, later in pairwise(times))


def test_a_place_starts_at_nothing() -> None:
    """A fresh place has seen no revision and no link."""
    assert Place() == Place(FanoutPosition(revision=0, links=0, progress=0, notes=0))
