"""A part of a fleet is killed or frozen while a robot is driven from another site."""

from collections.abc import Iterator

import pytest

from bench.rig.fleet_troubles import TROUBLES, FleetRig, FleetTrial
from tests.e2e.ports import free_pair
from tests.e2e.verdict import judged
from tests.effort import seed

EACH = 3
"""All of it, three hundred times each: `./dev bench --full fleet_cuts`."""

pytestmark = [
    pytest.mark.alone,
    pytest.mark.skipif("sys.platform != 'linux'", reason="the rig is for Linux"),
]


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[FleetRig]:
    """Run three sites over Zenoh."""
    with FleetRig(tmp_path_factory.mktemp("fleet"), free_pair()) as made:
        yield made


@pytest.mark.parametrize("trouble", TROUBLES)
def test_the_robot_stops_and_nothing_moves_after_healing(rig: FleetRig, trouble: str) -> None:
    """Stops and lists are in time, whichever node it is."""
    trials: list[FleetTrial] = []
    first = int(seed()[:6] or "0", 16)
    while not judged(trials, EACH):
        trials.append(rig.trial(first + len(trials), trouble))
