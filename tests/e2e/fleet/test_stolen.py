"""The key and the certificate of a site, copied to another computer."""

import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.fleet.counted_robot import NAME, CountedRobot
from tests.e2e.fleet.two_sites import WAIT_S, Site, TwoSites, until_said

ROBOT = f"/api/v1/robots/{NAME}@bern"
HORN = f"{ROBOT}/commands/horn"
TWICE = "two servers use the certificate of the site; end one of them, or revoke the site"
REVOKED = "the certificate of site zug is revoked"


@pytest.fixture
def robot() -> Iterator[CountedRobot]:
    """Run a robot."""
    with CountedRobot.running() as made:
        yield made


def test_a_stolen_certificate_counts_until_it_is_revoked(
    tmp_path: Path, robot: CountedRobot
) -> None:
    """It can do what the site can; both together are noticed; afterwards nothing gets through."""
    sites = TwoSites(tmp_path, bern=[robot.document(tmp_path)])
    bern, zug = sites.bern, sites.zug
    bern.is_emulated = False
    thief = Site(tmp_path / "thief", "puppet")
    try:
        sites.start_renewed()
        zug.kill()
        (thief.data / "fleet").mkdir(parents=True)
        shutil.copytree(zug.data / "fleet", thief.data / "fleet", dirs_exist_ok=True)
        thief.start()
        until_said(thief, HORN, {}, 200)
        robot.hears("horn")
        zug.start()
        assert bern.process is not None
        end_s = time.monotonic() + WAIT_S
        while not any(TWICE in line for line in bern.process.errors):
            assert time.monotonic() < end_s, bern.process.errors
            bern.ask("/api/v1/robots/puppet@zug")
        before = len(robot.heard)
        bern.command("fleet", "revoke", "zug")
        zug.kill()
        fault = f"the site bern refuses the connection: {REVOKED}"
        assert until_said(thief, HORN, {}, 502)["message"] == fault
        bern.process.wait_for(f"a line of the site zug is refused: {REVOKED}$")
        assert thief.ask(f"{ROBOT}/stop", {})[1]["message"] == fault
        assert thief.doctor()[-1] == f"MISSING {fault}"
        status, said = bern.ask("/api/v1/robots/puppet@zug")
        assert status == 502
        assert said["message"] == f"no secure connection to the site zug: {REVOKED}"
        assert len(robot.heard) == before
    finally:
        sites.kill()
        if thief.process is not None:
            thief.kill()
