"""`urc fleet` as real processes, with a data folder for each site; OpenSSL judges the files."""

import json
import re
import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
import zxingcpp

from tests.e2e.command_line import run
from tests.unit.fleet.fleets import Place
from urc.fleet.authority import FleetAuthority
from urc.fleet.certificates import CertificateRefused
from urc.fleet.files import AUTHORITY_FOLDER, FLEET_FOLDER
from urc.fleet.invitation import SiteInvitation
from urc.fleet.membership import Membership

ADDRESS = "127.0.0.1:9"
"""Nobody listens here, so `urc doctor` learns it at once."""


class Site:
    """The data folder of one site, and the commands that its maintainer types."""

    def __init__(self, data: Path) -> None:
        self.data = data
        self.folder = data / FLEET_FOLDER

    def __call__(self, *words: str, columns: int = 80) -> str:
        """Return the output of a command that succeeds in a terminal with UTF-8."""
        done = run(
            *("fleet", *words, "--data-dir", str(self.data)),
            COLUMNS=str(columns), LC_ALL="C.UTF-8", PYTHONUTF8="1",
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout

    def refused(self, *words: str, code: int = 1) -> str:
        """Return the one line with which a command fails."""
        done = run("fleet", *words, "--data-dir", str(self.data))
        assert (done.returncode, done.stdout) == (code, ""), done.stdout
        (line,) = done.stderr.splitlines()
        assert line.startswith("urc fleet: ")
        return line

    def status(self) -> dict[str, object]:
        found: dict[str, object] = json.loads(self("status", "--format", "json"))
        return found

    def doctor(self) -> str:
        done = run("doctor", "--data-dir", str(self.data))
        return next(line for line in done.stdout.splitlines() if " fleet " in line)

    def renew(self, authority: FleetAuthority, now: datetime | None = None) -> Membership:
        """Do what the server does at first contact."""
        now = now or datetime.now(UTC)
        own = Membership.load(self.folder)
        return own.renewed(authority.renew(own.renewal(), own.certificate, now), now)


@pytest.fixture
def office(tmp_path: Path) -> Site:
    site = Site(tmp_path / "office")
    site("init", "mill", "--site", "office", "--listen", "0.0.0.0:7447")
    return site


@pytest.fixture
def hall(tmp_path: Path) -> Site:
    return Site(tmp_path / "hall")


def authority_of(site: Site) -> FleetAuthority:
    return FleetAuthority.load(site.folder / AUTHORITY_FOLDER)


def test_a_fleet_from_its_start_to_a_revocation(office: Site, hall: Site) -> None:
    code = office("invite", "hall", "--address", ADDRESS).strip()
    assert hall("join", code, "--listen", "[::]:7447") == "joined fleet mill as site hall\n"
    joined = hall.status()
    assert joined["is_invitation"] is True
    renewed = hall.renew(authority_of(office))
    shown = hall.status()
    assert shown == {
        "fleet": "mill", "site": "hall", "authority": "office", "is_authority": False,
        "ends": f"{renewed.certificate.ends:%Y-%m-%dT%H:%M:%SZ}", "is_invitation": False,
        "listen": ["[::]:7447"], "connect": [ADDRESS], "revoked": 0, "problems": [],
        "sites": [],
    }  # fmt: skip
    assert office.status()["is_authority"] is True
    header, row = hall("status").splitlines()
    assert header.split()[:3] == ["FLEET", "SITE", "AUTHORITY"]
    assert row.split()[:3] == ["mill", "hall", "office"]
    assert "site hall of fleet mill, until " in hall.doctor()
    said = office("revoke", "hall")
    assert said == "revoked site hall (2 certificates so far; list number 1)\n"
    assert office.status()["revoked"] == 2
    renewed.take_revocations(authority_of(office).signed_revocations())
    assert "the certificate of site hall is revoked; on site office, run" in hall.doctor()
    audited = run("audit", "--data-dir", str(office.data)).stdout
    assert [one for one in ("fleet init", "fleet invite", "fleet revoke") if one in audited] == [
        "fleet init", "fleet invite", "fleet revoke",
    ]  # fmt: skip
    assert code not in audited


def test_a_revoked_site_joins_again_with_a_new_code(office: Site, hall: Site) -> None:
    hall("join", office("invite", "hall", "--address", ADDRESS).strip())
    old = hall.renew(authority_of(office), datetime.now(UTC) - timedelta(seconds=5))
    assert "already is a member" in office.refused("invite", "hall", "--address", ADDRESS)
    office("revoke", "hall")
    hall("join", office("invite", "hall", "--address", ADDRESS).strip())
    new = hall.renew(authority_of(office))
    revoked = authority_of(office).revocations()
    assert revoked.revokes(old.certificate.serial)
    assert not revoked.revokes(new.certificate.serial)


def test_a_code_in_a_file_is_private_and_not_printed(
    office: Site, hall: Site, tmp_path: Path
) -> None:
    file = tmp_path / "code.txt"
    said = office("invite", "hall", "--address", ADDRESS, "--file", str(file))
    assert said == f"wrote the code to {file}\n"
    assert file.stat().st_mode & 0o077 == 0
    again = office.refused("invite", "hall", "--address", ADDRESS, "--file", str(file))
    assert "already exists" in again
    hall("join", str(file))
    assert hall.status()["site"] == "hall"


def test_a_camera_reads_the_code_from_the_terminal(office: Site) -> None:
    output = office("invite", "hall", "--address", ADDRESS, "--qr", columns=160)
    code, *rows = output.splitlines()
    halves: list[list[int]] = []
    for row in rows:
        cells = re.findall(r"\[38;5;(\d+);48;5;(\d+)m", row)
        halves += ([255 * (cell[half] != "16") for cell in cells] for half in (0, 1))
    image = np.kron(np.array(halves, np.uint8), np.ones((4, 4), np.uint8))
    (found,) = zxingcpp.read_barcodes(image)
    assert found.text == code


def test_a_code_that_was_used_is_refused_at_the_second_site(
    office: Site, hall: Site, tmp_path: Path
) -> None:
    code = office("invite", "hall", "--address", ADDRESS).strip()
    thief = Site(tmp_path / "thief")
    for site in (hall, thief):
        site("join", code)
    hall.renew(authority_of(office))
    with pytest.raises(CertificateRefused, match="the invitation of site hall was used before"):
        thief.renew(authority_of(office))
    said = hall("join", code)
    assert said == "this site already is hall of fleet mill; nothing was changed\n"
    assert hall.status()["is_invitation"] is False


def test_commands_at_the_same_time_lose_no_certificate(office: Site) -> None:
    """Each invitation is in the ledger, so each can be revoked."""
    sites = [f"hall-{number}" for number in range(6)]
    with ThreadPoolExecutor(len(sites)) as pool:
        codes = list(pool.map(lambda one: office("invite", one, "--address", ADDRESS), sites))
        said = list(pool.map(lambda one: office("revoke", one), sites))
    assert sorted(line.split()[-1] for line in said) == [f"{number})" for number in range(1, 7)]
    revoked = authority_of(office).revocations()
    assert all(revoked.revokes(SiteInvitation.parse(one).certificate.serial) for one in codes)


def test_an_expired_code_is_refused_and_nothing_is_made(hall: Site, tmp_path: Path) -> None:
    past = datetime.now(UTC) - timedelta(hours=30)
    code = Place(tmp_path, now=past).invite(now=past).code()
    assert "the invitation of site hall ended 6 hours ago" in hall.refused("join", code)
    assert not hall.folder.exists()


@pytest.mark.parametrize(
    ("code", "fault"),
    [
        ("urc-fleet-1.abc", "the code of 15 characters is damaged; copy the complete code again"),
        ("urc-fleet-2.abc", "expected a code that begins with 'urc-fleet-1.'"),
        ("nothing", "nothing: expected a code that begins with 'urc-fleet-1.', or a file with one"),
        ("-", "expected a code that begins with 'urc-fleet-1.', or a file with one, found ''"),
    ],
)
def test_a_wrong_code_is_refused_in_one_line(hall: Site, code: str, fault: str) -> None:
    assert fault in hall.refused("join", code)


def test_a_site_leaves_its_fleet_only_on_request(office: Site, hall: Site, tmp_path: Path) -> None:
    other = Site(tmp_path / "other")
    other("init", "dock", "--site", "pier")
    hall("join", office("invite", "hall", "--address", ADDRESS).strip())
    code = other("invite", "hall", "--address", ADDRESS).strip()
    assert "already is hall of fleet mill; use --replace" in hall.refused("join", code)
    hall("join", code, "--replace")
    assert hall.status()["fleet"] == "dock"
    assert "cannot join another one" in office.refused("join", code, "--replace")


def test_commands_in_the_wrong_folder_say_where_they_belong(
    office: Site, hall: Site, tmp_path: Path
) -> None:
    hall("join", office("invite", "hall", "--address", ADDRESS).strip())
    assert "run the command on the authority's computer" in hall.refused("revoke", "office")
    assert "run the command on the authority's" in hall.refused(
        "invite", "store", "--address", ADDRESS
    )
    missing = Site(tmp_path / "missing")
    assert "is not a folder; select the folder of 'urc serve'" in missing.refused("status")
    empty = Site(tmp_path)
    assert "this site is in no fleet; join one with 'urc fleet join CODE'" in empty.refused(
        "status"
    )
    assert "this server is in no fleet" in empty.doctor()
    assert "already is office of fleet mill" in office.refused("init", "new", "--site", "office")


def test_wrong_use_is_named(office: Site) -> None:
    for words, fault in (
        (("init", "mill"), "'urc fleet init' requires --site"),
        (("invite", "hall"), "'urc fleet invite' requires --address HOST:PORT"),
        (("revoke",), "expected 'urc fleet revoke SITE', found 0 of 1 arguments"),
    ):
        assert fault in office.refused(*words, code=2)
    assert "expected the name of a site" in office.refused("invite", "Hall", "--address", ADDRESS)
    assert "expected an address such as" in office.refused("invite", "hall", "--address", "hall")
    assert "fleet mill has no site hell; known sites: none" in office.refused("revoke", "hell")


def test_the_authority_renews_its_own_certificate_after_a_long_time_off(tmp_path: Path) -> None:
    past = datetime.now(UTC) - timedelta(days=40)
    office = Site(tmp_path / "data")
    office.data.mkdir()
    Place(tmp_path, now=past).office.folder.rename(office.folder)
    assert "ended 33 days ago, or the clock of this computer is ahead; run 'urc fleet renew'" in (
        office.doctor()
    )
    said = office("renew")
    assert said.startswith("the certificate of site office ends: ")
    assert office("renew") == said  # not due yet, so it stays
    assert office.status()["problems"] == []


@pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl")
def test_openssl_accepts_the_files_of_each_site(office: Site, hall: Site) -> None:
    hall("join", office("invite", "hall", "--address", ADDRESS).strip())
    hall.renew(authority_of(office))
    for site, name in ((office, "office"), (hall, "hall")):
        for purpose in ("sslserver", "sslclient"):
            done = subprocess.run(
                ["openssl", "verify", "-x509_strict", "-purpose", purpose, "-verify_hostname",
                 name, "-CAfile", site.folder / "root.pem", site.folder / "site.pem"],
                capture_output=True, text=True, check=False,
            )  # fmt: skip
            assert done.stdout.endswith(": OK\n"), done.stderr
