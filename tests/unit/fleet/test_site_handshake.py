"""Real TLS 1.3 between two memberships, in memory; and OpenSSL's own judgement of the files."""

import shutil
import ssl
import subprocess
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from tests.unit.fleet.fleets import Place
from urc.fleet.certificates import SITE_LASTS, FleetRoot
from urc.fleet.joining import renew_own
from urc.fleet.names import FleetError

NOW = datetime.now(UTC).replace(microsecond=0)
"""OpenSSL compares certificates with the real clock."""


class Handshake:
    """Both ends of one connection, without sockets."""

    def __init__(self, server: ssl.SSLContext, client: ssl.SSLContext, address: str = "") -> None:
        up, down = ssl.MemoryBIO(), ssl.MemoryBIO()
        self.server = server.wrap_bio(up, down, server_side=True)
        self.client = client.wrap_bio(down, up, server_hostname=address or None)

    def run(self) -> None:
        """Exchange messages until both ends have read a byte of the other; raise `SSLError`."""
        ends = [self.client, self.server]
        steps: dict[ssl.SSLObject, list[Callable[[], object]]] = {
            end: [end.do_handshake, lambda end=end: end.write(b"x"), lambda end=end: end.read(1)]  # type: ignore[misc]
            for end in ends
        }
        for _ in range(20):
            for end in ends:
                while steps[end]:
                    try:
                        steps[end][0]()
                    except ssl.SSLWantReadError:
                        break
                    steps[end].pop(0)
        assert not any(steps.values())


def test_two_sites_of_a_fleet_prove_their_names(tmp_path: Path) -> None:
    place = Place(tmp_path, now=NOW)
    hall = place.member(now=NOW)
    line = Handshake(place.office.server_context(), hall.client_context("office"))
    line.run()
    assert line.client.version() == "TLSv1.3"
    shown = line.server.getpeercert(binary_form=True)
    assert shown is not None
    assert place.office.peer(shown, NOW).site == "hall"


def test_a_line_to_an_address_still_checks_the_name_of_the_site(tmp_path: Path) -> None:
    """asyncio passes the address of the server as its name."""
    place = Place(tmp_path, now=NOW)
    hall, store = place.member(now=NOW), place.member("store", now=NOW)
    Handshake(place.office.server_context(), hall.client_context("office"), "10.0.0.1").run()
    with pytest.raises(ssl.SSLCertVerificationError, match="Hostname mismatch"):
        Handshake(store.server_context(), hall.client_context("office"), "store").run()


def test_a_site_of_another_fleet_is_refused_at_both_ends(tmp_path: Path) -> None:
    """Although the fleets and sites have the same names."""
    place, other = Place(tmp_path / "a", now=NOW), Place(tmp_path / "b", now=NOW)
    hall, stranger = place.member(now=NOW), other.member(now=NOW)
    with pytest.raises(ssl.SSLCertVerificationError, match="verify failed"):
        Handshake(other.office.server_context(), hall.client_context("office")).run()
    blind = stranger.client_context("office")
    blind.check_hostname = False
    blind.verify_mode = ssl.CERT_NONE
    with pytest.raises(ssl.SSLCertVerificationError, match="verify failed"):
        Handshake(place.office.server_context(), blind).run()


def test_a_client_without_a_certificate_and_an_older_tls_are_refused(tmp_path: Path) -> None:
    place = Place(tmp_path, now=NOW)
    nobody = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    nobody.load_verify_locations(cadata=place.office.root.pem.decode())
    with pytest.raises(ssl.SSLError, match="PEER_DID_NOT_RETURN_A_CERTIFICATE"):
        Handshake(place.office.server_context(), nobody, "office").run()
    nobody.maximum_version = ssl.TLSVersion.TLSv1_2
    with pytest.raises(ssl.SSLError):
        Handshake(place.office.server_context(), nobody, "office").run()


@pytest.mark.parametrize(
    ("age", "fault"),
    [
        (SITE_LASTS + timedelta(hours=1), "certificate has expired"),
        (-timedelta(hours=1), "certificate is not yet valid"),
    ],
)
def test_a_certificate_out_of_its_time_is_refused(
    tmp_path: Path, age: timedelta, fault: str
) -> None:
    place = Place(tmp_path, now=NOW - timedelta(days=30))
    hall = place.member(now=NOW - age)
    office = renew_own(place.authority, place.office, NOW)
    with pytest.raises(ssl.SSLCertVerificationError, match=fault):
        Handshake(hall.server_context(), office.client_context("hall")).run()


def test_a_context_says_which_files_do_not_match(tmp_path: Path) -> None:
    place = Place(tmp_path, now=NOW)
    hall, store = place.member(now=NOW), place.member("store", now=NOW)
    hall.key_file.write_bytes(store.key_file.read_bytes())
    with pytest.raises(FleetError, match=r"site\.pem and site\.key cannot be used"):
        hall.server_context()


@pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl")
def test_openssl_accepts_the_certificates_for_both_ends(tmp_path: Path) -> None:
    """A program that others wrote, with its strict checks, as client, server and for the name."""
    hall = Place(tmp_path, now=NOW).member(now=NOW)

    def verdict(*more: str, root: FleetRoot = hall.root) -> str:
        (tmp_path / "root.pem").write_bytes(root.pem)
        done = subprocess.run(
            ["openssl", "verify", "-x509_strict", "-CAfile", tmp_path / "root.pem", *more,
             hall.certificate_file],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        return done.stdout + done.stderr

    for purpose in ("sslserver", "sslclient"):
        assert ": OK" in verdict("-purpose", purpose, "-verify_hostname", "hall")
    assert "mismatch" in verdict("-verify_hostname", "office")
    later = NOW + SITE_LASTS + timedelta(days=1)
    assert "expired" in verdict("-attime", str(int(later.timestamp())))
    other = Place(tmp_path / "other", now=NOW).office.root
    assert "error" in verdict(root=other)
