"""`urc trust` against OpenSSH's server: shown, asked for, kept, and shown again when it changes."""

import asyncio
import os
import pty
import subprocess
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.e2e.processes import ROOT
from tests.e2e.transports.sshd import USER, Sshd, fingerprint_of, new_key

pytestmark = [pytest.mark.anyio, pytest.mark.needs("sshd")]

WAIT_S = 30.0
PROFILE = r"""
urc: 1
kind: robot
name: diver
settings:
  port: { type: port }
  password: { type: string, secret: true }
transports:
  jump: { type: ssh, mode: forward, host: 127.0.0.1, port: "{{ settings.port }}", username: USER,
          password: "{{ settings.password }}" }
  console: { type: tcp, tunnel: jump, host: 127.0.0.1, port: 1,
             framing: { type: delimiter, tx: LF, rx: LF } }
"""


class Desk(NamedTuple):
    """A person with a profile, and a server that it leads to."""

    sshd: Sshd
    profile: Path
    data: Path

    async def trusts(self, *words: str, answer: str = "") -> tuple[int, str]:
        """Run ``urc trust``, at a terminal where there is an answer; return its code and words."""
        command = [sys.executable, "-m", "urc.cli.main", "trust", str(self.profile)]
        ours, theirs = pty.openpty()
        try:
            process = await asyncio.create_subprocess_exec(
                *command, *words, "--set", f"port={self.sshd.port}",
                cwd=ROOT,
                env=os.environ | {"URC_DATA_DIR": str(self.data)},
                stdin=theirs if answer else subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
            )  # fmt: skip
            os.write(ours, f"{answer}\n".encode())
            async with asyncio.timeout(WAIT_S):
                said, _ = await process.communicate()
        finally:
            os.close(ours)
            os.close(theirs)
        return process.returncode or 0, said.decode()

    @property
    def kept(self) -> str:
        """What the file of trusted keys holds."""
        file = self.data / "known_hosts"
        return file.read_text("ascii") if file.exists() else ""


@pytest.fixture
async def controller(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> AsyncIterator[Desk]:
    """Run a server for one test."""
    folder = tmp_path_factory.mktemp("sshd")
    sshd = Sshd(folder)
    await sshd.start()
    profile = tmp_path / "diver.yaml"
    profile.write_text(PROFILE.replace("USER", USER), "utf-8")
    yield Desk(sshd, profile, tmp_path / "data")
    sshd.kill()


async def test_key_is_kept_when_a_person_says_yes(controller: Desk) -> None:
    """Nobody logs in for that, so no password is asked for; the second time nothing is asked."""
    code, said = await controller.trusts(answer="no")
    assert (code, controller.kept) == (1, "")
    assert f"has the host key {controller.sshd.fingerprint} (ssh-ed25519)" in said
    assert "nothing was stored" in said

    code, said = await controller.trusts("jump", answer="yes")
    assert code == 0, said
    public = controller.sshd.host_key.with_suffix(".pub").read_text("ascii").split()
    assert controller.kept == f"[127.0.0.1]:{controller.sshd.port} {public[0]} {public[1]}\n"
    assert (controller.data / "known_hosts").stat().st_mode & 0o777 == 0o600

    code, said = await controller.trusts()
    assert code == 0
    assert "this key is already trusted" in said
    assert "Accepted" not in controller.sshd.said
    assert "Failed password" not in controller.sshd.said


async def test_script_must_name_the_fingerprint(controller: Desk, tmp_path: Path) -> None:
    """Whatever the server shows is not good enough."""
    code, said = await controller.trusts()
    assert code == 2
    assert "cannot ask without a terminal; use --yes SHA256:… to trust a key" in said
    other = fingerprint_of(new_key(tmp_path / "other"))
    code, said = await controller.trusts("--yes", other)
    assert code == 1
    assert f"the key does not match {other}; nothing was stored" in said
    assert controller.kept == ""
    code, said = await controller.trusts("--yes", controller.sshd.fingerprint)
    assert code == 0, said
    assert controller.kept.count("\n") == 1


async def test_changed_key_is_shown_with_the_old_one_and_takes_its_place(controller: Desk) -> None:
    """One server has one key; those of others stay."""
    before = controller.sshd.fingerprint
    assert (await controller.trusts("--yes", before))[0] == 0
    file = controller.data / "known_hosts"
    elsewhere = controller.kept.replace("127.0.0.1", "10.0.0.9")
    file.write_text(controller.kept + elsewhere, "ascii")
    controller.sshd.kill()
    controller.sshd.change_host_key()
    await controller.sshd.start()
    code, said = await controller.trusts(answer="no")
    assert code == 1
    assert f"the key has changed from {before}:" in said
    assert f"has the host key {controller.sshd.fingerprint}" in said
    assert (await controller.trusts(answer="yes"))[0] == 0
    assert elsewhere in controller.kept
    assert controller.kept.count("\n") == 2


async def test_wrong_use_is_told(controller: Desk) -> None:
    """Names that are no ssh transport, and servers that are not there."""
    code, said = await controller.trusts("console")
    assert code == 2
    assert "has no ssh transport 'console'" in said
    controller.sshd.kill()
    code, said = await controller.trusts()
    assert code == 1
    assert "(connection refused)" in said
