"""The desk and a robot at rest: an engine that was held up, and hands that change."""

from tests.unit.runtime.desks import Scene
from urc.runtime.motion_controller import LET_GO


def test_an_engine_that_was_held_up_stops_what_moves() -> None:
    """And nothing goes on by itself; a latch it is not."""
    it = Scene()
    assert it.controller.halt() == []
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.heard()
    assert it.controller.halt() == ["drive"]
    assert it.heard() == ["release drive"], "what the guard has stopped by itself hears no other"
    assert it.tick(speed=0.5) == LET_GO
    it.controller.release("ann", "drive")
    it.drive("ann", "take")
    assert it.tick(speed=0.5) == ""


def test_an_engine_that_was_held_up_leaves_a_robot_at_rest_alone() -> None:
    """One that was let go, and whose stop was written: it hears nothing before a new gesture."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.controller.release("ann", "drive")
    it.heard()
    assert it.controller.halt() == ["drive"], "nobody has said that the stop was written"
    it.heard()
    it.controller.release("ann", "drive")
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.controller.release("ann", "drive")
    it.controller.stopped("drive", "released")
    it.heard()
    assert it.controller.halt() == []
    assert it.heard() == []
    assert it.tick(speed=0.5) == "", "nothing was stopped: nothing is to be taken anew"


def test_a_change_of_hands_says_nothing_to_a_robot_at_rest() -> None:
    """Its stop was written when it was let go; one that moves again is stopped."""
    it = Scene()
    it.drive("ann", "take")
    it.tick(speed=0.5)
    it.controller.release("ann", "drive")
    it.controller.stopped("drive", "released")
    it.heard()
    it.drive("ann", "leave")
    assert it.heard() == []
    it.drive("bob", "take")
    it.tick("bob", speed=0.5)
    it.controller.release("bob", "drive")
    it.tick("bob", speed=0.5)
    it.controller.stopped("drive", "released")
    it.heard()
    it.drive("bob", "leave")
    assert it.heard() == ["stop drive"], "the stop that was written was that before the new gesture"
