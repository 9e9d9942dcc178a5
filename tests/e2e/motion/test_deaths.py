"""Whatever becomes of the operator, the robot is told to stop in time: a hundred of each death."""

from collections.abc import Iterator

import pytest

from bench.rig.deaths import DEATHS, LEASE_MS, LINK_DEATHS, Rig, Trial
from bench.rig.programs import can_relay
from tests.e2e.verdict import judged

EACH = 100
ROBOTS = 20
AT_ONCE = ("close", "kill", "reset", "kick")
"""Deaths of which the server hears; the others it learns by silence."""

pytestmark = [
    pytest.mark.alone,
    pytest.mark.skipif("sys.platform != 'linux'", reason="the rig is for Linux"),
]


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """Robots, a server with its guards, and pages; over a relay where one can be had."""
    with Rig(tmp_path_factory.mktemp("rig"), robot_count=ROBOTS, has_relay=can_relay()) as made:
        made.bout("close")  # the first one also starts the guards, twenty programs at once
        yield made


def stopped(rig: Rig, death: str) -> list[Trial]:
    """Let pages die until so many deaths say something; return them all."""
    trials: list[Trial] = []
    while not judged(trials, EACH):
        trials += rig.bout(death)
    return trials


@pytest.mark.parametrize("death", [one for one in DEATHS if one not in LINK_DEATHS])
def test_operator_who_vanishes_leaves_a_robot_that_stops(rig: Rig, death: str) -> None:
    """First byte of the stop: at most lease + 50 ms after the last tick, and then silence."""
    trials = stopped(rig, death)
    if death not in AT_ONCE:
        assert min(one.stop_ms for one in trials) >= LEASE_MS - 5  # nothing else can have told it


@pytest.mark.needs("tun")
@pytest.mark.parametrize("death", LINK_DEATHS)
def test_operator_whose_link_is_cut_leaves_a_robot_that_stops(rig: Rig, death: str) -> None:
    """The same; and what the page's kernel kept until the link healed moves nothing."""
    trials = stopped(rig, death)
    assert min(one.stop_ms for one in trials) >= LEASE_MS - 5
