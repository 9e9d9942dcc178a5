"""`urc send` as people run it: real processes, real sockets."""

import asyncio
import json
import os
import socket
import subprocess
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

import pytest
from websockets.asyncio.client import connect

from tests.e2e.command_line import run
from tests.e2e.keys import headers_for
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess
from tests.e2e.shy_bridge import shy_bridge

pytestmark = pytest.mark.anyio
Start = Callable[..., UrcProcess]

ROVER = """\
urc: 1
kind: robot
name: rover
settings:
  port: { type: port, default: 9090 }
transports:
  ros: { type: ros, host: 127.0.0.1, port: "{{ settings.port }}" }
commands:
  goal:
    moves: true
    args: { x: { type: number, unit: m } }
    send:
      publish:
        topic: /goal
        type: geometry_msgs/Point
        json: { x: "{{ x }}" }
"""


async def send(*words: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    """Run `urc send` to its end, while the test plays the robot."""
    return await asyncio.to_thread(run, "send", *words, **environment)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data folder of the test's own."""
    return tmp_path / "data"


# -- what is published arrives


@pytest.mark.parametrize("has_rosapi", [True, False])
async def test_what_is_published_has_arrived_when_send_says_so(
    has_rosapi: bool, tmp_path: Path, data: Path
) -> None:
    """The bridge keeps a first message until somebody listens, and only while we are there."""
    rover = tmp_path / "rover.yaml"
    rover.write_text(ROVER, encoding="utf-8")
    async with shy_bridge("/goal", has_rosapi=has_rosapi) as bridge:
        port = f"port={bridge.port}"
        done = await send(str(rover), "goal", "x=2", "--set", port, URC_DATA_DIR=str(data))
    assert (done.returncode, done.stderr) == (0, "")
    assert bridge.arrived == [("/goal", {"x": 2})]


async def test_what_is_published_to_nobody_is_no_success(tmp_path: Path, data: Path) -> None:
    """A misspelled topic is told as such."""
    rover = tmp_path / "rover.yaml"
    rover.write_text(ROVER, encoding="utf-8")
    async with shy_bridge("/other") as bridge:
        port = f"port={bridge.port}"
        done = await send(str(rover), "goal", "x=2", "--set", port, URC_DATA_DIR=str(data))
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == "urc send: goal was sent, but nothing subscribes to /goal\n"


# -- sequences


TWO_LINES = """\
urc: 1
kind: robot
name: tandem
settings:
  near: { type: port }
  far: { type: port }
transports:
  near:
    type: tcp
    host: 127.0.0.1
    port: "{{ settings.near }}"
    framing: { type: delimiter, tx: LF, rx: LF }
  far:
    type: tcp
    host: 127.0.0.1
    port: "{{ settings.far }}"
    framing: { type: delimiter, tx: LF, rx: LF }
commands:
  wake: { to: near, send: wake, reply: { equals: awake } }
  lamp: { to: far, send: lamp, reply: { equals: lit } }
sequences:
  begin: [{ run: wake }, { run: lamp }]
"""


async def test_a_sequence_over_two_lines_that_are_not_there_names_both(tmp_path: Path) -> None:
    """It names no line of its own: those of what it runs count."""
    tandem = tmp_path / "tandem.yaml"
    tandem.write_text(TWO_LINES, encoding="utf-8")
    near, far = free_port(), free_port()
    done = await send(str(tandem), "begin", "--set", f"near={near}", "--set", f"far={far}")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        "urc send: begin failed (disconnected): the robot is not connected:"
        f" nothing listens on 127.0.0.1:{near} (connection refused);"
        f" nothing listens on 127.0.0.1:{far} (connection refused)\n"
    )


# -- what moves: STOP, whoever drives, and how long it is held

HELD = """\
urc: 1
kind: robot
name: cart
settings:
  port: { type: port }
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: "{{ settings.port }}"
    framing: { type: delimiter, tx: LF, rx: LF }
commands:
  drive:
    args: { speed: { type: number, min: -1, max: 1, default: 0 } }
    send: "drive {{ speed }}"
    hold: { repeat: 50ms, release: { speed: 0 }, watchdog: none }
  go: { send: go, moves: true }
  beep: { send: beep }
  halt: { send: halt, stop: true }
"""


class Cart:
    """A robot that only listens: the lines it was sent, in order."""

    def __init__(self) -> None:
        self.port = 0
        self.heard: list[str] = []
        self._changed = asyncio.Event()

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Keep what comes until the client is gone."""
        while line := await reader.readline():
            self.heard.append(line.decode().strip())
            self._changed.set()
        writer.close()

    async def hears(self, line: str) -> None:
        """Return when that is the newest line."""
        async with asyncio.timeout(30):
            while self.heard[-1:] != [line]:
                self._changed.clear()
                await self._changed.wait()


@pytest.fixture
async def cart() -> AsyncIterator[Cart]:
    """One that is there."""
    robot = Cart()
    async with await asyncio.start_server(robot.serve, "127.0.0.1", 0) as server:
        robot.port = server.sockets[0].getsockname()[1]
        yield robot


@pytest.fixture
def profile(tmp_path: Path, cart: Cart) -> str:
    """Its file."""
    file = tmp_path / "cart.yaml"
    file.write_text(HELD.replace("type: port", f"type: port, default: {cart.port}"), "utf-8")
    return str(file)


def latch(data: Path, by: str) -> None:
    """Keep a stop as a server does."""
    file = data / "latches" / "cart.latch.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps({"epoch": 1, "latched_by": by, "owed": False}), "utf-8")


async def test_a_latched_stop_holds_what_is_sent(profile: str, cart: Cart, data: Path) -> None:
    """Also while no server runs: what moves is refused, all else is sent."""
    latch(data, "screen 1")
    place = ("--data-dir", str(data))
    done = await send(profile, "go", *place)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        "urc send: go failed (not-allowed): STOP was latched by screen 1, before a restart:"
        " reset it first; --despite-stop overrides this\n"
    )
    done = await send(profile, "drive", "speed=1", "--hold", "200ms", *place)
    assert (done.returncode, done.stdout) == (1, "")
    assert "drive failed (refused): STOP was latched" in done.stderr
    for command in ("beep", "halt"):
        assert (await send(profile, command, *place)).returncode == 0
    assert cart.heard == ["beep", "halt"]
    done = await send(profile, "go", "--despite-stop", *place)
    assert (done.returncode, done.stderr) == (0, "")
    assert cart.heard == ["beep", "halt", "go"]


async def test_whoever_drives_on_a_running_server_is_not_driven_against(
    profile: str, cart: Cart, data: Path, urc_process: Start
) -> None:
    """Nor is a stop that is latched there; a stop is sent whoever drives."""
    place = ("--data-dir", str(data))
    server = urc_process("serve", profile, "--port", "0", *place)
    url = (await server.wait_for_async(r"dashboard (http://\S+)"))[1]
    assert (await send(profile, "go", *place)).returncode == 0
    address = urlsplit(url).netloc
    async with connect(
        f"ws://{address}/ws?robot=cart",
        origin=f"http://{address}",
        additional_headers=headers_for(url),
    ) as screen:
        await screen.send(json.dumps({"t": "drive", "verb": "take"}))
        async for said in screen:
            lease = json.loads(said)
            if lease["t"] == "lease" and lease["holder"]:
                break
        done = await send(profile, "go", *place)
        assert (done.returncode, done.stdout) == (1, "")
        assert done.stderr.startswith(
            f"urc send: go failed (not-allowed): screen 1 is driving the robot on http://{address}"
        )
        assert (await send(profile, "halt", *place)).returncode == 0
    server.interrupt()
    assert (await send(profile, "go", *place)).returncode == 0
    assert [line for line in cart.heard if not line.startswith("drive")] == ["go", "halt", "go"]


async def test_a_server_that_was_killed_hinders_nothing(
    profile: str, cart: Cart, data: Path, urc_process: Start
) -> None:
    """Its note stays behind, and is removed."""
    server = urc_process("serve", profile, "--port", "0", "--data-dir", str(data))
    await server.wait_for_async(r"dashboard http://\S+")
    (note,) = (data / "servers").glob("*.json")
    assert note.stat().st_mode & 0o777 == 0o600
    server.kill()
    done = await send(profile, "go", "--data-dir", str(data))
    assert (done.returncode, done.stderr) == (0, "")
    assert cart.heard == ["go"]
    assert not note.exists()


async def test_a_server_that_hangs_lets_nothing_move_but_every_stop(
    profile: str, cart: Cart, data: Path
) -> None:
    """Nobody knows who drives; a stop does not ask."""
    with socket.create_server(("127.0.0.1", 0)) as hanging:
        address = f"http://127.0.0.1:{hanging.getsockname()[1]}/"
        note = data / "servers" / "hanging.json"
        note.parent.mkdir(parents=True)
        note.write_text(json.dumps({"address": address, "key": "k" * 40, "pid": os.getpid()}))
        done = await send(profile, "go", "--data-dir", str(data))
        assert (done.returncode, done.stdout) == (1, "")
        assert f"the server at {address} does not report the operator of the robot" in done.stderr
        assert (await send(profile, "halt", "--data-dir", str(data))).returncode == 0
    assert cart.heard == ["halt"]


async def test_a_stop_of_a_running_server_is_told_with_its_address(
    profile: str, cart: Cart, data: Path, urc_process: Start
) -> None:
    """That is where it is reset."""
    place = ("--data-dir", str(data))
    server = urc_process("serve", profile, "--port", "0", *place)
    url = (await server.wait_for_async(r"dashboard (http://\S+)"))[1]
    place_of_stop = f"{url}api/v1/robots/cart/stop"
    stop = Request(place_of_stop, method="POST", headers=headers_for(url))  # noqa: S310
    await asyncio.to_thread(lambda: urlopen(stop, timeout=30).close())  # noqa: S310
    done = await send(profile, "go", *place)
    assert (done.returncode, done.stdout) == (1, "")
    assert "STOP was latched by " in done.stderr
    assert f"reset it first on {url}" in done.stderr
    assert "go" not in cart.heard


async def test_a_held_command_is_held_for_as_long_as_is_said(
    profile: str, cart: Cart, data: Path
) -> None:
    """Then it is released, and its stop is out when it ends."""
    began = time.monotonic()
    done = await send(profile, "drive", "speed=0.5", "--hold", "600ms", "--data-dir", str(data))
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout) == {"command": "drive", "values": {}}
    assert time.monotonic() - began > 0.6
    moved = cart.heard.count("drive 0.5")
    assert moved > 1
    assert set(cart.heard[:moved]) == {"drive 0.5"}
    assert set(cart.heard[moved:]) == {"drive 0"}


async def test_a_held_command_whose_giver_is_killed_ends_in_a_stop(
    profile: str, cart: Cart, data: Path, urc_process: Start
) -> None:
    """The guard gives it; nobody is left who could."""
    words = ("drive", "speed=1", "--hold", "60s", "--data-dir", str(data))
    held = urc_process("send", profile, *words)
    await cart.hears("drive 1")
    held.kill()
    await cart.hears("drive 0")


async def test_a_stop_that_is_pressed_meanwhile_ends_what_is_held(
    profile: str, cart: Cart, data: Path, urc_process: Start
) -> None:
    """On whatever screen: the latch in the data folder counts."""
    words = ("drive", "speed=1", "--hold", "60s", "--data-dir", str(data))
    held = urc_process("send", profile, *words)
    await cart.hears("drive 1")
    latch(data, "screen 7")
    assert await held.wait_async() == 1
    assert held.errors[-1].startswith(
        "urc send: drive failed (stopped): STOP was latched by screen 7"
    )
    assert cart.heard[-1] == "drive 0"


async def test_how_long_it_is_held_must_be_said(profile: str) -> None:
    """And of what is given once it must not."""
    done = await send(profile, "drive", "speed=1")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (
        "urc send: drive moves the robot while held: add a duration, such as --hold 1s\n"
    )
    done = await send(profile, "beep", "--hold", "1s")
    assert (done.returncode, done.stderr) == (
        2,
        "urc send: beep is not a held command: remove --hold\n",
    )
    done = await send(profile, "drive", "speed=1", "--hold", "2m")
    assert (done.returncode, done.stderr) == (
        2,
        "urc send: --hold is limited to 60s; use a dashboard to drive longer\n",
    )
    done = await send(profile, "drive", "speed=7", "--hold", "1s")
    assert (done.returncode, done.stderr) == (
        2,
        "urc send: drive failed (bad-argument): speed: 7 is above its maximum 1\n",
    )


async def test_a_stop_waits_for_the_login(tmp_path: Path, data: Path) -> None:
    """It comes while the steps of the connection run: every time, from a shell."""
    heard: list[str] = []

    async def login(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"key?\n")
        heard.append((await reader.readline()).decode().strip())
        await asyncio.sleep(0.3)
        writer.write(b"welcome\n")
        while line := await reader.readline():
            heard.append(line.decode().strip())
        writer.close()

    greets = "    on_connect: [{ expect: 'key\\?' }, { send: abc }, { expect: welcome }]\n"
    async with await asyncio.start_server(login, "127.0.0.1", 0) as server:
        file = tmp_path / "cart.yaml"
        file.write_text(HELD.replace("commands:\n", f"{greets}commands:\n", 1), "utf-8")
        port = f"port={server.sockets[0].getsockname()[1]}"
        done = await send(str(file), "halt", "--set", port, "--data-dir", str(data))
    assert (done.returncode, done.stderr) == (0, "")
    assert heard == ["abc", "halt"]
