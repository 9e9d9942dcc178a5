"""What no transport may do, however it is treated: leave things behind, say things twice."""

import asyncio
import os
import random
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from tests.e2e.ports import free_port
from tests.e2e.transports.hostile import liar
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.test_contract import PEERS, robot
from tests.e2e.transports.test_mqtt import broker
from urc.config.load import load_profile
from urc.model.payload import Envelope, Payload
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import CommandFailed, Session
from urc.simulator.emulated_robot import EmulatedConnection
from urc.simulator.server import serve
from urc.transports.base import Transport, TransportError

pytestmark = pytest.mark.anyio

WAIT_S = 20.0
OLDEST = 400
"""Numbers that may be said after one that is still on its way: two seconds of them."""
DEATHS = 20
MOMENTS = 40
LONGEST_S = 0.03
"""Opening, sending and hearing takes less on loopback, whichever the transport is."""


async def use(transport: Transport, ask: Payload) -> None:
    """Do all that is done with a line."""
    await transport.open(20.0)
    while True:
        await transport.send(ask)
        await transport.receive()


@pytest.mark.parametrize("kind", PEERS)
async def test_line_that_is_cancelled_at_any_moment_leaves_nothing(kind: str) -> None:
    """No task, thread or socket, and it may be opened again."""
    chance = random.Random(kind)  # noqa: S311 - the same moments in every run
    async with robot(kind, "echo") as (peer, transport):
        for _ in range(MOMENTS):
            work = asyncio.create_task(use(transport, peer.ask))
            await asyncio.wait([work], timeout=chance.random() * LONGEST_S)
            work.cancel()
            async with asyncio.timeout(WAIT_S):
                with suppress(asyncio.CancelledError, TransportError):
                    await work
                await transport.close()
        async with asyncio.timeout(WAIT_S):
            await transport.open(20.0)
            await transport.send(peer.ask)
            await transport.receive()


# -- a server that dies again and again

LINES = r"""
signals: { heard: { type: integer } }
commands:
  say:
    to: wire
    args: { number: { type: integer } }
    send: "say {{ number }}"
    reply: { regex: '^heard (?P<heard>\d+)$', timeout: 500ms }
simulator:
  wire:
    - { match: '^hello$', send: ready }
    - { match: '^say (?P<number>\d+)$', send: "heard {{ number }}" }
"""
GREETED = r"""    on_connect: [{ send: hello }, { expect: '^ready$' }]
    reconnect: { initial: 50ms, max: 100ms }
"""
FRAMED = "    framing: { type: delimiter, tx: LF, rx: LF }\n"
MESSAGES = r"""    reconnect: { initial: 50ms, max: 100ms }
signals: { x: {} }
messages: { x: { subscribe: { topic: /x, type: a/B }, json: { x: data } } }
commands:
  say:
    args: { number: { type: integer } }
    send: { publish: { topic: /say, type: a/B, json: { said: "{{ 'say ' ~ number }}" } } }
"""
WEB = r"""    reconnect: { initial: 50ms, max: 100ms }
signals: { x: {} }
commands:
  say:
    args: { number: { type: integer } }
    send: { request: { method: POST, path: "/say", json: { said: "{{ 'say ' ~ number }}" } } }
"""
OPTIONS = {
    "tcp": "host: 127.0.0.1\n    port: '{{ settings.port }}'\n" + FRAMED + GREETED + LINES,
    "telnet": "host: 127.0.0.1\n    port: '{{ settings.port }}'\n" + FRAMED + GREETED + LINES,
    "ssh": "host: 127.0.0.1\n    port: '{{ settings.port }}'\n    username: me\n    password: x\n"
           "    pty: false\n    host_key: '{{ settings.key }}'\n" + FRAMED + GREETED + LINES,
    "websocket": "url: 'ws://127.0.0.1:{{ settings.port }}/'\n" + GREETED + LINES,
    "ros": "host: 127.0.0.1\n    port: '{{ settings.port }}'\n" + MESSAGES,
    "mqtt": "host: 127.0.0.1\n    port: '{{ settings.port }}'\n"
            + MESSAGES.replace(", type: a/B", ""),
    "zenoh": "host: 127.0.0.1\n    port: '{{ settings.port }}'\n"
             + MESSAGES.replace(", type: a/B", "").replace("topic: /", "topic: "),
    "http": "url: 'http://127.0.0.1:{{ settings.port }}'\n" + WEB,
}  # fmt: skip


class Way:
    """Passes connections on to a port, until it is cut; then nobody gets through for a while."""

    def __init__(self, target: int) -> None:
        self._target = target
        self._open: set[asyncio.StreamWriter] = set()
        self._is_up = True
        self.connections = 0

    async def talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if not self._is_up:
            return
        self.connections += 1
        inner, outer = await asyncio.open_connection("127.0.0.1", self._target)
        ends = {writer, outer}
        self._open |= ends

        async def pass_on(source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
            while data := await source.read(65536):
                sink.write(data)
                await sink.drain()

        ways = [asyncio.create_task(pass_on(*way)) for way in ((reader, outer), (inner, writer))]
        try:
            await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for end in ends:
                end.transport.abort()
            for way in ways:
                way.cancel()
            await asyncio.gather(*ways, return_exceptions=True)
            self._open -= ends

    async def cut(self, seconds: float) -> None:
        """Cut every connection, and let nobody through for `seconds`."""
        self._is_up = False
        for end in self._open:
            end.transport.abort()
        await asyncio.sleep(seconds)
        self._is_up = True


class Ear:
    """Notes what any emulated robot is told: its numbers, in order, and its greetings."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.numbers: list[tuple[int, int]] = []
        """Each with how many had been said by then."""
        self.said = 0
        self.greetings = 0
        hear = EmulatedConnection._receive

        def heard(line: EmulatedConnection, data: Payload, *more: Any) -> list[Payload]:
            said = str(data.body if isinstance(data, Envelope) else data)
            self.numbers += [(int(number), self.said) for number in re.findall(r"say (\d+)", said)]
            self.greetings += said.count("hello")
            return hear(line, data, *more)

        # Every server passes its frames here, as a stream or one at a time.
        patch.setattr(EmulatedConnection, "_receive", heard)

    async def hears_more(self) -> None:
        """Wait until a few more numbers have come."""
        heard = len(self.numbers)
        async with asyncio.timeout(WAIT_S):
            while len(self.numbers) < heard + 4:  # noqa: ASYNC110 - the robots have no event
                await asyncio.sleep(0.005)


@asynccontextmanager
async def far_end(kind: str, folder: Path, path: Path) -> AsyncIterator[tuple[int, str]]:
    """Emulate the robot, behind a broker where that is its way; give port and host key."""
    profile = load_profile(path, built_in_catalog())
    port = free_port()
    if kind == "mqtt":
        async with broker(folder, port=port), serve(profile, {"port": port, "key": ""}):
            yield port, ""
    else:
        async with serve(profile, {"port": port, "key": ""}) as listening:
            key = re.search(r"SHA256:[^ )]*", listening["wire"].text)
            yield port, key[0] if key else ""


def descriptors() -> int:
    return len(os.listdir("/proc/self/fd"))


@pytest.mark.needs("mosquitto")
@pytest.mark.parametrize("kind", OPTIONS)
async def test_server_that_dies_again_and_again_is_told_everything_once(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing twice, nothing late, greeted anew each time, and no descriptor more than before."""
    path = tmp_path / "robot.yaml"
    head = "urc: 1\nkind: robot\nname: mortal\n"
    head += "settings: { port: { type: port }, key: { type: string } }\n"
    path.write_text(f"{head}transports:\n  wire:\n    type: {kind}\n    {OPTIONS[kind]}")
    expectation = Ear(monkeypatch)
    async with far_end(kind, tmp_path, path) as (port, key), nothing_left():
        way = Way(port)
        async with liar(way.talk) as front:
            profile = load_profile(path, built_in_catalog())
            async with Session(
                profile, {"port": front, "key": key}, built_in_catalog().transports
            ) as session:
                await lives_through_it(session, way, expectation)
    told = [number for number, _ in expectation.numbers]
    assert len(told) == len(set(told)), "something was said twice"
    if kind != "http":  # requests under way on several connections may overtake each other
        assert told == sorted(told), "something old was said late"
    if kind not in ("ros", "mqtt", "zenoh", "http"):
        assert expectation.greetings >= DEATHS


async def lives_through_it(session: Session, way: Way, expectation: Ear) -> None:
    """Say numbers all the time while the server dies again and again."""
    saying: set[asyncio.Task[None]] = set()

    async def say(number: int) -> None:
        with suppress(CommandFailed):
            await session.command("say", {"number": number})

    async def load() -> None:
        while True:
            task = asyncio.create_task(say(expectation.said))
            expectation.said += 1
            saying.add(task)
            task.add_done_callback(saying.discard)
            await asyncio.sleep(0.005)

    loading = asyncio.create_task(load())
    chance = random.Random(7)  # noqa: S311 - the same in every run
    flat = 0
    async with asyncio.timeout(120):
        for death in range(DEATHS):
            await expectation.hears_more()
            if death == DEATHS // 4:
                flat = descriptors()
            await way.cut(chance.random() * 0.1)
        await expectation.hears_more()
        loading.cancel()
        await asyncio.gather(loading, *saying, return_exceptions=True)
    async with asyncio.timeout(WAIT_S):
        while descriptors() > flat + 8:
            # The last connections may still be closing. A pool of HTTP connections closes those
            # of a burst at its next request.
            await say(expectation.said)
            expectation.said += 1
            await asyncio.sleep(0.1)
    # Told in numbers, not in seconds: a pause of this machine makes nothing old.
    assert max(said - number for number, said in expectation.numbers) < OLDEST
