"""Frames of motion: what stops it can always be had, what moves it only when all is well."""

import pytest

from tests.dialogue import Dialogue, driver_of
from urc.model.exchange import MOST_STOPS, Confirm
from urc.model.payload import Count, CountedFrame, FrameVariants, Numbered, Payload
from urc.problems import UrcError
from urc.protocol.engine import Engine
from urc.protocol.events import MotionReady, NumbersUsed, Ready, Replied, Request, Samples, Send
from urc.protocol.motion_encoder import MotionEncoder, MotionUnavailable
from urc.protocol.requests.encode import BadArgument

DRIVER = """
signals:
  mode: { type: string, stale_after: 5s }
commands:
  drive:
    send: "DRIVE {{ v }} {{ w }}"
    args: { v: { type: number, min: -9, max: 9, default: 0 }, w: { type: number, default: 2 } }
    hold: { repeat: 50ms, release: { v: 0 } }
    requires:
      - { expr: mode == 'auto', else: The robot is not in automatic mode }
  turn:
    send: "{{ seq('n', 0, 9) }} TURN {{ v }}"
    args: { v: { type: integer, min: -1, max: 1, default: 0 } }
    hold: { repeat: 50ms, release: {} }
  ping: { send: "{{ seq('n', 0, 9) }} PING" }
messages:
  mode: { regex: '^MODE (?P<mode>\\w+)$' }
"""


def test_what_stops_it_needs_neither_the_robot_nor_a_connection() -> None:
    """It is rendered when a control is armed, and must be there whatever happens then."""
    motions = Dialogue(DRIVER).engine.motions
    assert motions.stop_frame("drive") == b"DRIVE 0 2\n"
    assert stops(motions)[0] == b"0 TURN 0\n"
    for command in ("ping", "nothing"):
        with pytest.raises(BadArgument, match=command):
            motions.stop_frame(command)


def test_motion_needs_a_line_that_is_ready() -> None:
    """Nothing of it waits until there is one."""
    talk = Dialogue(DRIVER)
    with pytest.raises(MotionUnavailable, match="the robot is not connected"):
        talk.engine.motions.motion_frame("turn", {"v": 1}, 0)
    talk.connect()
    assert talk.engine.motions.motion_frame("turn", {"v": 1}, 0) == b"0 TURN 1\n"
    talk.engine.closed("wire", "gone", 1)
    with pytest.raises(MotionUnavailable, match="the robot is not connected"):
        talk.engine.motions.motion_frame("turn", {"v": 1}, 1)


def test_motion_needs_what_the_command_requires_at_each_tick() -> None:
    """The reason is the driver's own; old news is no news."""
    talk = Dialogue(DRIVER).connect()
    move = talk.engine.motions.motion_frame
    with pytest.raises(MotionUnavailable, match="not in automatic mode"):
        move("drive", {"v": 3}, 0.1)
    talk.says("MODE auto")
    assert move("drive", {"v": 3}, 0.2) == b"DRIVE 3 2\n"
    with pytest.raises(MotionUnavailable, match="not in automatic mode"):
        move("drive", {"v": 3}, 6.0)


@pytest.mark.parametrize("value", [9.01, -10, float("nan"), float("inf"), "3", True, None, [1]])
def test_a_value_that_is_not_as_declared_makes_no_frame(value: object) -> None:
    """Whatever a page, a script or a recording says."""
    talk = Dialogue(DRIVER).connect()
    talk.says("MODE auto")
    with pytest.raises(BadArgument, match="v"):
        talk.engine.motions.motion_frame("drive", {"v": value}, 0.1)
    with pytest.raises(BadArgument, match="no argument 'u'"):
        talk.engine.motions.motion_frame("drive", {"u": 1}, 0.1)


def test_two_people_must_confirm_where_one_is_not_enough() -> None:
    """Documents may not ask for it; a driver that does is obeyed. Equal names are one person."""
    driver = driver_of(DRIVER)
    asked = driver.commands["turn"]._replace(confirm=Confirm(text="Clear", is_two_person=True))
    engine = Engine(driver._replace(commands={**driver.commands, "turn": asked}), {})
    engine.start("wire", 0)
    move = engine.motions.motion_frame
    for people in ((), ("ann",), ("ann", "ann"), ("ann", "")):
        with pytest.raises(MotionUnavailable, match="two people must confirm"):
            move("turn", {"v": 1}, 0.1, people)
    assert move("turn", {"v": 1}, 0.1, ("ann", "bob")) == b"0 TURN 1\n"


def stops(motions: MotionEncoder) -> list[Payload]:
    """Return the stops of ``turn`` that are made in advance."""
    series = motions.stop_frame("turn")
    assert isinstance(series, FrameVariants)
    return [one.data for one in series.frames]


def numbered(frame: Payload | CountedFrame) -> Numbered:
    """Return a frame that says what it does to the counters."""
    assert isinstance(frame, CountedFrame)
    return frame.numbered


def test_counters_go_on_over_motion_and_commands_and_a_stop_uses_none_before_it_leaves() -> None:
    talk = Dialogue(DRIVER).connect()
    motions = talk.engine.motions
    assert motions.motion_frame("turn", {"v": 1}, 0.1) == b"0 TURN 1\n"
    assert stops(motions)[0] == stops(motions)[0] == b"1 TURN 0\n"
    assert motions.motion_frame("turn", {"v": 1}, 0.2) == b"1 TURN 1\n"
    talk.run("ping")
    assert motions.motion_frame("turn", {"v": 0}, 0.3) == b"3 TURN 0\n"


def test_stops_are_made_for_each_repeat_and_for_a_new_connection() -> None:
    """Whoever stops alone has one for each number that may be next."""
    motions = Dialogue(DRIVER.replace("0, 9", "0, 999")).connect().engine.motions
    motions.share(["wire"])
    motions.set_counters("wire", {"n": 499}, is_settled=True)
    made = [one for one in stops(motions) if isinstance(one, bytes)]
    length = len(made) // 2
    assert length >= MOST_STOPS
    assert made[:length] == [b"%d TURN 0\n" % (500 + at) for at in range(length)]
    assert made[length:] == [b"%d TURN 0\n" % at for at in range(length)]


def test_numbers_of_a_shared_line_count_when_their_frames_have_left() -> None:
    """A tick that is replaced by a newer one uses no number up."""
    talk = Dialogue(DRIVER).connect()
    motions = talk.engine.motions
    motions.share(["wire"])
    first = motions.motion_frame("turn", {"v": 1}, 0.1)
    assert numbered(first) == Numbered(b"0 TURN 1\n", Count({}, {"n": 0}))
    assert numbered(motions.motion_frame("turn", {"v": -1}, 0.2)).data == b"0 TURN -1\n"
    assert motions.set_counters("wire", {"n": 0}, is_settled=True) == [NumbersUsed("wire")]
    next_one = numbered(motions.motion_frame("turn", {"v": 1}, 0.3))
    assert next_one == Numbered(b"1 TURN 1\n", Count({"n": 0}, {"n": 1}))
    used, sent = talk.engine.command(Request(1, "ping"), 0.4)[:2]
    assert used == NumbersUsed("wire"), "before the frame: its stops come first"
    assert isinstance(sent, Send)
    assert sent.counted is not None
    assert sent.counted.numbered == Numbered(b"1 PING\n", Count({"n": 0}, {"n": 1}))
    motions.set_counters("wire", {"n": 7}, is_settled=True)
    assert sent.counted.again() == Numbered(b"8 PING\n", Count({"n": 7}, {"n": 8}))
    assert isinstance(first, CountedFrame)
    assert first.again() == Numbered(b"8 TURN 1\n", Count({"n": 7}, {"n": 8})), "it overtakes"


def test_use_of_a_number_is_an_event_where_motion_shares_the_counters() -> None:
    """On each connection; also of a frame that cannot be encoded. Rendering a stop uses none."""
    talk = Dialogue(DRIVER)
    motions = talk.engine.motions
    assert (motions.is_lasting("turn"), motions.is_lasting("drive")) == (False, True)
    talk.connect()
    talk.run("ping")
    assert talk.motion == [MotionReady("wire")], "nothing shares them yet"
    motions.share(["wire"])
    for _ in range(2):
        talk.engine.closed("wire", "gone", 1)
        talk.motion.clear()
        talk.connect()
        motions.motion_frame("turn", {"v": 1}, 0.1)
        stops(motions)
        talk.run("ping")
        assert talk.motion == [MotionReady("wire"), NumbersUsed("wire")]


def test_line_with_start_up_steps_is_ready_for_motion_after_them() -> None:
    """Told before any frame that waited for them: a stop that is repeated now goes first."""
    talk = Dialogue(DRIVER + "wire: on_connect: [{ send: LOGIN }, { expect: '^OK$' }]")
    motions = talk.engine.motions
    talk.connect()
    assert (talk.motion, motions.is_ready("drive")) == ([], False)
    talk.run("ping")
    heard, *events = talk.engine.receive("wire", b"OK\n", 0.1)
    assert isinstance(heard, Samples)
    assert events[:2] == [MotionReady("wire"), Ready("wire")]
    assert [type(one) for one in events[2:]] == [Send, Replied]
    assert motions.is_ready("drive")


def test_its_errors_are_of_one_kind() -> None:
    """Whoever asks catches one."""
    assert issubclass(MotionUnavailable, UrcError)
    assert issubclass(BadArgument, UrcError)


ASKED = """
commands:
  lamp: { send: "LED {{ on }}", args: { on: { type: integer, min: 0, max: 1 } } }
  ping: { send: "{{ seq('n', 0, 9) }} PING", reply: { regex: '^PONG$' } }
  look: { send: LOOK, reply: { regex: '^OK$' } }
"""


def test_whoever_asks_for_a_command_may_hear_what_is_sent_for_it() -> None:
    """For the audit: on a free line at once, from the queue later, with the number it got."""
    talk, sent = Dialogue(ASKED).connect(), list[object]()
    for number, (name, given) in enumerate(
        [("lamp", {"on": 1}), ("lamp", {"on": 2}), ("look", {}), ("ping", {})]
    ):
        events = talk.engine.command(Request(number, name, given, on_sent=sent.append), 0.1)
        talk.take(events)
    assert sent == [b"LED 1\n", b"LOOK\n"], "what is refused, or waits, is not sent"
    talk.at(0.2).says("OK")
    assert sent[2:] == [b"0 PING\n"]


def test_a_robot_that_says_nothing_any_more_is_not_moved() -> None:
    """Whether it was frozen, or the line is half open: nobody would see what it does."""
    talk = Dialogue(DRIVER + "wire: stale_after: 2s").connect()
    move = talk.engine.motions.motion_frame
    talk.at(1.9)
    assert move("turn", {"v": 1}, 1.9)
    talk.at(2.1)
    with pytest.raises(MotionUnavailable, match="the robot has sent nothing for 2 s"):
        move("turn", {"v": 1}, 2.1)
    assert talk.engine.motions.stop_frame("turn"), "it is stopped all the same"
    talk.says("MODE manual")
    assert move("turn", {"v": 1}, 2.2)


def test_a_robot_that_moves_in_steps_is_told_nothing_to_stop_it() -> None:
    """Each frame is a step, and ends by itself."""
    talk = Dialogue(
        """
commands:
  jog: { send: "JOG {{ x }}", args: { x: { default: 0 } }, hold: { repeat: 100ms, step: 100ms } }
"""
    ).connect()
    assert talk.engine.motions.motion_frame("jog", {"x": 2}, 0.1) == b"JOG 2\n"
    assert talk.engine.motions.stop_frame("jog") == b""
