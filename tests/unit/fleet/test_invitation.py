"""The code of an invitation: complete, or refused in one line."""

import base64
import zlib
from datetime import timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.fleet.fleets import ADDRESS, NOW, Place
from urc.fleet.certificates import CertificateRefused
from urc.fleet.invitation import SiteInvitation
from urc.fleet.joining import join
from urc.fleet.names import FleetError


def test_a_code_contains_the_invitation(tmp_path: Path) -> None:
    invitation = Place(tmp_path).invite()
    code = invitation.code()
    found = SiteInvitation.parse(code)
    assert code.startswith("urc-fleet-1.")
    assert (found.root, found.certificate) == (invitation.root, invitation.certificate)
    assert (found.authority, found.connect) == ("office", (f"tls/{ADDRESS}",))
    assert found.key.private_numbers() == invitation.key.private_numbers()
    assert len(code) < 2000  # a QR code takes 2953 bytes


def test_a_code_may_be_broken_into_lines(tmp_path: Path) -> None:
    code = Place(tmp_path).invite().code()
    lines = "\n".join(code[at : at + 70] for at in range(0, len(code), 70))
    assert SiteInvitation.parse(f"  {lines}\n").authority == "office"


def test_an_invitation_ends_after_a_day(tmp_path: Path) -> None:
    invitation = Place(tmp_path).invite()
    with pytest.raises(CertificateRefused, match="the invitation of site hall ended 2 hours ago"):
        join(tmp_path / "hall", invitation, NOW + timedelta(hours=26))
    assert not (tmp_path / "hall").exists()


def test_each_incomplete_code_is_refused(tmp_path: Path) -> None:
    code = Place(tmp_path).invite().code()
    for end in range(len(code)):
        with pytest.raises(FleetError) as error:
            SiteInvitation.parse(code[:end])
        assert "\n" not in str(error.value)


def test_a_code_that_unpacks_to_gigabytes_costs_nothing() -> None:
    bomb = base64.urlsafe_b64encode(zlib.compress(bytes(4_000_000), 9)).decode()
    with pytest.raises(FleetError, match="incomplete; copy the complete code again"):
        SiteInvitation.parse(f"urc-fleet-1.{bomb}")


@given(st.text(), st.binary())
def test_any_text_is_a_code_or_refused_in_one_line(text: str, data: bytes) -> None:
    packed = base64.urlsafe_b64encode(zlib.compress(data)).decode()
    for code in (text, f"urc-fleet-1.{text}", f"urc-fleet-1.{packed}"):
        with pytest.raises(FleetError) as error:
            SiteInvitation.parse(code)
        assert "\n" not in str(error.value)
