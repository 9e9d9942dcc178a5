"""What a robot says about a request before it answers: say it again, or wait, I am busy."""

import pytest

from tests.dialogue import Dialogue

PRINTER = """
signals: { note: { type: string } }
commands:
  move:
    send: "N{{ seq('n', 1, 9) }} G0"
    reply: { equals: ok, errors: ['^!!'], resend: '^Resend', extend: '^busy' }
  home:
    send: HOME
    idempotent: true
    retries: 1
    reply: { equals: ok, resend: '^Resend', extend: { regex: '^busy', within: 2s }, timeout: 1s }
  other: { send: OTHER, reply: { equals: done } }
messages:
  note: { regex: '^(?P<note>busy.*)$' }
"""


def test_the_robot_is_sent_the_same_frame_again_at_once() -> None:
    """With the number that it had, and before what waits."""
    talk = Dialogue(PRINTER).connect()
    talk.run("move")
    talk.run("other")
    talk.at(0.4).says("Resend:1")
    assert talk.sent == ["N1 G0", "N1 G0"]
    talk.at(0.8).says("ok")
    assert talk.outcomes == {1: "done"}
    assert talk.sent == ["OTHER"]
    talk.says("done")
    talk.run("move")
    assert talk.sent == ["N2 G0"]


def test_a_frame_is_sent_again_three_times_where_nothing_else_is_said() -> None:
    """A line so bad that no copy arrives must not be kept busy for ever."""
    talk = Dialogue(PRINTER).connect()
    talk.run("move")
    for _ in range(4):
        talk.says("Resend:1")
    assert talk.sent == ["N1 G0"] * 4
    assert talk.outcomes == {1: "refused"}
    assert talk.messages[-1] == "the robot requested move again after 4 transmissions"


def test_retries_bound_how_often_a_frame_is_sent_again() -> None:
    """Those after a timeout and those that the robot asks for, together."""
    talk = Dialogue(PRINTER).connect()
    talk.run("home")
    talk.says("Resend")
    assert talk.at(0.9).sent == ["HOME"] * 2
    talk.at(1.5)
    assert (talk.sent, talk.outcomes) == ([], {1: "timed-out"})
    talk.at(3.0).run("home")
    talk.at(4.5).says("Resend")
    assert talk.sent == ["HOME"] * 2
    assert talk.outcomes[2] == "refused"


def test_what_is_not_idempotent_may_be_sent_again_for_a_robot_that_asks() -> None:
    """It says that it has not done it; after a timeout that is not known."""
    text = PRINTER.replace("errors: ['^!!']", "errors: ['^!!']").replace(
        "move:\n    send", "move:\n    retries: 2\n    send"
    )
    talk = Dialogue(text).connect()
    talk.run("move")
    talk.says("Resend", "Resend")
    assert talk.sent == ["N1 G0"] * 3
    talk.at(1.0)
    assert (talk.sent, talk.outcomes) == ([], {1: "timed-out"})


def test_a_busy_robot_is_waited_for() -> None:
    """Each such frame restarts the timeout, and is the message that it is."""
    talk = Dialogue(PRINTER).connect()
    talk.run("move")
    for time in (0.4, 0.8, 1.2):
        talk.at(time).says(f"busy {time}")
    assert talk.values == {"note": "busy 1.2"}
    assert talk.outcomes == {}
    talk.at(1.6).says("ok")
    assert talk.outcomes == {1: "done"}
    assert talk.faults == []


def test_a_robot_that_is_busy_and_then_silent_has_not_answered() -> None:
    """The timeout counts from its last word."""
    talk = Dialogue(PRINTER).connect()
    talk.run("move")
    talk.at(0.4).says("busy")
    talk.at(0.89)
    assert talk.outcomes == {}
    talk.at(0.9)
    assert talk.outcomes == {1: "timed-out"}


def test_a_robot_that_is_busy_for_ever_has_not_answered() -> None:
    """All that it asks for has an end."""
    talk = Dialogue(PRINTER.replace("    retries: 1\n", "")).connect()
    talk.run("home")
    for tenth in range(1, 21):
        talk.at(tenth / 10).says("busy")
    assert talk.outcomes == {1: "timed-out"}
    text = "no answer to home within 2 s, while the robot was busy"
    assert talk.messages[-1].startswith(text)
    talk.run("other")
    assert talk.at(2.9).sent == ["HOME"]
    talk.says("ok")
    assert talk.sent == ["OTHER"]


@pytest.mark.parametrize("said", ["busy", "Resend"])
def test_an_aside_about_nothing_is_no_answer(said: str) -> None:
    """With nothing under way it is a message, or nothing declared."""
    talk = Dialogue(PRINTER).connect()
    talk.says(said)
    assert talk.sent == []
    assert talk.faults == ([] if said == "busy" else ["no-match"])


KEYED = """
wire: queue: { in_flight: 2 }
commands:
  get:
    send: "{{ id }} GET"
    args: { id: { type: integer } }
    reply:
      regex: '^(?P<_id>\\d+) = (?P<_value>\\w+)$'
      match: _id == id
      resend: '^(?P<_id>\\d+) AGAIN$'
      extend: { regex: '^(?P<_id>\\d+) WAIT$' }
"""


def test_an_aside_is_about_the_request_that_it_names() -> None:
    """By the same key as the answer."""
    talk = Dialogue(KEYED).connect()
    talk.run("get", id=1)
    talk.run("get", id=2)
    assert talk.sent == ["1 GET", "2 GET"]
    talk.at(0.4).says("2 AGAIN", "2 WAIT")
    assert talk.sent == ["2 GET"]
    talk.at(0.6)
    assert talk.outcomes == {1: "timed-out"}
    talk.says("2 = x")
    assert talk.outcomes == {1: "timed-out", 2: "done"}


STAGED = """
commands:
  go:
    send: GO
    reply:
      stages:
        - { equals: ACK, resend: '^NAK$', extend: '^WAIT$' }
        - { equals: DONE, extend: '^STILL$' }
"""


def test_asides_belong_to_a_stage() -> None:
    """Sent again, the first answer is waited for again."""
    talk = Dialogue(STAGED).connect()
    talk.run("go")
    talk.at(0.4).says("NAK")
    assert talk.sent == ["GO", "GO"]
    talk.at(0.8).says("WAIT")
    talk.at(1.2).says("ACK")
    talk.at(1.6).says("STILL")
    talk.at(2.0).says("DONE")
    assert talk.outcomes == {1: "done"}


BINARY = """
transports:
  wire: { type: tcp, host: x, port: 1, framing: { type: fixed, size: 2 } }
signals: { volts: { type: integer } }
polls:
  - name: volts
    every: 10s
    send: { hex: "01 02" }
    reply:
      struct: [{ const: 6, type: u8 }, u8 volts]
      resend: { struct: [{ const: 21, type: u8 }, u8 _why] }
"""


def test_an_aside_may_have_any_form() -> None:
    """A NAK of a binary line, for a poll."""
    talk = Dialogue(BINARY).connect()
    talk.raw(b"\x15\x00")
    assert talk.sent == ["\x01\x02", "\x01\x02"]
    talk.raw(b"\x06\x2a")
    assert talk.values == {"volts": 42}


MANY = """
commands:
  list: { send: LIST, reply: { regex: '^a\\nb$', lines: 2, extend: '^wait$' } }
"""


def test_an_aside_between_the_lines_of_a_reply_is_none_of_them() -> None:
    """The lines before and after it belong together."""
    talk = Dialogue(MANY).connect()
    talk.run("list")
    talk.says("a", "wait", "b")
    assert talk.outcomes == {1: "done"}


REFUSED = """
signals:
  fault: { type: integer }
  last: { type: string }
messages:
  error: { regex: '^(?P<last>E.*)$' }
commands:
  go:
    send: GO
    reply: { equals: OK, errors: [{ regex: '^E(?P<_n>\\d+)$', set: { fault: "_n | int" } }] }
  dump: { send: DUMP, reply: { regex: '^a\\nb$', lines: 2, errors: ['^ERR$'] } }
  list:
    send: LIST
    reply: { regex: '(?s)^a.*END$', lines: { until: '^END$' }, errors: ['^ERR$'] }
sequences:
  walk: [{ send: GO }, { expect: { equals: OK, errors: [{ regex: '^E(?P<fault>\\d+)$' }] } }]
"""


@pytest.mark.parametrize("how", ["go", "walk"])
def test_a_refusal_sets_signals(how: str) -> None:
    """By its own fields, and as the message that it is."""
    talk = Dialogue(REFUSED).connect()
    talk.run(how)
    talk.says("E42")
    assert talk.outcomes == {1: "refused"}
    assert talk.values == {"fault": 42, "last": "E42"}


@pytest.mark.parametrize("command", ["dump", "list"])
def test_a_refusal_of_a_reply_of_several_lines_may_be_a_message(command: str) -> None:
    """A message among the lines is none of them, and refuses all the same."""
    talk = Dialogue(REFUSED).connect()
    talk.run(command)
    talk.says("ERR")
    assert talk.outcomes == {1: "refused"}
    assert talk.values == {"last": "ERR"}


def test_the_refusal_of_a_counted_reply_is_looked_for_in_all_of_it() -> None:
    """A line of data that begins with the same word is no refusal."""
    text = """
commands:
  log:
    send: LOG
    reply:
      regex: '(?s)^LOG.*$'
      lines: 3
      errors: ['^ERR', '^FAULT\\n\\d']
"""
    talk = Dialogue(text).connect()
    talk.run("log")
    talk.says("LOG", "ERR 3 at 12:00", "ERR 4 at 13:00")
    assert talk.outcomes == {1: "done"}
    talk.run("log")
    talk.says("ERR no log")
    assert talk.outcomes[2] == "refused"
    talk.run("log")
    talk.says("FAULT", "7")
    assert talk.outcomes[3] == "refused"
    assert talk.messages[-1] == "the robot answered 'FAULT\\n7'"


SHARED = """
wire: errors: ['^BUSY$', { regex: '^ERR (?P<_code>\\d+)$', text: "Error {{ _code }}" }]
signals: { volts: { type: integer } }
commands:
  go: { send: GO, reply: { equals: OK } }
  slow: { send: SLOW, reply: { equals: OK, errors: [{ equals: ERR 7, text: It is slow }] } }
  two: { send: TWO, reply: { stages: [{ equals: ACK }, { equals: OK }] } }
  tell: { send: TELL }
polls: [{ send: VOLTS, every: 10s, reply: { regex: '^(?P<volts>\\d+)$' } }]
"""


@pytest.mark.parametrize(
    ("command", "frames", "message"),
    [
        ("go", ("ERR 3",), "Error 3"),
        ("go", ("BUSY",), "the robot answered 'BUSY'"),
        ("slow", ("ERR 7",), "It is slow"),
        ("slow", ("ERR 8",), "Error 8"),
        ("two", ("ACK", "ERR 3"), "Error 3"),
    ],
)
def test_refusals_that_a_line_shares_hold_for_every_reply(
    command: str, frames: tuple[str, ...], message: str
) -> None:
    """Those of the reply itself come first."""
    talk = Dialogue(SHARED).connect()
    talk.says("12")
    talk.run(command)
    talk.says(*frames)
    assert talk.outcomes == {1: "refused"}
    assert talk.messages == [message]


def test_refusals_that_a_line_shares_hold_for_polls() -> None:
    """As for commands."""
    talk = Dialogue(SHARED).connect()
    talk.says("ERR 9")
    assert talk.faults == ["refused"]
    assert talk.messages == ["polls.0: Error 9"]
