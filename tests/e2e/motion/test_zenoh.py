"""A robot behind a Zenoh router that freezes or dies while it is driven."""

import pytest

from bench.rig.freeze import Freeze, freeze
from tests.e2e.verdict import judged

pytestmark = [pytest.mark.anyio, pytest.mark.alone]


async def test_nothing_old_arrives_after_a_freeze_of_the_router_and_the_stop_is_last() -> None:
    """All of it, two hundred times: `./dev bench motion_zenoh --full`."""
    freezes: list[Freeze] = []
    while not judged(freezes, 2):
        freezes += await freeze(1, robot_count=2, lasts_s=3.0, via="zenoh", seed=5 + len(freezes))


async def test_the_stop_is_first_after_the_router_was_killed() -> None:
    deaths: list[Freeze] = []
    while not judged(deaths, 2):
        deaths += await freeze(
            1, robot_count=2, lasts_s=1.0, via="zenoh", seed=9 + len(deaths), is_killed=True
        )
