"""The emulated robot, without a socket or a clock."""

from pathlib import Path

import pytest

from urc.client.local import load
from urc.model.payload import Envelope
from urc.model.profile import Profile, Reaction, SimulatorRule
from urc.patterns import compile_pattern
from urc.simulator.emulated_robot import EmulatedConnection, EmulatedRobot
from urc.testing.profile import line_profile, text

ASK = b"Give me the battery %\n"


def line_with(*rules: SimulatorRule) -> EmulatedConnection:
    profile = line_profile()
    return EmulatedRobot(with_rules(profile, *rules), {"port": 5}).line("wire")


def with_rules(profile: Profile, *rules: SimulatorRule) -> Profile:
    return profile._replace(simulator=rules or profile.simulator)


def rule(
    pattern: str | None, send: str | None, every_s: float | None = None, transport: str = "wire"
) -> SimulatorRule:
    match = None if pattern is None else compile_pattern(pattern)
    answer = None if send is None else text(send)
    return SimulatorRule(transport, match, every_s=every_s, reactions=(Reaction(send=answer),))


DIALOGUES = [
    ("the puppet", (), ASK, b"45\n"),
    ("byte after byte of a frame", (), b"Give me", b""),
    ("nobody's frame", (), b"hello\n", b""),
    ("two frames", (), ASK + ASK, b"45\n45\n"),
    (
        "groups",
        (rule(r"^add (?P<a>\d+) (?P<b>\d+)$", "{{ (a|int) + (b|int) }}"),),
        b"add 2 3\n",
        b"5\n",
    ),
    ("settings", (rule("^port$", "{{ settings.port }}"),), b"port\n", b"5\n"),
    ("first rule wins", (rule("^a", "one"), rule("^ab", "two")), b"ab\n", b"one\n"),
    ("takes it and says nothing", (rule("^a", None),), b"a\n", b""),
    ("rules of another line", (rule("^a", "x", transport="other"),), b"a\n", b""),
]


@pytest.mark.parametrize(("name", "rules", "sent", "expected"), DIALOGUES)
def test_frames_are_answered_by_the_rules(
    name: str, rules: tuple[SimulatorRule, ...], sent: bytes, expected: bytes
) -> None:
    """Whole and byte by byte, the robot says the same."""
    now_s = 1_700_000_045.9
    assert b"".join(line_with(*rules).receive(sent, now_s)) == expected
    line = line_with(*rules)
    dripped = [b"".join(line.receive(bytes([byte]), now_s)) for byte in sent]
    assert b"".join(dripped) == expected


FAULTS = [
    (b"hello\n", (), "no rule matches 'hello', and the driver never sends it"),
    (b"\xff\n", (), "received a frame that is not valid utf-8 text"),
    (b"a\n", (rule("^a", "{{ nothing }}"),), "'nothing' has no value here"),
    (b"x" * 70_000, (), "a frame has more than 65536 bytes without b'\\n'; dropped"),
]


@pytest.mark.parametrize(("sent", "rules", "message"), FAULTS)
def test_fault_is_counted_and_told(
    sent: bytes, rules: tuple[SimulatorRule, ...], message: str
) -> None:
    """Nothing a client sends, and no mistake in a rule, is an exception."""
    line = line_with(*rules)
    assert line.receive(sent, 0.0) == []
    assert (line.faults, line.last_fault) == (1, message)


def test_limit_of_answers_drops_what_comes_after() -> None:
    """A robot that closes after an answer does not look at the rest."""
    assert line_with().receive(ASK + ASK, 7.0, limit=1) == [b"7\n"]


def test_periodic_rules_speak_at_their_times() -> None:
    """Time comes in steps of any size; a long pause is not made up for."""
    line = line_with(rule(None, "tick {{ now | int }}", every_s=0.5))
    assert line.due_in_s == 0.5
    assert line.advance(0.3, 1.0) == []
    assert line.due_in_s == pytest.approx(0.2)
    assert line.advance(0.2, 2.0) == [b"tick 2\n"]
    assert line.advance(10.1, 3.0) == [b"tick 3\n"]
    assert line.due_in_s == pytest.approx(0.4)
    assert line_with().due_in_s is None


def test_a_reply_of_fields_that_mean_nothing_elsewhere_is_answered_all_the_same(
    tmp_path: Path,
) -> None:
    path = tmp_path / "caller.yaml"
    path.write_text(
        "urc: 1\nkind: robot\nname: caller\n"
        "transports: { ros: { type: ros, host: 127.0.0.1 } }\n"
        "signals: { x: {} }\n"
        "messages: { x: { subscribe: { topic: /x }, json: { x: data } } }\n"
        "commands:\n"
        "  reset: { send: { call: { service: /reset } }, reply: { json: { _ok: success } } }\n"
    )
    line = EmulatedRobot(load(path), {}).line("ros")
    (answer,) = line.receive(Envelope("call", {"service": "/reset", "id": 7}, {}), 0.0)
    assert answer == Envelope("response", {"id": 7, "ok": True, "status": 200}, b'{"success":1}')
