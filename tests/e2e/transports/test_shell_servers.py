"""The emulated SSH and Telnet servers, tried by OpenSSH's client, Debian's telnet, and URC."""

import asyncio
import os
import subprocess
import sys
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.e2e.ports import free_port
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.sshd import fingerprint_of, new_key
from urc.config.load import load_profile
from urc.model.profile import Profile
from urc.model.values import Value
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session
from urc.simulator.emulated_profile import stand_in
from urc.simulator.server import serve
from urc.simulator.servers.base import Endpoint

pytestmark = pytest.mark.anyio

WAIT_S = 15.0
PASSWORD = "let me in"  # noqa: S105 - of nobody

PROFILE = r"""
urc: 1
kind: robot
name: diver
title: Diver

settings:
  ssh_port: { type: port }
  telnet_port: { type: port }
  password: { type: string, secret: true }

transports:
  jump: { type: ssh, mode: forward, host: 127.0.0.1, port: "{{ settings.ssh_port }}",
          username: root, password: "{{ settings.password }}" }
  shell: { type: ssh, host: 127.0.0.1, port: "{{ settings.ssh_port }}", pty: false,
           username: root, password: "{{ settings.password }}",
           framing: { type: delimiter, tx: LF, rx: LF } }
  hidden: { type: tcp, tunnel: jump, host: 10.0.0.21, port: 6571,
            framing: { type: delimiter, tx: LF, rx: LF } }
  console: { type: telnet, host: 127.0.0.1, port: "{{ settings.telnet_port }}",
             framing: { type: delimiter, tx: LF, rx: LF } }
  inside: { type: telnet, tunnel: jump, host: 10.0.0.20,
            framing: { type: delimiter, tx: CR, rx: CRLF } }

signals:
  depth: { type: number, unit: m }
  level: { type: number }
  heading: { type: number }
  roll: { type: number }

polls:
  - { every: 100ms, to: shell, send: "depth?",
      reply: { regex: '^depth (?P<depth>[0-9.]+)$' } }
  - { every: 100ms, to: hidden, send: "level?",
      reply: { regex: '^level (?P<level>[0-9.]+)$' } }
  - { every: 100ms, to: console, send: "heading?",
      reply: { regex: '^heading (?P<heading>[0-9.]+)$' } }
  - { every: 100ms, to: inside, send: "roll?",
      reply: { regex: '^roll (?P<roll>[0-9.]+)$' } }

simulator:
  jump: []
  shell: [{ match: '^depth\?$', send: depth 12.5 }]
  hidden: [{ match: '^level\?$', send: level 3 }]
  console: [{ match: '^heading\?$', send: heading 270 }]
  inside: [{ match: '^roll\?$', send: roll 4.5 }]
"""
ONE_SHELL = r"""
urc: 1
kind: robot
name: diver
title: Diver

settings:
  port: { type: port }
  password: { type: string, secret: true }

transports:
  shell: { type: ssh, host: 127.0.0.1, port: "{{ settings.port }}", username: root,
           password: "{{ settings.password }}", KEY framing: { type: delimiter, tx: LF, rx: LF } }
  hidden: { type: tcp, tunnel: shell, host: 10.0.0.21, port: 6571,
            framing: { type: delimiter, tx: LF, rx: LF } }

signals:
  depth: { type: number, unit: m }
  level: { type: number }

polls:
  - { every: 100ms, to: shell, send: "depth?",
      reply: { regex: '^depth (?P<depth>[0-9.]+)$' } }
  - { every: 100ms, to: hidden, send: "level?",
      reply: { regex: '^level (?P<level>[0-9.]+)$' } }

simulator:
  shell: [{ match: '^depth\?$', send: depth 12.5 }]
  hidden: [{ match: '^level\?$', send: level 3 }]
"""

CAMERA = r"""
urc: 1
kind: robot
name: camera
title: Camera

settings:
  ssh_port: { type: port }
  password: { type: string, secret: true }

transports:
  jump: { type: ssh, mode: forward, host: 127.0.0.1, port: "{{ settings.ssh_port }}",
          username: root, password: "{{ settings.password }}" }
  web: { type: http, tunnel: jump, url: "SCHEME://10.0.0.20/api" }

signals:
  depth: { type: number, unit: m }

polls:
  - { every: 100ms, send: { request: { path: /depth } }, reply: { json: { depth: depth } } }

simulator:
  jump: []
  web: [{ poll: polls.0, set: { depth: 12.5 } }]
"""


@pytest.fixture(autouse=True)
def own_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep the emulated server's key, and what is trusted, to this test."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path / "data"))


def profile_of(text: str, folder: Path) -> Profile:
    file = folder / "diver.yaml"
    file.write_text(text, "utf-8")
    return load_profile(str(file), built_in_catalog())


@asynccontextmanager
async def emulated(folder: Path, key: Path | None = None) -> AsyncIterator[Mapping[str, Endpoint]]:
    """Run the robot with one shell, on any port."""
    said = f'key: "{key}", ' if key else ""
    profile = profile_of(ONE_SHELL.replace("KEY ", said), folder)
    settings: dict[str, Value] = {"port": free_port(), "password": PASSWORD}
    async with serve(profile, settings) as listening:
        yield listening


async def runs(*words: str, typed: str = "", **environment: str) -> str:
    """Return what a program prints on either stream."""
    process = await asyncio.create_subprocess_exec(
        *words,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        env=os.environ | environment,
    )
    try:
        async with asyncio.timeout(WAIT_S):
            said, _ = await process.communicate(typed.encode())
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    return said.decode()


def ssh_words(endpoint: Endpoint, folder: Path, *more: str) -> list[str]:
    """Return OpenSSH's command line, which knows nothing of this machine's user."""
    options = (
        "StrictHostKeyChecking=accept-new", f"UserKnownHostsFile={folder / 'known'}",
        "GlobalKnownHostsFile=/dev/null", "NumberOfPasswordPrompts=1", "IdentitiesOnly=yes",
    )  # fmt: skip
    words = ["ssh", "-F", "/dev/null", "-p", str(endpoint.port)]
    for option in options:
        words += ["-o", option]
    return [*words, *more]


def asked(folder: Path, password: str) -> dict[str, str]:
    """Return the environment in which ssh asks a program for the password."""
    program = folder / "askpass"
    program.write_text(f"#!/bin/sh\necho '{password}'\n", "ascii")
    program.chmod(0o755)
    return {"SSH_ASKPASS": str(program), "SSH_ASKPASS_REQUIRE": "force", "DISPLAY": ":0"}


# ---- clients of others


@pytest.mark.needs("ssh")
async def test_openssh_talks_to_the_emulated_shell(tmp_path: Path) -> None:
    """With a password; its key stays the same from one run to the next."""
    async with nothing_left():
        for _ in range(2):
            async with emulated(tmp_path) as listening:
                endpoint = listening["shell"]
                known = tmp_path / "known"
                if known.exists():  # the port is another one, the key is not
                    key = known.read_text("ascii").split(" ", 1)[1]
                    known.write_text(f"[127.0.0.1]:{endpoint.port} {key}", "ascii")
                words = ssh_words(endpoint, tmp_path, "-T", "root@127.0.0.1")
                said = await runs(*words, typed="depth?\n", **asked(tmp_path, PASSWORD))
                assert "depth 12.5\n" in said
                assert "WARNING" not in said


@pytest.mark.needs("ssh")
async def test_openssh_sees_a_terminal_that_echoes(tmp_path: Path) -> None:
    """Typed with the Enter key of a terminal, CR, where the driver says LF."""
    async with emulated(tmp_path) as listening:
        words = ssh_words(listening["shell"], tmp_path, "-tt", "root@127.0.0.1")
        said = await runs(*words, typed="depth?\r", **asked(tmp_path, PASSWORD))
        assert "depth?\r\ndepth 12.5\n" in said


@pytest.mark.needs("ssh")
async def test_openssh_is_refused_with_a_wrong_password_and_other_commands(tmp_path: Path) -> None:
    """As by a real server."""
    async with emulated(tmp_path) as listening:
        words = ssh_words(listening["shell"], tmp_path, "root@127.0.0.1", "reboot", "now")
        said = await runs(*words, **asked(tmp_path, "open sesame"))
        assert "Permission denied" in said
        said = await runs(*words, **asked(tmp_path, PASSWORD))
        assert "reboot: command not found" in said


@pytest.mark.needs("ssh")
async def test_openssh_logs_in_with_the_key_of_the_options(tmp_path: Path) -> None:
    """And with no other."""
    key, other = new_key(tmp_path / "key"), new_key(tmp_path / "other")
    async with emulated(tmp_path, key) as listening:
        for one, expected in ((key, "depth 12.5"), (other, "Permission denied")):
            words = ssh_words(
                listening["shell"], tmp_path, "-T", "-o", "BatchMode=yes", "-i", str(one),
                "root@127.0.0.1",
            )  # fmt: skip
            assert expected in await runs(*words, typed="depth?\n")


@pytest.mark.needs("ssh")
async def test_openssh_is_forwarded_to_the_robots_other_lines_alone(tmp_path: Path) -> None:
    """Not to this machine's, not to the network's."""
    async with emulated(tmp_path) as listening:
        assert listening["hidden"].text == "tcp 10.0.0.21:6571 through shell"
        for target, expected in (
            ("10.0.0.21:6571", "level 3\n"),
            ("127.0.0.1:22", "no server at this address"),
        ):
            words = ssh_words(listening["shell"], tmp_path, "-W", target, "root@127.0.0.1")
            said = await runs(*words, typed="level?\n", **asked(tmp_path, PASSWORD))
            assert expected in said


@pytest.mark.needs("telnet")
async def test_debian_telnet_talks_to_the_emulated_console(tmp_path: Path) -> None:
    """They negotiate that the server echoes; the client sends CR NUL for Enter."""
    profile = profile_of(PROFILE, tmp_path)
    settings: dict[str, Value] = {
        "ssh_port": free_port(), "telnet_port": free_port(), "password": PASSWORD,
    }  # fmt: skip
    async with serve(profile, settings, is_anywhere=True) as listening:
        endpoint = listening["console"]
        # The client needs a terminal, and leaves when its input ends.
        script = (
            "import os, pty, select, sys, time\n"
            "pid, fd = pty.fork()\n"
            f"if not pid: os.execvp('telnet', ['telnet', '127.0.0.1', '{endpoint.port}'])\n"
            "said, typed = b'', False\n"
            "while b'heading 270' not in said:\n"
            "    assert select.select([fd], [], [], 10)[0], said\n"
            "    said += os.read(fd, 4096)\n"
            "    if not typed and b'Escape character' in said:\n"
            "        typed = True\n"
            "        os.write(fd, b'heading?\\r')\n"
            "os.kill(pid, 9)\n"
            "sys.stdout.buffer.write(said)\n"
        )
        said = await runs(sys.executable, "-c", script)
        assert said.index("heading?") < said.index("heading 270")


# ---- URC's own transports


async def shows(session: Session, expected: Mapping[str, object]) -> None:
    """Wait until the signals have these values."""
    seen: dict[str, object] = {}
    async with asyncio.timeout(WAIT_S):
        while seen != expected:
            await asyncio.sleep(0.05)
            seen = {
                name: sample.value
                for name in expected
                if (sample := session.hub.latest(name)) is not None
            }


async def test_robot_of_five_lines_stands_in_for_itself(tmp_path: Path) -> None:
    """SSH, Telnet, and what goes through SSH, with nobody's real keys or passwords."""
    profile = profile_of(PROFILE, tmp_path)
    settings: dict[str, Value] = {"ssh_port": 22, "telnet_port": 23, "password": "none"}
    async with (
        nothing_left(),
        stand_in(profile, settings) as emulated_robot,
        Session(emulated_robot, settings, built_in_catalog().transports) as session,
    ):
        await shows(session, {"depth": 12.5, "level": 3.0, "heading": 270.0, "roll": 4.5})


@pytest.mark.parametrize("scheme", ["http", "https"])
async def test_camera_behind_the_jump_host_is_emulated_as_well(tmp_path: Path, scheme: str) -> None:
    """A line that has a url is reached through another one as the driver says it.

    It need not be named where the other line is only the way to it.
    """
    profile = profile_of(CAMERA.replace("SCHEME", scheme), tmp_path)
    settings: dict[str, Value] = {"password": PASSWORD, "ssh_port": free_port()}
    async with (
        nothing_left(),
        stand_in(profile, settings) as emulated_robot,
        Session(emulated_robot, settings, built_in_catalog().transports) as session,
    ):
        await shows(session, {"depth": 12.5})


def test_key_of_the_emulated_server_is_kept_for_its_owner_alone(tmp_path: Path) -> None:
    """It is trusted once, and nobody else can pose as the twin."""

    async def once() -> str:
        async with emulated(tmp_path) as listening:
            return listening["shell"].text

    first, second = asyncio.run(once()), asyncio.run(once())
    file = tmp_path / "data" / "simulator_host_key"
    assert file.stat().st_mode & 0o777 == 0o600
    made = subprocess.run(["ssh-keygen", "-y", "-f", str(file)], check=True, capture_output=True)
    (tmp_path / "public.pub").write_bytes(made.stdout)
    shown = fingerprint_of(tmp_path / "public")
    assert first.endswith(f"(host key {shown})")
    assert second.endswith(f"(host key {shown})")
