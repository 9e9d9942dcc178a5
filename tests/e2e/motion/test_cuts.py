"""A link to the robot that was cut and heals brings the stop first, and no old motion."""

from collections.abc import Iterator

import pytest

from tests.e2e.motion.verdict import judged
from urc.testing.rig_cuts import Cut, CutRig

pytestmark = pytest.mark.needs("tun")

CUTS_S = (0.22, 0.3, 0.5, 0.8, 1.3, 2.1, 3.0)
"""How long the cuts last; each is one of all robots at once. A line counts as stalled after 250 ms
without progress, which may begin one tick after the cut: so is the shortest of them chosen."""


@pytest.fixture(scope="module")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[CutRig]:
    """Robots behind a relay."""
    with CutRig(tmp_path_factory.mktemp("cuts")) as made:
        yield made


def test_cut_link_brings_no_old_motion_and_the_stop_first(rig: CutRig) -> None:
    """No motion older than 300 ms, and the stop within 100 ms of the link's being back."""
    cuts: list[Cut] = []
    for seconds in CUTS_S:
        cuts += rig.cut(seconds)
    assert judged(cuts, len(cuts) * 3 // 4)


@pytest.mark.parametrize("side", ["a", "b"])
def test_link_cut_in_one_direction_brings_no_old_motion_either(rig: CutRig, side: str) -> None:
    """Only the commands, or only the acknowledgements are lost."""
    cuts: list[Cut] = []
    for seconds in (0.6, 1.5):
        cuts += rig.cut(seconds, f"cut {side}")
    assert judged(cuts, len(cuts) * 3 // 4)
