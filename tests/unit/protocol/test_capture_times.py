"""Times of capture in messages with images, of all servers that state them."""

from pathlib import Path
from typing import Any

import pytest

from urc.config.load import load_profile
from urc.model.payload import Envelope
from urc.model.values import Sample
from urc.protocol.engine import Engine
from urc.protocol.events import Noted, Samples
from urc.protocol.forms.topics import paths_by_topic
from urc.protocol.readings.capture_times import stamp_s
from urc.runtime.registries import built_in_catalog

DAY_S = 1_700_000_000
"""A time of day; the clocks of robots count from 1970."""
JPEG = b"\xff\xd8image\xff\xd9"
PROFILE = """
urc: 1
kind: robot
name: rover
title: Rover
transports:
  ros: { type: ros, via: foxglove, host: 127.0.0.1 MORE }
signals:
  front: { type: image KEY }
  whole: { type: image }
  count: { type: integer }
messages:
  front: { subscribe: { topic: /front }, json: { front: data, count: count } }
  whole: { subscribe: { topic: /whole }, json: { whole: "@" } }
"""


class Rover:
    """An engine with two cameras."""

    def __init__(self, folder: Path, *, key: str = "", more: str = "") -> None:
        file = folder / "rover.yaml"
        file.write_text(PROFILE.replace("KEY", key).replace("MORE", more))
        profile = load_profile(file, built_in_catalog())
        assert not isinstance(profile, list)
        self.driver = profile.driver
        self.engine = Engine(self.driver, {})
        self.engine.start("ros", 0.0)
        self.notes: list[str] = []

    def hear(self, topic: str, body: dict[str, Any], now: float) -> list[Sample]:
        found: list[Sample] = []
        for event in self.engine.receive("ros", Envelope("message", {"topic": topic}, body), now):
            if isinstance(event, Samples):
                found += event.samples
            if isinstance(event, Noted):
                self.notes.append(event.text)
        return found

    def age_s(self, topic: str, body: dict[str, Any], now: float) -> float:
        (sample,) = self.hear(topic, body, now)
        return round(now - sample.time_s, 3)


def ros(stamp_s: float) -> dict[str, Any]:
    stamp = {"sec": DAY_S + int(stamp_s), "nanosec": round(stamp_s % 1 * 1e9)}
    return {"header": {"stamp": stamp, "frame_id": "eye"}, "format": "jpeg", "data": JPEG}


def ros1(stamp_s: float) -> dict[str, Any]:
    stamp = {"secs": DAY_S + int(stamp_s), "nsecs": round(stamp_s % 1 * 1e9)}
    return {"header": {"stamp": stamp}, "format": "jpeg", "data": JPEG}


def foxglove(stamp_s: float) -> dict[str, Any]:
    stamp = {"sec": DAY_S + int(stamp_s), "nanosec": round(stamp_s % 1 * 1e9)}
    return {"timestamp": stamp, "format": "jpeg", "data": JPEG}


def foxglove_json(stamp_s: float) -> dict[str, Any]:
    stamp = {"sec": DAY_S + int(stamp_s), "nsec": round(stamp_s % 1 * 1e9)}
    return {"timestamp": stamp, "format": "jpeg", "data": JPEG}


@pytest.mark.parametrize("message", [ros, ros1, foxglove, foxglove_json])
@pytest.mark.parametrize("topic", ["/front", "/whole"])
def test_an_image_that_waited_is_older_than_its_arrival(
    tmp_path: Path, topic: str, message: Any
) -> None:
    rover = Rover(tmp_path)
    assert rover.age_s(topic, message(1000.0), 10.0) == 0, "the clocks share no beginning"
    assert rover.age_s(topic, message(1000.1), 10.1) == 0
    assert rover.age_s(topic, message(1000.2), 11.0) == 0.8
    assert rover.age_s(topic, message(1001.1), 11.1) == 0
    assert rover.notes == []


def test_a_clock_that_is_set_is_one_line_in_the_log_and_locks_nothing(tmp_path: Path) -> None:
    rover = Rover(tmp_path)
    rover.age_s("/front", ros(1000.0), 10.0)
    rover.age_s("/front", ros(1000.1), 10.1)
    assert [rover.age_s("/front", ros(900.2 + n / 10), 10.2 + n / 10) for n in range(5)] == [0] * 5
    assert len(rover.notes) == 1
    assert rover.notes[0].startswith("front: the times of capture are suddenly 100.0 s behind")


@pytest.mark.parametrize(
    "stamp",
    [
        *(None, 7.5, "now", [], {}, {"sec": 0, "nanosec": 0}, {"sec": -1, "nanosec": 0}),
        *({"sec": DAY_S}, {"sec": DAY_S, "nanosec": 10**9}, {"sec": 2**40, "nanosec": 0}),
        *({"sec": True, "nanosec": 0}, {"sec": DAY_S + 0.5, "nanosec": 0}),
        *({"sec": 10**400, "nanosec": 0}, {"sec": 10**9 - 1, "nanosec": 0}),
    ],
)
def test_a_message_without_a_usable_stamp_counts_from_its_arrival(
    tmp_path: Path, stamp: object
) -> None:
    assert stamp_s(stamp) is None
    rover = Rover(tmp_path)
    for now in (10.0, 11.0):
        assert rover.age_s("/front", {"header": {"stamp": stamp}, "data": JPEG}, now) == 0


@pytest.mark.parametrize(
    ("key", "more"), [(", capture_time: false", ""), ("", ", use_sim_time: true")]
)
def test_slow_clocks_can_be_left_out(tmp_path: Path, key: str, more: str) -> None:
    rover = Rover(tmp_path, key=key, more=more)
    for now in range(10, 20):
        assert rover.age_s("/front", ros(1000 + now * 0.5), float(now)) == 0


def test_a_stamp_alone_is_no_image(tmp_path: Path) -> None:
    rover = Rover(tmp_path)
    assert rover.hear("/front", {"header": {"stamp": {"sec": DAY_S, "nanosec": 0}}}, 1.0) == []


def test_other_values_of_the_message_keep_their_arrival(tmp_path: Path) -> None:
    rover = Rover(tmp_path)
    rover.hear("/front", {**ros(1000.0), "count": 1}, 10.0)
    samples = {one.signal: one for one in rover.hear("/front", {**ros(1000.0), "count": 2}, 12.0)}
    assert samples["count"].time_s == 12.0
    assert samples["front"].time_s == 10.0


def test_binary_messages_are_read_up_to_their_stamp(tmp_path: Path) -> None:
    paths = paths_by_topic(Rover(tmp_path).driver, "ros", {})
    assert {("data",), ("header", "stamp"), ("timestamp",)} <= set(paths["/front"])


def test_a_simulation_that_runs_slower_than_real_time_makes_nothing_old(tmp_path: Path) -> None:
    """Its clock counts from its start."""
    rover = Rover(tmp_path)
    for step in range(100):
        stamp = {"sec": step // 2, "nanosec": 5 * 10**8 * (step % 2)}
        body = {"header": {"stamp": stamp}, "data": JPEG}
        assert rover.age_s("/front", body, 10.0 + step) == 0
