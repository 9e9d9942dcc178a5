"""A line on which one side talks at a time: motion waits for answers, shortly, and they for it."""

from tests.dialogue import Dialogue
from urc.protocol.requests.hold_replies import LONGEST_WAIT_S

DRIVER = """
wire: duplex: half
signals:
  volts: {}
commands:
  drive:
    send: "V {{ v }}"
    args: { v: { type: integer, default: 0 } }
    reply: { equals: OK, errors: ['^ERR'] }
    hold: { repeat: 50ms, release: {}, watchdog: 500ms }
  ask: { send: ASK, reply: { regex: '^A (?P<volts>\\d+)$' } }
  tell: { send: TELL }
"""


def talk(text: str = DRIVER) -> Dialogue:
    """Return a robot that is connected."""
    return Dialogue(text).connect()


def give(it: Dialogue, v: int = 1) -> bytes:
    """Return the frame of motion that may go out now."""
    data = it.engine.motions.motion_frame("drive", {"v": v}, it.now)
    assert isinstance(data, bytes)
    return data


def test_motion_does_not_overtake_an_answer_that_is_owed() -> None:
    """It would collide with it; the newest value goes out once the answer is there."""
    it = talk()
    it.run("ask")
    assert give(it, 1) == b""
    it.says("A 12")
    assert give(it, 2) == b"V 2\n"


def test_an_answer_that_does_not_come_holds_motion_up_for_a_tenth_of_a_second() -> None:
    """The robot can be driven all the same."""
    it = talk()
    it.run("ask")
    assert give(it) == b""
    it.now = LONGEST_WAIT_S - 0.01
    assert give(it) == b""
    it.now = LONGEST_WAIT_S
    assert give(it) == b"V 1\n"


def test_a_request_waits_for_the_answer_to_motion() -> None:
    """And goes out as soon as that is there."""
    it = talk()
    assert give(it) == b"V 1\n"
    it.run("ask")
    it.run("tell")
    assert it.sent == []
    it.says("OK")
    assert it.sent == ["ASK"]
    it.says("A 12")
    assert it.sent == ["TELL"]


def test_a_request_does_not_wait_for_ever_for_an_answer_to_motion() -> None:
    """One that was lost costs a tenth of a second."""
    it = talk()
    give(it)
    it.run("ask")
    it.at(LONGEST_WAIT_S + 0.001)
    assert it.sent == ["ASK"]


def test_a_second_value_waits_for_the_answer_to_the_first() -> None:
    """A refusal is an answer."""
    it = talk()
    assert give(it, 1) == b"V 1\n"
    assert give(it, 2) == b""
    it.says("ERR")
    assert give(it, 3) == b"V 3\n"


def test_a_stop_waits_for_nothing() -> None:
    """It was made before, and is written by whoever owns the line."""
    it = talk()
    it.run("ask")
    assert give(it) == b""
    assert it.engine.motions.stop_frame("drive") == b"V 0\n"


def test_on_other_lines_motion_waits_for_nothing() -> None:
    """Both sides talk when they like."""
    it = talk(DRIVER.replace("wire: duplex: half", ""))
    it.run("ask")
    assert give(it) == b"V 1\n"
