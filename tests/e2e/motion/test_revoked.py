"""A right that ends while its holder drives: the robot stops in time, for each kind of right."""

from collections.abc import Iterator

import pytest

from bench.rig.deaths import Trial
from bench.rig.revocations import REVOCATIONS, RevocationRig
from tests.e2e.verdict import judged

EACH = 20
ROBOTS = 10

pytestmark = [
    pytest.mark.alone,
    pytest.mark.skipif("sys.platform != 'linux'", reason="the rig is for Linux"),
]


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RevocationRig]:
    """Robots, a server with its guards, and pages of people, devices and programs."""
    with RevocationRig(tmp_path_factory.mktemp("rig"), robot_count=ROBOTS) as made:
        made.bout("person")  # starts the guards
        yield made


@pytest.mark.parametrize("kind", REVOCATIONS)
def test_a_revoked_right_stops_the_robot_that_its_holder_drives(
    rig: RevocationRig, kind: str
) -> None:
    """First byte of the stop within 300 ms; the ticks that follow move nothing."""
    trials: list[Trial] = []
    while not judged(trials, EACH):
        trials += rig.bout(kind)
