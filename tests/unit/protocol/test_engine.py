"""The engine as a dialogue: what it is told, and what it asks for in return."""

import pytest

from tests.dialogue import Dialogue
from urc.model.driver import (
    Argument,
    Command,
    Driver,
    FramingSpec,
    Message,
    Poll,
    Reply,
    Timeouts,
    TransportSpec,
)
from urc.model.values import AlarmLimits, Sample, Signal
from urc.patterns import compile_pattern
from urc.protocol.engine import Engine
from urc.protocol.events import (
    Close,
    Event,
    Failed,
    Open,
    Replied,
    Request,
    Samples,
    Send,
    Violation,
)
from urc.testing.profile import regex, text

LINES = FramingSpec("delimiter", {"tx": b"\n", "rx": b"\n"}, 64)
BATTERY = Signal("battery", "integer", min=0, max=100, limits=AlarmLimits(low=20, hysteresis=2))
TIMEOUTS = Timeouts(connect_s=3.0, reply_s=0.5)


def reply(pattern: str, *errors: str) -> Reply:
    """What answers a request."""
    return Reply(regex(pattern), tuple(map(compile_pattern, errors)))


POLL = Poll("polls.0", "wire", 1.0, text("bat?"), reply(r"^(?P<battery>\d+)$"))


def engine(connection: str = "persistent", *polls: Poll, **wire: object) -> Engine:
    """An engine with one line, two commands and one unsolicited message."""
    spec = TransportSpec(
        "wire", "tcp", connection=connection, framing=LINES, timeouts=TIMEOUTS, **wire
    )
    go = Argument("speed", "integer", min=0, max=9)
    driver = Driver(
        transports={"wire": spec},
        signals={"battery": BATTERY, "mode": Signal("mode", "string")},
        commands={
            "go": Command("go", "wire", text("GO {{ speed }}"), {"speed": go}),
            "ask": Command("ask", "wire", text("mode?"), {}, reply("^MODE (?P<mode>.+)$", "^ERR")),
        },
        messages={"mode": Message("mode", "wire", regex("^MODE (?P<mode>.+)$"))},
        polls=polls,
    )
    return Engine(driver, {})


def opened(*polls: Poll, **wire: object) -> Engine:
    """An engine whose line is connected at time 0 and whose first polls are sent."""
    made = engine("persistent", *polls, **wire)
    made.tick(0.0)
    made.start("wire", 0.0)
    return made


def codes(events: list[Event]) -> list[str]:
    """The codes of faults and failures, in order."""
    return [event.code for event in events if isinstance(event, (Violation, Failed))]


def test_a_poll_asks_and_its_answer_is_a_sample_with_its_alarm() -> None:
    """The whole slice in four lines."""
    wire = engine("persistent", POLL)
    wire.tick(0.0)
    assert wire.start("wire", 0.0) == [Send("wire", b"bat?\n")]
    assert wire.receive("wire", b"1", 0.1) == []
    assert wire.receive("wire", b"9\n", 0.2) == [
        Samples("wire", (Sample("battery", 19, 0.2, "low"),))
    ]
    assert wire.deadline == 1.0
    assert wire.tick(1.0) == [Send("wire", b"bat?\n")]


def test_a_per_request_line_is_opened_for_each_request_and_closed_after_its_answer() -> None:
    """As the thesis's emulated robot is used."""
    wire = engine("per_request", POLL)
    assert wire.deadline == float("-inf")
    assert wire.tick(0.0) == [Open("wire")]
    assert wire.start("wire", 0.1) == [Send("wire", b"bat?\n")]
    events = wire.receive("wire", b"42\n", 0.2)
    assert events == [Samples("wire", (Sample("battery", 42, 0.2),)), Close("wire")]
    assert wire.tick(1.0) == [Open("wire")]


def test_polls_keep_to_their_grid_and_do_not_pile_up() -> None:
    """A robot that answers late is asked once, not once per period missed."""
    wire = engine("per_request", POLL)
    wire.tick(0.0)
    assert wire.tick(3.2) == []  # still connecting: the first request waits
    wire.start("wire", 3.2)
    wire.receive("wire", b"1\n", 3.3)
    assert wire.deadline == 4.0


def test_a_command_without_an_answer_is_done_when_its_bytes_are_handed_over() -> None:
    """One request id, one answer."""
    wire = opened()
    events = wire.command(Request(7, "go", {"speed": 3}), 0.0)
    assert events == [Send("wire", b"GO 3\n"), Replied(7, "go", {})]


def test_an_answer_is_picked_out_of_unsolicited_frames() -> None:
    """Frames that answer nothing fall through to the messages."""
    wire = opened(POLL)
    events = wire.receive("wire", b"MODE auto\n42\nMODE manual\n", 0.1)
    values = [s.value for event in events if isinstance(event, Samples) for s in event.samples]
    assert values == ["auto", 42, "manual"]


@pytest.mark.parametrize(
    ("name", "arguments", "code", "words"),
    [
        ("fly", {}, "unknown-command", "the commands are: go, ask"),
        ("go", {}, "bad-argument", "needs the argument 'speed'"),
        ("go", {"speed": 10}, "bad-argument", "above its maximum 9"),
        ("go", {"speed": -1}, "bad-argument", "below its minimum 0"),
        ("go", {"speed": "3"}, "bad-argument", "expected integer, found '3'"),
        ("go", {"speed": True}, "bad-argument", "expected integer, found true"),
        ("go", {"speed": 1.5}, "bad-argument", "expected integer, found 1.5"),
        ("go", {"speed": float("nan")}, "bad-argument", "expected integer, found nan"),
        ("go", {"speed": 1, "x": 2}, "bad-argument", "has no argument 'x'"),
    ],
)
def test_a_command_that_cannot_be_sent_fails_at_once(
    name: str, arguments: dict[str, object], code: str, words: str
) -> None:
    """Nothing reaches the wire."""
    (event,) = opened().command(Request(1, name, arguments), 0.0)
    assert isinstance(event, Failed)
    assert event.code == code
    assert words in event.message


def test_text_cannot_smuggle_a_second_command() -> None:
    """Neither a delimiter nor any other control character passes through an argument."""
    spec = TransportSpec("wire", "tcp", framing=LINES)
    say = Command("say", "wire", text("SAY {{ text }}"), {"text": Argument("text", "string")})
    made = Engine(Driver(transports={"wire": spec}, commands={"say": say}), {})
    made.start("wire", 0.0)
    for word in ("hi\nDISARM", "hi\r", "\x00", "\x1b[2J", "\u2028"):
        assert codes(made.command(Request(1, "say", {"text": word}), 0.0)) == ["bad-argument"]
    assert made.command(Request(1, "say", {"text": "hé"}), 0.0)[0] == Send(
        "wire", b"SAY h\xc3\xa9\n"
    )


def test_an_error_answer_fails_the_command() -> None:
    """The robot's own words are in the message."""
    wire = opened()
    wire.command(Request(1, "ask"), 0.0)
    (event,) = wire.receive("wire", b"ERR busy\n", 0.1)
    assert event == Failed(1, "ask", "refused", "the robot answered 'ERR busy'")


def test_a_reply_after_the_timeout_is_dropped() -> None:
    """It must not be taken for the answer to the next request."""
    wire = opened(POLL)
    assert codes(wire.tick(0.5)) == ["reply-timeout"]
    assert codes(wire.receive("wire", b"11\n", 0.7)) == ["late-reply"]
    assert wire.tick(1.0) == [Send("wire", b"bat?\n")]
    assert codes(wire.receive("wire", b"12\n", 1.1)) == []


def test_nothing_is_sent_while_a_late_reply_may_still_come() -> None:
    """The line is wary for one more reply time, then goes on."""
    wire = opened(POLL)
    wire.tick(0.5)
    assert wire.command(Request(1, "ask"), 0.6) == []
    assert wire.deadline == 1.0
    assert Send("wire", b"mode?\n") in wire.tick(1.0)


def test_a_line_that_misses_three_answers_in_a_row_is_given_up() -> None:
    """Half-open or hung: a fresh connection is the only sure way to know whose answer is whose."""
    wire = opened(POLL)
    events: list[Event] = []
    while not any(isinstance(event, Close) for event in events):
        assert wire.deadline is not None
        events += wire.tick(wire.deadline)
    assert codes(events) == ["reply-timeout"] * 3
    assert events[-1] == Close("wire", "no answer to polls.0 within 0.5 s")


@pytest.mark.parametrize(
    ("errors", "answer", "outcome"),
    [
        ("", "V 7", "done"),
        (", errors: [ERR]", "V 7", "done"),
        (", errors: [ERR]", "ERR", "refused"),
    ],
)
def test_an_answer_begins_the_count_of_missing_ones_again(
    errors: str, answer: str, outcome: str
) -> None:
    """A robot that misses a few answers in an hour is healthy, also one that refuses."""
    talk = Dialogue(f"""
signals: {{ volts: {{}} }}
commands: {{ ask: {{ send: ask, reply: {{ pattern: "V {{volts:number}}"{errors} }} }} }}
""").connect()
    now = 0.0
    for misses in [1, 2] * 5:
        for _ in range(misses):
            number = talk.run("ask")
            talk.at(now := now + 2.0)
            assert talk.outcomes[number] == "timed-out"
        number = talk.run("ask")
        talk.says(answer)
        assert talk.outcomes[number] == outcome
    assert not talk.links
    for _ in range(3):
        talk.run("ask")
        talk.at(now := now + 2.0)
    assert talk.links == ["close wire: no answer to ask within 0.5 s"]


@pytest.mark.parametrize("fields", ["", "{volts:number}"], ids=["no reading", "reading"])
@pytest.mark.parametrize("before", [1, 50], ids=["fresh", "after a while"])
def test_a_good_answer_begins_the_count_of_missing_ones_again(before: int, fields: str) -> None:
    """A robot that misses a few answers in an hour is healthy, however its answers are read."""
    talk = Dialogue(f"""
signals: {{ volts: {{}} }}
commands: {{ ask: {{ send: ask, reply: {{ pattern: "V {fields}" }} }} }}
""").connect()
    now = 0.0
    for misses in [*[0] * before, *[1, 2] * 5]:
        for _ in range(misses):
            number = talk.run("ask")
            talk.at(now := now + 2.0)
            assert talk.outcomes[number] == "timed-out"
        number = talk.run("ask")
        talk.says("V 7" if fields else "V ")
        assert talk.outcomes[number] == "done"
    assert not talk.links
    for _ in range(3):
        talk.run("ask")
        talk.at(now := now + 2.0)
    assert talk.links == ["close wire: no answer to ask within 0.5 s"]


def test_a_lost_connection_fails_what_was_waiting_and_forgets_half_a_frame() -> None:
    """After a reconnect nothing stale survives."""
    wire = opened()
    wire.command(Request(1, "ask"), 0.0)
    wire.command(Request(2, "ask"), 0.0)
    wire.receive("wire", b"MODE au", 0.1)
    events = wire.closed("wire", "cable pulled", 0.2)
    assert codes(events) == ["cut-frame", "disconnected", "disconnected"]
    wire.start("wire", 1.0)
    assert codes(wire.receive("wire", b"to\n", 1.1)) == ["no-match"]


def test_a_command_on_a_line_that_is_down_fails_at_once() -> None:
    """It must not wait and take effect later."""
    made = engine()
    made.tick(0.0)
    assert codes(made.command(Request(1, "ask"), 0.0)) == ["disconnected"]


def test_a_per_request_command_fails_when_no_connection_can_be_made() -> None:
    """The reason is the transport's."""
    made = engine("per_request")
    made.tick(0.0)
    assert made.command(Request(1, "ask"), 0.0) == [Open("wire")]
    assert made.closed("wire", "nothing listens there", 0.1) == [
        Failed(1, "ask", "disconnected", "nothing listens there")
    ]


def test_a_request_that_waits_too_long_fails() -> None:
    """Every wait has a bound, even one for a connection that never comes."""
    made = engine("per_request")
    made.tick(0.0)
    made.command(Request(1, "ask"), 0.0)
    assert made.deadline == 4.0
    assert codes(made.tick(4.0)) == ["timed-out"]


def test_the_queue_is_bounded() -> None:
    """One more than fits is refused and said so."""
    wire = opened()
    events: list[Event] = []
    for number in range(70):
        events += wire.command(Request(number, "ask"), 0.0)
    assert codes(events) == ["queue-full"] * 5


def test_requests_keep_their_distance() -> None:
    """`min_gap` is for robots that cannot read fast."""
    wire = opened(min_gap_s=0.1)
    assert wire.command(Request(1, "go", {"speed": 1}), 0.0)[0] == Send("wire", b"GO 1\n")
    assert wire.command(Request(2, "go", {"speed": 2}), 0.05) == []
    assert wire.deadline == pytest.approx(0.1)
    assert wire.tick(0.1)[0] == Send("wire", b"GO 2\n")


@pytest.mark.parametrize(
    ("frame", "code"),
    [
        (b"101\n", "bad-value"),
        (b"hello\n", "no-match"),
        (b"\xff\xfe\n", "bad-text"),
        (b"x" * 100 + b"\n", "frame-too-long"),
    ],
)
def test_a_frame_that_is_not_as_declared_is_counted_never_raised(frame: bytes, code: str) -> None:
    """And never becomes a reading."""
    events = opened(POLL).receive("wire", frame, 0.1)
    assert codes(events) == [code]
    assert not any(isinstance(event, Samples) for event in events)


def test_an_alarm_ends_only_past_its_hysteresis() -> None:
    """A value that trembles at its limit must not flicker."""
    wire = opened(POLL)
    alarms = []
    for number, value in enumerate((25, 19, 21, 22, 19)):
        events = wire.receive("wire", f"{value}\n".encode(), number + 0.1)
        alarms += [s.alarm for event in events if isinstance(event, Samples) for s in event.samples]
        wire.tick(number + 1.0)
    assert alarms == ["", "low", "low", "", "low"]


def test_a_good_answer_without_values_shows_that_the_line_lives() -> None:
    """A robot may answer a poll with nothing but "pong"."""
    ping = Poll("polls.1", "wire", 1.0, text("ping"), reply("^pong$"))
    assert opened(ping).receive("wire", b"pong\n", 0.1) == [Samples("wire", ())]
