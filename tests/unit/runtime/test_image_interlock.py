"""A held command that needs an image moves by a current image, slowly by an old one, and no other.

Time passes by 50 ms with each tick of the scene.
"""

import pytest

from tests.unit.runtime.desks import DRIVER, SPEED, Scene
from urc.model.driver import Command
from urc.model.exchange import Hold, Sight
from urc.model.payload import WriteSpec
from urc.runtime.image_interlock import NO_IMAGE, OLD_IMAGE

HOLD = Hold(0.05, {"speed": 0.0}, 0.3, sight=Sight("front", 0.75, 0.25))
DRIVE = Command("drive", "wire", WriteSpec("text", {}), {"speed": SPEED}, hold=HOLD)
SEEING = DRIVER._replace(commands={**DRIVER.commands, "drive": DRIVE})


def scene(*, command: Command = DRIVE) -> Scene:
    """Return a robot whose `command` needs an image, driven by ann."""
    it = Scene(driver=SEEING._replace(commands={**SEEING.commands, command.name: command}))
    it.drive("ann", "take")
    it.heard()
    return it


def again(it: Scene, who: str = "ann") -> None:
    """Let go, and take control again, as a page does at the next push."""
    it.controller.release(who, "drive")
    it.drive(who, "take")
    it.heard()


def test_a_current_image_moves_at_the_wanted_speed_until_it_is_too_old() -> None:
    """The guard gets the end, so that it stops the robot even if the server stands still."""
    it = scene()
    assert it.tick(speed=0.8, sees=0.25) == ""
    assert it.heard()[-1] == "drive speed=0.8 for 0.50 s"


def test_an_older_image_moves_more_slowly() -> None:
    it = scene()
    assert it.tick(speed=0.8, sees=0.5) == ""
    assert it.heard()[-1] == "drive speed=0.4 for 0.25 s"


def test_an_image_that_is_too_old_ends_the_motion() -> None:
    """A control that stays held moves nothing, even with a new image; motion needs a new push."""
    it = scene()
    refused: list[tuple[str, str]] = []
    it.controller.on_refused = lambda command, why: refused.append((command, why))
    it.tick(speed=0.8, sees=0.1)
    it.heard()
    assert it.tick(speed=0.8, sees=0.75) == OLD_IMAGE
    assert it.heard() == ["release drive"]
    assert refused == [("drive", OLD_IMAGE)]
    assert it.tick(speed=0.8, sees=0.0) == OLD_IMAGE
    it.controller.release("ann", "drive")
    assert "take control again" in it.tick(speed=0.8, sees=0.0)
    assert not [text for text in it.heard() if "speed" in text]
    again(it)
    assert it.tick(speed=0.8, sees=0.0) == ""
    assert it.heard()[-1] == "drive speed=0.8 for 0.75 s"


def test_a_page_that_reports_no_image_does_not_begin() -> None:
    it = scene()
    assert it.tick(speed=0.8) == NO_IMAGE
    assert it.heard() == []
    assert it.tick(speed=0.8, sees=0.0) == NO_IMAGE, "a hand that held on moves nothing"


def test_a_page_that_reports_no_image_any_more_stops() -> None:
    it = scene()
    it.tick(speed=0.8, sees=0.0)
    it.heard()
    assert it.tick(speed=0.8) == OLD_IMAGE
    assert it.heard() == ["release drive"]


def test_the_guard_that_stops_first_is_explained_by_the_image() -> None:
    it = scene()
    it.tick(speed=0.8, sees=0.55)
    it.controller.stopped("drive", "expired")
    assert it.controller.why_short("drive") == OLD_IMAGE
    assert it.tick(speed=0.8, sees=0.0) == OLD_IMAGE


def test_a_lease_that_ended_by_itself_is_not_explained_by_the_image() -> None:
    it = scene()
    it.tick(speed=0.8, sees=0.0)
    it.controller.stopped("drive", "expired")
    assert it.controller.why_short("drive") == ""


def test_other_commands_take_no_notice_of_images() -> None:
    """Neither in what they send nor in how they hand it on."""
    it, plain = scene(), Scene()
    plain.drive("ann", "take")
    for one in (it, plain):
        one.heard()
        one.tick(command="lift", speed=0.8)
    assert it.heard() == plain.heard() == ["arm lift", "lift speed=0.8"]


def test_stop_and_release_need_no_image() -> None:
    it = scene()
    it.tick(speed=0.8, sees=0.0)
    it.heard()
    it.controller.release("ann", "drive")
    assert it.heard() == ["release drive"]
    it.controller.stop("ann")
    assert it.heard() == ["stop drive lift"]


def test_a_robot_that_moves_in_whole_numbers_is_slowed_towards_rest() -> None:
    us = SPEED._replace(name="us", type="integer", min=1000, max=2000, default=1500)
    gear = SPEED._replace(name="gear", type="integer", min=1, max=5, default=3)
    hold = HOLD._replace(release={"us": 1500})
    it = scene(command=DRIVE._replace(arguments={"us": us, "gear": gear}, hold=hold))
    it.tick(us=1901, gear=5, sees=0.5)
    assert it.heard()[-1] == "drive us=1700 gear=5 for 0.25 s"


def test_an_override_moves_without_an_image_for_a_moment() -> None:
    it = scene()
    assert it.tick(speed=0.8) == NO_IMAGE
    assert it.drive("ann", "override", for_s=5) == ""
    assert it.controller.images.override_s(it.now) == 5
    again(it)
    assert it.tick(speed=0.8) == ""
    assert it.heard()[-1] == "drive speed=0.8 for 4.95 s"
    it.now += 4.95
    assert it.tick(speed=0.8) == OLD_IMAGE
    assert it.heard() == ["release drive"]


@pytest.mark.parametrize(("wanted", "given"), [(0, 1), (-5, 1), (10, 10), (1e9, 30)])
def test_an_override_is_short(wanted: float, given: float) -> None:
    it = scene()
    it.drive("ann", "override", for_s=wanted)
    assert it.controller.images.override_s(it.now) == given


def test_only_whoever_holds_the_controls_overrides() -> None:
    it = scene()
    assert it.drive("bob", "override") == "ann has the controls"
    assert it.drive("vic", "override") == "ann has the controls"
    assert it.controller.images.override_s(it.now) == 0


def test_an_override_ends_with_stop_and_with_the_controls() -> None:
    for end in ("stop", "leave", "force"):
        it = scene()
        it.drive("ann", "override")
        if end == "stop":
            it.controller.stop("bob")
            assert it.drive("ann", "override").startswith("Stopped by bob")
            it.drive("ann", "reset")
        else:
            it.drive("ann" if end == "leave" else "eve", end)
            it.drive("eve", "leave")
        it.drive("ann", "take")
        it.heard()
        assert it.tick(speed=0.8) == NO_IMAGE, end


def test_a_robot_without_such_a_command_has_no_override() -> None:
    it = Scene()
    it.drive("ann", "take")
    assert "no command" in it.drive("ann", "override")
