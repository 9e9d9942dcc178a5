"""Dashboard → SSH → Telnet → robot: OpenSSH's server and inetutils', and the first one dies."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until_attribute, until_text
from tests.e2e.processes import UrcProcess
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.sshd import PASSWORD, USER, Sshd
from tests.e2e.transports.telnetd import Telnetd
from urc.config.load import load_profile
from urc.model.profile import Profile
from urc.model.values import Value
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import CommandFailed, Session

pytestmark = [
    pytest.mark.anyio,
    pytest.mark.needs("sshd"),
    pytest.mark.needs("telnetd"),
    pytest.mark.needs("socat"),
]

WAIT_S = 40.0

PROFILE = r"""
urc: 1
kind: robot
name: deep
title: Deep

settings:
  ssh_port: { type: port }
  telnet_port: { type: port }
  user: { type: string }
  password: { type: string, secret: true }
  host_key: { type: string }

transports:
  jump:
    type: ssh
    mode: forward
    host: 127.0.0.1
    port: "{{ settings.ssh_port }}"
    username: "{{ settings.user }}"
    password: "{{ settings.password }}"
    host_key: "{{ settings.host_key }}"
    reconnect: { initial: 100ms, max: 500ms }
  console:
    type: telnet
    tunnel: jump
    host: 127.0.0.1
    port: "{{ settings.telnet_port }}"
    framing: { type: delimiter, tx: CR, rx: CRLF }
    reconnect: { initial: 100ms, max: 500ms }
    on_connect:
      - { expect: '^robot ready$', timeout: 20s }
      - { send: hello }
      - { expect: '^(> )*heard hello$', timeout: 20s }

signals:
  battery: { type: integer, unit: "%", min: 0, max: 100 }

polls:
  - every: 200ms
    to: console
    send: battery
    reply: { regex: '^(> )*battery (?P<battery>\d+)$', timeout: 20s }

commands:
  say:
    to: console
    args: { word: { type: string } }
    send: "say-{{ word }}"
    reply: { regex: '^(> )*heard say-(?P<_word>\S+)$', timeout: 20s }
  wave: { to: console, send: wave, reply: { regex: '^(> )*heard wave$', timeout: 20s } }

widgets:
  battery: { use: battery, bind: { level: battery } }
  wave: { use: button, bind: { press: wave } }

interfaces:
  default: { grid: battery wave }
"""


class Chain(NamedTuple):
    """Everything between a dashboard and a robot."""

    file: Path
    profile: Profile
    settings: dict[str, Value]
    sshd: Sshd
    telnetd: Telnetd


@pytest.fixture
async def chain(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> AsyncIterator[Chain]:
    """Run both servers for one test."""
    monkeypatch.setenv("URC_DATA_DIR", str(tmp_path / "data"))
    folder = tmp_path_factory.mktemp("sshd")
    for one in (folder, *folder.parents[:2]):
        one.chmod(0o755)
    sshd, telnetd = Sshd(folder), Telnetd(tmp_path / "telnetd")
    file = tmp_path / "deep.yaml"
    file.write_text(PROFILE, "utf-8")
    await sshd.start()
    await telnetd.start()
    settings: dict[str, Value] = {
        "ssh_port": sshd.port, "telnet_port": telnetd.port, "user": USER, "password": PASSWORD,
        "host_key": sshd.fingerprint,
    }  # fmt: skip
    yield Chain(file, load_profile(str(file), built_in_catalog()), settings, sshd, telnetd)
    sshd.kill()
    telnetd.kill()


async def until(holds: Callable[[], bool], within_s: float = WAIT_S) -> None:
    """Wait until something is so."""
    async with asyncio.timeout(within_s):
        while not holds():  # noqa: ASYNC110 - states of several kinds
            await asyncio.sleep(0.02)


async def test_robot_behind_two_servers_survives_the_death_of_the_first(chain: Chain) -> None:
    """It comes back by itself, start-up sequence first, and hears nothing twice."""
    async with nothing_left():
        async with Session(chain.profile, chain.settings, built_in_catalog().transports) as session:
            links = session.hub.links
            await until(lambda: links["console"].state == "live")
            done, failed = await talks(session, chain, kill_at=20, until_done=60)
            assert chain.sshd.said.count("Accepted password") == 2
        heard = chain.telnetd.heard
    starts = [at for at, line in enumerate(heard) if line == "hello"]
    assert len(starts) == 2
    said = Counter(line for line in heard if line.startswith("say-"))
    assert max(said.values()) == 1, "something was sent twice"
    assert [said[f"say-{number}"] for number in done] == [1] * len(done)
    assert failed, "the server was killed while a command was under way"
    # All that the robot hears on the second connection was asked for after the first one broke.
    second = [line for line in heard[starts[1] :] if line.startswith("say-")]
    assert all(int(line.removeprefix("say-")) > max(failed) for line in second)


async def test_dashboard_shows_what_happens_between_the_servers(
    chain: Chain, new_page: PageMaker, urc_process: Callable[..., UrcProcess]
) -> None:
    """In a real browser: live, lost, live again by itself; each tap reaches the robot once."""
    words = [f"--set={name}={value}" for name, value in chain.settings.items()]
    process = urc_process("serve", str(chain.file), "--port", "0", *words)
    address = (await process.wait_for_async(r"(http://\S+)"))[1]
    page = await new_page()
    await page.goto(f"{address}robots/deep/")
    await until_text(page, "[data-badge-text]", "Live")
    await until_text(page, ".battery-digits", "42")
    await page.click(".button-main")
    await until(lambda: chain.telnetd.heard.count("wave") == 1)

    chain.sshd.kill()
    await until_attribute(page, "[data-badge]", "data-state", "bad")
    await until_attribute(page, ".battery", "data-state", "stale")
    await until_attribute(page, ".button-main", "aria-disabled", "true")

    await chain.sshd.start()
    await until_text(page, "[data-badge-text]", "Live")
    await until_attribute(page, ".battery", "data-state", "live")
    await until_attribute(page, ".button-main", "aria-disabled", "false")
    await page.click(".button-main")
    await until(lambda: chain.telnetd.heard.count("wave") == 2)
    assert chain.telnetd.heard.count("hello") == 2
    assert chain.sshd.said.count("Accepted password") == 2


async def talks(
    session: Session, chain: Chain, *, kill_at: int, until_done: int
) -> tuple[list[int], list[int]]:
    """Send numbered commands, one after the other; kill the server amid one and start it again.

    Return those that were done, and those that failed because the connection broke.
    """
    done: list[int] = []
    failed: list[int] = []
    number = 0
    async with asyncio.timeout(2 * WAIT_S):
        while len(done) < until_done:
            number += 1
            command = asyncio.ensure_future(session.command("say", {"word": str(number)}))
            if number == kill_at:
                await asyncio.sleep(0)  # it is under way
                chain.sshd.kill()
            try:
                await command
            except CommandFailed:
                failed.append(number)
                if len(failed) == 1:
                    await until(lambda: session.hub.links["console"].state == "lost")
                    await chain.sshd.start()
                    await until(lambda: session.hub.links["console"].state == "live")
            else:
                done.append(number)
    return done, failed
