"""Frames of motion: what stops it can always be had, what moves it only when all is well."""

import pytest

from tests.dialogue import Dialogue, driver_of
from urc.model.flow import Confirm
from urc.problems import UrcError
from urc.protocol.encode import BadArgument
from urc.protocol.engine import Engine
from urc.protocol.motions import NotNow

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
    assert motions.stop_frame("turn") == b"0 TURN 0\n"
    for command in ("ping", "nothing"):
        with pytest.raises(BadArgument, match=command):
            motions.stop_frame(command)


def test_motion_needs_a_line_that_is_ready() -> None:
    """Nothing of it waits until there is one."""
    talk = Dialogue(DRIVER)
    with pytest.raises(NotNow, match="the robot is not connected"):
        talk.engine.motions.motion_frame("turn", {"v": 1}, 0)
    talk.connect()
    assert talk.engine.motions.motion_frame("turn", {"v": 1}, 0) == b"0 TURN 1\n"
    talk.engine.closed("wire", "gone", 1)
    with pytest.raises(NotNow, match="the robot is not connected"):
        talk.engine.motions.motion_frame("turn", {"v": 1}, 1)


def test_motion_needs_what_the_command_requires_at_each_tick() -> None:
    """The reason is the driver's own; old news is no news."""
    talk = Dialogue(DRIVER).connect()
    move = talk.engine.motions.motion_frame
    with pytest.raises(NotNow, match="not in automatic mode"):
        move("drive", {"v": 3}, 0.1)
    talk.says("MODE auto")
    assert move("drive", {"v": 3}, 0.2) == b"DRIVE 3 2\n"
    with pytest.raises(NotNow, match="not in automatic mode"):
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
        with pytest.raises(NotNow, match="two people must confirm"):
            move("turn", {"v": 1}, 0.1, people)
    assert move("turn", {"v": 1}, 0.1, ("ann", "bob")) == b"0 TURN 1\n"


def test_counters_go_on_over_motion_and_commands() -> None:
    """A frame that is made counts; one that stops, made in advance, does not."""
    talk = Dialogue(DRIVER).connect()
    motions = talk.engine.motions
    assert motions.motion_frame("turn", {"v": 1}, 0.1) == b"0 TURN 1\n"
    assert motions.stop_frame("turn") == b"1 TURN 0\n"
    assert motions.motion_frame("turn", {"v": 1}, 0.2) == b"1 TURN 1\n"
    talk.run("ping")
    assert motions.motion_frame("turn", {"v": 0}, 0.3) == b"3 TURN 0\n"


def test_its_errors_are_of_one_kind() -> None:
    """Whoever asks catches one."""
    assert issubclass(NotNow, UrcError)
    assert issubclass(BadArgument, UrcError)
