"""Whose answer a frame is: correlation, order, stages, refusals, retries, replies of many lines."""

import base64

import pytest

from tests.dialogue import Dialogue

NUMBERED = """
wire: queue: { in_flight: 3 }
signals: { mode: { type: string } }
commands:
  get:
    send: "{{ id }} GET"
    args: { id: { type: integer } }
    reply: { regex: '^(?P<_id>\\d+) (?P<_value>\\w+)$', match: _id == id,
        errors: ['^(?P<_id>\\d+) ERROR (?P<_why>.*)$', '^BROKEN$'] }
  count:
    send: "{{ seq('n', 0, 255) }} COUNT"
    reply: { regex: '^#(?P<_n>\\d+) (?P<_value>\\w+)$', match: _n == seq.n }
  plain: { send: PLAIN, reply: { regex: '^= (?P<_value>\\w+)$' } }
messages:
  mode: { regex: '^MODE (?P<mode>\\w+)$' }
"""


def test_answers_are_picked_by_their_key_whatever_their_order() -> None:
    """And what answers nobody falls through to the messages."""
    talk = Dialogue(NUMBERED).connect()
    for number in (7, 8, 9, 10):
        talk.run("get", id=number)
    assert talk.sent == ["7 GET", "8 GET", "9 GET"]
    talk.says("9 c", "MODE auto", "007 a")
    assert talk.outcomes == {3: "done", 1: "done"}
    assert (talk.replies[3]["value"], talk.replies[1]["value"]) == ("c", "a")
    assert talk.values == {"mode": "auto"}
    assert talk.sent == ["10 GET"]
    talk.says("11 nobody")
    assert talk.faults == ["no-match"]


def test_the_counter_in_a_request_is_a_key() -> None:
    """`seq.NAME` is the number that this very frame carries."""
    talk = Dialogue(NUMBERED).connect()
    for _ in range(3):
        talk.run("count")
    talk.says("#2 c", "#0 a", "#1 b")
    assert [talk.replies[one]["value"] for one in (1, 2, 3)] == ["a", "b", "c"]


def test_a_refusal_is_picked_by_its_key_too() -> None:
    """One that names nobody is for whoever waits longest."""
    talk = Dialogue(NUMBERED).connect()
    for number in (7, 8, 9):
        talk.run("get", id=number)
    talk.says("8 ERROR no such thing", "BROKEN")
    assert talk.outcomes == {2: "refused", 1: "refused"}
    assert talk.messages == [
        "the robot answered '8 ERROR no such thing'",
        "the robot answered 'BROKEN'",
    ]


def test_without_a_key_answers_come_in_the_order_of_the_requests() -> None:
    """A correlated answer in between is no matter."""
    talk = Dialogue(NUMBERED).connect()
    talk.run("plain")
    talk.run("get", id=5)
    talk.run("plain")
    talk.says("= one", "5 x", "= two")
    assert [talk.replies[one]["value"] for one in (1, 2, 3)] == ["one", "x", "two"]


def test_a_late_answer_with_a_key_is_dropped_and_holds_up_nobody() -> None:
    """The next request goes at once: the key tells them apart."""
    talk = Dialogue(NUMBERED).connect()
    talk.run("get", id=1)
    talk.at(0.5)
    assert talk.outcomes == {1: "timed-out"}
    talk.run("get", id=2)
    assert talk.sent == ["1 GET", "2 GET"]
    talk.says("1 late", "2 good")
    assert talk.outcomes[2] == "done"
    assert talk.faults == ["reply-timeout", "late-reply"]


def test_a_late_answer_without_a_key_goes_to_nobody_else() -> None:
    """What was in flight behind it gets its own answer."""
    talk = Dialogue(NUMBERED).connect()
    talk.run("plain")
    talk.at(0.3).run("plain")
    talk.at(0.6)
    talk.says("= late", "= good")
    assert talk.outcomes == {1: "timed-out", 2: "done"}
    assert talk.replies[2]["value"] == "good"


STAGED = """
signals: { done_at: { type: integer } }
commands:
  go:
    send: GO
    reply:
      stages:
        - { regex: '^ACK (?P<_job>\\d+)$', timeout: 200ms }
        - { regex: '^DONE (?P<done_at>\\d+)$', timeout: 30s, errors: ['^STUCK'] }
      errors: [{ regex: '^ERR (?P<_code>\\d+)$', text: "Error {{ _code | int + 1 }}" }]
"""


def test_an_answer_may_have_stages() -> None:
    """Each has its own form, and what they say comes together in the end."""
    talk = Dialogue(STAGED).connect()
    number = talk.run("go")
    talk.says("ACK 7")
    assert talk.outcomes == {}
    talk.at(20.0).says("DONE 12")
    assert (talk.outcomes, talk.values) == ({number: "done"}, {"done_at": 12})
    assert talk.replies[number] == {"job": "7", "done_at": 12}


@pytest.mark.parametrize(
    ("frames", "until", "outcome", "message"),
    [
        ((), 0.2, "timed-out", "no answer to go within 0.2 s"),
        (("ACK 7",), 30.0, "timed-out", "no answer to go within 30 s"),
        (("ACK 7", "STUCK at 3"), 0.1, "refused", "the robot answered 'STUCK at 3'"),
        (("ERR 41",), 0.1, "refused", "Error 42"),
        (("ACK 7", "ERR 41"), 0.1, "refused", "Error 42"),
    ],
)
def test_each_stage_has_its_timeout_and_its_refusals(
    frames: tuple[str, ...], until: float, outcome: str, message: str
) -> None:
    """Those of the whole reply hold at every stage."""
    talk = Dialogue(STAGED).connect()
    talk.run("go")
    if frames:
        talk.says(*frames)
    talk.at(until)
    assert talk.outcomes == {1: outcome}
    assert message in talk.messages


RETRIED = """
commands:
  get: { send: "{{ seq('n', 0, 9) }} GET", idempotent: true, retries: 2, reply: { regex: '^V' } }
  other: { send: OTHER, reply: { regex: '^O' } }
"""


def test_what_is_idempotent_is_sent_again_with_the_same_bytes() -> None:
    """After one timeout, ahead of the others: any answer to it is as good as another."""
    talk = Dialogue(RETRIED).connect()
    talk.run("get")
    talk.run("other")
    assert talk.at(0.4).sent == ["0 GET"]
    assert talk.at(0.5).sent == ["0 GET"]
    assert talk.at(1.0).sent == ["0 GET"]
    talk.says("V1")
    assert talk.outcomes == {1: "done"}


def test_the_second_answer_to_a_retried_request_goes_to_no_other() -> None:
    """The robot answers both copies: the second answer is dropped, and the next request waits."""
    talk = Dialogue(RETRIED).connect()
    talk.run("get")
    talk.run("other")
    talk.at(0.6).says("V1")
    assert talk.outcomes == {1: "done"}
    assert talk.sent == ["0 GET", "0 GET"]
    talk.at(0.7).says("V1")
    assert talk.faults == ["reply-timeout", "late-reply"]
    assert talk.sent == ["OTHER"]
    talk.says("O")
    assert talk.outcomes == {1: "done", 2: "done"}


def test_retries_end() -> None:
    """And count as one miss."""
    talk = Dialogue(RETRIED).connect()
    talk.run("get")
    talk.at(5.0)
    assert talk.sent == ["0 GET"] * 3
    assert talk.outcomes == {1: "timed-out"}
    assert talk.faults == ["reply-timeout"] * 3
    assert talk.links == []


def test_a_late_answer_spares_the_retry() -> None:
    """It is as good as the answer to the same request, sent again."""
    talk = Dialogue(RETRIED.replace("retries: 2", "retries: { count: 2, initial: 1s }")).connect()
    talk.run("get")
    talk.at(0.7).says("V1")
    assert talk.outcomes == {1: "done"}
    assert talk.at(5.0).sent == ["0 GET"]


LINES = """
signals: { a: { type: integer }, b: { type: integer }, note: { type: string } }
commands:
  three: { send: THREE, reply: { regex: '^A(?P<a>\\d)\\nB(?P<b>\\d)\\nC', lines: 3 } }
  dump: { send: DUMP, reply: { regex: '(?s)^A(?P<a>\\d).*B(?P<b>\\d)', lines: { until: '^END$' },
      errors: ['^ERR'] } }
messages:
  note: { regex: '^NOTE (?P<note>.*)$' }
"""


@pytest.mark.parametrize(
    ("command", "frames", "values"),
    [
        ("three", ("A1", "B2", "C3"), {"a": 1, "b": 2}),
        ("three", ("A1", "NOTE hi", "B2", "C3"), {"a": 1, "b": 2, "note": "hi"}),
        ("three", ("echo", "A1", "B2", "C3"), {"a": 1, "b": 2}),
        ("dump", ("A1", "x", "y", "B2", "END"), {"a": 1, "b": 2}),
        ("dump", ("junk", "END", "A1", "B2", "END"), {"a": 1, "b": 2}),
    ],
)
def test_a_reply_may_be_several_frames(
    command: str, frames: tuple[str, ...], values: dict[str, object]
) -> None:
    """Messages that come in between are told as such; a stray line does not shift the rest."""
    for chunks in ([frames], [(one,) for one in frames]):
        talk = Dialogue(LINES).connect()
        talk.run(command)
        for chunk in chunks:
            talk.says(*chunk)
        assert (talk.outcomes, talk.values) == ({1: "done"}, values)


def test_a_refusal_ends_a_reply_of_several_lines() -> None:
    """Whatever has come of it before."""
    talk = Dialogue(LINES).connect()
    talk.run("dump")
    talk.says("A1", "ERR 3")
    assert talk.outcomes == {1: "refused"}


def test_a_reply_that_never_ends_is_dropped_and_times_out() -> None:
    """What is collected has a bound."""
    talk = Dialogue(LINES).connect()
    talk.run("dump")
    for _ in range(30):
        talk.says(*(["x" * 100] * 500))
    assert talk.faults == ["no-match"]
    talk.at(0.5)
    assert talk.outcomes == {1: "timed-out"}


def test_a_reply_may_bring_its_own_framing() -> None:
    """What follows it is cut as the line is, even in the same chunk."""
    text = """
signals: { a: { type: string }, mode: { type: string } }
commands:
  raw: { send: RAW, reply: { regex: '(?s)^(?P<a>....)$', framing: { type: fixed, size: 4 } } }
messages: { mode: { regex: '^MODE (?P<mode>\\w+)$' } }
"""
    data = b"MODE one\nAB\nDMODE two\n"
    for size in (1, 3, len(data)):
        talk = Dialogue(text).connect()
        talk.raw(data[:9])
        talk.run("raw")
        for start in range(9, len(data), size):
            talk.raw(data[start : start + size])
        assert talk.values == {"mode": "two", "a": "AB\nD"}
        assert talk.outcomes == {1: "done"}


GREETING = """
wire: on_connect:
wire: - { expect: '^HELLO (?P<_name>\\w+)$' }
wire: - expect: { framing: { type: fixed, size: 16 }, struct: [{ id: _n, type: bytes, size: 16 }] }
wire: - { send: "LOGIN {{ _name }} {{ _n | b64encode }}" }
wire: - { expect: '^WELCOME$' }
signals: { mode: { type: string } }
messages: { mode: { regex: '^MODE (?P<mode>\\w+)$' } }
"""
NONCE = b"\n\x00abc\nHELLO x\n\r\xff"


@pytest.mark.parametrize("size", [1, 2, 7, 9, 16, 17, 25, 33, 100])
def test_a_step_may_bring_its_own_framing(size: int) -> None:
    """The greeting is a line, the challenge sixteen bytes of any kind, and then come lines again.

    However the bytes are cut by the network, and when more follows than was asked for.
    """
    assert len(NONCE) == 16
    talk = Dialogue(GREETING).connect()
    data = b"HELLO ada\n" + NONCE + b"MODE idle\n"
    for start in range(0, len(data), size):
        talk.raw(data[start : start + size])
    assert talk.values == {"mode": "idle"}
    assert talk.sent == [f"LOGIN ada {base64.b64encode(NONCE).decode()}"]
    talk.says("WELCOME", "MODE two")
    assert talk.values == {"mode": "two"}
    assert talk.faults == []
    assert talk.engine.lines["wire"].is_ready


def test_a_frame_that_came_before_its_step_is_cut_by_the_framing_of_the_step() -> None:
    """The bytes lie there, no line to the line's own framing, while the sequence waits."""
    talk = Dialogue(
        """
signals: { mode: { type: string } }
messages: { mode: { regex: '^MODE (?P<mode>\\w+)$' } }
sequences:
  read:
    - { wait: 1s }
    - { expect: { framing: { type: fixed, size: 4 }, regex: '^(?P<mode>....)$' } }
"""
    ).connect()
    talk.run("read")
    talk.raw(b"ABCDMODE x")
    assert talk.values == {}
    talk.at(1.0)
    assert talk.values == {"mode": "ABCD"}
    assert talk.outcomes == {1: "done"}
    talk.raw(b"y\n")
    assert talk.values == {"mode": "xy"}


def test_a_step_that_waited_in_vain_leaves_the_line_to_its_own_framing() -> None:
    """Half a challenge is in front of the next line; the one after it is whole."""
    talk = Dialogue(
        """
signals: { mode: { type: string } }
messages: { mode: { regex: '^MODE (?P<mode>\\w+)$' } }
sequences: { read: [{ expect: { framing: { type: fixed, size: 9 }, regex: '^.{9}$' } }] }
"""
    ).connect()
    talk.run("read")
    talk.raw(b"\n123")
    talk.at(0.5)
    assert talk.outcomes == {1: "timed-out"}
    talk.raw(b"\nMODE on\n")
    assert talk.values == {"mode": "on"}
    assert talk.faults == ["no-match"] * 2


def test_a_request_that_times_out_says_what_came_in_place_of_the_answer() -> None:
    """A pattern that is nearly right is the most frequent fault of a new driver."""
    talk = Dialogue(
        """
commands:
  home: { send: HOME, reply: { regex: '^HOMED$' } }
  wait: { send: WAIT, reply: { regex: '^DONE$' } }
sequences: { dock: [{ expect: '^DOCKED$' }] }
"""
    ).connect()
    talk.says("earlier")
    talk.at(0.1).run("home")
    talk.says("OK")
    talk.at(0.6)
    assert talk.messages[-1] == (
        "no answer to home within 0.5 s; received 'OK', which is no answer to home"
    )
    talk.at(2.0).run("wait")
    talk.at(2.5)
    assert talk.messages[-1] == "no answer to wait within 0.5 s"
    talk.at(4.0).run("dock")
    talk.says("DOCKING")
    talk.at(4.5)
    assert talk.messages[-1] == (
        "dock.0: the expected frame did not arrive within 0.5 s; received 'DOCKING', which is not"
        " the expected frame"
    )


def test_answers_in_another_order_ask_for_match() -> None:
    """Without it, the first request waits for an answer that the second one had."""
    talk = Dialogue(
        """
wire: queue: { in_flight: 2 }
commands:
  volts: { send: V, reply: { regex: '^V[0-9]$' } }
  amps: { send: A, reply: { regex: '^A[0-9]$' } }
"""
    ).connect()
    talk.run("volts")
    talk.run("amps")
    talk.says("A1")
    talk.at(0.5)
    assert any(
        one == "no answer to volts within 0.5 s; received 'A1', which is no answer to volts;"
        " if replies arrive in a different order from requests, declare 'match'"
        for one in talk.messages
    ), talk.messages


def test_a_secret_that_cannot_be_written_names_what_is_missing() -> None:
    """A name shows nothing; its value would."""
    talk = Dialogue(
        """
wire: on_connect: [
wire:   { expect: '^HELLO( (?P<_salt>[a-z]+))?$' },
wire:   { send: "IN {{ (settings.key ~ _salt) | md5 }}" } ]
settings: { key: { type: string, secret: true } }
""",
        {"key": "geheim"},
    ).connect()
    talk.says("HELLO")
    told = " ".join([*talk.messages, *talk.links])
    assert "'_salt' has no value here" in told
    assert "geheim" not in told
