"""Questions before a command: for some of its values, and for two people."""

import pytest

from tests.dialogue import Dialogue, driver_of
from urc.model.exchange import Confirm
from urc.protocol.events import Request
from urc.protocol.sequences.commands import questions

BEAM = """
signals: { mode: { type: string } }
commands:
  beam:
    send: BEAM
    confirm: { level: hazardous, text: The beam goes on, two_person: true }
  erase:
    send: "ERASE {{ what }} {{ twice }}"
    confirm: { text: Something is erased }
    args:
      what:
        type: string
        choices: [log, map, all]
        confirm:
          map: { level: hazardous, text: All maps are lost }
          all: { level: hazardous, text: Everything is lost, two_person: true }
      twice: { type: boolean, default: false, confirm: { "true": { text: Twice } } }
  level:
    send: "L {{ n }}"
    args: { n: { type: integer, choices: [1, 9], confirm: { "9": { text: Loud } } } }
sequences:
  show: [{ send: HELLO }, { run: beam }]
  guarded:
    title: Guarded
    confirm: { text: Do it, two_person: true }
    requires: [{ expr: mode == 'auto', else: It is not automatic }]
    steps: [{ send: HELLO }]
messages: { mode: { regex: '^MODE (?P<mode>\\w+)$' } }
"""


def ask(talk: Dialogue, command: str, *people: str, **arguments: object) -> dict[int, str]:
    """Run a command that these people have said yes to."""
    talk.take(talk.engine.command(Request(1, command, arguments, people), talk.now))  # type: ignore[arg-type]
    return talk.outcomes


@pytest.mark.parametrize(
    ("people", "outcome"),
    [
        ((), "not-confirmed"),
        (("ada",), "not-confirmed"),
        (("ada", "ada"), "not-confirmed"),
        (("ada", ""), "not-confirmed"),
        (("ada", "grace"), "done"),
    ],
)
def test_two_people_must_say_yes(people: tuple[str, ...], outcome: str) -> None:
    """The same one twice is one person, and nobody is none."""
    talk = Dialogue(BEAM).connect()
    assert ask(talk, "beam", *people) == {1: outcome}
    assert talk.sent == (["BEAM"] if outcome == "done" else [])


def test_the_refusal_says_what_would_happen_and_who_is_missing() -> None:
    """One line for people."""
    talk = Dialogue(BEAM).connect()
    ask(talk, "beam", "ada")
    assert talk.messages == ["The beam goes on: two people must confirm beam, but only 1 did"]


@pytest.mark.parametrize(("what", "outcome"), [("map", "done"), ("all", "not-confirmed")])
def test_only_the_value_that_asks_for_two_needs_them(what: str, outcome: str) -> None:
    """The other values are one person's to confirm, in front of the screen."""
    assert ask(Dialogue(BEAM).connect(), "erase", "ada", what=what) == {1: outcome}


def test_a_sequence_hands_on_who_has_said_yes() -> None:
    """To everything that it runs."""
    talk = Dialogue(BEAM).connect()
    assert ask(talk, "show", "ada") == {1: "not-confirmed"}
    assert talk.sent == ["HELLO"]
    again = Dialogue(BEAM).connect()
    assert ask(again, "show", "ada", "grace") == {1: "done"}
    assert again.sent == ["HELLO", "BEAM"]


def test_a_sequence_asks_and_requires_like_a_command() -> None:
    """Before its first step."""
    talk = Dialogue(BEAM).connect()
    assert ask(talk, "guarded", "ada", "grace") == {1: "not-allowed"}
    again = Dialogue(BEAM).connect()
    again.says("MODE auto")
    assert ask(again, "guarded", "ada") == {1: "not-confirmed"}
    third = Dialogue(BEAM).connect()
    third.says("MODE auto")
    assert ask(third, "guarded", "ada", "grace") == {1: "done"}
    assert third.sent == ["HELLO"]


def test_questions_are_those_of_the_command_and_of_its_values() -> None:
    """What a screen asks, in this order."""
    commands = driver_of(BEAM).commands
    texts = [one.text for one in questions(commands["erase"], {"what": "map", "twice": True})]
    assert texts == ["Something is erased", "All maps are lost", "Twice"]
    assert questions(commands["level"], {"n": 9}) == (Confirm("normal", "Loud"),)
    assert questions(commands["level"], {"n": 9.0}) == (Confirm("normal", "Loud"),)
    assert questions(commands["level"], {"n": 1}) == ()
    assert [one.text for one in questions(commands["beam"], {})] == ["The beam goes on"]
