"""Messages that become entries of the robot's log."""

from pathlib import Path
from typing import Any

import pytest

from bench.rig.ros_messages import ROS2
from urc.config.load import load_profile
from urc.model.payload import Envelope
from urc.protocol.engine import Engine
from urc.protocol.events import Event, Noted, Samples, Send, Violation
from urc.protocol.requests.message_effects import LONGEST_NOTE
from urc.runtime.hub import Hub
from urc.runtime.link_report import NOTES_BURST, NOTES_REFILL_S, LinkReport
from urc.runtime.registries import built_in_catalog
from urc.testing.clock import FakeClock

LINES = """
urc: 1
kind: robot
name: talker
transports:
  wire: { type: tcp, host: 127.0.0.1, port: 1, framing: { type: delimiter, tx: LF, rx: LF } }
signals: { x: { type: number } }
messages:
  report:
    regex: '^(?P<_kind>[A-Z]+) (?P<x>[0-9]+) (?P<_text>.*)$'
    acknowledge: "OK {{ _text }}"
    log:
      text: "{{ _text }} at {{ x }}"
      level: >-
        'error' if _kind == 'ERR' else 'warning' if _kind == 'WRN' else
        'fatal' if _kind == 'ODD' else '' if _kind == 'DBG' else 'info'
"""
ROSOUT = """
urc: 1
kind: robot
name: talker
transports: { ros: { type: ros, via: auto, host: 127.0.0.1, version: 2 } }
messages:
  rosout:
    subscribe: { topic: /rosout, type: rcl_interfaces/Log }
    json: { _level: level, _node: name, _text: msg }
    when: _level >= 20
    log:
      text: "{{ _node }}: {{ _text }}"
      level: "'error' if _level >= 40 else 'warning' if _level >= 30 else 'info'"
"""


pytestmark = pytest.mark.anyio


def engine_of(text: str, folder: Path) -> Engine:
    path = folder / "talker.yaml"
    path.write_text(text, encoding="utf-8")
    return Engine(load_profile(path, built_in_catalog()).driver, {})


@pytest.fixture(name="engine")
def the_engine(tmp_path: Path) -> Engine:
    engine = engine_of(LINES, tmp_path)
    engine.start("wire", 0.0)
    return engine


def test_each_level_with_the_fields_and_the_signals_of_the_message(engine: Engine) -> None:
    events = engine.receive("wire", b"ERR 1 hot\nWRN 2 warm\nINF 3 fine\nDBG 4 noise\n", 1.0)
    assert [one for one in events if isinstance(one, Noted)] == [
        Noted("wire", "error", "hot at 1"),
        Noted("wire", "warning", "warm at 2"),
        Noted("wire", "info", "fine at 3"),
    ]
    values = [one.value for event in events if isinstance(event, Samples) for one in event.samples]
    assert values == [1, 2, 3, 4]
    sent = [event.data for event in events if isinstance(event, Send)]
    assert sent == [b"OK hot\n", b"OK warm\n", b"OK fine\n", b"OK noise\n"]


def test_an_unknown_level_is_a_fault_and_the_signals_are_set(engine: Engine) -> None:
    events = engine.receive("wire", b"ODD 5 text\n", 1.0)
    (fault,) = [one for one in events if isinstance(one, Violation)]
    assert fault.message == "the level of a log entry is info, warning or error, found 'fatal'"
    assert any(isinstance(one, Samples) and one.samples for one in events)


def test_text_is_bounded_and_has_no_control_characters(engine: Engine) -> None:
    line = b"ERR 1 \x1b[31m" + b"a" * 5000 + b"\n"
    (noted,) = [one for one in engine.receive("wire", line, 1.0) if isinstance(one, Noted)]
    assert len(noted.text) == LONGEST_NOTE
    assert noted.text.isprintable()


@pytest.mark.parametrize(
    ("level", "expected"), [(10, None), (20, "info"), (30, "warning"), (40, "error"), (50, "error")]
)
def test_the_log_of_ros_nodes_in_cdr(tmp_path: Path, level: int, expected: Any) -> None:
    """rosbags writes the message; level 10 is DEBUG, which the example leaves out."""
    engine, name = engine_of(ROSOUT, tmp_path), "rcl_interfaces/msg/Log"
    engine.start("ros", 0.0)
    stamp = ROS2.types["builtin_interfaces/msg/Time"](1, 2)
    made = ROS2.types[name](stamp, level, "lidar", "motor stalled", "a.cpp", "spin", 7)
    said = {"topic": "/rosout", "encoding": "cdr"}
    text, _ = ROS2.generate_msgdef(name, ros_version=2)
    data = bytes(ROS2.serialize_cdr(made, name))
    events: list[Event] = []
    for envelope in (
        Envelope("definition", {**said, "type": name, "notation": "ros2msg"}, text),
        Envelope("message", said, data),
    ):
        events += engine.receive("ros", envelope, 1.0)
    noted = [one for one in events if isinstance(one, Noted)]
    assert noted == ([Noted("ros", expected, "lidar: motor stalled")] if expected else [])


async def test_a_flood_is_limited_and_its_size_is_told() -> None:
    clock = FakeClock()
    hub = Hub({})
    report = LinkReport("ros", "", hub, clock)
    for count in range(NOTES_BURST + 30):
        report.note(Noted("ros", "info", f"line {count}"))
    assert hub.notes_count == NOTES_BURST
    await clock.advance(NOTES_REFILL_S * 2)
    report.note(Noted("ros", "error", "last"))
    last = hub.notes[-1]
    assert (last.level, last.text) == ("error", "last (after 30 entries that are not shown)")
