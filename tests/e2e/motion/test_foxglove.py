"""A robot behind the server of the Foxglove SDK that freezes or dies while it is driven."""

import pytest

from bench.rig.freeze import Freeze, freeze
from tests.e2e.verdict import judged

pytestmark = [pytest.mark.anyio, pytest.mark.alone]


async def test_nothing_old_arrives_after_a_freeze_of_the_server_and_the_stop_is_last() -> None:
    """All of it, two hundred times: `./dev bench motion_foxglove --full`."""
    freezes: list[Freeze] = []
    while not judged(freezes, 2):
        freezes += await freeze(
            1, robot_count=2, lasts_s=3.0, via="foxglove", seed=5 + len(freezes)
        )


async def test_a_short_freeze_behind_throttled_topics_ends_the_motion() -> None:
    """Messages that URC holds back go on for up to 2 s, and prove nothing."""
    freezes: list[Freeze] = []
    while not judged(freezes, 4):
        freezes += await freeze(
            2, robot_count=2, lasts_s=0.65, via="foxglove", seed=7 + len(freezes)
        )


async def test_the_stop_is_first_after_the_server_was_killed() -> None:
    deaths: list[Freeze] = []
    while not judged(deaths, 2):
        deaths += await freeze(
            1, robot_count=2, lasts_s=1.0, via="foxglove", seed=9 + len(deaths), is_killed=True
        )
