"""MQTT beyond the contract: a real broker, its own clients, what is never queued or kept."""

import asyncio
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.e2e.ports import free_port
from tests.e2e.transports.authority import Authority
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.programs import listens, program
from urc.config.load import load_profile
from urc.model.payload import Envelope
from urc.problems import UrcError
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session
from urc.simulator.server import serve as serve_robot
from urc.transports.base import (
    ConnectFailed,
    PeerClosed,
    TopicSubscription,
    TransportError,
    TransportSetup,
)
from urc.transports.mqtt import from_setup
from urc.transports.mqtt_client import MqttTransport

pytestmark = [
    pytest.mark.anyio,
    pytest.mark.needs("mosquitto"),
    pytest.mark.needs("mosquitto-clients"),
]

WAIT_S = 20.0
READY = "ears/ready"
VERSIONS = pytest.mark.parametrize("version", [5, "3.1.1"])
LAMP = """
urc: 1
kind: robot
name: lamp
title: Lamp
settings:
  host: { type: host, default: 127.0.0.1 }
  port: { type: port, default: 1883 }
transports:
  broker: { type: mqtt, host: "{{ settings.host }}", port: "{{ settings.port }}" }
signals:
  volts: { unit: V, min: 0, max: 30 }
messages:
  volts: { subscribe: { topic: cells/+/volts }, regex: '^(?P<volts>[0-9.]+)$' }
commands:
  light:
    args: { level: { type: integer, min: 0, max: 100 } }
    send: { publish: { topic: lamp/set, text: "{{ level }}" } }
"""


def line(port: int, *topics: TopicSubscription, **options: object) -> MqttTransport:
    made = from_setup(
        TransportSetup("wire", {"host": "127.0.0.1", "port": port, **options}, topics)
    )
    assert isinstance(made, MqttTransport)
    return made


def said(topic: str, body: object = b"", **how: object) -> Envelope:
    return Envelope("publish", {"topic": topic, **how}, body)


async def heard(transport: MqttTransport) -> Envelope:
    return await asyncio.wait_for(transport.receive(), WAIT_S)


@asynccontextmanager
async def broker(folder: Path, *settings: str, port: int = 0) -> AsyncIterator[int]:
    """Run Mosquitto on a free port, with anonymous clients unless told otherwise."""
    port = port or free_port()
    # Started as root it would become a user who may read nothing in here.
    lines = [f"listener {port} 127.0.0.1", "user root", *(settings or ("allow_anonymous true",))]
    file = folder / f"mosquitto-{port}.conf"
    file.write_text("\n".join(lines) + "\n")
    mosquitto = shutil.which("mosquitto") or "/usr/sbin/mosquitto"
    async with program(mosquitto, "-c", str(file)):
        await listens(port)
        yield port


class Ears:
    """What mosquitto_sub prints, a line a message: its topic and its text."""

    def __init__(self, output: asyncio.StreamReader) -> None:
        self._output = output
        self._early: list[str] = []

    async def begin(self, port: int) -> None:
        """Wait until it hears what is said to it; what it hears before is kept."""
        async with asyncio.timeout(WAIT_S):
            while True:
                await publish(port, READY, "now")
                try:
                    async with asyncio.timeout(0.3):
                        while not (told := await self._output.readline()).startswith(
                            READY.encode()
                        ):
                            self._early.append(told.decode().strip())
                    return
                except TimeoutError:
                    continue

    async def next(self) -> str:
        """Return the next line."""
        if self._early:
            return self._early.pop(0)
        while True:
            told = await asyncio.wait_for(self._output.readline(), WAIT_S)
            if not told.startswith(READY.encode()):
                return told.decode().strip()


@asynccontextmanager
async def expectations(port: int, *topics: str) -> AsyncIterator[Ears]:
    """Run mosquitto_sub, subscribed when the context begins."""
    words = [word for topic in (*topics, READY) for word in ("-t", topic)]
    process = await asyncio.create_subprocess_exec(
        "mosquitto_sub", *words, "-v", "-p", str(port), stdout=asyncio.subprocess.PIPE
    )
    assert process.stdout is not None
    try:
        reader = Ears(process.stdout)
        await reader.begin(port)
        yield reader
    finally:
        process.kill()
        await process.wait()


async def publish(port: int, topic: str, text: str, *options: str) -> None:
    command = ["mosquitto_pub", "-p", str(port), "-t", topic, "-m", text, *options]
    process = await asyncio.create_subprocess_exec(*command)
    assert await asyncio.wait_for(process.wait(), WAIT_S) == 0


@VERSIONS
async def test_other_clients_hear_and_are_heard(tmp_path: Path, version: object) -> None:
    """Wildcards, every quality of service, and whether a message had been kept for us."""
    async with nothing_left(), broker(tmp_path) as port:
        await publish(port, "cells/1/volts", "3.7", "-r")
        topics = (TopicSubscription("cells/+/volts", {"qos": 1}), TopicSubscription("log/#"))
        transport = line(port, *topics, version=version)
        await transport.open(20.0)
        kept = await heard(transport)
        assert kept.attributes["topic"] == "cells/1/volts"
        assert (kept.attributes["retain"], kept.body) == (True, b"3.7")
        await publish(port, "log/a/b", "grüezi", "-q", "1")
        fresh = await heard(transport)
        assert fresh == Envelope(
            "message", {"topic": "log/a/b", "retain": False, "qos": 0}, "grüezi".encode()
        )
        async with expectations(port, "lamp/#") as reader:
            for qos in (0, 1, 2):
                await transport.send(said(f"lamp/{qos}", {"level": qos}, qos=qos))
                assert await reader.next() == f'lamp/{qos} {{"level":{qos}}}'
        await transport.close()


@VERSIONS
@pytest.mark.parametrize("end", ["close", "cut"])
async def test_broker_publishes_the_will_however_the_line_ends(
    tmp_path: Path, version: object, end: str
) -> None:
    """Also when it is ended here: then nobody drives any more, either."""
    async with nothing_left(), broker(tmp_path) as port, expectations(port, "rover/stop") as reader:
        will = {"topic": "rover/stop", "payload": "halt"}
        transport = line(port, version=version, will=will)
        await transport.open(20.0)
        if end == "cut":
            assert transport._session is not None
            transport._session.line.shutdown(2)
        await transport.close()
        assert await reader.next() == "rover/stop halt"


@VERSIONS
async def test_nothing_is_said_late(tmp_path: Path, version: object) -> None:
    """What could not be said is gone: paho alone keeps it, and sends it when it is back."""
    port = free_port()
    async with nothing_left():
        transport = line(port, version=version)
        async with broker(tmp_path, port=port):
            await transport.open(20.0)
            await transport.send(said("drive", b"1", qos=1))
        with pytest.raises(PeerClosed):
            await heard(transport)
        for _ in range(50):
            with pytest.raises(TransportError):
                await transport.send(said("drive", b"1", qos=1))
        with pytest.raises(ConnectFailed, match="nothing listens"):
            await transport.open(1.0)
        async with broker(tmp_path, port=port), expectations(port, "#") as reader:
            await transport.open(20.0)
            await transport.send(said("drive", b"stop", qos=1))
            assert await reader.next() == "drive stop"
            await transport.close()


async def test_late_subscriber_sees_nothing_of_what_was_driven(tmp_path: Path) -> None:
    """Nothing is kept by the broker unless the document says retain."""
    async with nothing_left(), broker(tmp_path) as port:
        transport = line(port)
        await transport.open(20.0)
        await transport.send(said("drive", b"1"))
        await transport.send(said("state", b"on", retain=True))
        async with expectations(port, "drive", "state") as reader:
            assert await reader.next() == "state on"
        await transport.close()


@VERSIONS
async def test_broker_that_refuses_says_why(tmp_path: Path, version: object) -> None:
    """The wrong password is no silence; the right one is taken."""
    passwords = tmp_path / "passwords"
    made = await asyncio.create_subprocess_exec(
        "mosquitto_passwd", "-b", "-c", str(passwords), "lab", "secret"
    )
    assert await made.wait() == 0
    passwords.chmod(0o644)
    async with nothing_left(), broker(tmp_path, f"password_file {passwords}") as port:
        transport = line(port, version=version, username="lab", password="wrong")  # noqa: S106
        with pytest.raises(ConnectFailed) as told:
            await transport.open(20.0)
        assert str(told.value) == (f"127.0.0.1:{port} refuses the connection (not authorized)")
        transport = line(port, version=version, username="lab", password="secret")  # noqa: S106
        await transport.open(20.0)
        await transport.close()


async def test_line_with_tls_talks_to_a_broker_that_it_trusts_alone(tmp_path: Path) -> None:
    """The whole of it is encrypted; a broker that nobody vouches for is refused with the reason."""
    authority = Authority(tmp_path)
    own = authority.sign("127.0.0.1")
    settings = ("allow_anonymous true", f"certfile {own.cert}", f"keyfile {own.key}")
    async with nothing_left(), broker(tmp_path, *settings) as port:
        transport = line(port, TopicSubscription("state"), tls={"ca": authority.file})
        await transport.open(20.0)
        await transport.send(said("state", b"on" * 50_000))
        assert (await heard(transport)).body == b"on" * 50_000
        await transport.close()
        with pytest.raises(ConnectFailed) as told:
            await line(port, tls=True).open(20.0)
        assert "certificate" in str(told.value)


async def test_profile_drives_the_emulated_robot_through_the_broker(tmp_path: Path) -> None:
    """The robot is a client of the broker as the driver is; both come back when it was gone."""
    path = tmp_path / "lamp.yaml"
    path.write_text(LAMP)
    profile = load_profile(path, built_in_catalog())
    port = free_port()
    settings = {"host": "127.0.0.1", "port": port}
    async with nothing_left():
        with pytest.raises(UrcError, match="needs a broker; start one, for example"):
            async with serve_robot(profile, settings):
                pass
        async with (
            broker(tmp_path, port=port),
            serve_robot(profile, settings) as listening,
            expectations(port, "lamp/set") as reader,
        ):
            assert listening["broker"].text == f"mqtt through the broker 127.0.0.1:{port}"
            async with Session(profile, settings, built_in_catalog().transports) as session:
                with session.hub.subscribe() as news:
                    async with asyncio.timeout(WAIT_S):
                        while session.hub.latest("volts") is None:
                            await news.changed()
                            news.changes()
                async with asyncio.timeout(WAIT_S):
                    await session.command("light", {"level": 40})
                assert await reader.next() == "lamp/set 40"


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"host": ""}, "mqtt: host must be a host name or address, not ''"),
        ({"version": 4}, "mqtt: version must be 5 or 3.1.1, not '4'"),
        ({"password": "x"}, "mqtt has a password but no username"),
        ({"will": {"topic": "a/#"}}, "one topic without wildcards, not 'a/#'"),
        ({"will": {"topic": "a", "qos": 3}}, "mqtt: qos must be 0, 1 or 2, not 3"),
    ],
)
async def test_unusable_option_gets_one_line(options: dict[str, object], text: str) -> None:
    """When the transport is made, before anything is opened."""
    with pytest.raises(TransportError) as told:
        line(1883, **options)
    assert text in str(told.value)
