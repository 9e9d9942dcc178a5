"""Messages instead of bytes: topics, calls and requests through the engine of a driver."""

from pathlib import Path

import pytest

from urc.client.local import load
from urc.model.payload import Envelope
from urc.model.profile import Profile
from urc.protocol.engine import Engine
from urc.protocol.events import Event, Failed, Replied, Request, Samples, Send, Violation
from urc.protocol.forms.topics import listened, matches

DOCUMENT = """
urc: 1
kind: robot
name: rover

settings:
  space: { type: string, default: /rover }

transports:
  ros: { type: ros, host: 127.0.0.1 }
  broker: { type: mqtt, host: 127.0.0.1 }
  web: { type: http, url: "http://127.0.0.1:8080" }

signals:
  x: { type: number, unit: m }
  volts: { type: number }
  level: { type: number }
  progress: { type: number }
  camera: { type: image }

messages:
  odom:
    from: ros
    subscribe: { topic: "{{ settings.space }}/odom", type: nav_msgs/Odometry, throttle: 100ms }
    json: { x: pose.pose.position.x }
  docking: { from: ros, subscribe: { topic: /dock/feedback }, json: { progress: done } }
  cells:
    from: broker
    subscribe: { topic: cells/+/volts }
    regex: '^(?P<volts>[\\d.]+)$'
    when: "_topic == 'cells/a/volts'"
  picture: { from: web, subscribe: { topic: /cam, stream: mjpeg }, raw: camera }

commands:
  drive:
    to: ros
    args: { speed: { type: number, min: -1, max: 1 } }
    send:
      publish:
        { topic: /cmd_vel, type: geometry_msgs/Twist, json: { linear: { x: "{{ speed }}" } } }
  reset: { to: ros, send: { call: { service: /reset, type: std_srvs/Trigger } } }
  dock:
    to: ros
    send: { goal: { action: /dock, type: irobot_create_msgs/action/Dock, json: {} } }
  lamp:
    to: broker
    args: { lit: { type: boolean } }
    send: { publish: { topic: cmnd/POWER, text: "{{ 'ON' if lit else 'OFF' }}" } }
    reply: { subscribe: { topic: stat/POWER }, regex: '^(?P<_state>ON|OFF)$' }
  set_level:
    to: web
    args: { level: { type: number } }
    send: { request: { method: PUT, path: /level, query: { n: "{{ level }}" } } }
  ask_level: { to: web, send: { request: { path: /level } }, reply: { json: { level: value } } }
"""


@pytest.fixture
def profile(tmp_path: Path) -> Profile:
    path = tmp_path / "rover.yaml"
    path.write_text(DOCUMENT)
    return load(path)


@pytest.fixture
def engine(profile: Profile) -> Engine:
    engine = Engine(profile.driver, {"space": "/rover"})
    for name in profile.driver.transports:
        engine.start(name, 0.0)
    return engine


def sent(events: list[Event]) -> list[object]:
    return [event.data for event in events if isinstance(event, Send)]


def readings(events: list[Event]) -> dict[str, object]:
    samples = [event.samples for event in events if isinstance(event, Samples)]
    return {one.signal: one.value for some in samples for one in some}


def message(topic: str, body: object) -> Envelope:
    return Envelope("message", {"topic": topic}, body)


def test_a_message_sets_signals_when_it_comes_on_its_topic(engine: Engine) -> None:
    body = {"pose": {"pose": {"position": {"x": 1.5}}}}
    assert readings(engine.receive("ros", message("/rover/odom", body), 1.0)) == {"x": 1.5}


def test_the_same_message_on_another_topic_is_a_fault(engine: Engine) -> None:
    body = {"pose": {"pose": {"position": {"x": 1.5}}}}
    (fault,) = engine.receive("ros", message("/odom", body), 1.0)
    assert isinstance(fault, Violation)
    assert fault.code == "no-match"
    assert "/odom" in fault.message


def test_json_in_bytes_is_read_like_json_as_data(engine: Engine) -> None:
    body = b'{"pose":{"pose":{"position":{"x":2}}}}'
    assert readings(engine.receive("ros", message("/rover/odom", body), 1.0)) == {"x": 2}


def test_a_wildcard_tells_its_topic(engine: Engine) -> None:
    assert readings(engine.receive("broker", message("cells/a/volts", b"3.7"), 1.0)) == {
        "volts": 3.7
    }
    assert not readings(engine.receive("broker", message("cells/b/volts", b"3.6"), 1.0))


def test_a_picture_is_taken_whole(engine: Engine) -> None:
    jpeg = b"\xff\xd8\xff\xd9"
    assert readings(engine.receive("web", message("/cam", jpeg), 1.0)) == {"camera": jpeg}


def test_the_topics_listened_to_come_from_messages_and_replies(profile: Profile) -> None:
    assert listened(profile.driver, "ros", {"space": "/rover"}) == {
        "/rover/odom": {"type": "nav_msgs/Odometry", "throttle": 0.1},
        "/dock/feedback": {},
    }
    assert list(listened(profile.driver, "broker", {})) == ["cells/+/volts", "stat/POWER"]


def test_a_publish_is_done_when_it_is_sent(engine: Engine) -> None:
    events = engine.command(Request(1, "drive", {"speed": 0.5}), 1.0)
    (envelope,) = sent(events)
    assert envelope == Envelope(
        "publish",
        {"topic": "/cmd_vel", "type": "geometry_msgs/Twist"},
        {"linear": {"x": 0.5}},
    )
    assert events[-1] == Replied(1, "drive")


def test_a_call_is_done_when_its_own_answer_has_come(engine: Engine) -> None:
    first = sent(engine.command(Request(1, "reset"), 1.0))[0]
    second = sent(engine.command(Request(2, "reset"), 1.0))[0]
    assert isinstance(first, Envelope)
    assert isinstance(second, Envelope)
    assert first.attributes["id"] != second.attributes["id"]

    answer = Envelope("response", {"id": second.attributes["id"], "ok": True}, {"success": True})
    assert engine.receive("ros", answer, 1.1)[-1] == Replied(2, "reset")
    answer = Envelope("response", {"id": first.attributes["id"], "ok": True}, {"success": True})
    assert engine.receive("ros", answer, 1.2)[-1] == Replied(1, "reset")


def test_a_call_that_is_refused_fails_with_the_robots_reason(engine: Engine) -> None:
    (call,) = sent(engine.command(Request(1, "reset"), 1.0))
    assert isinstance(call, Envelope)
    refusal = Envelope(
        "response",
        {"id": call.attributes["id"], "ok": False, "reason": "service /reset is unknown"},
    )
    (failed,) = engine.receive("ros", refusal, 1.1)
    assert failed == Failed(1, "reset", "refused", "service /reset is unknown")


def test_a_message_never_answers_a_call(engine: Engine) -> None:
    engine.command(Request(1, "ask_level"), 1.0)
    events = engine.receive("web", message("/level", b'{"value": 7}'), 1.1)
    assert not [event for event in events if isinstance(event, Replied)]


def test_the_body_of_a_response_is_the_reply(engine: Engine) -> None:
    (asked,) = sent(engine.command(Request(1, "ask_level"), 1.0))
    assert isinstance(asked, Envelope)
    number = asked.attributes["id"]
    assert asked == Envelope("request", {"path": "/level", "method": "GET", "id": number})
    body = b'{"value": 7}'
    events = engine.receive(
        "web", Envelope("response", {"id": number, "ok": True, "status": 200}, body), 1.1
    )
    assert readings(events) == {"level": 7}
    assert events[-1] == Replied(1, "ask_level", {"level": 7})


def test_a_response_that_is_not_as_declared_says_so(engine: Engine) -> None:
    (asked,) = sent(engine.command(Request(1, "ask_level"), 1.0))
    assert isinstance(asked, Envelope)
    answer = Envelope("response", {"id": asked.attributes["id"], "ok": True}, b"<html>")
    (failed,) = engine.receive("web", answer, 1.1)
    assert isinstance(failed, Failed)
    assert failed.message == "the reply does not match the declaration: '<html>'"


def test_an_answer_that_comes_too_late_is_nobodys(engine: Engine) -> None:
    (asked,) = sent(engine.command(Request(1, "ask_level"), 1.0))
    assert isinstance(asked, Envelope)
    assert [one for one in engine.tick(5.0) if isinstance(one, Failed)]
    again = sent(engine.command(Request(2, "ask_level"), 5.0))[0]
    assert isinstance(again, Envelope)
    late = Envelope("response", {"id": asked.attributes["id"], "ok": True}, b'{"value": 1}')
    events = engine.receive("web", late, 5.1)
    assert not readings(events)
    assert not [one for one in events if isinstance(one, Replied)]


def test_an_answer_may_come_on_a_topic(engine: Engine) -> None:
    (envelope,) = sent(engine.command(Request(1, "lamp", {"lit": True}), 1.0))
    assert envelope == Envelope("publish", {"topic": "cmnd/POWER"}, b"ON")
    events = engine.receive("broker", message("stat/POWER", b"ON"), 1.1)
    assert events[-1] == Replied(1, "lamp", {"state": "ON"})


def test_arguments_stand_in_addresses_too(engine: Engine) -> None:
    (envelope,) = sent(engine.command(Request(1, "set_level", {"level": 3}), 1.0))
    assert isinstance(envelope, Envelope)
    assert envelope.attributes["query"] == {"n": "3"}


def test_the_progress_of_a_goal_comes_as_messages(engine: Engine) -> None:
    (goal,) = sent(engine.command(Request(1, "dock"), 1.0))
    assert isinstance(goal, Envelope)
    number = goal.attributes["id"]
    feedback = Envelope("feedback", {"id": number, "action": "/dock"}, {"done": 0.4})
    assert readings(engine.receive("ros", feedback, 1.1)) == {"progress": 0.4}
    result = Envelope("response", {"id": number, "ok": True}, {})
    assert engine.receive("ros", result, 1.2)[-1] == Replied(1, "dock")


@pytest.mark.parametrize(
    ("topic", "name", "fits"),
    [
        ("a/b", "a/b", True),
        ("a/b", "a/b/c", False),
        ("a/+/c", "a/b/c", True),
        ("a/+/c", "a/b/b/c", False),
        ("a/#", "a/b/c", True),
        ("a/#", "a", True),
        ("a/#", "b/a", False),
        ("#", "a/b", True),
        ("+", "a", True),
        ("+", "a/b", False),
        ("+/+", "/a", True),
        ("/+", "/a", True),
    ],
)
def test_wildcards_are_those_of_mqtt_5_section_4_7(topic: str, name: str, *, fits: bool) -> None:
    assert matches(topic)(name) is fits
