"""What must hold before a command is sent, and come true after it; motion and its release."""

import pytest

from tests.dialogue import Dialogue
from urc.protocol.requests.encode import BadArgument

GUARDED = """
signals:
  mode: { type: string, stale_after: 5s }
  speed: { stale_after: 5s }
commands:
  drive:
    send: "DRIVE {{ v }}"
    args: { v: { type: number, min: -9, max: 9, default: 0 }, w: { default: 2 } }
    reply: { equals: OK }
    requires:
      - { expr: mode == 'auto', else: The robot is not in automatic mode }
      - { expr: v <= speed * 2, else: That is too fast }
    hold: { repeat: 50ms, release: { v: 0 } }
  pause:
    send: PAUSE
    reply: { equals: OK }
    verify: { expr: mode == 'paused', within: 2s }
  reach: { send: "GO {{ v }}", args: { v: {} }, verify: { expr: speed == v, within: 2s } }
  wait: { send: WAIT, reply: { equals: OK } }
messages:
  mode: { regex: '^MODE (?P<mode>\\w+)$' }
  speed: { regex: '^SPEED (?P<speed>[0-9.]+)$' }
"""


@pytest.mark.parametrize(
    ("frames", "later", "speed", "outcome", "message"),
    [
        ((), 0.0, 1, "not-allowed",
         "The robot is not in automatic mode ('mode' has no value here)"),
        (("MODE manual",), 0.0, 1, "not-allowed", "The robot is not in automatic mode"),
        (("MODE auto", "SPEED 1"), 0.0, 3, "not-allowed", "That is too fast"),
        (("MODE auto", "SPEED 1"), 0.0, 2, "done", None),
        (("MODE auto", "SPEED 1"), 6.0, 2, "not-allowed",
         "The robot is not in automatic mode ('mode' has no value here)"),
    ],
)  # fmt: skip
def test_a_command_is_sent_only_when_what_it_requires_holds(
    frames: tuple[str, ...], later: float, speed: float, outcome: str, message: str | None
) -> None:
    """A signal that is old, or was never read, is no knowledge."""
    talk = Dialogue(GUARDED).connect()
    if frames:
        talk.says(*frames)
    talk.at(later).run("drive", v=speed)
    if talk.sent:
        talk.says("OK")
    assert talk.outcomes == {1: outcome}
    assert talk.messages == ([message] if message else [])


def test_a_condition_is_asked_again_when_the_command_is_sent() -> None:
    """What waited in the queue may not be allowed any more."""
    talk = Dialogue(GUARDED).connect()
    talk.says("MODE auto", "SPEED 1")
    talk.run("wait")
    number = talk.run("drive", v=1)
    talk.says("MODE manual", "OK")
    assert talk.sent == ["WAIT"]
    assert talk.outcomes[number] == "not-allowed"


def test_a_command_is_done_when_what_it_is_for_has_come_true() -> None:
    """Only what was read after it was sent counts."""
    talk = Dialogue(GUARDED).connect()
    talk.says("MODE paused")
    talk.at(1.0).run("pause")
    talk.says("OK")
    assert talk.outcomes == {}
    talk.says("MODE running")
    assert talk.outcomes == {}
    talk.says("MODE paused")
    assert talk.outcomes == {1: "done"}


def test_a_command_whose_purpose_does_not_come_true_has_failed() -> None:
    """After the time that it was given."""
    talk = Dialogue(GUARDED).connect()
    talk.run("reach", v=3)
    talk.says("SPEED 2.5")
    talk.at(1.9)
    assert talk.outcomes == {}
    talk.at(2.0)
    assert talk.outcomes == {1: "not-verified"}
    assert talk.messages == ["'speed == v' did not become true within 2 s"]


def test_release_gives_the_bytes_that_stop_the_motion() -> None:
    """Whatever it requires, and whether there is a connection or not."""
    talk = Dialogue(GUARDED)
    assert talk.engine.motions.stop_frame("drive") == b"DRIVE 0\n"
    with pytest.raises(BadArgument):
        talk.engine.motions.stop_frame("pause")


def test_text_of_the_robot_equals_a_number_only_when_it_is_that_number() -> None:
    """`_id == id` means what it says, also for padded numbers and for words."""
    text = """
commands:
  get: { send: GET, args: { id: { type: %s } }, reply: { regex: '^(?P<_id>\\S+)$',
      match: _id == id } }
"""
    for kind, wanted, frame, is_mine in [
        ("integer", 7, "7", True), ("integer", 7, "07", True), ("integer", 7, "7.0", True),
        ("integer", 7, "8", False), ("integer", 7, "x", False), ("string", "07", "7", False),
        ("string", "ab", "ab", True), ("boolean", True, "1", False),
        ("integer", 7, "7" * 99, False),
    ]:  # fmt: skip
        talk = Dialogue(text % kind).connect()
        talk.run("get", id=wanted)
        talk.says(frame)
        assert (1 in talk.outcomes) == is_mine, (kind, wanted, frame)
