"""What is asked again and again, and what keeps a line alive."""

import pytest

from tests.dialogue import Dialogue
from urc.protocol.events import Request

POLLED = """
signals: { mode: { type: string, stale_after: 3s }, volts: {}, amps: {} }
commands:
  volts: { send: "V{{ channel }}?", args: { channel: { type: integer, default: 1 } },
      reply: { regex: '^V=(?P<volts>[0-9.]+)$' } }
messages: { mode: { regex: '^MODE (?P<mode>\\w+)$' } }
polls:
  - { run: volts, args: { channel: 2 }, every: 1s }
  - { send: A?, every: 1s, phase: 500ms, when: mode == 'auto',
      reply: { regex: '^A=(?P<amps>[0-9.]+)$' } }
"""


def test_a_poll_may_run_a_command() -> None:
    """With its reply, and arguments of the poll's own."""
    talk = Dialogue(POLLED).connect()
    assert talk.sent == ["V2?"]
    talk.says("V=3.5")
    assert talk.values == {"volts": 3.5}


def test_a_poll_is_asked_while_its_condition_holds() -> None:
    """A signal that was never read, or is old, makes it false."""
    talk = Dialogue(POLLED).connect()
    asked = []
    for tick in range(16):
        talk.at(tick / 2)
        if tick == 2:
            talk.says("MODE auto")
        sent = talk.sent
        if "V2?" in sent:
            talk.says("V=1")
        if "A?" in sent:
            asked.append(tick / 2)
            talk.says("A=1")
    assert asked == [1.5, 2.5, 3.5]


def test_a_poll_that_nobody_answers_is_asked_less_often_until_it_is() -> None:
    """One dead part stalls nobody, and its misses do not close the line."""
    talk = Dialogue(
        """
wire: timeouts: { reply: 100ms }
signals: { a: {}, b: {} }
polls:
  - { send: A?, every: 1s, reply: { regex: '^A=(?P<a>\\d)$' }, offline: { after: 3, retry: 10s } }
  - { send: B?, every: 1s, phase: 300ms, reply: { regex: '^B=(?P<b>\\d)$' } }
""".replace("wire: timeouts: { reply: 100ms }\n", "")
    ).connect()
    asked, is_dead = [], True
    for tick in range(400):
        talk.at(tick / 10)
        for frame in talk.sent:
            if frame == "B?":
                talk.says("B=1")
            else:
                asked.append(tick / 10)
                is_dead = tick < 200
                if not is_dead:
                    talk.says("A=1")
    assert talk.links == []
    first = [time for time in asked if time < 20]
    assert len(first) == 4
    assert first[3] - first[2] == pytest.approx(10.5, abs=0.11)
    alive = [time for time in asked if time > 20]
    assert len(alive) == pytest.approx(17, abs=2)


ALIVE = """
wire: keepalive: { every: 2s, send: "BEAT {{ seq('n', 0, 9) }}" }
commands: { ping: { send: PING } }
"""


def test_a_line_is_kept_alive_when_nothing_else_is_sent() -> None:
    """Whatever is sent counts."""
    talk = Dialogue(ALIVE).connect()
    assert talk.at(1.9).sent == []
    assert talk.at(2.0).sent == ["BEAT 0"]
    talk.at(3.5).run("ping")
    assert talk.at(5.4).sent == ["PING"]
    assert talk.at(5.5).sent == ["BEAT 1"]
    talk.take(talk.engine.closed("wire", "cut", 5.5))
    assert talk.at(20.0).sent == []


def test_a_line_may_be_kept_alive_by_a_command() -> None:
    """Its answer is waited for, and misses count."""
    talk = Dialogue(
        """
wire: keepalive: { every: 1s, run: ping }
commands: { ping: { send: PING, reply: { equals: PONG } } }
"""
    ).connect()
    assert talk.at(1.0).sent == ["PING"]
    talk.says("PONG")
    talk.at(10.0)
    assert talk.faults == ["reply-timeout"] * 3
    assert talk.links == ["close wire: no answer to ping within 0.5 s"]
    assert talk.outcomes == {}


def test_silence_is_told_of_once() -> None:
    """And again after the robot has spoken."""
    talk = Dialogue(
        """
wire: stale_after: 1s
signals: { mode: { type: string }, own: { type: string, stale_after: 9s } }
messages: { mode: { regex: '^(?P<mode>\\w+) (?P<own>\\w+)$' } }
"""
    ).connect()
    talk.at(10.0)
    assert talk.faults == ["no-data"]
    talk.says("a b")
    talk.at(20.0)
    assert talk.faults == ["no-data", "no-data"]
    ages = {name: one.stale_after_s for name, one in talk.engine.known._signals.items()}
    assert ages == {"mode": 1.0, "own": 9.0}


def test_an_unknown_command_ends_once() -> None:
    """Like everything else."""
    talk = Dialogue(ALIVE).connect()
    talk.take(talk.engine.command(Request(1, "fly"), 0.0))
    assert talk.outcomes == {1: "unknown-command"}


COUNTED = """
wire: keepalive: { every: 2s, run: ping, after: [beat] }
commands:
  ping: { send: PING }
  beat: { send: BEAT }
  other: { send: OTHER }
polls: [{ run: beat, every: 60s, phase: 11s }]
"""


def test_only_what_the_robot_counts_puts_off_the_keepalive() -> None:
    """Its own words count, and so does a poll that runs what counts."""
    talk = Dialogue(COUNTED).connect()
    talk.at(1.0).run("other")
    assert talk.at(1.9).sent == ["OTHER"]
    assert talk.at(2.0).sent == ["PING"]
    talk.at(3.0).run("beat")
    assert talk.at(4.9).sent == ["BEAT"]
    assert talk.at(5.0).sent == ["PING"]
    assert talk.at(10.9).sent == ["PING", "PING"]
    assert talk.at(12.9).sent == ["BEAT"]
    assert talk.at(13.0).sent == ["PING"]
