"""A counterpart that stands still for seconds while its system goes on taking what is written."""

import pytest

from bench.rig.freeze import freeze

pytestmark = [pytest.mark.anyio, pytest.mark.alone]


async def test_nothing_old_arrives_after_a_freeze_and_the_stop_is_last() -> None:
    """All of it, a hundred times: `bench/motion_freeze.py`."""
    freezes = await freeze(2, lanes=2, lasts_s=5.0, seed=3)
    assert len(freezes) == 4
    said = [one for one in freezes if not one.is_excused]
    assert said, f"the machine was too busy: {freezes}"
    assert [one for one in said if not one.is_good] == []
