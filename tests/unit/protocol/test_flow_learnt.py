"""What the steps of a connection learnt is known to all that is said on it, and for as long."""

import pytest

from tests.dialogue import Dialogue, driver_of
from urc.protocol.events import Ready
from urc.protocol.motion_encoder import MotionUnavailable

SESSION = """
wire: keepalive: { every: 3s, send: "{{ _session }} ALIVE" }
wire: on_connect: [{ send: LOGIN }, { expect: '^HELLO (?P<_session>\\w+)$' }]
wire: on_close: [{ send: "{{ _session }} BYE" }]
commands:
  get:
    send: "{{ _session }} GET {{ what }}"
    args: { what: { type: string } }
    reply: { regex: '^V$' }
    idempotent: true
    retries: 1
  count: { send: "{{ _session }} {{ seq('n', 0, 9) }}" }
  drive:
    send: "{{ _session }} V {{ v }}"
    args: { v: {} }
    hold: { repeat: 50ms, release: { v: 0 }, watchdog: 500ms }
messages:
  ping: { regex: '^PING$', acknowledge: "{{ _session }} PONG" }
polls: [{ every: 2s, send: "{{ _session }} VOLTS" }]
sequences:
  twice: [{ send: "{{ _session }} ONE" }, { run: count }, { send: "{{ _session }} TWO" }]
"""


def logged_in(name: str = "abc") -> Dialogue:
    """Return a conversation on which the robot has said its session."""
    talk = Dialogue(SESSION).connect()
    assert talk.sent == ["LOGIN"]
    talk.says(f"HELLO {name}")
    return talk.at(0.0)


def test_commands_polls_and_keepalive_know_what_the_login_learnt() -> None:
    """And so do answers to messages, and the steps of sequences."""
    talk = logged_in()
    assert talk.sent == ["abc VOLTS"]
    talk.run("get", what="x")
    assert talk.sent == ["abc GET x"]
    talk.says("V", "PING")
    assert talk.sent == ["abc PONG"]
    talk.run("twice")
    assert talk.sent == ["abc ONE", "abc 0", "abc TWO"]
    assert talk.at(2.0).sent == ["abc VOLTS"]


def test_what_keeps_a_line_alive_knows_it() -> None:
    """With nothing else said."""
    talk = Dialogue(SESSION.replace("every: 2s", "every: 60s")).connect()
    talk.says("HELLO abc")
    assert talk.at(3.0).sent == ["LOGIN", "abc VOLTS", "abc ALIVE"]


def test_the_good_bye_knows_it() -> None:
    """A robot has to be told which session ends."""
    talk = logged_in()
    talk.take(talk.engine.finish(talk.now))
    assert talk.sent == ["abc VOLTS", "abc BYE"]


def test_a_command_that_waits_for_the_login_is_written_after_it() -> None:
    """Nothing is known before; its arguments are checked all the same."""
    talk = Dialogue(SESSION).connect()
    talk.run("get", what="x")
    talk.run("count")
    assert talk.sent == ["LOGIN"]
    talk.says("HELLO abc")
    assert talk.sent[0] == "abc GET x"
    assert talk.outcomes == {}


def test_a_new_connection_has_a_session_of_its_own() -> None:
    """The old one is known to nobody, not even before the new login is done."""
    talk = logged_in()
    talk.take(talk.engine.closed("wire", "gone", talk.now))
    talk.connect()
    talk.run("get", what="x")
    talk.says("HELLO new")
    assert "new GET x" in talk.sent


def test_a_request_that_is_sent_again_has_the_same_bytes() -> None:
    """On the same connection."""
    talk = logged_in()
    talk.run("get", what="x")
    talk.at(0.6)
    assert talk.sent == ["abc VOLTS", "abc GET x", "abc GET x"]


def test_motion_knows_it() -> None:
    """Each frame of it, and the one that stops."""
    talk = Dialogue(SESSION).connect()
    motions = talk.engine.motions
    assert not motions.is_lasting("drive")
    with pytest.raises(MotionUnavailable):
        motions.motion_frame("drive", {"v": 1}, 0.0)
    talk.says("HELLO abc")
    assert motions.motion_frame("drive", {"v": 1}, 0.0) == b"abc V 1\n"
    assert motions.stop_frame("drive") == b"abc V 0\n"


def test_what_was_not_learnt_is_named() -> None:
    """One way through the login says a session, the other does not."""
    text = """
wire: on_connect:
wire: - { if: settings.guest, then: [{ send: HI }], else: [{ expect: '^(?P<_id>\\d+)$' }] }
settings: { guest: { type: boolean, default: true } }
commands: { go: { send: "{{ _id }} GO" } }
"""
    talk = Dialogue(text, {"guest": True}).connect()
    talk.run("go")
    assert talk.outcomes == {1: "bad-argument"}
    assert "_id" in talk.messages[-1]


PER_REQUEST = """
wire: connection: per_request
wire: on_connect: [{ expect: '^NONCE (?P<_nonce>\\w+)$' }]
commands:
  get: { send: "GET {{ _nonce }}", reply: { regex: '^V$' }, idempotent: true, retries: 1 }
polls: [{ every: 10s, phase: 1s, send: "POLL {{ _nonce }}", reply: { regex: '^V$' } }]
"""


def test_a_connection_of_its_own_for_each_request_has_its_own_nonce() -> None:
    """Also when the request is sent again."""
    talk = Dialogue(PER_REQUEST)
    talk.take(talk.engine.tick(0.0))
    talk.run("get")
    assert talk.links == ["open wire"]
    talk.take(talk.engine.start("wire", 0.0))
    talk.says("NONCE one")
    assert talk.sent == ["GET one"]
    talk.at(0.5)
    talk.take(talk.engine.start("wire", talk.now))
    talk.says("NONCE two")
    assert talk.sent == ["GET two"]
    talk.says("V")
    assert talk.outcomes == {1: "done"}
    talk.at(1.0)
    talk.take(talk.engine.start("wire", talk.now))
    talk.says("NONCE three")
    assert talk.sent == ["POLL three"]


def test_a_name_that_no_login_learns_is_found_when_the_document_is_loaded() -> None:
    """With the names that there are."""
    with pytest.raises(AssertionError, match="did you mean '_session'"):
        driver_of(SESSION.replace("{{ _session }} GET", "{{ _sesion }} GET"))


def test_what_another_line_learnt_is_not_known_here() -> None:
    """Each login is about its own line."""
    text = """
transports:
  a:
    type: udp
    host: x
    port: 1
    on_connect: [{ expect: '^(?P<_id>\\d+)$' }]
  b: { type: udp, host: x, port: 2 }
commands:
  go: { to: b, send: "{{ _id }}" }
  come: { to: a, send: "{{ _id }}" }
"""
    text = text.replace("type: udp", "type: pigeon")
    with pytest.raises(AssertionError, match=r"commands\.go\.send: '_id' is unknown here"):
        driver_of(text)


WAITS = """
wire: on_connect: [{ send: LOGIN }, { wait: 1s }, { expect: '^OK$' }]
messages: { armed: { regex: '^ARMED$' } }
sequences:
  arm: [{ expect: '^(OK|ARMED)$', timeout: 10s }, { send: GO }]
"""


def test_a_sequence_waits_for_the_login() -> None:
    """As a command does: what the robot says to the login is not said to the sequence."""
    talk = Dialogue(WAITS).connect()
    talk.run("arm")
    talk.at(1.0).says("OK")
    assert talk.outcomes == {}
    assert talk.sent == ["LOGIN"]
    talk.says("ARMED")
    assert talk.sent == ["GO"]
    assert talk.outcomes == {1: "done"}


def test_a_sequence_does_not_wait_for_ever_for_a_login() -> None:
    """It fails with the line, or when a command would."""
    talk = Dialogue(WAITS).connect()
    talk.run("arm")
    talk.at(1.5)
    assert talk.outcomes == {1: "disconnected"}


def test_the_engine_says_when_a_login_is_done() -> None:
    """Only then is a line live; without steps nobody waits for it."""
    talk = Dialogue(WAITS)
    talk.take(talk.engine.tick(0.0))
    assert not any(isinstance(one, Ready) for one in talk.engine.start("wire", 0.0))
    talk.at(1.0)
    events = talk.engine.receive("wire", b"OK\n", talk.now)
    assert Ready("wire") in events
