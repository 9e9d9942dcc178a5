"""Certificates that have ended or are revoked: nothing reaches a robot, and one line says why."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.e2e.fleet.counted_robot import NAME, CountedRobot
from tests.e2e.fleet.two_sites import WAIT_S, TwoSites, until_said
from tests.e2e.fleet.wrong_clock import WEEK_S, clock
from urc.fleet.files import FLEET_FOLDER
from urc.fleet.membership import Membership

ROBOT = f"/api/v1/robots/{NAME}@bern"
HORN = f"{ROBOT}/commands/horn"


@pytest.fixture
def robot() -> Iterator[CountedRobot]:
    """Run a robot."""
    with CountedRobot.running() as made:
        yield made


def aged(folder: Path, robot: CountedRobot, age_s: float) -> TwoSites:
    """Return two sites whose certificates are old; the servers are not running."""
    past = clock(-age_s)
    sites = TwoSites(folder, bern=[robot.document(folder)], environment=past)
    sites.bern.is_emulated = False
    try:
        sites.start_renewed()
    finally:
        sites.kill()
    for site in (sites.bern, sites.zug):
        site.environment = {}
    return sites


@pytest.mark.needs("faketime")
def test_an_ended_certificate_is_refused_until_a_new_invitation(
    tmp_path: Path, robot: CountedRobot
) -> None:
    """The site was off for more than a week."""
    sites = aged(tmp_path, robot, WEEK_S + 3 * 3600)
    zug = sites.zug
    try:
        sites.start()
        fault = (
            "the certificate of site zug ended 3 hours ago, or the clock of this computer is ahead"
        )
        assert zug.process is not None
        zug.process.wait_for(f"^urc serve: other sites will refuse this site: {fault}$")
        again = "on site bern, run 'urc fleet invite zug', and join again"
        assert zug.doctor() == [f"MISSING {fault}; {again}"]
        for _ in range(5):
            assert zug.ask(HORN, {})[0] == 502
        assert robot.heard == []
        zug.kill()
        code = sites.bern.command("fleet", "invite", "zug", "--address", sites.address)
        zug.command("fleet", "join", code)
        zug.start()
        until_said(zug, HORN, {}, 200)
        robot.hears("horn")
    finally:
        sites.kill()


@pytest.mark.needs("faketime")
def test_a_site_that_listens_uses_its_new_certificate_without_a_restart(
    tmp_path: Path, robot: CountedRobot
) -> None:
    """Other sites reach it after the end of the certificate with which it has started."""
    left_s = 20.0
    made_s = time.time() - WEEK_S + left_s
    sites = aged(tmp_path, robot, time.time() - made_s)
    try:
        ends = Membership.load(sites.bern.data / FLEET_FOLDER).certificate.ends
        sites.start()
        until_said(sites.zug, HORN, {}, 200)
        sites.zug.kill()
        time.sleep(max(0.0, ends.timestamp() + 1 - time.time()))
        sites.zug.start()
        until_said(sites.zug, HORN, {}, 200)
        assert sites.zug.doctor()[0].startswith("ok site zug of fleet lab, until ")
        assert len(sites.zug.doctor()) == 1
    finally:
        sites.kill()


@pytest.mark.needs("faketime")
def test_doctor_explains_an_address_that_refuses_or_does_not_answer(
    tmp_path: Path, robot: CountedRobot
) -> None:
    """Zenoh is silent about both. The own certificate is older than the error of the clock."""
    sites = aged(tmp_path, robot, 4 * 86400)
    zug = sites.zug
    try:
        sites.bern.start()
        zug.environment = clock(-86400)
        zug.start()
        where = f"127.0.0.1:{sites.port}"
        fault = (
            f"{where}: the certificate of site bern is not valid yet: the clock of this computer is"
            " at least 23 hours behind; set the clock"
        )
        assert zug.process is not None
        zug.process.wait_for(f"the fleet cannot be reached at {fault}$")
        assert zug.doctor()[-1] == f"MISSING {fault}"
        sites.bern.kill()
        assert zug.doctor()[-1] == (
            f"MISSING {where}: cannot be reached (connection refused); check the address, the"
            " server and the firewall there"
        )
        assert robot.heard == []
    finally:
        sites.kill()


def test_a_revoked_certificate_is_told_in_lists_and_by_doctor(
    tmp_path: Path, robot: CountedRobot
) -> None:
    """The robots of the site are lost, with the reason; STOP is refused too, and says so."""
    sites = TwoSites(tmp_path, bern=[robot.document(tmp_path)])
    sites.bern.is_emulated = False
    zug = sites.zug
    try:
        sites.start_renewed()
        until_said(zug, HORN, {}, 200)
        robot.hears("horn")
        zug.ask("/api/v1/robots")
        sites.bern.command("fleet", "revoke", "zug")
        fault = "the site bern refuses the connection: the certificate of site zug is revoked"
        assert until_said(zug, HORN, {}, 502)["message"] == fault
        assert zug.ask(f"{ROBOT}/stop", {})[1]["message"] == fault
        assert robot.heard == ["horn"]
        assert zug.doctor()[-1] == f"MISSING {fault}"
        assert sites.bern.doctor()[-1] == (
            "MISSING no secure connection to the site zug: the certificate of site zug is revoked"
        )
        end_s = time.monotonic() + WAIT_S
        while True:
            far = [one for one in zug.ask("/api/v1/robots")[1]["robots"] if "@" in one["name"]]
            if [(one["state"], one["detail"]) for one in far] == [("lost", fault)]:
                break
            assert time.monotonic() < end_s, far
            time.sleep(0.1)
    finally:
        sites.kill()
