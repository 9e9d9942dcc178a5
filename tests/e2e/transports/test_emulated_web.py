"""The emulated robot behind HTTP and WebSocket, tried by URC and by clients it knows nothing of."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from scripts.node import node_executable
from tests.e2e.ports import free_port
from tests.e2e.transports.leaks import nothing_left
from urc.client.local import CommandFailed, ConnectedRobot, connect, load
from urc.simulator.server import serve

pytestmark = [pytest.mark.anyio]

WAIT_S = 15.0

PROFILE = """
urc: 1
kind: robot
name: web
title: Web
summary: A robot with a web server, a camera and a WebSocket.

settings:
  port: { type: port, default: 8080 }
  socket_port: { type: port, default: 8081 }
  password: { type: string, default: s3cret }

transports:
  web:
    type: http
    url: "http://127.0.0.1:{{ settings.port }}/api"
    auth: { type: digest, user: operator, password: "{{ settings.password }}" }
  socket:
    type: websocket
    url: "ws://127.0.0.1:{{ settings.socket_port }}/control"
    subprotocols: [v1.robot]

signals:
  battery: { type: integer, unit: "%" }
  power: { type: integer }
  temperature: { type: number, unit: degC }
  camera: { type: image }
  still: { type: image }
  depth: { type: integer }

polls:
  - name: status
    to: web
    every: 200ms
    send: { request: { path: /status, query: { of: battery } } }
    reply: { json: { battery: battery } }

messages:
  heat: { from: web, subscribe: { topic: "/events#heat", stream: sse }, json: { temperature: c } }
  cam: { from: web, subscribe: { topic: /cam, stream: mjpeg }, raw: camera }
  still: { from: web, subscribe: { topic: /still.jpg, stream: stills, every: 100ms }, raw: still }

commands:
  light:
    to: web
    args: { level: { type: integer, min: 0, max: 255 } }
    send: { request: { path: "/control?var=led&val={{ level }}" } }
  drive:
    to: web
    args: { speed: { type: number, min: -1, max: 1 } }
    send: { request: { method: POST, path: /drive, json: { speed: "{{ speed }}" } } }
    reply: { json: { power: power } }
  dive:
    to: socket
    args: { depth: { type: integer, min: 0, max: 10 } }
    send: "dive {{ depth }}"
    reply: { regex: '^at (?P<depth>[0-9]+)$' }

simulator:
  web:
    - { poll: status, set: { battery: 87 } }
    - { every: 100ms, message: heat, set: { temperature: 36.5 } }
  socket:
    - { match: '^dive (?P<to>[0-9]+)$', send: "at {{ to }}" }
"""


@asynccontextmanager
async def robot(folder: Path) -> AsyncIterator[tuple[Path, dict[str, int]]]:
    """Emulate the robot on free ports; give its profile and settings."""
    path = folder / "web.yaml"
    path.write_text(PROFILE)
    settings = {"port": free_port(), "socket_port": free_port()}
    async with nothing_left(), serve(load(path), {**settings, "password": "s3cret"}):
        yield path, settings


async def value(connected: ConnectedRobot, name: str) -> object:
    """Return the first value of a signal."""
    async with asyncio.timeout(WAIT_S):
        async for sample in connected.watch(name):
            if sample.value is not None:
                return sample.value
    raise AssertionError("it ended")


async def curl(*arguments: str) -> bytes:
    process = await asyncio.create_subprocess_exec(
        "curl", "-sS", "--max-time", "10", *arguments, stdout=asyncio.subprocess.PIPE
    )
    said, _ = await process.communicate()
    return said


async def test_driver_and_its_emulation_understand_each_other(tmp_path: Path) -> None:
    """Polls, commands, events and pictures, each on its line, with Digest in between."""
    async with robot(tmp_path) as (path, settings), connect(path, **settings) as connected:
        assert await value(connected, "battery") == 87
        assert await value(connected, "temperature") == 36.5
        for camera in ("camera", "still"):
            picture = await value(connected, camera)
            assert isinstance(picture, bytes)
            assert (picture[:2], picture[-2:]) == (b"\xff\xd8", b"\xff\xd9")
        async with asyncio.timeout(WAIT_S):
            await connected.command("light", level=7)
            assert await connected.command("dive", depth=3) == {"depth": 3}
            assert "power" in await connected.command("drive", speed=0.5)


async def test_wrong_password_is_told(tmp_path: Path) -> None:
    """The command fails with what the robot said."""
    async with (
        robot(tmp_path) as (path, settings),
        connect(path, **{**settings, "password": "guess"}) as connected,
    ):
        with pytest.raises(CommandFailed, match="401 Unauthorized"):
            async with asyncio.timeout(WAIT_S):
                await connected.command("drive", speed=0.5)


@pytest.mark.needs("curl")
async def test_client_of_others_is_served(tmp_path: Path) -> None:
    """curl shows who it is, reads, writes, and is told what is not there."""
    async with robot(tmp_path) as (_, settings):
        base = f"http://127.0.0.1:{settings['port']}/api"
        assert await curl(f"{base}/status?of=battery") == b"who are you?\n"
        who = ("--digest", "-u", "operator:s3cret")
        assert await curl(*who, f"{base}/status?of=battery") == b'{"battery":87}'
        code = ("-o", "/dev/null", "-w", "%{http_code}")
        assert await curl(*who, *code, f"{base}/missing") == b"404"
        assert await curl(*who, *code, f"{base}/control?var=led&val=7") == b"200"
        events = await curl(*who, "-N", "--max-time", "1", f"{base}/events")
        assert events.startswith(b'event: heat\ndata: {"c":36.5}\n\n')


@pytest.mark.needs("ffmpeg")
async def test_camera_is_one_for_others(tmp_path: Path) -> None:
    """ffmpeg decodes the stream and the still without a complaint."""
    async with robot(tmp_path) as (_, settings):
        for source in (["-f", "mpjpeg"], ["-f", "jpeg_pipe"]):
            name = "cam" if source[1] == "mpjpeg" else "still.jpg"
            body = await curl(
                "--digest", "-u", "operator:s3cret", "--max-time", "1",
                f"http://127.0.0.1:{settings['port']}/api/{name}",
            )  # fmt: skip
            process = await asyncio.create_subprocess_exec(
                "ffmpeg", "-v", "error", *source, "-i", "-", "-f", "framecrc", "-",
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.PIPE,
            )  # fmt: skip
            said, complaints = await process.communicate(body)
            assert complaints == b""
            assert len([row for row in said.splitlines() if not row.startswith(b"#")]) >= 1


@pytest.mark.needs("node")
async def test_socket_is_one_for_others(tmp_path: Path) -> None:
    """Node's own WebSocket agrees on a protocol, talks, and closes in good order."""
    script = """
    const socket = new WebSocket(process.argv[1], ["v0.robot", "v1.robot"]);
    socket.onopen = () => { console.log(socket.protocol); socket.send("dive 4"); };
    socket.onmessage = (event) => { console.log(event.data); socket.close(); };
    socket.onclose = (event) => console.log(event.wasClean);
    socket.onerror = () => console.log("error");
    """
    node = node_executable()
    assert node is not None
    async with robot(tmp_path) as (_, settings):
        url = f"ws://127.0.0.1:{settings['socket_port']}/control"
        process = await asyncio.create_subprocess_exec(
            node, "--experimental-websocket", "-e", script, url, stdout=asyncio.subprocess.PIPE
        )
        async with asyncio.timeout(WAIT_S):
            said, _ = await process.communicate()
    assert said.decode().split("\n") == ["v1.robot", "at 4", "true", ""]
