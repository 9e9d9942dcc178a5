"""A robot with a secret, a lamp behind a broker, and their dev pages, for tests."""

import asyncio
import base64
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

from playwright.async_api import Page

from tests.e2e.processes import UrcProcess

__all__ = ["LAMP", "PICTURE", "ROBOT", "WORD", "Bell", "Start", "served"]

WORD = "hunter2"
ROBOT = """\
urc: 1
kind: robot
name: bell
title: Bell
settings:
  password: { type: string, secret: true }
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: PORT
    framing: { type: delimiter, tx: CRLF, rx: CRLF }
    timeouts: { reply: 20s }
    on_connect:
      - { send: "LOGIN {{ settings.password }}", redact: true }
      - { expect: '^WELCOME$' }
signals:
  battery: { type: integer, unit: "%", limits: { low: 20 } }
messages:
  level: { from: wire, regex: '^BAT (?P<battery>\\d+)$' }
commands:
  ring:
    title: Ring the bell
    args: { times: { type: integer, min: 1, max: 9, default: 1 } }
    send: "RING {{ times }}"
    reply: { regex: '^OK$' }
  melt: { send: MELT, confirm: { text: It will not be a bell any more. } }
"""
LAMP = """\
urc: 1
kind: robot
name: lamp
title: Lamp
settings:
  password: { type: string, secret: true }
  port: { type: port, default: 1883 }
transports:
  broker:
    type: mqtt
    host: 127.0.0.1
    port: "{{ settings.port }}"
    username: me
    password: "{{ settings.password }}"
signals:
  lit: { type: boolean }
messages:
  state: { subscribe: { topic: lamp/state }, json: { lit: on } }
commands:
  switch:
    args: { lit: { type: boolean } }
    send: { publish: { topic: lamp/set, qos: 1, json: { on: "{{ lit }}" } } }
"""

PICTURE = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5ErkJggg=="
)

Start = Callable[..., UrcProcess]


class Bell:
    """A robot that echoes what it is told, letter by letter, and answers."""

    def __init__(self) -> None:
        self.lines: list[bytes] = []
        self.writers: list[asyncio.StreamWriter] = []

    async def talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one connection."""
        self.writers.append(writer)
        try:
            while line := await reader.readline():
                self.lines.append(line)
                if line.startswith(b"LOGIN"):
                    for letter in line:
                        writer.write(bytes([letter]))
                        await writer.drain()
                    writer.write(b"WELCOME\r\nBAT 12\r\n")
                else:
                    writer.write(b"OK\r\n")
                await writer.drain()
        except ConnectionError:
            pass
        finally:
            writer.close()


@asynccontextmanager
async def served(
    page: Page, start: Start, folder: Path, *options: str
) -> AsyncIterator[tuple[Bell, Path, str]]:
    """Open the dev page of a bell; give the robot, its document and the server's address."""
    bell = Bell()
    server = await asyncio.start_server(bell.talk, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    file = folder / "bell.yaml"
    file.write_text(ROBOT.replace("PORT", str(port)), "utf-8")
    words = ("serve", str(file), "--set", f"password={WORD}", "--port", "0")
    process = start(*words, "--dev", "--data-dir", str(folder / "data"), *options)
    address = (await process.wait_for_async(r"(http://\S+)"))[1]
    await page.goto(f"{address}robots/bell/dev")
    try:
        yield bell, file, address
    finally:
        await page.goto("about:blank")  # before the server goes: nothing of it is missed then
        server.close()
        for writer in bell.writers:
            writer.transport.abort()
