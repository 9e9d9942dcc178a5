"""Everything is killed at random, while pages at several sites want to drive one robot."""

from pathlib import Path

import pytest

from bench.rig.fleet_soak import SoakRig
from tests.e2e.ports import free_pair
from tests.effort import seed

LASTS_S = 15.0
"""Ten minutes of it: `./dev bench --full fleet_soak`."""

pytestmark = [
    pytest.mark.alone,
    pytest.mark.skipif("sys.platform != 'linux'", reason="the rig is for Linux"),
]


def test_one_page_drives_and_a_confirmed_stop_lasts_until_its_reset(tmp_path: Path) -> None:
    with SoakRig(tmp_path, free_pair()) as rig:
        found = rig.piece(int(seed()[:6] or "0", 16), LASTS_S)
    assert found.fault == "", found
    assert found.kills, found
