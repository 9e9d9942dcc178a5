"""A robot that says nothing when it does what was asked, and answers only when it refuses."""

import pytest

from tests.dialogue import Dialogue

DRIVER = """
signals:
  volts: {}
commands:
  lamp: { send: LAMP, reply: { silence: 300ms, errors: ['^ERR'] } }
  staged: { send: S, reply: { stages: [{ equals: ACK }, { silence: 1s, errors: ['^FAIL'] }] } }
  ask: { send: ASK, reply: { regex: '^A (?P<volts>\\d+)$' } }
messages:
  volts: { regex: '^V (?P<volts>\\d+)$' }
"""


def talk(text: str = DRIVER) -> Dialogue:
    """Return a robot that is connected."""
    return Dialogue(text).connect()


def test_silence_for_the_whole_time_is_success() -> None:
    """Neither earlier nor with a fault."""
    it = talk()
    number = it.run("lamp")
    it.at(0.29)
    assert number not in it.outcomes
    it.at(0.31)
    assert (it.outcomes[number], it.faults) == ("done", [])


def test_a_refusal_within_the_time_is_failure() -> None:
    """In the robot's words, at once."""
    it = talk()
    number = it.run("lamp")
    it.now = 0.1
    it.says("ERR 7")
    assert it.outcomes[number] == "refused"
    assert "ERR 7" in it.messages[-1]


def test_what_else_comes_is_told_and_breaks_no_silence() -> None:
    """The robot may talk of other things."""
    it = talk()
    number = it.run("lamp")
    it.says("V 12")
    assert it.values == {"volts": 12.0}
    it.at(0.31)
    assert it.outcomes[number] == "done"


def test_the_next_request_waits_for_the_end_of_the_silence() -> None:
    """Else a refusal could be about either."""
    it = talk()
    it.run("lamp")
    it.run("ask")
    assert it.sent == ["LAMP"]
    it.at(0.31)
    assert it.sent == ["ASK"]


def test_silence_holds_up_no_answer_where_several_requests_are_in_flight() -> None:
    """Answers come in order, and silence is none that comes."""
    it = talk(f"wire: queue: {{ in_flight: 2 }}\n{DRIVER}")
    it.run("lamp")
    asked = it.run("ask")
    it.says("A 9")
    assert it.outcomes[asked] == "done"


def test_many_silences_do_not_close_the_line() -> None:
    """They are no missing answers."""
    it = talk()
    for place in range(5):
        it.run("lamp")
        it.at(0.31 * (place + 1))
    assert set(it.outcomes.values()) == {"done"}
    assert it.links == []


@pytest.mark.parametrize(("says", "outcome"), [("", "done"), ("FAIL x", "refused")])
def test_silence_may_be_the_last_of_several_answers(says: str, outcome: str) -> None:
    """Accepted first, then done unless it says otherwise."""
    it = talk()
    number = it.run("staged")
    it.says("ACK")
    if says:
        it.says(says)
    it.at(1.1)
    assert it.outcomes[number] == outcome
