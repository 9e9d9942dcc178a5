"""Strangers besiege the server from another address, and the operator drives on.

Slow requests, sockets that read nothing, and wrong passphrases arrive at the same time. The paired
operator keeps the lease: no stop reaches the robot until the operator lets go.
"""

import asyncio
import contextlib
import json
import time
from collections.abc import Iterator
from math import inf
from pathlib import Path
from typing import NamedTuple

import pytest

from bench.rig.deaths import LEASE_MS, Rig
from tests.e2e.verdict import judged
from urc.access.grants import Grant
from urc.access.store import AccessStore

DRIPPING = 500
DEAF = 200
FAILED_PER_S = 50
SIEGE_S = 8.0
SETTLED_S = 1.0
LEASE_NS = int(LEASE_MS * 1e6)
ATTACKER = ("127.0.0.2", 0)
WATCHERS = 4
LATE_MS = 100.0
"""Delay of the machine before a stop that makes a siege invalid, in milliseconds."""

pytestmark = [
    pytest.mark.alone,
    pytest.mark.anyio,
    pytest.mark.skipif("sys.platform != 'linux'", reason="the rig is for Linux"),
]


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    """One robot, and a server with its guard."""
    with Rig(tmp_path, robot_count=1) as made:
        made.bout("close")  # starts the guard
        yield made


def cookie_of(store: AccessStore, name: str, role: str) -> str:
    """Return the cookie of a new person, or of a new device, with this role."""
    now = time.time()
    kind = "device" if role == "drive" else "person"
    added = store.add(kind, name, [Grant(role)], now=now)  # type: ignore[arg-type]
    _, secret = store.open_sign_in(added.id, "pairing", now=now)
    return f"urc-sign-in-{store.instance()}={secret}"


class Siege:
    """The attackers at another address."""

    def __init__(self, port: int, cookies: list[str]) -> None:
        self.port = port
        self.cookies = cookies
        self.refused = 0
        """Failed sign-ins that the server has answered."""
        self.deaf = 0
        """Sockets that the server has accepted."""

    async def _line(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        return await asyncio.open_connection("127.0.0.1", self.port, local_addr=ATTACKER)

    def _head(self, first: str, *more: str) -> bytes:
        place = f"127.0.0.1:{self.port}"
        lines = (first, f"Host: {place}", f"Origin: http://{place}", *more)
        return "\r\n".join((*lines, "", "")).encode()

    async def drip(self) -> None:
        """Send a request byte by byte, and begin again after each refusal."""
        while True:
            with contextlib.suppress(OSError):
                _, writer = await self._line()
                try:
                    for byte in self._head("GET /robots/robot-0/ HTTP/1.1"):
                        writer.write(bytes([byte]))
                        await asyncio.sleep(0.5)
                finally:
                    writer.transport.abort()
            await asyncio.sleep(0.5)

    async def stay_deaf(self, number: int) -> None:
        """Open a page's socket, and read nothing."""
        with contextlib.suppress(OSError):
            reader, writer = await self._line()
            try:
                writer.write(
                    self._head(
                        "GET /ws?robot=robot-0 HTTP/1.1",
                        "Upgrade: websocket",
                        "Connection: Upgrade",
                        "Sec-WebSocket-Version: 13",
                        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
                        f"Cookie: {self.cookies[number % len(self.cookies)]}",
                    )
                )
                is_open = b" 101 " in await reader.readline()
                self.deaf += is_open
                writer.transport.pause_reading()  # type: ignore[attr-defined]
                await asyncio.Event().wait()
            finally:
                writer.transport.abort()

    async def guess(self) -> None:
        """Try a wrong passphrase once."""
        body = json.dumps({"name": "Ann", "passphrase": "a wrong passphrase"}).encode()
        head = self._head(
            "POST /api/v1/sign-in HTTP/1.1", "Content-Type: application/json",
            f"Content-Length: {len(body)}", "Connection: close",
        )  # fmt: skip
        with contextlib.suppress(OSError):
            reader, writer = await self._line()
            try:
                writer.write(head + body)
                status = await reader.readline()
                assert b" 200 " not in status
                self.refused += bool(status)
            finally:
                writer.transport.abort()

    async def run(self, for_s: float) -> None:
        """Attack in all ways at the same time."""
        async with asyncio.TaskGroup() as group:
            tasks = [group.create_task(self.drip()) for _ in range(DRIPPING)]
            tasks += [group.create_task(self.stay_deaf(number)) for number in range(DEAF)]
            end_s = time.monotonic() + for_s
            while time.monotonic() < end_s:
                tasks.append(group.create_task(self.guess()))
                await asyncio.sleep(1 / FAILED_PER_S)
            for task in tasks:
                task.cancel()


class Trial(NamedTuple):
    """The result of one siege."""

    is_good: bool
    late_ms: float
    """Delay of the machine during the lease that ended first, in milliseconds; 0 without a stop."""

    @property
    def is_excused(self) -> bool:
        """Whether the machine was too busy for the ticks of a page."""
        return not self.is_good and self.late_ms > LATE_MS


async def besieged(rig: Rig, operator: str, watchers: list[str]) -> Trial:
    """Let a paired operator drive during a siege; return whether no stop reached the robot."""
    number = rig.drive(0, cookie=operator)
    await asyncio.to_thread(rig.operators.await_told, "dying", number)
    await asyncio.sleep(SETTLED_S)
    siege = Siege(rig.server.port, watchers)
    began_ns = time.monotonic_ns()
    await siege.run(SIEGE_S)
    heard = rig.robots.since(0, began_ns)
    before = [one.text for one in rig.robots.heard[0] if one.time_ns < began_ns]
    rig.operators.kill(number)
    if before[-1] == "M 0":  # a busy machine has ended the gesture before the siege
        return Trial(False, inf)
    assert siege.refused > 0
    assert siege.deaf > DEAF / 2
    stop = next((one for one in heard if one.text == "M 0"), None)
    if stop is None:
        return Trial(len(heard) > SIEGE_S * 5, 0.0)
    return Trial(False, rig.late_ms(stop.time_ns - LEASE_NS, stop.time_ns))


async def test_the_paired_operator_drives_on(rig: Rig, tmp_path: Path) -> None:
    store = AccessStore(tmp_path / "data")
    operator = cookie_of(store, "Tablet in the lab", "drive")
    watchers = [cookie_of(store, f"Watcher {number}", "watch") for number in range(WATCHERS)]
    store.close()
    await asyncio.sleep(SETTLED_S)
    trials: list[Trial] = []
    while not judged(trials, 1):
        trials.append(await besieged(rig, operator, watchers))
