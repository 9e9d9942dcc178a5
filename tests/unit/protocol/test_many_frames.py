"""Several frames of one command: together, in their order, with one release each."""

import pytest

from tests.dialogue import Dialogue
from urc.protocol.requests.encode import BadArgument

DRIVER = """
commands:
  drive:
    send: ["M1 {{ left | fixed(0) }}", { hex: "02 {{ right | round | int | i16be }}" }]
    args: { left: { min: -100, max: 100, default: 0 }, right: { min: -100, max: 100, default: 0 } }
    hold: { repeat: 50ms, release: { left: 0, right: 1 }, watchdog: 500ms }
  lamps:
    send: ["L1 {{ a }}", "L2 {{ a }}"]
    args: { a: { type: integer } }
    reply: { equals: OK }
"""


def test_frames_of_motion_go_out_as_one_piece() -> None:
    """Nothing comes between them, whatever the line does."""
    motions = Dialogue(DRIVER).connect().engine.motions
    frame = motions.motion_frame("drive", {"left": 20, "right": -1}, 0)
    assert frame == b"M1 20\n" + b"\x02\xff\xff\n"


def test_the_stop_of_each_frame_is_armed() -> None:
    """One release for all, and none of them can be forgotten."""
    motions = Dialogue(DRIVER).engine.motions
    assert motions.stop_frame("drive") == b"M1 0\n" + b"\x02\x00\x01\n"
    assert motions.is_lasting("drive")


def test_a_value_that_one_frame_cannot_carry_sends_neither() -> None:
    """Half a command is none."""
    motions = Dialogue(DRIVER).connect().engine.motions
    with pytest.raises(BadArgument, match="right"):
        motions.motion_frame("drive", {"left": 20, "right": 101}, 0)


def test_a_command_that_is_given_once_sends_them_all_and_waits_for_its_answer() -> None:
    """As for one frame."""
    talk = Dialogue(DRIVER).connect()
    number = talk.run("lamps", a=3)
    assert talk.sent == ["L1 3\nL2 3"]
    talk.says("OK")
    assert talk.outcomes[number] == "done"
