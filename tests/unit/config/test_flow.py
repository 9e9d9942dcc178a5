"""What documents say about the flow of talk, beyond what the collection of broken ones shows."""

import pytest

from tests.dialogue import driver_of
from urc.config.load import check
from urc.model.exchange import Hold, Offline
from urc.model.sequence import PromptStep, SendStep, all_steps
from urc.registry import Registries, Table
from urc.runtime.registries import built_in_catalog

HEAD = "urc: 1\nkind: driver\nname: talker\n"


def codes(text: str, folder: object) -> set[str]:
    """The codes of what is found in a document with a serial line."""
    path = f"{folder}/talker.yaml"
    with open(path, "w", encoding="utf-8") as file:
        file.write(HEAD + text)
    catalog = built_in_catalog()
    lines = Table("urc.transports", {"tcp": "x:x", "pigeon": "x:x"})
    return {problem.code for problem in check(path, Registries(lines, catalog.framings)).problems}


@pytest.mark.parametrize(
    ("baud", "every", "is_told"),
    [(1200, "50ms", True), (1200, "1s", False), (115200, "50ms", False)],
)
def test_polls_that_a_serial_line_cannot_carry_are_told(
    baud: int, every: str, is_told: bool, tmp_path: object
) -> None:
    """Counted by what is written out, ten bits a byte."""
    text = f"""
transports:
  wire: {{ type: pigeon, baud: {baud}, framing: {{ type: delimiter, tx: LF, rx: LF }} }}
polls:
  - {{ send: "HOW MUCH IS LEFT?", every: {every}, reply: {{ equals: OK, timeout: 10ms }} }}
"""
    assert ("too-many-polls" in codes(text, tmp_path)) == is_told


def test_steps_are_counted_with_their_branches(tmp_path: object) -> None:
    """Two hundred fit, and no more."""
    branch = ", ".join(["{ wait: 1s }"] * 150)
    text = f"""
transports:
  wire: {{ type: pigeon, framing: {{ type: delimiter, tx: LF, rx: LF }} }}
sequences:
  long: [{{ if: 1 > 0, then: [{branch}], else: [{branch}] }}]
"""
    assert "too-many-steps" in codes(text, tmp_path)


def test_everything_arrives_in_the_model() -> None:
    """As it was written, with what was left out filled in."""
    driver = driver_of(
        """
wire: queue: { in_flight: 3 }
wire: on_connect: [{ prompt: ': $', else: [{ send: HI, redact: true }] }]
commands:
  drive: { send: "V {{ v }}", args: { v: { default: 0 } }, hold: { repeat: 50ms, release: {} },
      rate_limit: 30/m }
  ask: { send: "A {{ n }}", args: { n: { type: integer, default: 7 } }, reply: { equals: OK } }
sequences:
  both: [{ run: drive }, { run: ask, args: { n: 3 } }]
polls:
  - { run: ask, every: 2s, offline: { after: 2, retry: 1m } }
"""
    )
    wire, drive, poll = driver.transports["wire"], driver.commands["drive"], driver.polls[0]
    assert (wire.queue.in_flight, wire.queue.depth) == (3, 64)
    prompt, send = all_steps(wire.on_connect)
    assert isinstance(prompt, PromptStep)
    assert isinstance(send, SendStep)
    assert (send.is_secret, send.transport) == (True, "wire")
    assert (drive.hold, drive.rate_per_s) == (Hold(0.05, {}), 0.5)
    assert (poll.send, poll.reply) == (driver.commands["ask"].send, driver.commands["ask"].reply)
    assert (poll.arguments, poll.offline, poll.priority) == ({"n": 7}, Offline(2, 60.0), "low")
    assert (driver.commands["both"].title, driver.commands["both"].transport) == ("Both", "wire")


def test_a_sequence_needs_the_roles_of_its_commands() -> None:
    """Through sequences and branches too; a higher role of the sequence itself counts."""
    driver = driver_of(
        """
commands:
  look: { send: LOOK }
  tune: { send: TUNE, role: maintain }
sequences:
  evening: [{ if: 1 > 0, then: [{ wait: 1s }], else: [{ run: morning }] }]
  morning: [{ run: look }, { run: tune }]
  plain: [{ run: look }]
  strict: { steps: [{ run: tune }], role: administer }
  over: [{ run: strict }, { run: tune }]
"""
    )
    assert {name: one.role for name, one in driver.commands.items()} == {
        "look": "drive",
        "tune": "maintain",
        "evening": "maintain",
        "morning": "maintain",
        "plain": "drive",
        "strict": "administer",
        "over": "administer",
    }


@pytest.mark.parametrize(("mode", "is_told"), [("4", False), ("10", True), ("'{{ 2 * 2 }}'", True)])
def test_what_nobody_asks_for_may_end_motion_and_not_begin_it(
    mode: str, is_told: bool, tmp_path: object
) -> None:
    """A value that is known tells; what is only known when it runs counts as moving."""
    text = f"""
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 6789
    framing: {{ type: delimiter, tx: LF, rx: LF }}
    on_connect: [{{ run: set_mode, args: {{ mode: {mode} }} }}]
commands:
  set_mode: {{ send: "M {{{{ mode }}}}", args: {{ mode: {{ type: integer }} }}, moves: mode == 10 }}
  stay: {{ send: STAY, stop: true }}
"""
    assert codes(text, tmp_path) == ({"wrong-command"} if is_told else set())


def test_a_document_with_a_login_can_test_its_frames(tmp_path: object) -> None:
    """Tests of single frames need no login, no condition and no fresh signal."""
    text = """
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 6789
    framing: { type: delimiter, tx: LF, rx: LF }
    on_connect: [{ expect: '^HELLO$' }]
    keepalive: { every: 1s, send: BEAT }
signals: { mode: { type: string } }
commands:
  go:
    send: GO
    requires: [{ expr: mode == 'ready', else: The robot is not ready }]
    verify: { expr: mode == 'moving', within: 1s }
polls:
  - { send: M?, every: 1s, phase: 3s, when: mode == 'x', reply: { regex: '^(?P<mode>\\w+)$' } }
tests:
  - { name: bytes, run: go, sent: { wire: GO } }
  - { name: refusal, run: go, fails: not ready }
  - { name: reading, feed: { wire: "ready\\n" }, reply_to: 0, expect: { mode: ready } }
"""
    path = f"{tmp_path}/talker.yaml"
    with open(path, "w", encoding="utf-8") as file:
        file.write(HEAD + text)
    from urc.runtime.document_tests import exercise

    profile = check(path, built_in_catalog()).profile
    assert profile is not None
    assert [problem.message for problem in exercise(profile).problems] == []


@pytest.mark.parametrize(("said", "is_told"), [("", True), (", replies: never", False)])
def test_a_line_that_never_answers_is_not_asked_to_notice_a_loss(
    said: str, is_told: bool, tmp_path: object
) -> None:
    """A receiver of a remote control has nothing to say: its silence means nothing."""
    text = f"""
transports:
  wire: {{ type: pigeon{said}, framing: {{ type: delimiter, tx: LF, rx: LF }} }}
commands:
  drive: {{ send: "V {{{{ v }}}}", args: {{ v: {{}} }},
    hold: {{ repeat: 50ms, release: {{ v: 0 }}, watchdog: 500ms }} }}
"""
    assert ("no-loss-detection" in codes(text, tmp_path)) == is_told
