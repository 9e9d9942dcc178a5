"""The local authority, judged by OpenSSL and by Python's own TLS."""

import shutil
import ssl
import stat
import subprocess
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509

from urc.access.authority import LEAF_LASTS, OLDEST, RENEW_BEFORE, CertificateAuthority
from urc.access.grants import AccessError

NOW = datetime(2026, 11, 23, 12, tzinfo=UTC)
NAMES = ("localhost", "lab-pi", "lab-pi.local", "192.168.4.1", "127.0.0.1", "fe80::1%wlan0")
openssl = pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl")


def verified(authority: Path, leaf: Path, *more: str, at: datetime = NOW) -> str:
    """Return the verdict of OpenSSL about a certificate."""
    done = subprocess.run(
        ["openssl", "verify", "-x509_strict", "-purpose", "sslserver", "-CAfile", authority,
         "-attime", str(int(at.timestamp())), *more, leaf],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    return (done.stdout + done.stderr).strip()


@openssl
def test_openssl_accepts_the_certificate_for_each_name(tmp_path: Path) -> None:
    authority = CertificateAuthority(tmp_path, NAMES, NOW)
    leaf = authority.issue()
    for more in (
        ("-verify_hostname", "lab-pi.local"), ("-verify_hostname", "lab-pi"),
        ("-verify_ip", "192.168.4.1"), ("-verify_ip", "fe80::1"),
    ):  # fmt: skip
        assert verified(authority.file, leaf.chain, *more).endswith(": OK"), more
    assert "mismatch" in verified(authority.file, leaf.chain, "-verify_hostname", "other.local")
    assert "expired" in verified(authority.file, leaf.chain, at=leaf.ends + timedelta(days=1))


@openssl
def test_the_authority_cannot_imitate_a_public_site(tmp_path: Path) -> None:
    """Its key, once stolen, signs a certificate that OpenSSL refuses."""
    authority = CertificateAuthority(tmp_path, NAMES, NOW)
    authority._names = [x509.DNSName("bank.example")]
    leaf = authority.issue()
    assert "permitted subtree violation" in verified(authority.file, leaf.chain)


def test_python_loads_the_files_for_a_server(tmp_path: Path) -> None:
    leaf = CertificateAuthority(tmp_path, NAMES, NOW).issue()
    ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(leaf.chain, leaf.key)
    for key in tmp_path.glob("*.key"):
        assert stat.S_IMODE(key.stat().st_mode) == 0o600


def test_a_restart_keeps_both_certificates(tmp_path: Path) -> None:
    first = CertificateAuthority(tmp_path, NAMES, NOW)
    leaf = first.issue()
    again = CertificateAuthority(tmp_path, NAMES, NOW + timedelta(days=300))
    assert (first.is_new, leaf.is_new) == (True, True)
    assert (again.is_new, again.issue().is_new) == (False, False)
    assert again.fingerprint == first.fingerprint
    assert len(first.fingerprint.split()) == 16


def test_a_certificate_that_ends_soon_or_lacks_a_name_is_issued_again(tmp_path: Path) -> None:
    """By the same authority: devices need not trust another one."""
    first = CertificateAuthority(tmp_path, NAMES, NOW)
    first.issue()
    late = CertificateAuthority(
        tmp_path, NAMES, NOW + LEAF_LASTS - RENEW_BEFORE + timedelta(hours=1)
    )
    assert (late.is_new, late.issue().is_new) == (False, True)
    moved = CertificateAuthority(tmp_path, (*NAMES, "10.0.0.9"), NOW)
    assert (moved.is_new, moved.issue().is_new) == (False, True)
    assert moved.fingerprint == first.fingerprint


def test_a_name_outside_of_local_networks_needs_another_authority(tmp_path: Path) -> None:
    CertificateAuthority(tmp_path, NAMES, NOW)
    wider = CertificateAuthority(tmp_path, (*NAMES, "robots.lab.example"), NOW)
    assert wider.is_new
    assert not CertificateAuthority(tmp_path, (*NAMES, "robots.lab.example"), NOW).is_new


@openssl
def test_a_machine_without_a_clock_gets_certificates_that_are_valid_today(tmp_path: Path) -> None:
    authority = CertificateAuthority(tmp_path, NAMES, datetime(1970, 1, 1, tzinfo=UTC))
    leaf = authority.issue()
    assert verified(authority.file, leaf.chain, at=OLDEST + timedelta(days=30)).endswith(": OK")


@pytest.mark.parametrize("name", ["", "a b", "-x", "http://x", "a/b"])
def test_a_wrong_name_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(AccessError, match="expected a host name or an address, found"):
        CertificateAuthority(tmp_path, [name], NOW)


def test_damaged_files_are_named(tmp_path: Path) -> None:
    CertificateAuthority(tmp_path, NAMES, NOW)
    (tmp_path / "authority.pem").write_bytes(b"nonsense")
    with pytest.raises(AccessError, match=r"authority\.pem: cannot be read: "):
        CertificateAuthority(tmp_path, NAMES, NOW)


def test_an_optional_name_never_needs_another_authority(tmp_path: Path) -> None:
    """A laptop in another network must not ask all devices to trust it again."""
    home = CertificateAuthority(tmp_path, ["lab-pi.local"], NOW, optional=["lab-pi", "192.168.4.1"])
    away = CertificateAuthority(
        tmp_path, ["lab-pi.local"], NOW, optional=["lab-pi", "10.1.2.3", "141.30.1.2", "other"]
    )
    assert (home.left_out, away.is_new) == ((), False)
    assert away.left_out == ("141.30.1.2", "other")
    leaf = x509.load_pem_x509_certificate(away.issue().chain.read_bytes())
    names = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert [str(one.value) for one in names] == ["lab-pi.local", "lab-pi", "10.1.2.3"]


def test_two_servers_that_start_together_share_one_authority(tmp_path: Path) -> None:
    with ThreadPoolExecutor() as pool:
        made = list(pool.map(lambda _: CertificateAuthority(tmp_path, NAMES, NOW), range(8)))
        leaves = list(pool.map(lambda one: one.issue(), made))
    assert len({one.fingerprint for one in made}) == 1
    assert sum(one.is_new for one in made) == 1
    assert sum(one.is_new for one in leaves) == 1
    ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(leaves[0].chain, leaves[0].key)
