"""A site whose clock is a day off: nothing reaches a robot, and one line says why."""

import json
import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.fleet.counted_robot import NAME, CountedRobot
from tests.e2e.fleet.two_sites import TwoSites, until_said
from tests.e2e.fleet.wrong_clock import clock
from urc.fleet.files import AUTHORITY_FOLDER, FLEET_FOLDER

pytestmark = pytest.mark.needs("faketime")
DAY_S = 86400
ROBOT = f"/api/v1/robots/{NAME}@bern"
HORN = f"{ROBOT}/commands/horn"


class Cart:
    """Both sites, and the robot of bern."""

    def __init__(self, sites: TwoSites, robot: CountedRobot) -> None:
        self.sites = sites
        self.robot = robot


@pytest.fixture
def cart(tmp_path: Path) -> Iterator[Cart]:
    """Run bern; zug has its certificate, and is not running. The horn has sounded once."""
    with CountedRobot.running() as robot:
        sites = TwoSites(tmp_path, bern=[robot.document(tmp_path)])
        sites.bern.is_emulated = False
        try:
            sites.start_renewed()
            until_said(sites.zug, HORN, {}, 200)
            robot.hears("horn")
            sites.zug.kill()
            yield Cart(sites, robot)
        finally:
            sites.kill()


def test_a_clock_a_day_ahead_is_named_at_both_sites_and_stop_works(cart: Cart) -> None:
    """Bern refuses the visitor; lists and `urc doctor` of both sites name the clock."""
    sites = cart.sites
    sites.zug.environment = clock(DAY_S)
    sites.zug.start()
    fault = (
        r"the clock of the site zug is 2[34] hours ahead of the clock of the site bern; set the"
        r" wrong clock"
    )
    said = until_said(sites.zug, HORN, {}, 403)
    assert re.fullmatch(fault, said["message"])
    _, found = sites.zug.ask("/api/v1/robots")
    far = next(one for one in found["robots"] if one["name"] == f"{NAME}@bern")
    assert far["state"] == "lost"
    assert re.fullmatch(fault, far["detail"])
    for site in (sites.zug, sites.bern):
        assert re.fullmatch(f"MISSING {fault}", site.doctor()[-1])
    assert cart.robot.heard == ["horn"]
    assert sites.zug.ask(f"{ROBOT}/stop", {})[0] == 200


def test_a_clock_a_day_behind_is_named_at_the_start_and_by_doctor(cart: Cart) -> None:
    """The certificate is not valid yet, so the site reaches no other site, and says so."""
    sites = cart.sites
    sites.zug.environment = clock(-DAY_S)
    sites.zug.start()
    fault = (
        "the certificate of site zug is not valid yet: the clock of this computer is at least 23"
        " hours behind; set the clock"
    )
    assert sites.zug.process is not None
    sites.zug.process.wait_for(f"^urc serve: other sites will refuse this site: {fault}$")
    assert sites.zug.doctor() == [f"MISSING {fault}"]
    status, said = sites.zug.ask(HORN, {})
    assert (status, said["message"]) == (502, "the site bern cannot be reached")
    assert sites.zug.ask(f"{ROBOT}/stop", {})[0] == 502
    assert cart.robot.heard == ["horn"]


def test_a_clock_days_ahead_renews_a_certificate_once(cart: Cart) -> None:
    """Each new certificate is half over at once; the authority's list must not grow for ever."""
    sites = cart.sites
    ledger = sites.bern.data / FLEET_FOLDER / AUTHORITY_FOLDER / "issued.json"
    before = len(json.loads(ledger.read_bytes())["entries"])
    sites.zug.environment = clock(5 * DAY_S)
    sites.zug.start()
    assert sites.zug.process is not None
    sites.zug.process.wait_for("the new certificate of this site is half over already: this clock")
    time.sleep(12.0)  # longer than the interval between attempts
    assert len(json.loads(ledger.read_bytes())["entries"]) == before + 1
