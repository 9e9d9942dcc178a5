"""A route of the emulated TurtleBot 4: followed, cancelled by STOP, and after a lost connection."""

import asyncio
from contextlib import suppress
from pathlib import Path

import pytest

from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.test_rosbridge_goals import cable, until, value
from urc.config.load import load_profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import CommandFailed, Session
from urc.runtime.settings import resolve_settings
from urc.simulator.server import serve as serve_robot

pytestmark = pytest.mark.anyio

ROBOT = Path(__file__).resolve().parents[3] / "robots" / "turtlebot4.yaml"
WAIT_S = 60.0


def place(session: Session) -> tuple[float, float]:
    x, y = value(session, "map_x"), value(session, "map_y")
    assert isinstance(x, float)
    assert isinstance(y, float)
    return x, y


END = (3.0, -2.0)
"""The end of the long route; the robot needs more than 30 s to it."""


async def until_rested(session: Session) -> None:
    """Wait until the robot does not move for a second; fail if that is at the route's end."""
    async with asyncio.timeout(WAIT_S):
        before = None
        while before != place(session):
            before = place(session)
            await asyncio.sleep(1.0)
    assert before != pytest.approx(END, abs=0.5), "the robot drove to the end of the route"


async def test_a_route_is_followed_in_order_and_stop_ends_it_after_a_lost_connection() -> None:
    profile = load_profile(ROBOT, built_in_catalog())
    usual, _ = resolve_settings(profile, {})
    async with (
        nothing_left(),
        serve_robot(profile, {**usual, "port": 0}) as listening,
        cable(listening["ros"].port) as (near, cut),
    ):
        settings = {**usual, "host": "127.0.0.1", "port": near}
        async with Session(profile, settings, built_in_catalog().transports) as session:
            # The localisation's first pose comes after the first transforms.
            known = ("map_x", "covariance")
            await until(session, lambda: None not in [value(session, one) for one in known])
            x, y = place(session)
            route = {"xs": [x + 0.3, x + 0.3, x + 0.6], "ys": [y, y + 0.3, y + 0.3]}
            await session.command("follow", route)
            assert place(session) == pytest.approx((x + 0.6, y + 0.3), abs=0.3)
            assert value(session, "waypoint") == 2

            with pytest.raises(CommandFailed, match="the action was aborted"):
                await session.command("follow", {"xs": [0.0, 99.0], "ys": [0.0, 0.0]})

            following = asyncio.create_task(
                session.command("follow", {"xs": [-3.0, END[0]], "ys": [2.0, END[1]]})
            )
            await until(session, lambda: value(session, "waypoint") == 0)
            cut()
            with pytest.raises(CommandFailed):
                await following
            await until(session, lambda: session.hub.links["ros"].state == "live")
            before = place(session)  # the robot drives on without a connection
            await until(session, lambda: place(session) != before)
            async with asyncio.timeout(WAIT_S):
                while True:  # as STOP does, until the command has been sent
                    with suppress(CommandFailed):
                        await session.command("stop_route", {})
                        break
                    await asyncio.sleep(0.1)
            await until_rested(session)

            session.latch("STOP was pressed")
            with pytest.raises(CommandFailed, match="STOP was pressed"):
                await session.command("follow", route)
            await until_rested(session)
