"""Zenoh beyond the contract: a real router in a process of its own, and what it does not hide."""

import asyncio
import json
import os
import re
import signal
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.e2e.ports import free_port
from tests.e2e.transports.authority import Authority
from tests.e2e.transports.hostile import liar
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.peers.zenoh import other_program, warm_up
from urc.config.load import load_profile
from urc.model.payload import Envelope
from urc.problems import UrcError
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session
from urc.simulator.server import serve as serve_robot
from urc.transports import zenoh_session
from urc.transports.base import (
    ConnectFailed,
    PeerClosed,
    TopicSubscription,
    TransportError,
    TransportSetup,
)
from urc.transports.zenoh import from_setup
from urc.transports.zenoh_client import ZenohTransport
from urc.transports.zenoh_session import MAX_BYTES, MAX_KEY_BYTES, PING_S

pytestmark = pytest.mark.anyio

WAIT_S = 20.0
OPEN_S = 10.0
CONNECT_S = 3.0
"""The timeout of a transport that names none."""
HURRIED_S = 0.5
"""The longest timeout of the guard's attempts for a stop, through a tunnel."""
ROVER = """
urc: 1
kind: robot
name: rover
title: Rover
settings:
  host: { type: host, default: 127.0.0.1 }
  port: { type: port, default: 7447 }
transports:
  router:
    type: zenoh
    host: "{{ settings.host }}"
    port: "{{ settings.port }}"
    reconnect: { initial: 50ms, max: 100ms }
signals:
  volts: { unit: V, min: 0, max: 30 }
  present: { type: boolean }
  battery: { type: number }
messages:
  volts: { subscribe: { topic: cells/*/volts }, regex: '^(?P<volts>[0-9.]+)$' }
  present: { subscribe: { topic: robot/alive, liveliness: true }, json: { present: alive } }
commands:
  light:
    args: { level: { type: integer, min: 0, max: 100 }, lamp: { type: string, default: main } }
    send: { publish: { topic: "lamps/{{ lamp }}/set", text: "{{ level }}" } }
  ask:
    send: { get: { topic: robot/battery, parameters: { unit: "%" } } }
    reply: { regex: '^(?P<battery>[0-9]+)$' }
"""


@pytest.fixture(autouse=True)
def _warm() -> None:
    warm_up()


def line(port: int, *topics: TopicSubscription, **options: object) -> ZenohTransport:
    made = from_setup(
        TransportSetup("wire", {"host": "127.0.0.1", "port": port, **options}, topics)
    )
    assert isinstance(made, ZenohTransport)
    return made


def said(topic: str, body: object = b"") -> Envelope:
    return Envelope("publish", {"topic": topic}, body)


def wanted(topic: str, number: int = 1, body: object = None, **how: object) -> Envelope:
    return Envelope("get", {"topic": topic, "id": number, **how}, body)


async def heard(transport: ZenohTransport) -> Envelope:
    return await asyncio.wait_for(transport.receive(), WAIT_S)


async def ends(transport: ZenohTransport, within_s: float = WAIT_S) -> str:
    """Receive until the connection ends; return why."""
    try:
        async with asyncio.timeout(within_s):
            while True:
                await transport.receive()
    except PeerClosed as told:
        return str(told)


class Device:
    """The other program: what it prints, and what it is told to publish."""

    def __init__(self, process: asyncio.subprocess.Process, port: int) -> None:
        self._process = process
        self.port = port

    async def next(self, kind: str) -> Mapping[str, object]:
        """Return the next line of a kind."""
        assert self._process.stdout is not None
        async with asyncio.timeout(WAIT_S):
            while told := await self._process.stdout.readline():
                found: Mapping[str, object] = json.loads(told)
                if found["kind"] == kind:
                    return found
        raise AssertionError("the device has ended")

    def puts(self, key: str, value: str | None) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"key": key, "value": value}).encode() + b"\n")

    def signal(self, what: signal.Signals) -> None:
        os.kill(self._process.pid, what)


@asynccontextmanager
async def device(
    port: int = 0, late_s: float = 0, key: str = "**", **settings: object
) -> AsyncIterator[Device]:
    """Run the router with its device, which subscribes to `key`, until the context ends."""
    port = port or free_port()
    arguments = (str(port), json.dumps(settings), str(late_s), key)
    async with other_program("tests.e2e.transports.zenoh_device", *arguments) as process:
        made = Device(process, port)
        await made.next("ready")
        yield made


async def test_another_program_hears_and_is_heard() -> None:
    """Values and their notation both ways; a deletion has no value; an own value is not heard."""
    async with nothing_left(), device() as other:
        transport = line(other.port, TopicSubscription("cells/*/volts"))
        await transport.open(OPEN_S)
        await transport.send(said("lamp/set", b"30"))
        assert await other.next("put") == {
            "kind": "put", "key": "lamp/set", "value": "30", "encoding": "zenoh/bytes",
        }  # fmt: skip
        await transport.send(said("lamp/set", {"level": 30}))
        told = await other.next("put")
        assert (told["value"], told["encoding"]) == ('{"level":30}', "application/json")
        await transport.send(said("cells/9/volts", b"9.9"))
        other.puts("cells/1/amps", "1.0")
        other.puts("cells/1/volts", None)
        other.puts("cells/1/volts", "3.7")
        assert await heard(transport) == Envelope("message", {"topic": "cells/1/volts"}, b"3.7")
        await transport.close()


async def test_requests_have_the_first_value_or_a_reason() -> None:
    """A value, a refusal in one line, and a key for which nobody answers."""
    async with nothing_left(), device() as other:
        transport = line(other.port)
        await transport.open(OPEN_S)
        await transport.send(wanted("robot/battery", 1, b"now", parameters={"unit": "% of it"}))
        told = await other.next("get")
        assert (told["value"], told["parameters"]) == ("now", "unit=%25%20of%20it")
        first = await heard(transport)
        assert first == Envelope("response", {"id": 1, "ok": True, "topic": "robot/battery"}, b"80")
        await transport.send(wanted("robot/locked", 2))
        assert (await heard(transport)).attributes["reason"] == "the robot is locked"
        for number, key in ((3, "robot/nothing"), (4, "nobody")):
            await transport.send(wanted(key, number))
            said_no = (await heard(transport)).attributes
            assert (said_no["id"], said_no["ok"]) == (number, False)
            assert said_no["reason"] == f"nothing answers '{key}'"
        await transport.close()


async def test_tokens_are_seen_both_ways() -> None:
    """URC's own ends with its connection, in good order or not; an absent one is told, too."""
    watched = (
        TopicSubscription("robot/alive", {"liveliness": True}),
        TopicSubscription("robot/other", {"liveliness": True}),
    )
    async with nothing_left(), device() as other:
        transport = line(other.port, *watched, liveliness="rover/operator")
        for end in (transport.close, transport.abort):
            await transport.open(OPEN_S)
            assert (await other.next("alive"))["key"] == "rover/operator"
            found = {
                one.attributes["topic"]: one.body
                for one in [await heard(transport), await heard(transport)]
            }
            assert found == {"robot/alive": b'{"alive":true}', "robot/other": b'{"alive":false}'}
            await end()
            assert (await other.next("gone"))["key"] == "rover/operator"
        await transport.open(OPEN_S)
        assert {(await heard(transport)).body for _ in range(2)} == {
            b'{"alive":true}', b'{"alive":false}',
        }  # fmt: skip
        other.puts("robot/alive", None)
        gone = await heard(transport)
        assert (gone.attributes["topic"], gone.body) == ("robot/alive", b'{"alive":false}')
        await transport.close()


async def test_router_that_dies_is_lost_at_once_and_stays_lost() -> None:
    """The library would come back by itself; the link must know, and must send its stop first."""
    async with nothing_left():
        async with device() as other:
            transport = line(other.port, TopicSubscription("**"))
            await transport.open(OPEN_S)
            await transport.send(said("lamp/set", b"1"))
            await other.next("put")
            other.signal(signal.SIGKILL)
            began = asyncio.get_running_loop().time()
            assert await ends(transport) == "the robot closed the connection"
            assert asyncio.get_running_loop().time() - began < 1.0
        with pytest.raises(ConnectFailed, match="nothing listens"):
            await transport.open(OPEN_S)
        async with device(other.port) as again:
            with pytest.raises(TransportError):
                await transport.send(said("lamp/set", b"2"))
            await transport.open(OPEN_S)
            await transport.send(said("lamp/set", b"3"))
            assert (await again.next("put"))["value"] == "3"
            await transport.close()


async def test_new_connection_waits_for_no_subscriber() -> None:
    """A key may never have one; with the usual timeout, each attempt would fail, for ever."""
    loop = asyncio.get_running_loop()
    async with nothing_left():
        async with device(key="drive") as other:
            transport = line(other.port)
            await transport.open(CONNECT_S)
            await transport.send(said("lamp/set", b"1"))
            await transport.send(said("drive", b"1"))
            await other.next("put")
            other.signal(signal.SIGKILL)
            await ends(transport)
        async with device(other.port, late_s=60.0):
            for timeout_s in (CONNECT_S, HURRIED_S):
                began = loop.time()
                await transport.open(timeout_s)
                await transport.send(said("drive", b"0"))
                assert loop.time() - began < timeout_s
            await transport.close()


async def films(transport: ZenohTransport, sizes: Iterator[int]) -> None:
    for size in sizes:
        await asyncio.wait_for(transport.send(said("film", b"x" * size)), WAIT_S)


async def test_message_that_the_router_does_not_accept_never_arrives_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A frozen router reads on when it is thawed, but the connection has been reset."""
    monkeypatch.setattr(zenoh_session, "_PASS_S", 1.0)  # sooner than the kernel gives up
    sizes = iter(range(3_000_000, 3_000_040))
    async with nothing_left(), device() as other:
        transport = line(other.port)
        await transport.open(OPEN_S)
        other.signal(signal.SIGSTOP)
        try:
            with pytest.raises(PeerClosed, match="the router accepts no data"):
                await films(transport, sizes)
            assert await ends(transport) == "the router accepts no data"
        finally:
            other.signal(signal.SIGCONT)
        lost = next(sizes) - 1
        await asyncio.sleep(1.0)
        await transport.open(OPEN_S)
        await transport.send(said("film", b"end"))
        arrived = []
        while (value := (await other.next("put"))["value"]) != "end":
            arrived.append(value)
        assert f"{lost} bytes" not in arrived
        await transport.close()


async def test_key_that_is_too_long_is_ignored() -> None:
    """Neither a value nor a token may fill the memory by its name."""
    long = "a" * (MAX_KEY_BYTES + 1)
    async with nothing_left(), device() as other:
        transport = line(other.port, TopicSubscription("**"))
        await transport.open(OPEN_S)
        await transport.send(said("lamp/set", b"1"))
        await other.next("put")  # the subscription has arrived before
        other.puts(long, "1")
        other.puts(long[:-1], "2")
        assert (await heard(transport)).body == b"2"
        await transport.close()


async def test_router_that_freezes_is_lost() -> None:
    """Its system still takes what is sent, so only a reply to a ping proves that it works."""
    async with nothing_left(), device() as other:
        transport = line(other.port, TopicSubscription("**"))
        await transport.open(OPEN_S)
        await asyncio.wait_for(transport.probe(), 2.0)
        other.signal(signal.SIGSTOP)
        try:
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(transport.probe(), 0.5)
            why = await ends(transport, 3 * PING_S)
            assert re.fullmatch(r"the router has not replied for (9|10|11|12) s", why)
        finally:
            other.signal(signal.SIGCONT)
        await transport.open(OPEN_S)
        await asyncio.wait_for(transport.probe(), WAIT_S)
        await transport.close()


async def test_large_values_arrive_whole() -> None:
    """In both directions, in many pieces; beyond the limit they are dropped, and the line lives."""
    big = "x" * 3_000_000
    async with nothing_left(), device() as other:
        transport = line(other.port, TopicSubscription("photo"))
        await transport.open(OPEN_S)
        await transport.send(said("film", big.encode()))
        assert (await other.next("put"))["value"] == "3000000 bytes"
        other.puts("photo", big)
        assert (await heard(transport)).body == big.encode()
        other.puts("photo", "x" * (MAX_BYTES + 1))

        async def say_small() -> None:
            while True:  # a device drops values while its line is full
                other.puts("photo", "small")
                await asyncio.sleep(0.5)

        saying = asyncio.create_task(say_small())
        assert (await heard(transport)).body == b"small"
        saying.cancel()
        await transport.close()


@pytest.mark.parametrize(
    "topic", ["", "/lamp", "lamp/", "a//b", "lamps/*/set", "**", "a$*", "lamp?x=1", "a#b"]
)
async def test_key_that_is_no_key_is_refused(topic: str) -> None:
    """Before anything is sent: a value in a key must not reach other keys."""
    async with nothing_left(), device() as other:
        transport = line(other.port)
        await transport.open(OPEN_S)
        for envelope in (said(topic), wanted(topic)):
            with pytest.raises(TransportError, match=r"^zenoh cannot "):
                await transport.send(envelope)
        await transport.send(said("lamp/set", b"1"))
        assert (await other.next("put"))["key"] == "lamp/set"
        await transport.close()


async def test_server_of_another_protocol_is_told() -> None:
    """At once where it closes, and within the time where it says nothing."""

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(10)
        writer.write(b"HTTP/1.1 400 Bad Request\r\n\r\n")
        await writer.drain()

    async with nothing_left(), liar(answer) as port:
        with pytest.raises(ConnectFailed) as told:
            await line(port).open(OPEN_S)
        assert str(told.value).startswith(f"127.0.0.1:{port} is not a Zenoh router, ")


async def test_login_is_needed_and_checked(tmp_path: Path) -> None:
    """A wrong password is refused in one clear line, at once."""
    users = tmp_path / "users"
    users.write_text("lab:secret\n")
    login = {"usrpwd": {"user": "r", "password": "r", "dictionary_file": str(users)}}
    async with nothing_left(), device(transport={"auth": login}) as other:
        transport = line(other.port, username="lab", password="secret")  # noqa: S106
        await transport.open(OPEN_S)
        await transport.send(said("lamp/set", b"1"))
        assert (await other.next("put"))["value"] == "1"
        await transport.close()
        began = asyncio.get_running_loop().time()
        with pytest.raises(ConnectFailed) as told:
            await line(other.port, username="lab", password="wrong").open(OPEN_S)  # noqa: S106
        assert "refuses the connection" in str(told.value)
        with pytest.raises(ConnectFailed) as told:
            await line(other.port).open(OPEN_S)
        assert "\n" not in str(told.value)
        assert asyncio.get_running_loop().time() - began < OPEN_S


async def test_tls_is_checked_like_that_of_other_transports(tmp_path: Path) -> None:
    """With the router's own TLS: trusted, unknown, and without the certificate that it wants."""
    authority = Authority(tmp_path)
    cert, key = authority.sign("127.0.0.1")
    tls = {
        "root_ca_certificate": str(authority.file),
        "listen_certificate": str(cert),
        "listen_private_key": str(key),
        "enable_mtls": True,
    }
    port = free_port()
    endpoint = {"endpoints": [f"tls/127.0.0.1:{port}"]}
    async with nothing_left(), device(port, listen=endpoint, transport={"link": {"tls": tls}}):
        trust = {"ca": str(authority.file)}
        mine = {"cert": str(cert), "key": str(key)}
        transport = line(port, tls={**trust, **mine})
        await transport.open(OPEN_S)
        await transport.send(said("lamp/set", b"1"))
        await transport.close()
        with pytest.raises(ConnectFailed, match="unknown authority"):
            await line(port, tls=mine).open(OPEN_S)
        began = asyncio.get_running_loop().time()
        with pytest.raises(ConnectFailed) as told:
            await line(port, tls=trust).open(OPEN_S)
        assert "\n" not in str(told.value)
        assert asyncio.get_running_loop().time() - began < OPEN_S


def doors() -> set[str]:
    """Return the sockets of this process that others could reach: listening TCP, and UDP."""
    own = {os.readlink(f"/proc/self/fd/{one}") for one in os.listdir("/proc/self/fd")
           if Path(f"/proc/self/fd/{one}").is_symlink()}  # fmt: skip
    found = set()
    for table in ("tcp", "tcp6", "udp", "udp6"):
        for row in Path(f"/proc/self/net/{table}").read_text("ascii").splitlines()[1:]:
            words = row.split()
            if f"socket:[{words[9]}]" in own and (table[:3] == "udp" or words[3] == "0A"):
                found.add(f"{table} {words[1]}")
    return found


async def test_no_door_is_opened() -> None:
    """Neither a port nor a multicast socket, while connected."""
    async with nothing_left(), device() as other:
        before = doors()
        transport = line(other.port, TopicSubscription("**"), liveliness="rover/operator")
        await transport.open(OPEN_S)
        await transport.send(said("lamp/set", b"1"))
        assert doors() == before
        await transport.close()


def is_present(session: Session) -> bool:
    found = session.hub.latest("present")
    return found is not None and found.value is True


async def test_profile_talks_to_its_emulated_robot(tmp_path: Path) -> None:
    """Values, tokens and requests, by the document alone; a lost robot is lost for the page."""
    path = tmp_path / "rover.yaml"
    path.write_text(ROVER)
    profile = load_profile(path, built_in_catalog())
    port = free_port()
    settings = {"host": "127.0.0.1", "port": port}
    transports = built_in_catalog().transports
    async with nothing_left(), Session(profile, settings, transports) as session:
        async with serve_robot(profile, settings):
            async with asyncio.timeout(WAIT_S):
                while not is_present(session):  # noqa: ASYNC110
                    await asyncio.sleep(0.02)
            await session.command("light", {"level": 20})
            assert (await session.command("ask", {})).values.keys() == {"battery"}
            with pytest.raises(UrcError, match="would change the topic"):
                await session.command("light", {"level": 20, "lamp": "*"})
        with pytest.raises(UrcError, match="not connected"):
            await asyncio.wait_for(lights_on(session), WAIT_S)


async def lights_on(session: Session) -> None:
    """Run a command for ever, or until it fails."""
    while True:
        await session.command("light", {"level": 20})
        await asyncio.sleep(0.02)


async def test_emulated_robot_tells_why_it_cannot_listen(tmp_path: Path) -> None:
    """The port is taken: in one line, with the transport's name."""
    path = tmp_path / "rover.yaml"
    path.write_text(ROVER)
    profile = load_profile(path, built_in_catalog())
    async with device() as other:
        with pytest.raises(UrcError, match=r"^transports.router: cannot listen on .*in use"):
            async with serve_robot(profile, {"host": "127.0.0.1", "port": other.port}):
                pass
