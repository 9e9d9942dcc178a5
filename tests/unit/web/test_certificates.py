"""The certificate of a server: its names, its files, and its renewal while the server runs."""

import ipaddress
import ssl
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import serialization

from urc.access import authority as authorities
from urc.access.authority import CertificateAuthority
from urc.problems import UrcError
from urc.web.serve import certificates as module
from urc.web.serve.certificates import (
    Certificates,
    GivenCertificate,
    LocalCertificate,
    names_of,
)

pytestmark = pytest.mark.anyio


def on_machine(monkeypatch: pytest.MonkeyPatch, *addresses: str) -> None:
    """Let this machine have these addresses."""
    found = tuple(ipaddress.ip_address(one) for one in addresses)
    monkeypatch.setattr(module, "local_addresses", lambda: found)
    monkeypatch.setattr(module, "own_names", lambda: frozenset({"lab-pi.local"}))


def names_in(chain: Path) -> list[str]:
    """Return the names in a certificate."""
    leaf = x509.load_pem_x509_certificate(chain.read_bytes())
    names = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    return [str(one.value) for one in names]


def test_the_names_are_those_that_the_server_accepts(monkeypatch: pytest.MonkeyPatch) -> None:
    on_machine(monkeypatch, "192.168.4.1", "141.30.1.2", "fd00::1", "2a02:8109::7")
    required, optional = names_of("0.0.0.0", ["robots.lab"])
    assert required == ("localhost", "127.0.0.1", "::1", "robots.lab")
    assert optional == ("lab-pi.local", "192.168.4.1", "141.30.1.2", "fd00::1")
    assert names_of("141.30.1.2", [])[0] == ("localhost", "127.0.0.1", "::1", "141.30.1.2")
    assert "robot-pi" in names_of("robot-pi", [])[0]


def test_a_public_address_of_ipv6_is_named_if_it_is_the_only_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    on_machine(monkeypatch, "2a02:8109::7")
    assert names_of("::", [])[1] == ("lab-pi.local", "2a02:8109::7")


async def test_a_new_address_gets_a_new_certificate_of_the_same_authority(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Without a change, nothing is issued; open connections keep the old context."""
    on_machine(monkeypatch, "192.168.4.1")
    held = await Certificates.of(LocalCertificate(tmp_path, "0.0.0.0"))
    first, names = held.current, names_in(tmp_path / "server.pem")
    assert not await held.renew()
    assert held.current is first
    on_machine(monkeypatch, "192.168.4.1", "10.0.0.9")
    assert await held.renew()
    assert names_in(tmp_path / "server.pem") == [*names, "10.0.0.9"]
    assert held.context() is not first.context
    assert held.current.fingerprint == first.fingerprint
    assert not await held.renew()


async def test_a_certificate_that_ends_soon_is_renewed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    on_machine(monkeypatch, "192.168.4.1")
    held = await Certificates.of(LocalCertificate(tmp_path, "0.0.0.0"))
    leaf = (tmp_path / "server.pem").read_bytes()

    class Later(datetime):
        """A clock 370 days ahead."""

        @classmethod
        def now(cls, tz: object = None) -> datetime:  # type: ignore[override]
            """Return the time."""
            return datetime.now(UTC) + timedelta(days=370)

    monkeypatch.setattr(module, "datetime", Later)
    assert await held.renew()
    assert (tmp_path / "server.pem").read_bytes() != leaf


async def test_a_fault_keeps_the_old_certificate(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    on_machine(monkeypatch, "192.168.4.1")
    held = await Certificates.of(LocalCertificate(tmp_path, "0.0.0.0"))
    first = held.current
    (tmp_path / "authority.pem").write_text("nonsense")
    on_machine(monkeypatch, "192.168.4.2")
    assert not await held.renew()
    assert held.current is first
    assert "the old certificate stays in use" in caplog.text


def test_a_replaced_authority_is_announced(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The first one is not: its fingerprint is printed anyway."""
    on_machine(monkeypatch, "192.168.4.1")
    assert LocalCertificate(tmp_path, "0.0.0.0").load().notes == ()
    assert LocalCertificate(tmp_path, "0.0.0.0").load().notes == ()
    (note,) = LocalCertificate(tmp_path, "0.0.0.0", ["robots.example"]).load().notes
    assert "all devices must trust it" in note
    on_machine(monkeypatch, "141.30.1.2")
    (note,) = LocalCertificate(tmp_path, "0.0.0.0", ["robots.example"]).load().notes
    assert "cannot certify 141.30.1.2" in note


def given(folder: Path, name: str) -> tuple[Path, Path]:
    """Make the files of an operator."""
    issued = CertificateAuthority(folder / name, [f"{name}.lab"], datetime.now(UTC)).issue()
    return issued.chain, issued.key


async def test_files_of_the_operator_are_read_again_after_a_change(tmp_path: Path) -> None:
    chain, key = given(tmp_path, "one")
    held = await Certificates.of(GivenCertificate(chain, key))
    first = held.current
    assert (first.name, first.authority) == ("one.lab", b"")
    assert not await held.renew()
    other_chain, other_key = given(tmp_path, "two")
    key.write_bytes(other_key.read_bytes())
    assert not await held.renew()  # the new key, still with the old certificate
    assert held.current is first
    chain.write_bytes(other_chain.read_bytes())
    assert await held.renew()
    assert held.current.name == "two.lab"


def test_faults_in_the_files_name_the_file(tmp_path: Path) -> None:
    chain, key = given(tmp_path, "one")
    _, other = given(tmp_path, "two")
    loaded = serialization.load_pem_private_key(key.read_bytes(), None)
    locked = tmp_path / "locked.key"
    locked.write_bytes(
        loaded.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.BestAvailableEncryption(b"canary"),
        )
    )
    empty = tmp_path / "empty.pem"
    empty.touch()
    for files, text in (
        ((chain, other), "one/server.pem with .*two/server.key: KEY_VALUES_MISMATCH"),
        ((empty, key), "empty.pem: expected a certificate in PEM"),
        ((tmp_path / "none.pem", key), "none.pem: No such file or directory"),
        ((chain, tmp_path / "none.key"), "none.key: No such file or directory"),
    ):
        with pytest.raises(UrcError, match=f"--tls-cert: cannot use .*{text}"):
            GivenCertificate(*files).load()
    with pytest.raises(UrcError, match=r"--tls-key: .*locked\.key has a passphrase"):
        GivenCertificate(chain, locked).load()


def test_old_versions_of_tls_are_refused(tmp_path: Path) -> None:
    context = GivenCertificate(*given(tmp_path, "one")).load().context
    assert context.minimum_version == ssl.TLSVersion.TLSv1_2
    assert context.options & ssl.OP_NO_RENEGOTIATION


def test_an_ended_certificate_is_announced(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(authorities, "OLDEST", datetime(2020, 1, 1, tzinfo=UTC))
    past = datetime(2021, 1, 1, tzinfo=UTC)
    issued = CertificateAuthority(tmp_path, ["one.lab"], past).issue()
    (note,) = GivenCertificate(issued.chain, issued.key).load().notes
    assert "the certificate expired on 2022-02-02" in note
