"""What the desk makes of the movers' reports, and which stops it owes."""

from tests.unit.runtime.desks import DRIVER, Scene, held
from urc.model.driver import Command, Driver
from urc.model.payload import Payload, WriteSpec
from urc.motion.lease import Operator
from urc.problems import UrcError
from urc.runtime.motion_controller import LET_GO, MOST_SCREENS

HALT = Command("halt", "wire", WriteSpec("text", {}), stops=True)


def driver(*commands: Command) -> Driver:
    """Return a robot of these commands."""
    return DRIVER._replace(commands={one.name: one for one in commands})


def moving(it: Scene) -> None:
    """Let ann drive."""
    it.drive("ann", "take")
    assert it.tick(speed=0.5) == ""
    it.heard()


def test_a_robot_hears_a_stop_by_its_controls_or_by_a_command() -> None:
    fold = Command("fold", "wire", WriteSpec("text", {}), moves=True)
    beep = DRIVER.commands["beep"]
    told = [
        (one.can_move, one.has_own_stop)
        for one in (
            Scene(driver=driver(*commands)).controller
            for commands in ([held("drive")], [HALT], [fold], [beep], [held("drive"), HALT])
        )
    ]
    assert told == [(True, True), (True, True), (True, False), (False, False), (True, True)]


def test_a_command_of_a_stop_is_owed_until_it_was_given() -> None:
    it = Scene(driver=driver(held("drive"), HALT))
    changes: list[bool] = []
    it.controller.on_change = lambda state: changes.append(it.controller.is_confirmed)
    assert it.controller.owed == []
    it.controller.stop("ann")
    assert it.controller.owed == ["halt"]
    it.controller.given("halt")
    assert (it.controller.owed, it.controller.is_confirmed) == ([], False)
    it.controller.stopped("drive", "stopped")
    assert it.controller.is_confirmed
    it.controller.given("halt")
    it.controller.stopped("drive", "stopped")
    assert changes == [False, True], "it is told once"


def test_a_screen_that_is_gone_is_no_screen_any_more() -> None:
    """Others have room, and what it still says is nobody's."""
    it = Scene()
    moving(it)
    it.controller.part("ann")
    assert it.heard() == ["stop drive"]
    assert "ann" not in it.controller._screens
    for number in range(MOST_SCREENS - 3):
        it.controller.join(Operator(f"more {number}"))


def test_the_report_of_a_stop_that_was_pressed_closes_no_later_gesture() -> None:
    """It may come when it was reset, and somebody drives again."""
    it = Scene()
    moving(it)
    it.controller.stop("bob")
    it.drive("ann", "reset")
    it.drive("ann", "take")
    it.controller.stopped("drive", "stopped")
    assert it.tick(speed=0.5) == ""


def test_whoever_holds_on_is_told_whether_the_line_or_the_lease_ended() -> None:
    for reason, why in (("revoked", "Lost contact while driving"), ("expired", LET_GO)):
        it = Scene()
        moving(it)
        it.controller.stopped("drive", reason)  # type: ignore[arg-type]
        assert it.tick(speed=0.5) == why


def test_a_release_confirms_no_stop() -> None:
    """It was written before STOP was pressed, and told after it."""
    it = Scene(driver=driver(held("drive")))
    moving(it)
    it.controller.release("ann", "drive")
    it.controller.stop("ann")
    it.controller.stopped("drive", "released")
    assert not it.controller.is_confirmed
    it.controller.stopped("drive", "stopped")
    assert it.controller.is_confirmed


def test_a_stop_that_is_told_after_the_session_counts() -> None:
    """There is no line any more that it could have come too early for."""
    it = Scene(driver=driver(held("drive")))
    it.controller.stop("ann")
    it.controller.detach()
    it.controller.stopped("drive", "stopped")
    assert it.controller.is_confirmed


def numbered() -> Scene:
    """Return a desk of three controls that are armed, two of them on one line, with numbers."""
    it = Scene(driver=driver(held("drive"), held("lift", "air"), held("turn")))
    it.frames.number = 10
    it.drive("ann", "take")
    for command in ("drive", "lift", "turn"):
        it.tick(command=command, speed=0.5)
    it.heard()
    return it


def test_all_stops_of_a_line_are_made_anew_and_no_others() -> None:
    it = numbered()
    it.frames.send("wire")
    renewed = it.heard()
    assert [told.rpartition(" ")[0].split()[-1] for told in renewed] == ["drive", "turn"]
    it.frames.send("air")
    assert [told.rpartition(" ")[0].split()[-1] for told in it.heard()] == ["lift"]


def test_a_stop_that_cannot_be_made_anew_keeps_back_no_other() -> None:
    it = numbered()
    whole = it.frames.stop_frame

    def broken(command: str) -> Payload:
        if command == "drive":
            raise UrcError("no such setting")
        return whole(command)

    it.frames.stop_frame = broken  # type: ignore[method-assign]
    it.frames.send("wire")
    (renewed,) = it.heard()
    assert renewed.endswith("turn stop")


def test_a_stop_that_was_armed_once_is_not_kept_for_ever() -> None:
    """What can't be made when nothing is armed is told by `urc validate`, and is not made up."""
    it = Scene(driver=driver(held("drive"), held("lift", "air")))
    moving(it)
    it.controller.stop("ann")
    whole = it.frames.stop_frame

    def broken(command: str) -> Payload:
        if command == "drive":
            raise UrcError("no such setting")
        return whole(command)

    it.frames.stop_frame = broken  # type: ignore[method-assign]
    it.heard()
    it.controller.stop("ann")
    assert it.heard() == ["stop lift"]


def test_a_control_that_a_stop_closed_says_so_until_it_was_let_go() -> None:
    """And stands: what the movers told of it before changes nothing."""
    it = Scene()
    moving(it)
    it.controller.stopped("drive", "expired")
    assert it.controller.rests("drive")
    assert it.controller.halt() == []
    assert it.heard() == []
