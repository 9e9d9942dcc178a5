"""Robots that come and go while the dashboard runs."""

import asyncio
from pathlib import Path

import pytest

from urc.testing.dashboard import FakeRobot, dashboard_profile, plain_widget
from urc.web.fleet.fleet import Fleet
from urc.web.fleet.robots import Robot, RobotService, SessionFailed

pytestmark = pytest.mark.anyio


def served(robot: FakeRobot) -> Robot:
    """Return a robot that is not there, as the dashboard serves it."""
    return Robot(robot.profile, {}, robot.open)


def fleet(*robots: FakeRobot) -> Fleet:
    """Return a fleet, each robot with a service of its own."""
    return Fleet(
        {one.profile.name: served(one) for one in robots},
        lambda _, robot: RobotService(robot, linger_s=0.0),
    )


async def test_a_robot_that_is_added_can_be_looked_at_and_one_that_is_removed_is_let_go() -> None:
    """Its session ends, and who still looks is told; the others go on."""
    first, second = FakeRobot(dashboard_profile()), FakeRobot(dashboard_profile(name="rover"))
    ships = fleet(first)
    async with asyncio.timeout(10), ships.running():
        ships.add("rover", served(second))
        service = ships.services["rover"]
        with service.visit(), ships.services["puppet"].visit():
            live = await service.live()
            await ships.services["puppet"].live()
            assert (first.is_open, second.is_open) == (True, True)
            await ships.remove("rover")
            assert (first.is_open, second.is_open) == (True, False)
            assert live.ended.is_set()
    assert list(ships.robots) == list(ships.services) == ["puppet"]
    assert not first.is_open


async def test_a_robot_that_was_never_looked_at_is_removed_at_once() -> None:
    robot = FakeRobot(dashboard_profile())
    ships = fleet(robot)
    async with asyncio.timeout(10), ships.running():
        await ships.remove("puppet")
        await ships.remove("puppet")
    assert robot.opened == 0


async def test_a_session_that_cannot_be_opened_is_told_also_after_an_addition() -> None:
    class Refusing(FakeRobot):
        def open(self):  # type: ignore[no-untyped-def]  # it never gives one
            from urc.problems import UrcError

            raise UrcError("no such port")

    ships = fleet()
    async with asyncio.timeout(10), ships.running():
        ships.add("puppet", served(Refusing(dashboard_profile())))
        with ships.services["puppet"].visit(), pytest.raises(SessionFailed, match="no such port"):
            await ships.services["puppet"].live()
        await ships.remove("puppet")


async def test_widgets_of_one_name_are_kept_apart(tmp_path: Path) -> None:
    """The same files are the same widget; other files get another name on that robot's pages."""
    copy, other = tmp_path / "copy" / "battery", tmp_path / "other" / "battery"
    for folder, text in ((copy, "a"), (other, "b")):
        folder.mkdir(parents=True)
        (folder / "widget.js").write_text(text, encoding="utf-8")
    same = tmp_path / "same" / "battery"
    same.mkdir(parents=True)
    (same / "widget.js").write_text("a", encoding="utf-8")
    ships = fleet()
    for name, folder in (("a", copy), ("b", same), ("c", other)):
        own = plain_widget("battery", ["level"], folder=folder)
        ships.add(name, served(FakeRobot(dashboard_profile(name=name, widgets=[own]))))
    names = [next(iter(ships.robots[name].profile.widgets)) for name in "abc"]
    assert names[:2] == ["battery", "battery"]
    assert names[2].startswith("battery.")
    slot = ships.robots["c"].profile.slots["battery"]
    assert slot.widget == names[2]
    assert f"{names[2]}/widget.js" in ships.widgets.files
