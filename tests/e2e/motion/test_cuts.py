"""A link to the robot that was cut and heals brings the stop first, and no old motion."""

from collections.abc import Iterator

import pytest

from bench.rig.cuts import Cut, CutRig
from bench.rig.kinds import KINDS
from tests.e2e.verdict import judged

pytestmark = [
    pytest.mark.alone,
    pytest.mark.needs("tun"),
    pytest.mark.needs("mosquitto"),
    pytest.mark.needs("sshd"),
    pytest.mark.needs("netcat"),
]

CUTS_S = (0.2, 0.5, 1.6)
"""How long the cuts last; each is one of all robots at once."""
ONE_WAY_S = 0.8


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CutRig]:
    """Two robots on every kind of line, behind a relay."""
    with CutRig(tmp_path_factory.mktemp("cuts"), (*KINDS, *KINDS)) as made:
        made.warm_up()
        yield made


def test_cut_link_brings_no_old_motion_and_the_stop_first(rig: CutRig) -> None:
    """No motion older than 300 ms, and the stop within 100 ms of the link's being back."""
    cuts: list[Cut] = []
    for seconds in CUTS_S:
        cuts += rig.cut(seconds)
    wanted = len(cuts) * 3 // 4
    while not judged(cuts, wanted):
        cuts += rig.cut(CUTS_S[1])


@pytest.mark.parametrize("order", ["cut a", "cut b", "down a", "down b"])
def test_link_cut_in_one_direction_or_an_interface_down_is_no_different(
    rig: CutRig, order: str
) -> None:
    """Only the commands, or only the acknowledgements are lost; or a plug is pulled."""
    cuts = rig.cut(ONE_WAY_S, order)
    wanted = len(cuts) * 3 // 4
    while not judged(cuts, wanted):
        cuts += rig.cut(ONE_WAY_S, order)
