"""A robot on a line of text, the page with its widgets, and what it gets of them."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

from playwright.async_api import Locator, Page

from tests.e2e.dashboards import until, until_attribute
from tests.e2e.processes import UrcProcess

__all__ = ["Crane", "crane", "ready"]

PROFILE = """\
urc: 1
kind: robot
name: crane
title: Crane
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: PORT
    framing: { type: delimiter, tx: LF, rx: LF }
    timeouts: { reply: 20s }
signals:
  lamp: { type: boolean }
  mode: { type: string }
  volts: { type: number }
  gear: { type: integer, states: { "0": low, "1": high, "2": top } }
  pump: { type: string, states: { P0: still, P1: running } }
messages:
  geared: { regex: '^gear (?P<gear>\\d) (?P<pump>P\\d)$' }
  told: { regex: '^(?P<lamp>on|off),(?P<mode>\\w+),(?P<volts>[\\d.]+)$' }
commands:
  set_lamp:
    send: "LAMP {{ 1 if lit else 0 }}"
    args: { lit: { type: boolean } }
    reply: { equals: OK }
  set_mode:
    send: "MODE {{ mode }}"
    args: { mode: { type: string, choices: [idle, auto] } }
    reply: { equals: OK }
  set_volts:
    send: "VOLT {{ volts }}"
    args: { volts: { type: number, min: 0, max: 10, unit: V } }
    reply: { equals: OK }
  set_gear:
    send: "GEAR {{ gear }}"
    args: { gear: { type: integer, choices: [0, 1, 2] } }
    reply: { equals: OK }
  set_pump:
    send: "PUMP {{ pump }}"
    args: { pump: { type: string, choices: [P0, P1] } }
    reply: { equals: OK }
  say: { send: "SAY {{ words }}", args: { words: { type: string } }, reply: { equals: OK } }
  raw: { send: "{{ line }}", args: { line: { type: string } }, reply: { equals: OK } }
  beep: { send: BEEP, reply: { equals: OK } }
  unlock: { send: UNLOCK, reply: { equals: OK } }
  arm: { send: ARM, reply: { equals: OK } }
  dock: { send: DOCK, reply: { equals: OK }, confirm: { text: Dock now? } }
  erase:
    send: ERASE
    reply: { equals: OK }
    confirm: { level: hazardous, text: The map is lost }
  beam:
    send: BEAM
    reply: { equals: OK }
    confirm: { level: hazardous, text: The beam goes on, two_person: true }
sequences:
  take_off: [{ run: unlock }, { run: arm }, { run: beep }]
WIDGETS
"""


class Crane:
    """A robot that keeps the lines that it is sent, and says OK to each."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._writers: list[asyncio.StreamWriter] = []
        self.holds = False
        """Whether it keeps its answers until `release`."""

    def release(self) -> None:
        """Give the answer that it has kept."""
        self.holds = False
        for writer in self._writers:
            writer.write(b"OK\n")

    async def talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one connection."""
        self._writers.append(writer)
        try:
            while line := await reader.readline():
                self.lines.append(line.decode())
                if not self.holds:
                    writer.write(b"OK\n")
                    await writer.drain()
        except ConnectionError:
            pass
        finally:
            writer.close()

    async def tell(self, lamp: str, mode: str, volts: str) -> None:
        """Say how it is; the page may know of the connection before this end of it does."""
        await until(lambda: bool(self._writers))
        for writer in self._writers:
            writer.write(f"{lamp},{mode},{volts}\n".encode())

    async def tell_gear(self, gear: int, pump: str) -> None:
        """Say it as the robot does, not in the words for people."""
        await until(lambda: bool(self._writers))
        for writer in self._writers:
            writer.write(f"gear {gear} {pump}\n".encode())

    async def until_got(self, *lines: str) -> None:
        """Wait for exactly these lines, and forget them."""
        wanted = [f"{line}\n" for line in lines]
        await until(lambda: len(self.lines) >= len(wanted))
        assert self.lines == wanted
        self.lines.clear()


@asynccontextmanager
async def crane(
    urc_process: Callable[..., UrcProcess], folder: Path, widgets: str
) -> AsyncIterator[tuple[Crane, str]]:
    """Serve a crane with these widgets, each in the slot of its name; give it and its page."""
    robot = Crane()
    server = await asyncio.start_server(robot.talk, "127.0.0.1", 0)
    names = [line.split(":")[0].strip() for line in widgets.strip().splitlines()]
    slots = "\n".join(f"  {line.strip()}" for line in widgets.strip().splitlines())
    rows = [names[start : start + 3] for start in range(0, len(names), 3)]
    grid = "\n".join("      " + " ".join((*row, *"." * (3 - len(row)))) for row in rows)
    shown = f"widgets:\n{slots}\ninterfaces:\n  default:\n    grid: |\n{grid}\n"
    text = PROFILE.replace("WIDGETS", shown)
    file = folder / "crane.yaml"
    file.write_text(text.replace("PORT", str(server.sockets[0].getsockname()[1])), "utf-8")
    try:
        words = ("--port", "0", "--data-dir", str(folder / "data"))
        process = urc_process("serve", str(file), *words)
        address = (await process.wait_for_async(r"(http://\S+)"))[1]
        yield robot, f"{address}robots/crane/"
    finally:
        server.close()


async def ready(page: Page, selector: str) -> Locator:
    """Return a control that can be used."""
    await until_attribute(page, selector, "aria-disabled", "false")
    return page.locator(selector)
