"""A counterpart that stands still for seconds while its system goes on taking what is written."""

import pytest

from bench.rig.freeze import Freeze, freeze
from tests.e2e.verdict import judged

pytestmark = [pytest.mark.anyio, pytest.mark.alone]


async def test_nothing_old_arrives_after_a_freeze_and_the_stop_is_last() -> None:
    """All of it, a hundred times: `bench/motion_freeze.py`."""
    freezes: list[Freeze] = []
    while not judged(freezes, 3):
        freezes += await freeze(2, robot_count=2, lasts_s=5.0, seed=3 + len(freezes))
