"""Sequences that wait for a condition, and that do the same again; limits of what a line does."""

import pytest

from tests.dialogue import Dialogue, driver_of
from urc.protocol.requests.bounds import longest_s

ARMING = """
signals:
  mode: { type: string, stale_after: 5s }
commands:
  status: { send: "S?", reply: { regex: '^MODE (?P<mode>\\w+)$' } }
messages:
  told: { regex: '^NOW (?P<mode>\\w+)$' }
sequences:
  wait: [{ wait: { until: mode == 'ready', timeout: 2s } }, { send: GO }]
  patient:
    - { wait: { until: mode == 'ready', timeout: 2s }, else: it is never ready }
    - { send: GO }
  otherwise:
    - { wait: { until: mode == 'ready', timeout: 2s }, else: [{ send: HELP }] }
    - { send: GO }
  ask:
    - { repeat: [{ run: status }, { wait: 100ms }], times: 3, until: mode == 'ready' }
    - { send: GO }
  insist: [{ repeat: [{ run: status }], times: 2, until: mode == 'ready', else: [{ send: HELP }] }]
  complain: [{ repeat: [{ run: status }], times: 1, until: mode == 'ready', else: it is stuck }]
  blink: [{ repeat: [{ send: ON }, { repeat: [{ send: OFF }], times: 2 }], times: 2 }]
"""


def test_a_sequence_waits_until_a_condition_is_true() -> None:
    """Whatever tells of it, a message or a poll."""
    talk = Dialogue(ARMING).connect()
    talk.run("wait")
    talk.says("NOW busy")
    assert talk.sent == []
    talk.at(1.9).says("NOW ready")
    assert talk.sent == ["GO"]
    assert talk.outcomes == {1: "done"}


def test_what_is_true_already_is_not_waited_for() -> None:
    """As long as the reading is fresh."""
    talk = Dialogue(ARMING).connect()
    talk.says("NOW ready")
    talk.run("wait")
    assert talk.sent == ["GO"]
    talk.at(6.0).run("wait")
    assert talk.sent == []


@pytest.mark.parametrize("frames", [("NOW ready", "NOW busy"), ("NOW busy", "NOW ready")])
def test_a_condition_that_was_true_between_two_frames_is_seen(frames: tuple[str, ...]) -> None:
    """However the bytes were cut: both frames come in one piece."""
    talk = Dialogue(ARMING).connect()
    talk.run("wait")
    talk.says(*frames)
    assert talk.sent == ["GO"]


@pytest.mark.parametrize(
    ("name", "outcome", "sent", "message"),
    [
        ("wait", "timed-out", [], "wait.0: \"mode == 'ready'\" did not become true within 2 s"),
        ("patient", "timed-out", [], "it is never ready"),
        ("otherwise", "done", ["HELP", "GO"], ""),
    ],
)
def test_a_wait_has_an_end(name: str, outcome: str, sent: list[str], message: str) -> None:
    """It fails, in words of its own or ours, or goes another way."""
    talk = Dialogue(ARMING).connect()
    talk.run(name)
    talk.at(1.9)
    assert talk.outcomes == {}
    talk.at(2.0)
    assert talk.outcomes == {1: outcome}
    assert talk.sent == sent
    assert talk.messages == ([message] if message else [])


def test_steps_are_repeated_until_a_condition_is_true() -> None:
    """It is asked after each round, and what was read in the round counts."""
    talk = Dialogue(ARMING).connect()
    talk.run("ask")
    talk.says("MODE busy")
    assert talk.at(0.1).sent == ["S?", "S?"]
    talk.says("MODE ready")
    assert talk.at(0.2).sent == ["GO"]
    assert talk.outcomes == {1: "done"}


@pytest.mark.parametrize(
    ("name", "rounds", "outcome", "sent", "message"),
    [
        ("ask", 3, "failed", [], "ask.0: not finished after 3 iterations"),
        ("insist", 2, "done", ["HELP"], ""),
        ("complain", 1, "failed", [], "it is stuck"),
    ],
)
def test_rounds_are_bounded(
    name: str, rounds: int, outcome: str, sent: list[str], message: str
) -> None:
    """After the last one it fails, or goes another way."""
    talk = Dialogue(ARMING).connect()
    talk.run(name)
    for turn in range(rounds):
        assert talk.sent == ["S?"]
        talk.says("MODE busy")
        talk.at(0.1 * (turn + 1))
    assert talk.outcomes == {1: outcome}
    assert talk.sent == sent
    assert talk.messages == ([message] if message else [])


def test_without_a_condition_all_rounds_are_done() -> None:
    """Rounds within rounds, too."""
    talk = Dialogue(ARMING).connect()
    talk.run("blink")
    assert talk.sent == ["ON", "OFF", "OFF", "ON", "OFF", "OFF"]
    assert talk.outcomes == {1: "done"}


def test_a_wait_for_a_condition_ends_with_its_line() -> None:
    """Nothing of it goes on upon the next one."""
    talk = Dialogue(ARMING).connect()
    talk.run("wait")
    talk.take(talk.engine.closed("wire", "unplugged", 1.0))
    assert talk.outcomes == {1: "disconnected"}


def test_longest_time_counts_every_round() -> None:
    """Whoever asks waits that long for the outcome, and no longer."""
    driver = driver_of(ARMING)
    once_s = longest_s(driver, "status")
    assert longest_s(driver, "ask") == pytest.approx(3 * (once_s + 0.1) + 2.0)


@pytest.mark.parametrize(("limit", "ends"), [("700ms", 0.7), ("200ms", 0.2)])
def test_the_steps_of_a_connection_have_a_limit_together(limit: str, ends: float) -> None:
    """After it the line is closed, as when a step fails."""
    timeouts = f"timeouts: {{ connect: 1s, reply: 500ms, on_connect: {limit} }}"
    text = """
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 6789
    framing: { type: delimiter, tx: LF, rx: LF }
    on_connect: [{ repeat: [{ send: HI }, { wait: 300ms }], times: 100 }]
    TIMEOUTS
commands: { go: { send: GO } }
"""
    talk = Dialogue(text.replace("TIMEOUTS", timeouts)).connect()
    talk.run("go")
    talk.at(ends - 0.05)
    assert talk.links == []
    talk.at(ends)
    assert talk.links == ["close wire: the sequence took too long"]
    assert talk.outcomes == {1: "disconnected"}


PATIENT = """
commands:
  wake:
    send: WAKE
    reply: { regex: '^UP (?P<_n>\\d+)$', match: _n == n, timeout: 100ms }
    args: { n: { type: integer, default: 7 } }
    idempotent: true
    retries: { count: 3, initial: 400ms, max: 1s }
"""


def test_waits_before_a_request_is_sent_again_double_up_to_the_longest() -> None:
    """400 ms, 800 ms, then 1 s; each counted from the moment that the answer is overdue."""
    talk = Dialogue(PATIENT).connect()
    talk.run("wake")
    sent_at = []
    for hundredth in range(400):
        talk.at(hundredth / 100)
        if talk.sent:
            sent_at.append(hundredth / 100)
    assert sent_at == [0.0, 0.5, 1.4, 2.5]
    assert talk.outcomes == {1: "timed-out"}


def test_an_answer_that_comes_during_such_a_wait_is_the_answer() -> None:
    """It is not sent again then."""
    talk = Dialogue(PATIENT).connect()
    talk.run("wake")
    talk.at(0.15).says("UP 7")
    assert talk.outcomes == {1: "done"}
    talk.at(3.0)
    assert talk.sent == ["WAKE"]
