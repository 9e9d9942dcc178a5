"""A site's membership: it survives kills, refuses foreign files, and names each fault."""

import json
import os
import stat
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest

from tests.unit.fleet.fleets import ADDRESS, NOW, Place
from urc.fleet.certificates import SITE_LASTS, CertificateRefused
from urc.fleet.files import write
from urc.fleet.joining import join
from urc.fleet.membership import Membership, NoMembership
from urc.fleet.names import FleetError


def test_a_membership_is_loaded_as_it_was_stored(tmp_path: Path) -> None:
    place = Place(tmp_path)
    hall = place.member()
    loaded = Membership.load(hall.folder)
    assert (loaded.fleet, loaded.site, loaded.authority) == ("mill", "hall", "office")
    assert loaded.connect == (f"tls/{ADDRESS}",)
    assert loaded.certificate == hall.certificate
    assert place.office.listen == (f"tls/{ADDRESS}",)
    loaded.check(NOW)


def test_only_the_owner_can_read_the_files(tmp_path: Path) -> None:
    hall = Place(tmp_path).member()
    files = [one for one in hall.folder.iterdir() if one.name != "lock"]
    assert {stat.S_IMODE(one.stat().st_mode) for one in files} == {0o600}
    assert "PRIVATE" not in repr(hall)


@pytest.mark.parametrize("kill_at", range(1, 4))
def test_a_kill_during_a_renewal_leaves_a_usable_pair(
    tmp_path: Path, kill_at: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process dies at each step of `renewed` in turn: before, between and after the writes."""
    place = Place(tmp_path)
    hall = place.member()
    chain = place.authority.renew(hall.renewal(), hall.certificate, NOW)
    steps = 0

    class Killed(BaseException):
        pass

    def counted(act: Callable[..., None]) -> Callable[..., None]:
        def run(*arguments: Any, **options: Any) -> None:
            nonlocal steps
            steps += 1
            if steps == kill_at:
                raise Killed
            act(*arguments, **options)

        return run

    with monkeypatch.context() as patched:
        patched.setattr("urc.fleet.membership.write", counted(write))
        patched.setattr(os, "replace", counted(os.replace))
        with pytest.raises(Killed):
            hall.renewed(chain, NOW)
    loaded = Membership.load(hall.folder)
    loaded.server_context()  # OpenSSL compares the pair too
    assert place.renewed(loaded).certificate.serial != hall.certificate.serial


def test_the_key_of_a_renewal_is_kept_until_its_reply(tmp_path: Path) -> None:
    """The authority may have issued the certificate although the reply was lost."""
    place = Place(tmp_path)
    hall = place.joined()
    chain = place.authority.renew(hall.renewal(), hall.certificate, NOW)
    again = Membership.load(hall.folder)
    again.renewal()
    assert again.renewed(chain, NOW).certificate.site == "hall"
    assert not (hall.folder / "next.key").exists()


def test_a_certificate_for_another_site_or_key_is_not_stored(tmp_path: Path) -> None:
    place = Place(tmp_path)
    hall, store = place.member(), place.member("store")
    foreign = place.authority.renew(store.renewal(), store.certificate, NOW)
    hall.renewal()
    with pytest.raises(FleetError, match="expected a certificate for site hall, found store"):
        hall.renewed(foreign, NOW)
    other = place.authority.renew(hall.renewal(), hall.certificate, NOW)
    (hall.folder / "next.key").unlink()
    hall.renewal()
    with pytest.raises(FleetError, match="does not match the key of this renewal"):
        hall.renewed(other, NOW)
    assert Membership.load(hall.folder).certificate == hall.certificate


def test_a_membership_that_has_ended_or_is_revoked_loads_but_fails_its_check(
    tmp_path: Path,
) -> None:
    place = Place(tmp_path)
    hall = place.member()
    loaded = Membership.load(hall.folder)
    with pytest.raises(CertificateRefused, match="ended 2 days ago, or the clock"):
        loaded.check(NOW + SITE_LASTS + timedelta(days=2))
    with pytest.raises(CertificateRefused, match="at least 50 minutes behind; set the clock"):
        loaded.check(NOW - timedelta(hours=1))
    place.authority.revoke("hall", NOW)
    loaded.take_revocations(place.authority.signed_revocations())
    with pytest.raises(CertificateRefused, match="the certificate of site hall is revoked"):
        loaded.check(NOW)


def test_the_certificate_of_a_peer_is_checked_in_full(tmp_path: Path) -> None:
    place, other = Place(tmp_path / "a"), Place(tmp_path / "b", "other")
    hall = place.member()
    assert place.office.peer(hall.certificate.pem, NOW) == hall.certificate
    with pytest.raises(CertificateRefused, match="of site hall is not from fleet mill"):
        place.office.peer(other.member().certificate.pem, NOW)
    with pytest.raises(FleetError, match="expected the certificate of a site"):
        place.office.peer(place.office.root.pem, NOW)
    place.authority.revoke("hall", NOW)
    place.office.take_revocations(place.authority.signed_revocations())
    with pytest.raises(CertificateRefused, match="site hall is revoked"):
        place.office.peer(hall.certificate.pem, NOW)


def test_the_certificate_of_an_invitation_is_good_for_its_renewal_only(tmp_path: Path) -> None:
    """A copied code must not read a robot, even before the invited site has used it."""
    place = Place(tmp_path)
    invited = place.joined()
    with pytest.raises(CertificateRefused, match="site hall must first renew the certificate of"):
        place.office.peer(invited.certificate.pem, NOW)
    found = place.office.peer(invited.certificate.pem, NOW, is_renewal=True)
    assert place.authority.renew(invited.renewal(), found, NOW)


def test_a_site_does_not_leave_its_fleet_by_mistake(tmp_path: Path) -> None:
    place, other = Place(tmp_path / "a"), Place(tmp_path / "b", "other")
    hall = place.member()
    invitation = other.invite()
    with pytest.raises(FleetError, match="already is hall of fleet mill; use --replace to leave"):
        join(hall.folder, invitation, NOW)
    assert Membership.load(hall.folder).fleet == "mill"
    join(hall.folder, invitation, NOW, replace=True)
    assert Membership.load(hall.folder).fleet == "other"
    with pytest.raises(FleetError, match="has the authority of a fleet, which cannot join anoth"):
        join(other.office.folder, place.invite("store"), NOW, replace=True)


def test_the_code_of_an_earlier_invitation_changes_nothing(tmp_path: Path) -> None:
    place = Place(tmp_path)
    invitation = place.invite()
    join(tmp_path / "hall", invitation, NOW)
    renewed = place.renewed(Membership.load(tmp_path / "hall"), NOW + timedelta(hours=1))
    again = join(tmp_path / "hall", invitation, NOW + timedelta(hours=2))
    assert again.certificate == renewed.certificate


def test_a_site_that_is_invited_again_keeps_what_it_knows_of_revocations(tmp_path: Path) -> None:
    place = Place(tmp_path)
    hall = place.member()
    place.authority.revoke("hall", NOW)
    hall.take_revocations(place.authority.signed_revocations())
    again = place.joined(now=NOW + timedelta(hours=1))
    assert again.revocations().number == 1
    again.check(NOW + timedelta(hours=1))


def test_a_folder_without_a_membership_says_how_to_join(tmp_path: Path) -> None:
    with pytest.raises(NoMembership, match="in no fleet; join one with 'urc fleet join CODE'"):
        Membership.load(tmp_path)


@pytest.mark.parametrize(
    ("file", "text", "fault"),
    [
        ("fleet.json", "{", "fleet.json: .*truncated.*; correct the file"),
        ("fleet.json", '{"fleet": 1}', "fleet.json: Expected `str`"),
        ("root.pem", "hello", "expected a certificate in PEM or DER"),
        ("site.pem", "hello", "expected a certificate in PEM or DER"),
        ("site.pem", None, "site.pem is missing; join the fleet again"),
        ("site.key", "hello", "expected a private key in PEM"),
    ],
)
def test_a_damaged_membership_is_named(
    tmp_path: Path, file: str, text: str | None, fault: str
) -> None:
    hall = Place(tmp_path).member()
    place = hall.folder / file
    if text is None:
        place.unlink()
    else:
        place.write_text(text)
    with pytest.raises(FleetError, match=fault) as error:
        Membership.load(hall.folder)
    assert str(error.value).startswith(str(hall.folder))
    assert "\n" not in str(error.value)


def test_files_of_two_fleets_or_sites_are_not_mixed(tmp_path: Path) -> None:
    place = Place(tmp_path)
    hall, store = place.member(), place.member("store")
    (hall.folder / "site.key").write_bytes(store.key_file.read_bytes())
    with pytest.raises(FleetError, match=r"site\.key does not match site\.pem"):
        Membership.load(hall.folder)
    (hall.folder / "site.pem").write_bytes(store.certificate_file.read_bytes())
    with pytest.raises(FleetError, match="names fleet mill and site hall, but the certificates"):
        Membership.load(hall.folder)


def test_an_address_without_a_port_is_named(tmp_path: Path) -> None:
    hall = Place(tmp_path).member()
    facts = json.loads((hall.folder / "fleet.json").read_text())
    (hall.folder / "fleet.json").write_text(json.dumps(facts | {"connect": ["tls/mill"]}))
    with pytest.raises(FleetError, match=r"expected an address such as .*, with a port"):
        Membership.load(hall.folder)


def test_a_damaged_revocation_list_is_named_and_replaced_by_the_next_one(tmp_path: Path) -> None:
    place = Place(tmp_path)
    hall = place.member()
    hall.take_revocations(place.authority.signed_revocations())
    for text in ("{}", ""):
        (hall.folder / "revoked.json").write_text(text)
        with pytest.raises(FleetError, match=r"revoked\.json: the revocation list is damaged; del"):
            hall.revocations()
    assert hall.take_revocations(place.authority.signed_revocations())


def test_a_revocation_passes_from_site_to_site(tmp_path: Path) -> None:
    """The authority need not be reachable."""
    place = Place(tmp_path)
    hall, store = place.member(), place.member("store")
    assert store.signed_revocations() == b""
    place.authority.revoke("hall", NOW)
    place.office.take_revocations(place.authority.signed_revocations())
    assert store.take_revocations(place.office.signed_revocations())
    with pytest.raises(CertificateRefused, match="site hall is revoked"):
        store.peer(hall.certificate.pem, NOW)
