"""Message shapes: what goes to a page, and what is taken from one."""

import json
import math

import pytest

from urc.expressions import compile_expression
from urc.model.driver import Command, Driver, Message, Poll, Reply
from urc.model.exchange import Hold
from urc.model.profile import Profile
from urc.model.values import AlarmAttributes, AlarmLimits, Sample, Signal
from urc.runtime.hub import LinkStatus, LogEntry
from urc.testing.profile import regex, text
from urc.web.wire import messages as wire


def test_a_frame_holds_indexes_values_and_ages() -> None:
    """Names are told once; frames carry indexes only, and alarms only when there are any."""
    samples = [Sample("b", 7, 9.5), Sample("a", True, 9.999)]
    text = wire.encode_values(samples, wire.Indexes({"a": 0, "b": 1}), 10.0)
    assert json.loads(text) == {"t": "v", "n": 10000, "i": [1, 0], "v": [7, True], "a": [500, 1]}


def test_readings_that_are_equally_old_have_one_age() -> None:
    """What came in one message mostly is; an age is never below nothing."""
    indexes = wire.Indexes({"a": 0, "b": 1})
    samples = [Sample("a", 1, 9.5), Sample("b", 2, 9.5)]
    assert json.loads(wire.encode_values(samples, indexes, 10.0))["a"] == 500
    assert json.loads(wire.encode_values(samples, indexes, 9.0))["a"] == 0


def test_alarms_stand_beside_their_values() -> None:
    """One alarm in a frame brings the list for all of its values."""
    samples = [Sample("a", 1, 1.0, "low"), Sample("b", 2, 1.0)]
    text = wire.encode_values(samples, wire.Indexes({"a": 0, "b": 1}), 1.0)
    assert json.loads(text)["s"] == ["low", ""]


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (None, None),
        (1.5, 1.5),
        (math.nan, None),
        (math.inf, None),
        (2**53 - 1, 2**53 - 1),
        (2**53, "9007199254740992"),
        (-(2**63), "-9223372036854775808"),
        (True, True),
        ("", ""),
        ("</script>", "</script>"),
        ("x" * 5000, "x" * 4095 + "…"),
        ("a\ud800b", "a?b"),
    ],
)
def test_values_arrive_as_a_browser_can_hold_them(value: object, shown: object) -> None:
    """Integers beyond a browser's, huge texts, broken text and NaN never break a frame."""
    sample = Sample("a", value, 1.0)  # type: ignore[arg-type]
    frame = json.loads(wire.encode_values([sample], wire.Indexes({"a": 7}), 1.0))
    assert frame == {"t": "v", "n": 1000, "i": [7], "v": [shown], "a": 0}


def test_hello_says_what_each_signal_means_and_where_it_comes_from() -> None:
    """The page can tell which values are cut off when one of several lines is lost."""
    reply = Reply(regex(r"^(?P<volts>\d+)$"))
    driver = Driver(
        signals={
            "volts": Signal(
                "volts", "number", unit="V", limits=AlarmLimits(low=11), stale_after_s=3
            ),
            "note": Signal("note", "string", states=(("0", "off"),), stale_after_s=2),
        },
        messages={"m": Message("m", "radio", regex(r"(?P<note>.*)"))},
        polls=(Poll("polls.0", "wire", 1.0, text("volts?"), reply),),
        commands={
            "home": Command("home", "wire", text("HOME")),
            "calibrate": Command("calibrate", "wire", text("CAL"), role="maintain"),
            "drive": Command("drive", "wire", text("go"), hold=Hold(0.05, {})),
        },
    )
    hello = json.loads(wire.encode_hello(Profile("p", "P", "p.yaml", driver=driver), "s1", 2.0))
    assert hello == {
        "t": "hello", "version": 1, "session": "s1", "robot": "p", "title": "P", "now": 2000,
        "names": ["volts", "note"],
        "signals": [
            {"name": "volts", "type": "number", "unit": "V", "limits": {"low": 11.0},
             "stale_after_s": 3, "sources": ["wire"], "has_alarms": True},
            {"name": "note", "type": "string", "states": {"0": "off"},
             "stale_after_s": 2, "sources": ["radio"]},
        ],
        "roles": {"home": "drive", "calibrate": "maintain", "drive": "drive"},
        "controls": ["drive"],
        "pictures": "",
    }  # fmt: skip


def test_hello_tells_the_priorities_that_are_not_the_usual_ones() -> None:
    """Usual ones are not sent: most robots declare no others."""
    low, high = AlarmAttributes("low"), AlarmAttributes("high")
    limits = AlarmLimits(lolo=5, low=10, attributes=(("low", low),))
    states = AlarmLimits(states=("open", "fault"), attributes=(("fault", high),))
    usual = AlarmLimits(hihi=5, high=4, attributes=(("hihi", high),))
    driver = Driver(
        signals={
            "charge": Signal("charge", "number", limits=limits),
            "door": Signal("door", "string", limits=states),
            "heat": Signal("heat", "number", limits=usual),
        }
    )
    hello = json.loads(wire.encode_hello(Profile("p", "P", "p.yaml", driver=driver), "s1", 2.0))
    assert [one.get("priorities") for one in hello["signals"]] == [
        {"lolo": "high", "low": "low"},
        {"open": "medium", "fault": "high"},
        None,
    ]


def test_hello_tells_which_videos_the_page_compares() -> None:
    """The server itself compares images; a playback shows images again after a jump."""
    driver = Driver(
        signals={
            "film": Signal("film", "video", frozen_after_s=2.0),
            "front": Signal("front", "image", frozen_after_s=2.0),
        }
    )
    profile = Profile("p", "P", "p.yaml", driver=driver)
    for is_playback, wanted in ((False, [2.0, None]), (True, [None, None])):
        hello = json.loads(wire.encode_hello(profile, "s1", 2.0, is_playback=is_playback))
        assert [one.get("frozen_after_s") for one in hello["signals"]] == wanted


def test_a_computed_signal_comes_from_where_its_inputs_come_from() -> None:
    """It is old when none of their lines is live, by way of others too."""
    driver = Driver(
        signals={
            "half": Signal("half", formula=compile_expression("power / 2")),
            "power": Signal("power", formula=compile_expression("volts * amps")),
            "volts": Signal("volts"),
            "amps": Signal("amps"),
        },
        messages={
            "v": Message("v", "wire", regex(r"^V(?P<volts>.*)")),
            "a": Message("a", "radio", regex(r"^A(?P<amps>.*)")),
        },
    )
    hello = json.loads(wire.encode_hello(Profile("p", "P", "p.yaml", driver=driver), "s1", 2.0))
    sources = {one["name"]: one.get("sources") for one in hello["signals"]}
    assert sources["half"] == sources["power"] == ["radio", "wire"]


def test_values_of_many_parts() -> None:
    """Lists and named parts go as they are; of bytes only how many there are."""
    samples = [
        Sample("cells", (3.9, None, 2**60), 1.0),
        Sample("pose", {"x": [1, {"y": b"abc"}], 3: "z"}, 1.0),
        Sample("picture", b"\xff" * 40000, 1.0),
        Sample("rays", (0.5, None, math.nan, True), 1.0),
        Sample("words", ("a", "\ud800"), 1.0),
    ]
    index = {"cells": 0, "pose": 1, "picture": 2, "rays": 3, "words": 4}
    assert json.loads(wire.encode_values(samples, wire.Indexes(index), 1.5))["v"] == [
        [3.9, None, str(2**60)],
        {"x": [1, {"y": {"bytes": 3}}], "3": "z"},
        {"bytes": 40000},
        [0.5, None, None, True],
        ["a", "?"],
    ]


def test_links_log_replies_and_pongs() -> None:
    """The other messages, each as the page reads it."""
    link = LinkStatus("wire", "lost", "tcp x:1", 1.0, "connection refused", 3, 4)
    assert json.loads(wire.encode_links([link], 3.0)) == {
        "t": "links",
        "links": [
            {"transport": "wire", "state": "lost", "address": "tcp x:1", "since": 2000,
             "detail": "connection refused", "attempts": 3, "faults": 4, "cause": "refused",
             "ready": False}
        ],
    }  # fmt: skip
    assert json.loads(wire.encode_log([LogEntry(1.0, "error", "wire", "no")], 7, 2.0)) == {
        "t": "log",
        "first": 7,
        "lines": [{"age": 1000, "level": "error", "source": "wire", "text": "no"}],
    }
    run = wire.CommandRequest(5, "go")
    assert json.loads(wire.encode_reply(run, values={"x": 1})) == {
        "t": "reply", "id": 5, "ok": True, "values": {"x": 1},
    }  # fmt: skip
    assert json.loads(wire.encode_reply(run, code="timed-out", message="late")) == {
        "t": "reply", "id": 5, "ok": False, "code": "timed-out", "message": "late",
    }  # fmt: skip
    assert json.loads(wire.encode_pong(wire.Ping(1.5), 2.0)) == {"t": "pong", "c": 1.5, "n": 2000}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"t":"ping","c":12.5}', wire.Ping(12.5)),
        ('{"t":"run","id":1,"command":"go"}', wire.CommandRequest(1, "go")),
        (
            '{"t":"run","id":1,"command":"go","arguments":{"v":1.5,"s":"x","__proto__":null}}',
            wire.CommandRequest(1, "go", {"v": 1.5, "s": "x", "__proto__": None}),
        ),
    ],
)
def test_good_messages(text: str, message: wire.Inbound) -> None:
    """What a page may say."""
    assert wire.decode(text) == message


@pytest.mark.parametrize(
    "text",
    [
        "",
        "x",
        "null",
        "[]",
        "{}",
        '{"t":"nope"}',
        '{"t":"ping"}',
        '{"t":"ping","c":"1"}',
        '{"t":"ping","c":1,"extra":1}',
        '{"t":"run","id":"1","command":"go"}',
        '{"t":"run","id":1,"command":"go","arguments":{"v":[[1]]}}',
        '{"t":"run","id":1,"command":"go","arguments":{"v":{"w":1}}}',
        '{"t":"run","id":1,"command":"go","arguments":[]}',
        '{"t":"ping","c":1}{"t":"ping","c":1}',
        '{"t":"ping","c":1',
        "[" * 60_000,
        '{"a":' * 10_000,
        '{"t":"ping","x":' + "[" * 60_000,
        '{"t":"run","id":1,"command":"' + "x" * wire.INBOUND_BYTES + '"}',
        "\ud800",
        b'{"t":"ping","c":\xff}',
    ],
)
def test_bad_messages_are_refused_with_a_reason(text: str | bytes) -> None:
    """Whatever a page sends ends in one kind of error: wrong type, too deep, too long, no JSON."""
    with pytest.raises(wire.BadMessage) as caught:
        wire.decode(text)
    assert str(caught.value)
