"""A server with an emulated robot for programs, its people, and a client for each of them."""

import asyncio
import json
import secrets
import time
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager, closing
from pathlib import Path
from typing import Any

import httpx2

from tests.e2e.keys import headers_for
from tests.e2e.processes import UrcProcess
from urc.access.grants import parse_grant
from urc.access.store import AccessStore

__all__ = ["CART", "OTHER", "ApiServer", "Events", "started"]

CART = """\
urc: 1
kind: robot
name: cart
title: Cart
tags: [lab]
settings:
  host: { type: host, default: 127.0.0.1 }
  port: { type: port, default: 7001 }
  word: { type: string, secret: true, required: false }
transports:
  wire:
    type: tcp
    host: "{{ settings.host }}"
    port: "{{ settings.port }}"
    framing: { type: delimiter, tx: LF, rx: LF }
signals:
  battery: { type: integer, unit: "%", min: 0, max: 200, limits: { low: 20 }, stale_after: 3s }
  speed: { type: number, unit: m/s, stale_after: 3s }
  never: { type: string, stale_after: 3s }
commands:
  drive:
    send: "M {{ speed }}"
    args: { speed: { type: number, unit: m/s, min: -1, max: 1 } }
    hold: { repeat: 50ms, lease: 250ms, release: { speed: 0 }, watchdog: none }
  echo:
    title: Echo
    send: "E {{ word }} {{ times }}"
    args: { word: { type: string }, times: { type: integer, min: 1, max: 9, default: 1 } }
    reply: { regex: '^E (?P<_word>\\w+)$', errors: ['^NO'] }
  mute: { send: "Q", reply: { regex: '^never$', timeout: 500ms } }
  tune: { send: "T", role: maintain, reply: { equals: tuned } }
  launch: { send: "L", moves: true, reply: { equals: launched } }
  erase:
    send: "X"
    confirm: { level: hazardous, text: The map will be lost }
    reply: { equals: gone }
  arm: { send: "A", confirm: { text: Two people, two_person: true }, reply: { equals: armed } }
  halt: { send: "H", stop: true, reply: { equals: halted } }
sequences:
  twice: [{ run: echo, args: { word: a } }, { run: echo, args: { word: b } }]
messages:
  speed: { regex: '^S (?P<speed>[-0-9.]+)$' }
  never: { regex: '^N (?P<never>.*)$' }
polls:
  - { every: 100ms, send: "B", reply: { regex: '^B (?P<battery>\\d+)$' } }
simulator:
  signals: { speed: 0.0 }
  wire:
    - { match: '^B$', send: "B {{ 40 + (now | int) % 20 }}" }
    - { match: '^M (?P<wanted>[-0-9.]+)$', send: "S {{ wanted }}" }
    - { match: '^E (?P<word>\\w+) ', send: "E {{ word }}" }
    - { match: '^Q$', set: { battery: 50 } }
    - { match: '^T$', send: tuned }
    - { match: '^L$', send: launched }
    - { match: '^X$', send: gone }
    - { match: '^A$', send: armed }
    - { match: '^H$', send: halted }
"""
OTHER = """\
urc: 1
kind: robot
name: other
title: Other
transports:
  wire: { type: tcp, host: 127.0.0.1, port: 7002, framing: { type: delimiter, tx: LF, rx: LF } }
signals: { level: { type: integer } }
messages: { level: { regex: '^(?P<level>\\d+)$' } }
simulator:
  wire: [{ every: 100ms, send: "{{ (now | int) % 9 }}" }]
"""

_KNOWN_S = 5.0


class ApiServer:
    """A running server, and the folder with the store of its people."""

    def __init__(self, process: UrcProcess, address: str, data: Path) -> None:
        self.process = process
        self.address = address
        self._data = data

    def token(
        self, *grants: str, commands: tuple[str, ...] = (), is_known: bool = True
    ) -> tuple[str, str]:
        """Return the id and the token of a new program; wait until the server knows it.

        A program without a role is never known: `is_known` is false.
        """
        now = time.time()
        allowed = [parse_grant(one) for one in grants]
        name = secrets.token_hex(4)
        with closing(AccessStore(self._data)) as store:
            added = store.add("program", name, allowed, now=now, commands=commands)
            _, secret = store.open_sign_in(added.id, "token", now=now)
        until = time.monotonic() + _KNOWN_S
        while (
            is_known and self._status(secret) == 401
        ):  # the server looks at the file ten times a second
            assert time.monotonic() < until, "the server does not know the token"
        return added.id, secret

    def begin_to_remove(self, program: str) -> None:
        """Remove a program; the server notices it a little later."""
        with closing(AccessStore(self._data)) as store:
            store.remove(program)

    def remove(self, program: str, token: str) -> None:
        """Remove a program; wait until the server refuses its token."""
        self.begin_to_remove(program)
        until = time.monotonic() + _KNOWN_S
        while self._status(token) != 401:
            assert time.monotonic() < until, "the server still accepts the token"

    def _status(self, token: str) -> int:
        headers = {"authorization": f"Bearer {token}"}
        url = f"{self.address}api/v1/robots"
        return httpx2.get(url, headers=headers, trust_env=False).status_code

    def client(self, token: str | None = None) -> httpx2.AsyncClient:
        """Return a client with a token, or with the start key."""
        headers = headers_for(self.address)
        if token is not None:
            headers = {"authorization": f"Bearer {token}"} if token else {}
        return httpx2.AsyncClient(
            base_url=f"{self.address}api/v1/", headers=headers, timeout=20, trust_env=False
        )


def started(
    start: Callable[..., UrcProcess], folder: Path, *more: str, robots: Mapping[str, str] = {}
) -> ApiServer:
    """Start a server with emulated robots."""
    files = []
    for name, text in (robots or {"cart": CART, "other": OTHER}).items():
        file = folder / f"{name}.yaml"
        file.write_text(text, "utf-8")
        files.append(str(file))
    data = folder / "data"
    process = start("serve", *files, "--simulate", "--port", "0", "--data-dir", str(data), *more)
    address = process.wait_for(r"dashboard (http://\S+?/)$")[1]
    return ApiServer(process, address, data)


class Events:
    """A reader of Server-Sent Events."""

    def __init__(self, response: httpx2.Response) -> None:
        self._lines = response.aiter_lines()

    async def next(self) -> tuple[str, Any]:
        """Return name and data of the next event; ("", None) for a comment or the end."""
        name, data = "", None
        async for line in self._lines:
            if line.startswith("event: "):
                name = line[7:]
            elif line.startswith("data: "):
                data = json.loads(line[6:])
            elif not line and name:
                return name, data
            elif line.startswith(":"):
                return "", None
        return "over", None

    async def until(self, wanted: str) -> Any:
        """Return the data of the next event with a name."""
        async with asyncio.timeout(15):
            while True:
                name, data = await self.next()
                if name == wanted:
                    return data
                assert name != "over", f"the stream ended before {wanted!r}"


@asynccontextmanager
async def streaming(client: httpx2.AsyncClient, path: str) -> AsyncIterator[Events]:
    """Read a stream."""
    async with client.stream("GET", path) as response:
        assert response.status_code == 200, await response.aread()
        assert response.headers["content-type"].startswith("text/event-stream")
        yield Events(response)
