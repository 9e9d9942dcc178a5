"""An engine whose robot was stopped: what moves by itself is refused, and sequences have ended."""

from tests.dialogue import Dialogue

DRIVER = """
commands:
  ask: { send: ASK, reply: { equals: OK } }
  fold: { send: FOLD, moves: true }
  beep: { send: BEEP }
  climb: { send: "CLIMB {{ on }}", args: { on: { type: boolean, default: true } }, moves: "on" }
sequences:
  level: [{ run: climb, args: { on: false } }]
  upstairs: [{ run: climb }]
  show:
    - { send: A }
    - { wait: 1s }
    - { send: B }
  dance:
    - { run: beep }
    - { run: fold }
  twice:
    moves: true
    steps: [{ send: C }, { run: ask }, { send: D }]
"""
WHY = "Stopped by ann. Reset to drive again."


def latch(talk: Dialogue, reason: str = WHY) -> None:
    """Press STOP, or reset it."""
    talk.take(talk.engine.latch(reason, talk.now))


def test_what_moves_by_itself_is_refused_until_the_stop_is_reset() -> None:
    """A command, a sequence that is marked, and one that runs what is marked; nothing else."""
    talk = Dialogue(DRIVER).connect()
    latch(talk)
    for name in ("fold", "twice", "dance"):
        assert talk.outcomes[talk.run(name)] == "not-allowed"
    assert set(talk.messages) == {WHY}
    assert talk.outcomes[talk.run("beep")] == "done"
    assert talk.sent == ["BEEP"]
    latch(talk, "")
    assert (talk.outcomes[talk.run("fold")], talk.sent) == ("done", ["FOLD"])


def test_a_command_that_moves_for_some_values_is_refused_for_those_only() -> None:
    """So the one that ends motion is given; a default counts as what is given."""
    talk = Dialogue(DRIVER).connect()
    latch(talk)
    assert talk.outcomes[talk.run("climb", on=True)] == "not-allowed"
    assert talk.outcomes[talk.run("climb")] == "not-allowed"
    assert talk.outcomes[talk.run("climb", on=False)] == "done"
    assert talk.outcomes[talk.run("upstairs")] == "not-allowed"
    assert talk.outcomes[talk.run("level")] == "done"
    assert talk.sent == ["CLIMB false", "CLIMB false"]


def test_what_waits_and_moves_for_its_values_is_not_sent_after_the_stop() -> None:
    """Beside it waits what ends the motion."""
    talk = Dialogue(DRIVER).connect()
    talk.run("ask")
    up, down = talk.run("climb", on=True), talk.run("climb", on=False)
    latch(talk)
    talk.says("OK")
    assert (talk.outcomes[up], talk.outcomes[down]) == ("not-allowed", "done")
    assert talk.sent == ["ASK", "CLIMB false"]


def test_what_moves_and_waits_to_be_sent_is_not_sent_after_the_stop() -> None:
    """It has been taken already, and another request is in flight."""
    talk = Dialogue(DRIVER).connect()
    talk.run("ask")
    talk.run("fold")
    talk.run("beep")
    latch(talk)
    talk.says("OK")
    assert talk.outcomes == {1: "done", 2: "not-allowed", 3: "done"}
    assert talk.sent == ["ASK", "BEEP"]


def test_what_moves_and_waited_is_not_sent_after_the_stop_was_reset_either() -> None:
    """It was wished before the stop; the same command given anew is sent."""
    talk = Dialogue(DRIVER).connect()
    talk.run("ask")
    old, beep = talk.run("fold"), talk.run("beep")
    latch(talk)
    latch(talk, "")
    new = talk.run("fold")
    talk.says("OK")
    assert [talk.outcomes[each] for each in (old, beep, new)] == ["not-allowed", "done", "done"]
    assert talk.sent == ["ASK", "BEEP", "FOLD"]


def test_what_moves_is_not_tried_again_after_a_stop() -> None:
    """Its answer was lost; it was sent once, before the stop."""
    again = "idempotent: true, retries: 2, reply: { equals: OK, timeout: 1s }"
    talk = Dialogue(f"commands: {{ fold: {{ send: FOLD, moves: true, {again} }} }}").connect()
    fold = talk.run("fold")
    latch(talk)
    latch(talk, "")
    talk.at(10)
    assert (talk.sent, talk.outcomes[fold]) == (["FOLD"], "not-allowed")


def test_a_running_sequence_ends_with_the_reason_and_sends_nothing_more() -> None:
    """Whether it is marked or not."""
    talk = Dialogue(DRIVER).connect()
    talk.run("show")
    assert talk.sent == ["A"]
    latch(talk)
    assert talk.outcomes == {1: "stopped"}
    assert talk.engine.programs["show"].sequence_control.reason == WHY
    talk.at(5)
    assert talk.sent == []


def test_what_a_sequence_has_queued_is_not_sent_after_the_stop() -> None:
    """Neither a frame of its own nor a command that it runs."""
    for steps in ("{ send: B }", "{ run: beep }"):
        talk = Dialogue(
            f"""
commands:
  ask: {{ send: ASK, reply: {{ equals: OK }} }}
  beep: {{ send: BEEP }}
sequences:
  show: [{steps}]
"""
        ).connect()
        talk.run("ask")
        talk.run("show")
        latch(talk)
        talk.says("OK")
        talk.at(5)
        assert (talk.outcomes, talk.sent) == ({1: "done", 2: "stopped"}, ["ASK"])


def test_a_second_stop_ends_what_was_begun_while_the_first_holds() -> None:
    """What does not move may run while a stop is latched; a stop ends it nevertheless."""
    talk = Dialogue(DRIVER).connect()
    latch(talk)
    talk.run("show")
    assert talk.sent == ["A"]
    latch(talk)
    assert talk.outcomes == {1: "stopped"}


def test_steps_of_a_connection_go_on_after_the_stop() -> None:
    """Else the stop could not reach the robot."""
    talk = Dialogue(
        """
wire: on_connect: [{ send: HI }, { expect: '^YO$' }, { send: READY }]
commands:
  beep: { send: BEEP }
"""
    )
    talk.connect()
    latch(talk)
    talk.says("YO")
    assert talk.sent == ["HI", "READY"]
