"""Getting into OpenSSH's own server: who we are, and whether it is the right one."""

import os
import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.ssh_lines import OPEN_S, hears, line_to, public_folder, refusal
from tests.e2e.transports.sshd import PASSWORD, Sshd, fingerprint_of, new_key
from urc.transports.known_hosts import own_file, remember

pytestmark = [pytest.mark.anyio, pytest.mark.needs("sshd")]

RIGHT, WRONG = "correct horse", "battery staple"

# ---- logging in


async def test_wrong_password_is_told_without_repeating_it(sshd: Sshd) -> None:
    """Nor is anything left of the attempt."""
    async with nothing_left():
        said = await refusal(line_to(sshd, password=WRONG))
    assert said == f"127.0.0.1:{sshd.port} rejects the login of 'robot' (tried: password)"


async def test_key_logs_in_as_a_file_and_as_text(sshd: Sshd, tmp_path: Path) -> None:
    """A secret setting holds the text."""
    key = new_key(tmp_path / "key")
    sshd.authorize(key)
    for shown in (str(key), key.read_text("ascii")):
        line = line_to(sshd, password=None, key=shown, mode="exec", command="whoami")
        await line.open(OPEN_S)
        assert await hears(line, b"\n") == b"robot\n"
        await line.close()


async def test_key_that_the_server_does_not_know_is_refused(sshd: Sshd, tmp_path: Path) -> None:
    """Only what was shown is told."""
    key = new_key(tmp_path / "key")
    said = await refusal(line_to(sshd, password=None, key=str(key)))
    assert said == f"127.0.0.1:{sshd.port} rejects the login of 'robot' (tried: key)"


async def test_locked_key_needs_its_passphrase(sshd: Sshd, tmp_path: Path) -> None:
    """Without it, with a wrong one, and with the right one."""
    key = new_key(tmp_path / "key", passphrase=RIGHT)
    sshd.authorize(key)
    options = {"password": None, "key": str(key), "mode": "exec", "command": "cat"}
    assert (
        await refusal(line_to(sshd, **options))
        == f"cannot use the key {key}: it needs a passphrase"
    )
    wrong = await refusal(line_to(sshd, **options, passphrase=WRONG))
    assert wrong == f"cannot use the key {key}: the passphrase is wrong"
    line = line_to(sshd, **options, passphrase=RIGHT)
    await line.open(OPEN_S)
    await line.send(b"ping\n")
    assert await hears(line, b"\n") == b"ping\n"
    await line.close()


async def test_what_is_no_key_is_told(sshd: Sshd, tmp_path: Path) -> None:
    """Before anybody is asked."""
    (tmp_path / "poem.txt").write_text("roses are red\n", "ascii")
    said = await refusal(line_to(sshd, key=str(tmp_path / "poem.txt")))
    assert said == f"the key {tmp_path / 'poem.txt'} is not an SSH private key"
    said = await refusal(line_to(sshd, key=str(tmp_path / "gone")))
    assert said == f"cannot read the key {tmp_path / 'gone'} (no such file or directory)"


def hash_names(file: Path) -> None:
    """Let ssh-keygen replace every name in a known-hosts file by its hash."""
    subprocess.run(["ssh-keygen", "-q", "-H", "-f", str(file)], check=True, capture_output=True)


@contextmanager
def agent(folder: Path) -> Iterator[Callable[[Path], None]]:
    """Run an SSH agent; give what adds a key to it."""
    address = str(folder / "agent")
    process = subprocess.Popen(
        ["ssh-agent", "-D", "-a", address], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    assert process.stdout is not None
    process.stdout.readline()  # it says where it listens once it does

    def add(key: Path) -> None:
        os.environ["SSH_AUTH_SOCK"] = address
        subprocess.run(["ssh-add", "-q", str(key)], check=True, stderr=subprocess.DEVNULL)

    try:
        yield add
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


async def test_agent_logs_in(sshd: Sshd, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It signs; the key itself is nowhere near."""
    key = new_key(tmp_path / "key")
    sshd.authorize(key)
    line = line_to(sshd, password=None, agent=True, mode="exec", command="whoami")
    assert await refusal(line) == "there is no SSH agent: SSH_AUTH_SOCK is not set"
    monkeypatch.setenv("SSH_AUTH_SOCK", str(tmp_path / "agent"))
    with agent(tmp_path) as add:
        assert await refusal(line) == "the SSH agent holds no keys; 'ssh-add' adds a key"
        add(key)
        key.unlink()
        async with nothing_left():
            await line.open(OPEN_S)
            assert await hears(line, b"\n") == b"robot\n"
            await line.close()


# ---- host keys


async def test_unknown_host_key_is_refused_and_told(sshd: Sshd) -> None:
    """With the fingerprint that OpenSSH shows, and the command that trusts it; nothing is kept."""
    line = line_to(sshd, host_key=None)
    said = await refusal(line)
    assert said == (
        f"the host key of 127.0.0.1:{sshd.port} is unknown: found {sshd.fingerprint} "
        "(ssh-ed25519); if the key belongs to the robot, 'urc trust PROFILE gauge' trusts the key"
    )
    assert not own_file().exists()
    assert PASSWORD not in sshd.said
    assert "Accepted" not in sshd.said, "the login was tried before the key was known"


async def test_trusted_host_key_opens_the_line_until_it_changes(sshd: Sshd) -> None:
    """Then both fingerprints are told, and the password is given to nobody."""
    line = line_to(sshd, host_key=None)
    offer = await line.look_at_key(OPEN_S)
    assert (offer.fingerprint, offer.expected) == (sshd.fingerprint, "unknown")
    file = remember("127.0.0.1", sshd.port, offer.key)
    assert file.stat().st_mode & 0o777 == 0o600
    await line.open(OPEN_S)
    await line.close()

    before = sshd.fingerprint
    sshd.kill()
    sshd.change_host_key()
    await sshd.start()
    logins = sshd.said.count("Accepted")
    said = await refusal(line)
    assert said == (
        f"the host key of 127.0.0.1:{sshd.port} has changed: expected {before}, found "
        f"{sshd.fingerprint} (ssh-ed25519); the connection may be intercepted. If the robot was "
        "reinstalled, 'urc trust PROFILE gauge' trusts the new key"
    )
    assert sshd.said.count("Accepted") == logins
    assert file.read_text("ascii").count("\n") == 1


async def test_pinned_host_key_is_the_only_one(sshd: Sshd, tmp_path: Path) -> None:
    """Even when the files know better."""
    offer = await line_to(sshd, host_key=None).look_at_key(OPEN_S)
    remember("127.0.0.1", sshd.port, offer.key)
    other = fingerprint_of(new_key(tmp_path / "other"))
    said = await refusal(line_to(sshd, host_key=other))
    assert f"expected {other}, found {sshd.fingerprint}" in said
    assert said.endswith("put the new key into host_key")


async def test_known_hosts_of_openssh_are_understood(sshd: Sshd, tmp_path: Path) -> None:
    """Hashed ones as well, and a server with several keys shows the one that is known."""
    file = tmp_path / "known"
    public = sshd.host_key.with_suffix(".pub").read_text("ascii").split()
    file.write_text(f"[127.0.0.1]:{sshd.port} {public[0]} {public[1]}\n", "ascii")
    hash_names(file)
    assert "127.0.0.1" not in file.read_text("ascii")
    line = line_to(sshd, host_key=None, known_hosts=str(file))
    await line.open(OPEN_S)
    await line.close()
    said = await refusal(line_to(sshd, host_key=None, known_hosts=str(tmp_path / "none")))
    assert said == f"the known-hosts file {tmp_path / 'none'} does not exist"


@pytest.mark.filterwarnings("ignore:Diffie-Hellman over finite fields")
async def test_server_of_2010_needs_legacy(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Its algorithms are taken only where the document says so."""
    folder = public_folder(tmp_path_factory)
    sshd = Sshd(
        folder,
        host_key=new_key(folder / "rsa", "rsa"),
        extra=(
            "KexAlgorithms diffie-hellman-group14-sha1\nHostKeyAlgorithms ssh-rsa\n"
            "Ciphers aes128-cbc\nMACs hmac-sha1"
        ),
    )
    await sshd.start()
    try:
        said = await refusal(line_to(sshd))
        assert "offers no algorithm that URC accepts; 'legacy: true' permits old algorithms" in said
        line = line_to(sshd, legacy=True, mode="exec", command="echo old")
        await line.open(OPEN_S)
        assert await hears(line, b"\n") == b"old\n"
        await line.close()
    finally:
        sshd.kill()
