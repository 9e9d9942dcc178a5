"""Which host keys are trusted, by the file of our own and by others."""

from pathlib import Path

import asyncssh
import pytest

from urc.transports.base import TransportError
from urc.transports.known_hosts import HostKeys, fingerprint, own_file, remember

ONE, OTHER = (asyncssh.generate_private_key("ssh-ed25519").convert_to_public() for _ in range(2))


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path / "data"))


def verdict(keys: HostKeys, key: asyncssh.SSHKey, host: str = "diver", port: int = 22) -> str:
    return keys.judge(key, keys.known(host, port))


def test_nothing_is_trusted_before_it_was_confirmed() -> None:
    """And looking does not make a file."""
    assert verdict(HostKeys(), ONE) == "unknown"
    assert not own_file().exists()


def test_confirmed_key_is_that_of_one_host_and_port() -> None:
    """The same host has other servers on other ports."""
    remember("diver", 22, ONE)
    assert verdict(HostKeys(), ONE) == ""
    assert verdict(HostKeys(), OTHER) == fingerprint(ONE)
    assert verdict(HostKeys(), OTHER, port=2222) == "unknown"
    assert verdict(HostKeys(), ONE, host="diver2") == "unknown"
    remember("diver", 2222, OTHER)
    assert verdict(HostKeys(), OTHER, port=2222) == ""
    assert verdict(HostKeys(), ONE) == ""


def test_new_key_takes_the_place_of_the_old_one_and_of_nothing_else() -> None:
    """Notes of people stay in the file."""
    remember("diver", 22, ONE)
    own_file().write_text("# the lab's robots\n" + own_file().read_text("ascii"), "ascii")
    remember("diver", 22, OTHER)
    assert verdict(HostKeys(), ONE) == fingerprint(OTHER)
    assert own_file().read_text("ascii").splitlines()[0] == "# the lab's robots"
    assert own_file().stat().st_mode & 0o777 == 0o600
    assert [one.name for one in own_file().parent.iterdir()] == ["known_hosts"]


def test_pinned_fingerprint_counts_alone() -> None:
    """The files are not even read."""
    remember("diver", 22, ONE)
    own_file().write_bytes(b"\xff")
    pinned = HostKeys(fingerprint(OTHER) + "=")
    assert verdict(pinned, OTHER) == ""
    assert verdict(pinned, ONE) == fingerprint(OTHER)


def test_revoked_key_is_refused_whoever_trusts_it(tmp_path: Path) -> None:
    """OpenSSH's mark for keys that were stolen."""
    public = ONE.export_public_key("openssh").decode()
    file = tmp_path / "known"
    file.write_text(f"diver {public}@revoked * {public}", "ascii")
    remember("diver", 22, ONE)
    assert verdict(HostKeys("", str(file)), ONE) == "revoked"


def test_broken_files_are_told(tmp_path: Path) -> None:
    """Which one, and why."""
    with pytest.raises(TransportError) as told:
        HostKeys("", str(tmp_path / "none")).known("diver", 22)
    assert str(told.value) == f"the known-hosts file {tmp_path / 'none'} does not exist"
    own_file().parent.mkdir()
    own_file().write_bytes(b"\xff\xfe")
    with pytest.raises(TransportError, match="cannot read the known-hosts file"):
        HostKeys().known("diver", 22)
