"""A fleet's authority: it invites, renews and revokes, and says in one line why it refuses."""

from datetime import timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa

from tests.unit.fleet.fleets import ADDRESS, NOW, Place, serials
from urc._x509 import common_name
from urc.fleet.authority import FleetAuthority
from urc.fleet.certificates import (
    INVITATION_LASTS,
    ROOT_LASTS,
    SITE_LASTS,
    CertificateRefused,
    SiteCertificate,
    new_key,
)
from urc.fleet.files import AUTHORITY_FOLDER
from urc.fleet.joining import make_fleet, renew_own
from urc.fleet.names import FleetError
from urc.fleet.revocations import RevocationList

HOUR = timedelta(hours=1)


def request(name: str, key: ec.EllipticCurvePrivateKey | rsa.RSAPrivateKey | None = None) -> bytes:
    builder = x509.CertificateSigningRequestBuilder().subject_name(common_name(name))
    made = builder.sign(key or new_key(), hashes.SHA256())
    return made.public_bytes(serialization.Encoding.PEM)


def test_a_site_is_invited_and_gets_certificates_for_a_week(tmp_path: Path) -> None:
    place = Place(tmp_path)
    hall = place.joined()
    assert (hall.site, hall.certificate.is_invitation) == ("hall", True)
    assert hall.certificate.ends == NOW + INVITATION_LASTS
    assert hall.is_renewal_due(NOW)
    renewed = place.renewed(hall, NOW + HOUR)
    assert (renewed.site, renewed.certificate.is_invitation) == ("hall", False)
    assert renewed.certificate.ends == NOW + HOUR + SITE_LASTS
    assert not renewed.is_renewal_due(NOW + HOUR)


def test_a_renewal_is_due_after_half_of_the_time(tmp_path: Path) -> None:
    hall = Place(tmp_path).member()
    assert not hall.is_renewal_due(NOW + SITE_LASTS / 2 - HOUR)
    assert hall.is_renewal_due(NOW + SITE_LASTS / 2)


def test_an_invitation_is_accepted_for_one_key_only(tmp_path: Path) -> None:
    """A lost reply can be requested again; a copy of the code fails, and the line says why."""
    place = Place(tmp_path)
    hall = place.joined()
    asked = hall.renewal()
    place.authority.renew(asked, hall.certificate, NOW)  # this reply is lost
    assert not place.renewed(hall).certificate.is_invitation
    with pytest.raises(CertificateRefused, match=r"was used before.*urc fleet revoke hall"):
        place.authority.renew(request("hall"), hall.certificate, NOW)


def test_a_newer_invitation_replaces_an_unused_one(tmp_path: Path) -> None:
    place = Place(tmp_path)
    first, second = place.invite(), place.invite()
    with pytest.raises(CertificateRefused, match="a newer invitation of site hall has replaced"):
        place.authority.renew(request("hall"), first.certificate, NOW)
    assert place.authority.renew(request("hall"), second.certificate, NOW)


def test_a_member_cannot_be_invited_again_before_it_is_revoked(tmp_path: Path) -> None:
    """Two sites of one name would get each other's commands."""
    place = Place(tmp_path)
    place.member()
    with pytest.raises(FleetError, match="site hall already is a member of fleet mill; choose"):
        place.invite()
    with pytest.raises(FleetError, match="site office already is a member"):
        place.invite("office")
    place.authority.revoke("hall", NOW)
    assert place.invite().certificate.site == "hall"


def test_the_certificate_of_a_member_that_was_off_for_a_week_has_ended(tmp_path: Path) -> None:
    place = Place(tmp_path)
    hall = place.member()
    late = NOW + SITE_LASTS + timedelta(days=3)
    with pytest.raises(CertificateRefused, match="certificate of site hall ended 3 days ago"):
        place.authority.renew(hall.renewal(), hall.certificate, late)
    assert place.invite("hall", late).certificate.ends == late + INVITATION_LASTS


def test_a_clock_that_is_behind_is_named_with_its_error(tmp_path: Path) -> None:
    place = Place(tmp_path)
    hall = place.member()
    with pytest.raises(CertificateRefused, match="clock of this computer is at least 23 hours beh"):
        place.authority.renew(hall.renewal(), hall.certificate, NOW - timedelta(days=1))


@pytest.mark.parametrize(
    ("asked", "fault"),
    [
        (b"hello", "expected a certificate signing request in PEM"),
        (request("office"), "site hall requested a certificate for another name: .'office'."),
        (request("hall", ec.generate_private_key(ec.SECP384R1())), "expected a P-256 key"),
        (request("hall", rsa.generate_private_key(65537, 2048)), "expected a P-256 key"),
    ],
)
def test_a_wrong_request_is_refused_in_one_line(tmp_path: Path, asked: bytes, fault: str) -> None:
    place = Place(tmp_path)
    with pytest.raises(FleetError, match=fault) as error:
        place.authority.renew(asked, place.member().certificate, NOW)
    assert "\n" not in str(error.value)


def test_a_renewal_needs_a_new_key(tmp_path: Path) -> None:
    place = Place(tmp_path)
    hall = place.member()
    with pytest.raises(CertificateRefused, match="must renew its certificate with a new key"):
        place.authority.renew(request("hall", hall.key), hall.certificate, NOW)


def test_a_certificate_of_another_fleet_is_refused(tmp_path: Path) -> None:
    """Even of a fleet with the same name."""
    place, other = Place(tmp_path / "a"), Place(tmp_path / "b")
    stranger = other.member()
    with pytest.raises(CertificateRefused, match="of site hall is not from fleet mill"):
        place.authority.renew(stranger.renewal(), stranger.certificate, NOW)


def test_all_certificates_of_a_revoked_site_are_revoked(tmp_path: Path) -> None:
    place = Place(tmp_path)
    first = place.joined()
    second = place.renewed(first)
    third = place.renewed(second)
    store = place.member("store")
    listed = place.authority.revoke("hall", NOW)
    assert listed.number == 1
    assert listed.serials == {
        "hall": serials(first.certificate, second.certificate, third.certificate)
    }
    assert not listed.revokes(store.certificate.serial)
    with pytest.raises(CertificateRefused, match="the certificate of site hall is revoked"):
        place.authority.renew(third.renewal(), third.certificate, NOW)


def test_a_revoked_site_can_be_invited_again(tmp_path: Path) -> None:
    """Only its old certificates stay revoked."""
    place = Place(tmp_path)
    old = place.member()
    place.authority.revoke("hall", NOW)
    new = place.member(now=NOW + HOUR)
    revoked = place.authority.revocations()
    assert (revoked.number, revoked.count) == (1, 2)
    assert revoked.revokes(old.certificate.serial)
    assert not revoked.revokes(new.certificate.serial)
    assert place.authority.revoke("hall", NOW + HOUR).number == 2


def test_a_second_revocation_changes_nothing(tmp_path: Path) -> None:
    place = Place(tmp_path)
    place.member()
    assert place.authority.revoke("hall", NOW) == place.authority.revoke("hall", NOW)


def test_the_authority_and_unknown_sites_cannot_be_revoked(tmp_path: Path) -> None:
    place = Place(tmp_path)
    place.member()
    with pytest.raises(FleetError, match="fleet mill has no site hell; known sites: hall"):
        place.authority.revoke("hell", NOW)
    with pytest.raises(FleetError, match="office is the authority itself"):
        place.authority.revoke("office", NOW)


def test_a_restored_ledger_still_revokes_what_it_renews(tmp_path: Path) -> None:
    """A certificate that a restored backup does not know enters the ledger with its renewal."""
    place = Place(tmp_path)
    ledger = tmp_path / "office" / AUTHORITY_FOLDER / "issued.json"
    backup = ledger.read_bytes()
    hall = place.member()
    ledger.write_bytes(backup)
    new = place.renewed(hall)
    revoked = place.authority.revoke("hall", NOW).serials["hall"]
    assert revoked == serials(hall.certificate, new.certificate)


def test_a_restored_authority_gets_lost_revocations_back_from_a_site(tmp_path: Path) -> None:
    """Its own list may have the same number by then; the merged list has the next one."""
    place = Place(tmp_path)
    hall, store = place.member(), place.member("store")
    folder = tmp_path / "office" / AUTHORITY_FOLDER
    backup = (folder / "revoked.json").read_bytes()
    place.authority.revoke("hall", NOW)
    known = place.authority.signed_revocations()
    (folder / "revoked.json").write_bytes(backup)
    place.authority.revoke("store", NOW)
    assert place.authority.merge_revocations(known)
    merged = place.authority.revocations()
    assert merged.number == 2
    assert merged.revokes(hall.certificate.serial)
    assert merged.revokes(store.certificate.serial)
    assert not place.authority.merge_revocations(known)


def test_the_ledger_forgets_certificates_that_ended_long_ago(tmp_path: Path) -> None:
    place = Place(tmp_path)
    place.member()
    place.invite("store", NOW + timedelta(days=60))
    with pytest.raises(FleetError, match="no site hall; known sites: store"):
        place.authority.revoke("hall", NOW + timedelta(days=60))


def test_the_own_site_of_the_authority_renews_even_after_its_end(tmp_path: Path) -> None:
    place = Place(tmp_path)
    assert renew_own(place.authority, place.office, NOW + HOUR) is place.office
    late = NOW + 3 * SITE_LASTS
    assert renew_own(place.authority, place.office, late).certificate.ends == late + SITE_LASTS


def test_no_certificate_is_issued_outside_the_time_of_the_root(tmp_path: Path) -> None:
    """A certificate of a wrong clock would be refused elsewhere, with a confusing reason."""
    place = Place(tmp_path)
    last = NOW + ROOT_LASTS - HOUR
    assert place.invite("late", last).certificate.ends == NOW + ROOT_LASTS
    for wrong in (NOW - HOUR, NOW + ROOT_LASTS):
        with pytest.raises(FleetError, match=r"lasts from 2026-12-01 to 2036-11-28; set the clock"):
            place.invite("hall", wrong)
    with pytest.raises(CertificateRefused, match="the root certificate of fleet mill ended 2 hou"):
        place.office.check(NOW + ROOT_LASTS + 2 * HOUR)


def test_an_authority_is_never_replaced(tmp_path: Path) -> None:
    Place(tmp_path)
    with pytest.raises(FleetError, match="this site already is office of fleet mill"):
        make_fleet(tmp_path / "office", "mine", "office", NOW)
    (tmp_path / "office" / "fleet.json").unlink()
    with pytest.raises(FleetError, match="already has the authority of fleet mill with site offi"):
        make_fleet(tmp_path / "office", "mine", "office", NOW)


def test_an_interrupted_start_of_a_fleet_is_completed(tmp_path: Path) -> None:
    place = Place(tmp_path)
    (tmp_path / "office" / "fleet.json").unlink()
    again = make_fleet(tmp_path / "office", "mill", "office", NOW, listen=[ADDRESS])
    assert again.root == place.office.root


@pytest.mark.parametrize(
    ("file", "text", "fault"),
    [
        ("root.key", "hello", "expected a private key in PEM"),
        ("root.pem", "hello", "expected a certificate in PEM or DER"),
        ("issued.json", "{", "damaged: .*restore it from a backup"),
    ],
)
def test_a_damaged_authority_is_named(tmp_path: Path, file: str, text: str, fault: str) -> None:
    Place(tmp_path)
    folder = tmp_path / "office" / AUTHORITY_FOLDER
    (folder / file).write_text(text)
    with pytest.raises(FleetError, match=fault) as error:
        FleetAuthority.load(folder)
    assert str(error.value).startswith(str(folder))
    assert "\n" not in str(error.value)


def test_a_folder_without_an_authority_says_where_the_command_runs(tmp_path: Path) -> None:
    with pytest.raises(FleetError, match="this folder has no authority; run the command on"):
        FleetAuthority.load(tmp_path)


def test_an_older_revocation_list_is_signed_like_a_newer_one_but_never_replaces_it(
    tmp_path: Path,
) -> None:
    place = Place(tmp_path)
    place.member()
    old = place.authority.signed_revocations()
    place.authority.revoke("hall", NOW)
    new = place.authority.signed_revocations()
    store = place.member("store")
    assert store.take_revocations(new)
    assert not store.take_revocations(old)
    assert not store.take_revocations(new)
    assert store.revocations() == RevocationList.verified(new, place.authority.root)


def test_a_certificate_of_a_site_is_read_from_pem_and_der(tmp_path: Path) -> None:
    found = Place(tmp_path).member().certificate
    der = found.certificate.public_bytes(serialization.Encoding.DER)
    assert SiteCertificate.parse(der) == SiteCertificate.parse(found.pem) == found
