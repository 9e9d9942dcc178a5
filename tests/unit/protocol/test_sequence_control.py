"""A sequence that people pause, go through step by step, and end."""

from tests.dialogue import Dialogue
from urc.protocol.events import Request
from urc.protocol.sequences.sequence_control import PAUSE_S, Pull

DRIVER = """
commands:
  hello: { send: HELLO, reply: { equals: OK } }
sequences:
  show:
    - { send: A }
    - { repeat: [{ send: B }], times: 2 }
    - { run: hello }
    - { send: C }
"""


def pull(talk: Dialogue, what: Pull) -> None:
    """Want something of the sequence, and let the engine see it."""
    talk.engine.programs["show"].sequence_control.pull(what)
    talk.take(talk.engine.tick(talk.now))


def begun(talk: Dialogue) -> Dialogue:
    """Run the sequence."""
    talk.take(talk.engine.command(Request(1, "show"), talk.now))
    return talk


def where(talk: Dialogue) -> tuple[int, bool, bool]:
    """Return how many steps were begun, whether it runs, and whether it is paused."""
    sequence_control = talk.engine.programs["show"].sequence_control
    return sequence_control.place, sequence_control.is_running, sequence_control.is_paused


def test_a_sequence_that_nobody_steers_runs_through() -> None:
    """It says where it stands; the last step is its number of steps."""
    talk = begun(Dialogue(DRIVER).connect())
    assert where(talk) == (3, True, False)
    talk.says("OK")
    assert where(talk) == (4, False, False)
    assert talk.outcomes == {1: "done"}


def test_told_to_step_before_it_begins_it_begins_paused_and_does_one_after_the_other() -> None:
    """A step is one of the outermost, with all that is in it."""
    talk = Dialogue(DRIVER).connect()
    pull(talk, "step")
    begun(talk)
    assert (where(talk), talk.sent) == ((0, True, True), [])
    pull(talk, "step")
    assert (where(talk), talk.sent) == ((1, True, True), ["A"])
    pull(talk, "step")
    assert (where(talk), talk.sent) == ((2, True, True), ["B", "B"])
    pull(talk, "step")
    assert (where(talk), talk.sent) == ((3, True, False), ["HELLO"])
    talk.says("OK")
    assert where(talk) == (3, True, True)
    pull(talk, "step")
    assert (where(talk), talk.outcomes) == ((4, False, False), {1: "done"})
    begun(talk)
    assert where(talk) == (3, True, False)  # the next run is not held


def test_a_pause_waits_for_the_step_that_is_under_way() -> None:
    """What it has begun ends; then nothing happens before it goes on."""
    talk = begun(Dialogue(DRIVER).connect())
    pull(talk, "pause")
    assert where(talk) == (3, True, False)
    talk.says("OK")
    assert (where(talk), talk.outcomes) == ((3, True, True), {})
    pull(talk, "resume")
    assert talk.outcomes == {1: "done"}


def test_it_can_be_ended_while_it_waits_and_while_it_is_paused() -> None:
    """With a reason; and it can be run again."""
    talk = begun(Dialogue(DRIVER).connect())
    pull(talk, "abort")
    assert talk.outcomes == {1: "aborted"}
    assert talk.engine.programs["show"].sequence_control.reason == "ended on request"
    talk = Dialogue(DRIVER).connect()
    pull(talk, "step")
    begun(talk)
    pull(talk, "abort")
    assert (talk.outcomes, talk.sent) == ({1: "aborted"}, [])


def test_a_pause_has_an_end() -> None:
    """Others want to run it too."""
    talk = Dialogue(DRIVER).connect()
    pull(talk, "step")
    begun(talk)
    talk.at(PAUSE_S + 1)
    assert talk.outcomes == {1: "timed-out"}


def test_what_is_wanted_of_a_sequence_at_rest_is_forgotten() -> None:
    """Only a step is kept: it is for the next run, and taken back by going on."""
    talk = Dialogue(DRIVER).connect()
    pull(talk, "pause")
    pull(talk, "abort")
    pull(talk, "step")
    pull(talk, "resume")
    assert where(begun(talk)) == (3, True, False)
