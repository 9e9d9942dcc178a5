"""What `urc doctor` says about a membership: each problem in one line, with a hint."""

import os
from datetime import datetime, timedelta
from importlib import util
from pathlib import Path
from typing import Any

import pytest

from tests.unit.fleet.fleets import NOW, Place
from urc.fleet import faults as module
from urc.fleet.certificates import INVITATION_LASTS, SITE_LASTS
from urc.fleet.faults import membership_faults
from urc.fleet.files import AUTHORITY_FOLDER
from urc.fleet.joining import renew_own
from urc.fleet.membership import Membership

AGAIN = "on site office, run 'urc fleet invite hall', and join again"


def said(site: Membership, now: datetime = NOW) -> str:
    """Return the only line about a membership."""
    (line,) = membership_faults(site.folder, now)
    assert "\n" not in line
    return line


def test_nothing_is_said_of_a_good_membership_or_none(tmp_path: Path) -> None:
    place = Place(tmp_path)
    for folder in (place.office.folder, place.member().folder, tmp_path / "nothing"):
        assert list(membership_faults(folder, NOW)) == []


def test_a_certificate_that_has_ended(tmp_path: Path) -> None:
    place = Place(tmp_path)
    hall, store = place.member(), place.joined("store")
    line = said(hall, NOW + SITE_LASTS + timedelta(days=4))
    assert line.startswith("the certificate of site hall ended 4 days ago, or the clock of this")
    assert line.endswith(AGAIN)
    line = said(store, NOW + INVITATION_LASTS + timedelta(hours=3))
    assert line.startswith("the invitation of site store ended 3 hours ago")


def test_a_clock_that_is_behind(tmp_path: Path) -> None:
    """A new invitation would not help, so the line does not suggest one."""
    line = said(Place(tmp_path).member(), NOW - timedelta(days=365))
    assert line.endswith("the clock of this computer is at least 364 days behind; set the clock")


def test_the_certificate_of_the_authority_has_ended(tmp_path: Path) -> None:
    place = Place(tmp_path)
    late = NOW + SITE_LASTS + timedelta(days=1)
    assert said(place.office, late).endswith("run 'urc fleet renew'")
    renew_own(place.authority, place.office, late)
    assert list(membership_faults(place.office.folder, late)) == []


def test_a_revoked_site(tmp_path: Path) -> None:
    place = Place(tmp_path)
    hall = place.member()
    place.authority.revoke("hall", NOW)
    hall.take_revocations(place.authority.signed_revocations())
    assert said(hall) == f"the certificate of site hall is revoked; {AGAIN}"


def test_a_certificate_of_another_fleet(tmp_path: Path) -> None:
    hall, other = Place(tmp_path / "a").member(), Place(tmp_path / "b").member()
    hall.root_file.write_bytes(other.root_file.read_bytes())
    assert said(hall) == f"the certificate of site hall is not from fleet mill; {AGAIN}"


def test_a_key_that_does_not_match(tmp_path: Path) -> None:
    place = Place(tmp_path)
    hall, store = place.member(), place.member("store")
    hall.key_file.write_bytes(store.key_file.read_bytes())
    assert said(hall).endswith(
        "site.key does not match site.pem; restore a backup, or join the fleet again"
    )


def test_an_unreadable_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even the existence of a file can be read there."""
    hall = Place(tmp_path).member()
    stat = os.stat

    def refused(file: str | Path, *arguments: Any, **options: Any) -> os.stat_result:
        if Path(file).is_relative_to(hall.folder):
            raise PermissionError(13, "Permission denied", str(file))
        return stat(file, *arguments, **options)

    monkeypatch.setattr(Path, "open", refused)
    monkeypatch.setattr(os, "stat", refused)
    assert said(hall) == (
        f"{hall.folder / 'fleet.json'}: cannot be read: Permission denied; run URC as the owner of"
        " the folder"
    )


def test_a_damaged_authority(tmp_path: Path) -> None:
    office = Place(tmp_path).office
    (office.folder / AUTHORITY_FOLDER / "revoked.json").unlink()
    assert said(office).endswith("revoked.json: missing; restore it from a backup")


def test_a_missing_package_is_named_with_its_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def found(name: str) -> object:
        return None if name == "zenoh" else util.find_spec(name)

    monkeypatch.setattr(module, "find_spec", found)
    line = said(Place(tmp_path).member())
    assert line.startswith("the fleet needs the package eclipse-zenoh: ")
    assert " install " in line
    assert list(membership_faults(tmp_path / "nothing", NOW)) == []
