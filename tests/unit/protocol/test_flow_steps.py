"""Sequences: logins, prompts, branches, what is run, and what becomes of them when a line dies."""

import pytest

from tests.dialogue import Dialogue

LOGIN = """
settings: { user: { type: string, default: ada }, key: { type: string, secret: true } }
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: 6789
    framing: { type: delimiter, tx: LF, rx: LF }
    timeouts: { connect: 1s, reply: 500ms }
    on_connect:
      - { prompt: 'login: $' }
      - { send: "{{ settings.user }}" }
      - { prompt: '[Pp]assword: $', timeout: 2s, else: it asks for no password }
      - { send: "{{ settings.key }}", redact: true }
      - { expect: { regex: '^(?P<_answer>WELCOME|MAINTENANCE)', errors: ['^DENIED'] } }
      - { if: "_answer == 'MAINTENANCE'",
          then: [{ fail: "the robot is in {{ _answer | lower }}" }] }
      - { run: wake }
    on_close: [{ send: bye }, { expect: '^BYE$' }]
signals: { state: { type: string } }
commands:
  wake: { send: WAKE, reply: { regex: '^STATE (?P<state>\\w+)$' } }
  ping: { send: PING, reply: { equals: PONG } }
  halt: { send: HALT, priority: realtime }
  drive: { send: DRIVE, hold: { repeat: 50ms, release: {} } }
polls:
  - { every: 1s, send: STATE?, reply: { regex: '^STATE (?P<state>\\w+)$' } }
"""
SETTINGS = {"user": "ada", "key": "s3cret-word"}


def logged_in() -> Dialogue:
    """A dialogue whose line is ready."""
    talk = Dialogue(LOGIN, SETTINGS).connect()
    talk.raw(b"Robot v1\nlogin: ")
    talk.raw(b"Password: ")
    talk.says("WELCOME ada")
    talk.says("STATE awake")
    return talk.at(0.0)


def test_a_line_is_used_only_after_its_steps_are_done() -> None:
    """Commands wait for it, but what a hand holds fails; polls begin after it."""
    talk = Dialogue(LOGIN, SETTINGS).connect()
    early = talk.run("ping")
    assert talk.outcomes.get(talk.run("drive")) == "disconnected"
    assert talk.sent == []
    talk.raw(b"Robot v1\nlog")
    talk.raw(b"in: ")
    assert talk.sent == ["ada"]
    talk.raw(b"Password: ")
    assert talk.sent == ["s3cret-word"]
    talk.says("WELCOME ada")
    assert talk.sent == ["WAKE"]
    assert early not in talk.outcomes
    talk.says("STATE awake")
    assert talk.at(0.0).sent == ["PING"]
    talk.says("PONG")
    assert talk.outcomes[early] == "done"
    assert talk.sent == ["STATE?"]
    talk.says("STATE ready")
    assert talk.values == {"state": "ready"}


def test_a_stop_that_comes_during_the_login_is_the_first_thing_after_it() -> None:
    """It passes what waited before it, and it is not refused: whoever stops asks once."""
    talk = Dialogue(LOGIN, SETTINGS).connect()
    talk.run("ping")
    stop = talk.run("halt")
    assert stop not in talk.outcomes
    talk.raw(b"login: ")
    talk.raw(b"password: ")
    talk.says("WELCOME ada")
    assert "HALT" not in talk.sent
    talk.says("STATE awake")
    assert talk.sent == ["HALT", "PING"]
    assert talk.outcomes[stop] == "done"


def test_a_stop_that_waits_for_a_login_that_fails_fails_with_it() -> None:
    """It is told, and nothing of it is left for the next connection."""
    talk = Dialogue(LOGIN, SETTINGS).connect()
    stop = talk.run("halt")
    talk.at(0.5)
    assert talk.outcomes[stop] == "disconnected"
    talk.connect()
    for said in (b"login: ", b"password: "):
        talk.raw(said)
    talk.says("WELCOME ada", "STATE awake")
    assert "HALT" not in talk.sent


def test_a_whole_login_may_arrive_in_one_chunk() -> None:
    """Each step hears what came after the one before it."""
    talk = Dialogue(
        """
wire: on_connect: [{ expect: '^A$' }, { expect: '^B$' }, { prompt: '> $' }]
commands: { ping: { send: PING } }
"""
    ).connect()
    talk.raw(b"A\nB\n> ")
    talk.run("ping")
    assert talk.sent == ["PING"]


@pytest.mark.parametrize(
    ("chunks", "until", "reason"),
    [
        ((), 0.5, "close wire: wire.on_connect.0: the expected frame did not arrive within 0.5 s"),
        ((b"login: ",), 2.0, "close wire: it asks for no password"),
        (
            (b"login: ", b"password: ", b"DENIED s3cret-word\n"),
            0.1,
            "close wire: the robot answered 'DENIED •••'",
        ),
        (
            (b"login: ", b"password: ", b"MAINTENANCE\n"),
            0.1,
            "close wire: the robot is in maintenance",
        ),
        (
            (b"login: ", b"password: ", b"WELCOME\n"),
            0.5,
            "close wire: no answer to wake within 0.5 s",
        ),
    ],
)
def test_steps_that_fail_close_the_line_with_the_reason(
    chunks: tuple[bytes, ...], until: float, reason: str
) -> None:
    """The link then backs off, and begins anew."""
    talk = Dialogue(LOGIN, SETTINGS).connect()
    waiting = talk.run("ping")
    for chunk in chunks:
        talk.raw(chunk)
    talk.at(until)
    assert talk.links == [reason]
    assert talk.outcomes[waiting] == "disconnected"
    assert f"close wire: {talk.messages[-1]}" == reason
    talk.connect()
    talk.raw(b"login: ")
    assert talk.sent[-1] == "ada"


def test_a_secret_shows_in_no_message() -> None:
    """Not even when the robot echoes it."""
    talk = logged_in()
    talk.says("you said s3cret-word!")
    assert talk.messages[-1] == "no declaration matches 'you said •••!'"
    assert not any("s3cret" in message for message in talk.messages)


def test_a_connection_that_is_lost_ends_its_steps() -> None:
    """Nothing of them goes on upon the next one."""
    talk = Dialogue(LOGIN, SETTINGS).connect()
    talk.raw(b"login: ")
    talk.take(talk.engine.closed("wire", "cut", 0.1))
    talk.connect()
    assert talk.sent == ["ada"]
    talk.raw(b"password: ")
    assert talk.sent == []
    assert talk.links == []


def test_a_line_that_is_closed_in_good_order_says_good_bye() -> None:
    """And is closed when it is answered."""
    talk = logged_in()
    assert talk.sent[-1] == "STATE?"
    talk.take(talk.engine.finish(0.0))
    assert talk.sent == ["bye"]
    assert talk.links == []
    talk.says("BYE")
    assert talk.links == ["close wire"]


def test_a_good_bye_has_a_bound() -> None:
    """A robot that does not answer holds up nobody."""
    talk = logged_in()
    number = talk.run("ping")
    talk.take(talk.engine.finish(0.0))
    assert talk.outcomes[number] == "disconnected"
    assert talk.sent[-1] == "bye"
    assert talk.at(0.4).links == []
    assert talk.at(2.0).links == ["close wire"]


def test_a_line_without_good_bye_is_closed_at_once() -> None:
    """One that is still logging in, too."""
    talk = Dialogue("commands: { ping: { send: PING } }").connect()
    talk.take(talk.engine.finish(0.0))
    assert talk.links == ["close wire"]


ARM = """
signals:
  mode: { type: string }
  speed: { type: integer, max: 10 }
commands:
  power: { send: "POWER {{ level }}", args: { level: { type: integer, max: 9 } },
      reply: { regex: '^POWERED (?P<_watts>\\d+)$', errors: ['^NO'] } }
  wave: { send: WAVE }
sequences:
  arm:
    - { run: power, args: { level: "{{ 2 + 3 }}" } }
    - { wait: 2s }
    - { set: { mode: "{{ _watts }} W", speed: 3 } }
    - if: _watts | int > 50
      then: [{ run: greet }]
      else: [{ fail: "only {{ _watts }} W" }]
    - { send: ARMED }
  greet:
    - { run: wave }
    - { expect: '^HELLO$', timeout: 1s, else: [{ send: "HELLO?" }, { expect: '^HELLO$',
        timeout: 1s }] }
  bad: [{ set: { speed: 11 } }]
  none: [{ if: mode == 'x', then: [{ fail: x }] }]
"""


def test_a_sequence_is_run_like_a_command() -> None:
    """Steps, values, waits, branches, and sequences in it."""
    talk = Dialogue(ARM).connect()
    number = talk.run("arm")
    assert talk.sent == ["POWER 5"]
    talk.says("POWERED 60")
    assert talk.at(1.9).values == {}
    assert talk.at(2.0).values == {"mode": "60 W", "speed": 3}
    assert talk.sent == ["WAVE"]
    talk.says("HELLO")
    assert talk.sent == ["ARMED"]
    assert talk.outcomes == {number: "done"}


def test_what_is_expected_and_does_not_come_may_be_asked_for() -> None:
    """`else` of an expect is what to do then; the sequence goes on after it."""
    talk = Dialogue(ARM).connect()
    talk.run("greet")
    talk.at(1.0)
    assert talk.sent == ["WAVE", "HELLO?"]
    talk.says("HELLO")
    assert talk.outcomes == {1: "done"}
    talk.run("greet")
    talk.at(3.0)
    assert talk.outcomes[2] == "timed-out"


@pytest.mark.parametrize(
    ("command", "frame", "code", "message"),
    [
        ("arm", "POWERED 20", "failed", "only 20 W"),
        ("arm", "NO power", "refused", "the robot answered 'NO power'"),
        ("bad", "", "failed", "speed: 11 is above its maximum 10"),
        ("none", "", "done", ""),
    ],
)
def test_a_sequence_that_fails_says_why(command: str, frame: str, code: str, message: str) -> None:
    """In the words of the step; a condition over what was never read is not true."""
    talk = Dialogue(ARM).connect()
    talk.run(command)
    if frame:
        talk.says(frame)
    talk.at(2.0)
    assert talk.outcomes == {1: code}
    assert talk.messages == ([message] if message else [])


def test_a_sequence_is_not_run_twice_at_a_time() -> None:
    """The second one is told so."""
    talk = Dialogue(ARM).connect()
    talk.run("arm")
    talk.run("arm")
    assert talk.outcomes == {2: "at-work"}
    assert talk.messages == ["arm is already running"]


def test_a_sequence_does_not_go_on_upon_a_new_connection() -> None:
    """After any gap, nothing moves by itself."""
    talk = Dialogue(ARM).connect()
    talk.run("arm")
    talk.says("POWERED 60")
    talk.take(talk.engine.closed("wire", "cut", 1.0))
    assert talk.outcomes == {1: "disconnected"}
    talk.connect()
    talk.at(5.0)
    assert talk.sent == ["POWER 5"]


def test_steps_make_a_connection_of_one_request_usable_too() -> None:
    """Each connection logs in, asks, says good-bye and is closed."""
    talk = Dialogue(
        """
wire: connection: per_request
wire: on_connect: [{ send: HI }, { expect: '^HI$' }]
wire: on_close: [{ send: BYE }]
commands: { ask: { send: ASK, reply: { regex: '^A' } } }
"""
    )
    talk.take(talk.engine.tick(0.0))
    talk.run("ask")
    talk.run("ask")
    for number in (1, 2):
        assert talk.links.pop() == "open wire"
        talk.take(talk.engine.start("wire", 0.0))
        assert talk.sent == ["HI"]
        talk.says("HI")
        assert talk.sent == ["ASK"]
        talk.says("A1")
        assert talk.outcomes[number] == "done"
        assert talk.sent == ["BYE"]
        assert "close wire" in talk.links
        talk.links.remove("close wire")
    assert talk.links == []


def test_a_connection_of_one_request_that_cannot_log_in_fails_that_request() -> None:
    """And the next one gets a connection of its own."""
    talk = Dialogue(
        """
wire: connection: per_request
wire: on_connect: [{ expect: '^HI$' }]
commands: { ask: { send: ASK, reply: { regex: '^A' } } }
"""
    )
    talk.take(talk.engine.tick(0.0))
    talk.run("ask")
    talk.run("ask")
    talk.take(talk.engine.start("wire", 0.0))
    talk.at(0.5)
    assert talk.outcomes == {1: "disconnected"}
    assert [link.partition(":")[0] for link in talk.links] == [
        "open wire", "close wire", "open wire",
    ]  # fmt: skip
