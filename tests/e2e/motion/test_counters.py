"""Held motion over UDP, in frames that share a counter with polls, a keepalive and each other."""

import pytest

from bench.rig.counters import gestures

pytestmark = pytest.mark.anyio


async def test_numbers_are_gapless_and_rise_at_the_socket_that_receives() -> None:
    """Gestures of up to a minute, a hundred times: `bench/motion_counters.py`."""
    told = await gestures([5.0, 6.0, 7.0], robot_count=3, seed=11)
    assert [one.fault for one in told] == ["", "", ""]
    assert all(one.motions > 50 and one.frames - one.motions > 50 for one in told)
