"""Packages that only connect to this machine, and would be its engineer there.

Three drivers, kept as files: one has another robot's password sent to an address of its own, one
drives another robot with no hand anywhere, one resets a STOP. Three fences stop each of them, and
each fence is tried with the others open.
"""

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import NamedTuple

import httpx2
import pytest
from websockets.asyncio.client import connect

from tests.e2e.dashboards import WAIT_S, until, until_closed
from tests.e2e.keys import headers_for
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess
from urc.config.load import WidgetFolder, check
from urc.problems import ProblemsError
from urc.runtime.open_profile import open_document
from urc.runtime.registries import built_in_catalog

pytestmark = pytest.mark.anyio

ATTACKS = Path(__file__).resolve().parents[1] / "attacks" / "drivers"
NAMES = ("steal-secret", "drive-another", "reset-stop")
PASSWORD = "open-sesame"  # noqa: S105 - of a robot that is not there
SAID = "this is the address of the dashboard itself, not of a robot"
VICTIM = """\
urc: 1
kind: robot
name: victim
settings:
  host: { type: host, default: 127.0.0.1 }
  port: { type: port, default: PORT }
  password: { type: string, secret: true }
transports:
  wire:
    type: tcp
    host: "{{ settings.host }}"
    port: "{{ settings.port }}"
    framing: { type: delimiter, tx: LF, rx: LF }
    on_connect: [{ send: "login {{ settings.password }}" }]
signals:
  speed: { type: number }
messages:
  at: { regex: '^at (?P<speed>\\S+)$' }
commands:
  drive:
    args: { speed: { type: number, min: -1, max: 1 } }
    send: "V {{ speed }}"
    hold: { repeat: 50ms, release: { speed: 0 }, watchdog: 500ms }
"""


class Scene(NamedTuple):
    """A dashboard with a victim and an attacker, and all that was heard."""

    address: str
    data: Path
    robot: list[str]
    """Lines that the victim heard."""
    thief: list[str]
    """Lines that the attacker's own address heard."""

    @property
    def latch(self) -> Path:
        """Where a STOP at the victim is kept."""
        return self.data / "latches" / "victim.latch.json"

    def is_latched(self) -> bool:
        """Return whether the STOP that was pressed stands."""
        return self.latch.exists() and bool(json.loads(self.latch.read_text())["latched_by"])


@asynccontextmanager
async def listening(heard: list[str]) -> AsyncIterator[int]:
    """Keep the lines that come to a port of this machine; give it."""

    async def take(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while line := await reader.readline():
            heard.append(line.decode(errors="replace").strip())
        writer.close()

    server = await asyncio.start_server(take, "127.0.0.1", 0)
    async with server:
        yield int(server.sockets[0].getsockname()[1])


@asynccontextmanager
async def scene(
    urc_process: Callable[..., UrcProcess], folder: Path, attack: str, host: str = "127.0.0.1"
) -> AsyncIterator[Scene]:
    """Serve the victim, with STOP pressed, and an attacker without its reserved headers."""
    robot: list[str] = []
    thief: list[str] = []
    async with listening(robot) as robots_port, listening(thief) as thiefs_port:
        port = free_port()
        victim = folder / "victim.yaml"
        victim.write_text(VICTIM.replace("PORT", str(robots_port)), "utf-8")
        attacker = folder / f"{attack}.yaml"
        text = without_headers(attack).replace("8080", str(port))
        attacker.write_text(text.replace("6666", str(thiefs_port)), "utf-8")
        data = folder / "data"
        words = ["--port", str(port), "--data-dir", str(data), "--host", host]
        process = urc_process(
            "serve", str(victim), str(attacker), *words, URC_SET_PASSWORD=PASSWORD
        )
        await process.wait_for_async("^dashboard ")
        one = Scene(f"http://127.0.0.1:{port}/", data, robot, thief)
        headers = {"origin": one.address.rstrip("/")}
        async with httpx2.AsyncClient(headers=headers, timeout=WAIT_S) as client:
            stopped = await client.post(f"{one.address}api/v1/robots/victim/stop")
            assert stopped.status_code == 200
        await until(one.is_latched)
        yield one
        assert one.is_latched()
        assert one.thief == []
        assert {line for line in one.robot if line.startswith("V")} <= {"V 0", "V 0.0"}
        assert await asyncio.to_thread(process.interrupt) == 0


def without_headers(attack: str) -> str:
    """Return an attacker's document without the headers for which it is refused at once."""
    lines = (ATTACKS / attack / "driver.yaml").read_text("utf-8").splitlines(keepends=True)
    return "".join(line for line in lines if "headers:" not in line)


@pytest.mark.parametrize("attack", NAMES)
async def test_its_headers_are_refused_before_anything_is_connected(attack: str) -> None:
    """By `urc validate`, at install and at the start alike."""
    file = ATTACKS / attack / "driver.yaml"
    found = check(str(file), built_in_catalog(), WidgetFolder(ATTACKS))
    assert [problem.code for problem in found.problems] == ["reserved-header"]
    with pytest.raises(ProblemsError):
        open_document(str(file))


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
@pytest.mark.parametrize("attack", NAMES)
async def test_its_line_does_not_lead_to_the_dashboard(
    attack: str, host: str, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """Without the headers it is a document like others; its page is opened, and it connects."""
    async with scene(urc_process, tmp_path, attack, host) as one:
        place = one.address.removeprefix("http://")
        async with connect(
            f"ws://{place}ws?robot={attack}",
            origin=one.address.rstrip("/"),  # type: ignore[arg-type]
            additional_headers=headers_for(one.address),
        ) as line:
            async with asyncio.timeout(WAIT_S):
                while SAID not in str(await line.recv()):
                    pass
            await asyncio.sleep(0.5)  # it would have done its work by now


@pytest.mark.parametrize(("host", "refused"), [("127.0.0.1", 401), ("0.0.0.0", 401)])
async def test_without_the_key_it_is_a_stranger(
    host: str, refused: int, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """What the three would say, said to the dashboard from this machine, with its own origin."""
    async with scene(urc_process, tmp_path, "steal-secret", host) as one:
        origin = one.address.rstrip("/")
        settings = {"settings": {"host": "127.0.0.1", "port": "1", "password": None}}
        headers = {"origin": origin, "x-forwarded-for": "127.0.0.1"}
        async with httpx2.AsyncClient(headers=headers, timeout=WAIT_S) as client:
            path = f"{one.address}api/v1/robots/victim/settings"
            answer = await client.post(path, json={**settings, "test": True, "anyway": True})
            assert answer.status_code == refused
        url = one.address.replace("http", "ws") + "ws?robot=victim"
        async with connect(url, origin=origin) as line:  # type: ignore[arg-type]
            if refused == 401:
                assert await until_closed(line) == 4401
                return
            await line.send('{"t":"drive","verb":"force"}')
            async with asyncio.timeout(WAIT_S):
                while "Taking over needs the role maintain" not in str(said := await line.recv()):
                    assert '"forces":true' not in str(said)
