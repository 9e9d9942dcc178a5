"""The emulated robots, driven by public programs and libraries that know nothing of URC.

Each dialogue is that of the library's own examples; what it reads and does is compared with what
the robot's protocol says, not with what URC says of it.
"""

import asyncio
import json
import os
import re
import shutil
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from importlib.util import find_spec
from pathlib import Path

import pynmea2
import pytest
from gpsdclient.client import GPSDClient
from PIL import Image

from scripts.node import node_executable
from tests.conftest import NO_BUILD
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess
from tests.e2e.robots.emulated import CLIENTS, WAIT_S, ask, emulate, told
from tests.e2e.robots.lan import lan
from tests.e2e.transports.programs import listens, program

pytestmark = pytest.mark.anyio

Start = Callable[..., UrcProcess]
ROS = ("absolem", "generic-ros1", "turtlebot3")


@pytest.mark.needs("netns")
async def test_tello_flies_for_a_tello_library(tmp_path: Path) -> None:
    """tello-asyncio, whose ports are those of the SDK: two machines on a network of their own."""
    async with lan(f"urct{os.getpid() % 10**6}") as network:
        robot = (sys.executable, "-m", "urc.cli.main", "simulate", "robots/tello.yaml")
        where = ("--host", network.robot_address, "--set", "command_port=8889")
        async with program(*network.robot, *robot, *where, "--set", "state_port=8890"):
            await bound(network.robot, 8889)
            found = await ask("tello_flight.py", before=network.client)
    assert 10 < found["battery"] <= 100
    assert found["states"] > 3
    assert len(found["video"]) > 20
    assert set(map(tuple, found["video"])) == {(320, 240)}


async def bound(space: tuple[str, ...], port: int) -> None:
    """Wait until somebody has a UDP port of a network."""
    async with asyncio.timeout(WAIT_S):
        # Another process tells nobody when it is ready.
        while f":{port:04X} " not in await told(*space, "cat", "/proc/net/udp"):  # noqa: ASYNC110
            await asyncio.sleep(0.05)


async def test_roslibpy_drives_what_rosbridge_leads_to(urc_process: Start) -> None:
    """Odometry, battery, laser and services, for ROS 1 and ROS 2."""
    places = []
    for name in ROS:
        ports = ("port", "camera_port") if name == "absolem" else ("port",)
        places.append(f"{name}={(await emulate(urc_process, name, ports))['ros']}")
    found = await ask("rosbridge_drive.py", *places)
    assert list(found) == list(ROS)
    assert all(one["way"] > 0.02 and one["beams"] >= 16 for one in found.values())
    assert 0 < found["generic-ros1"]["battery"] <= 1
    assert found["absolem"]["status"]["emergency_stop_on"] is False
    assert found["turtlebot3"]["power"] is True
    assert {"/odom", "/cmd_vel", "/scan"} <= set(found["turtlebot3"]["topics"])


@pytest.mark.needs("node")
@pytest.mark.needs("roslib")
async def test_roslib_drives_a_turtlebot(urc_process: Start) -> None:
    """The library of web pages."""
    port = (await emulate(urc_process, "turtlebot4"))["ros"]
    node = node_executable()
    assert node
    found = json.loads(await told(node, str(CLIENTS / "turtlebot_drive.mjs"), str(port)))
    assert found["moved"] > 0.02
    assert found["beams"] >= 16


async def test_a_ground_station_drives_the_rover(urc_process: Start) -> None:
    """pymavlink: heartbeats, modes, arming, sticks, all with checksums that it verifies itself."""
    port = (await emulate(urc_process, "ardupilot-rover"))["mav"]
    found = await ask("rover_mission.py", str(port))
    accepted = 0
    assert [found[name] for name in ("manual", "arm", "hold", "disarm")] == [accepted] * 4
    assert (found["type"], found["autopilot"]) == (10, 3), "a rover, by ArduPilot"
    assert found["turned"] > 0.05
    assert 0 < found["battery"] <= 100
    assert found["bad"] == 0


@pytest.mark.skipif(find_spec("dashboard_client") is None, reason=NO_BUILD)
async def test_a_dashboard_client_runs_a_program_of_the_arm(urc_process: Start) -> None:
    """ur_rtde."""
    port = (await emulate(urc_process, "ur-e-series", ("port", "state_port")))["dashboard"]
    found = await ask("arm_dashboard.py", str(port))
    assert found["connected"] is True
    assert "RUNNING" in found["mode"]
    assert "weld.urp" in found["loaded"]
    assert "PLAYING" in found["playing"]
    assert found["running"] is True
    assert "PAUSED" in found["paused"]
    assert "STOPPED" in found["stopped"]
    assert "NORMAL" in found["safety"]
    assert "POWER_OFF" in found["off"]


@pytest.mark.needs("socat")
async def test_pycreate2_drives_a_create(urc_process: Start, tmp_path: Path) -> None:
    """Over a serial line, which socat makes of the port."""
    port = (await emulate(urc_process, "create-2"))["oi"]
    device = tmp_path / "ttyUSB0"
    async with program("socat", f"pty,raw,echo=0,link={device}", f"tcp:127.0.0.1:{port}"):
        await listens(device)
        found = await ask("create_drive.py", str(device))
    assert found["mode"] == 2, "safe"
    assert 0 < found["ticks"] < 32768
    assert 10_000 < found["voltage"] < 18_000
    assert 0 < found["charge"] <= 3000


async def test_a_gpsd_client_follows_the_emulated_gpsd(urc_process: Start) -> None:
    """gpsdclient."""
    port = (await emulate(urc_process, "gpsd"))["daemon"]
    position = await asyncio.to_thread(first_position, port)
    assert position["mode"] == 3
    assert abs(position["lat"] - 46.5) < 1
    assert abs(position["lon"] - 6.5) < 1


def first_position(port: int) -> dict[str, float]:
    """Return the first report of a position."""
    with GPSDClient(port=port, timeout=WAIT_S) as client:
        for report in client.dict_stream(filter=["TPV"]):
            return dict(report)
    raise AssertionError("it ended")


@pytest.mark.needs("gpsd")
async def test_gpsd_and_pynmea2_read_the_emulated_receiver(urc_process: Start) -> None:
    """Check sums, units and all: gpsd makes reports of the sentences."""
    port = (await emulate(urc_process, "nmea-gps"))["serial"]
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    async with asyncio.timeout(WAIT_S):
        lines = [(await reader.readline()).decode("ascii") for _ in range(2)]
    writer.close()
    gga, rmc = (pynmea2.parse(line.strip(), check=True) for line in lines)
    assert (gga.sentence_type, rmc.sentence_type) == ("GGA", "RMC")
    assert rmc.status == "A"
    gpsd, own = shutil.which("gpsd") or "/usr/sbin/gpsd", free_port()
    async with program(gpsd, "-N", "-n", "-S", str(own), f"tcp://127.0.0.1:{port}"):
        await listens(own)
        position = await asyncio.to_thread(first_position, own)
    assert abs(position["lat"] - gga.latitude) < 0.01
    assert abs(position["lon"] - gga.longitude) < 0.01


@pytest.mark.needs("ssh")
@pytest.mark.needs("telnet")
async def test_ssh_and_telnet_reach_the_rover_of_the_thesis(
    urc_process: Start, tmp_path: Path
) -> None:
    """The way of the Yún's manual: a tunnel to its console, and telnet through it."""
    process = urc_process(
        "simulate", "robots/roveo-mini.yaml", "--set", "ssh_port=0", "--set", "password=arduino",
        URC_DATA_DIR=str(tmp_path / "data"),
    )  # fmt: skip
    port = (await process.wait_for_async(r"^listening yun .*?:(\d+)"))[1]
    askpass = tmp_path / "askpass"
    askpass.write_text("#!/bin/sh\necho arduino\n", "ascii")
    askpass.chmod(0o755)
    own = free_port()
    known = ("-o", "StrictHostKeyChecking=no", "-o", "UserKnownHostsFile=/dev/null")
    tunnel = ("ssh", "-F", "/dev/null", *known, "-o", "ExitOnForwardFailure=yes", "-N")
    words = (*tunnel, "-p", port, "-L", f"127.0.0.1:{own}:127.0.0.1:6571", "root@127.0.0.1")
    secret = (f"SSH_ASKPASS={askpass}", "SSH_ASKPASS_REQUIRE=force", "DISPLAY=:0")
    async with program("env", *secret, *words):
        await listens(own)
        async with typed("telnet", "127.0.0.1", str(own)) as (say, until):
            await until(r"BAT \d+")
            say("DRIVE 40 -10\n")
            await until(r"SPEED [1-9]")
            say("DRIVE 0 0\n")
            await until(r"SPEED 0")
            say("STAIRS 1\n")
            await until(r"STAIRS 1")


@asynccontextmanager
async def typed(
    *command: str,
) -> AsyncIterator[tuple[Callable[[str], None], Callable[[str], Awaitable[None]]]]:
    """Run a program that people type at; give what types, and what waits for a line it prints."""
    process = await asyncio.create_subprocess_exec(
        *command, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE
    )
    assert process.stdin
    assert process.stdout
    line_in, line_out = process.stdin, process.stdout

    async def until(pattern: str) -> None:
        async with asyncio.timeout(WAIT_S):
            while not re.search(
                pattern, (line := await line_out.readline()).decode("ascii", "replace")
            ):
                assert line, f"it ended before {pattern!r}"

    try:
        yield lambda text: line_in.write(text.encode("ascii")), until
    finally:
        process.kill()
        await process.wait()


@pytest.mark.needs("ffmpeg")
@pytest.mark.needs("curl")
async def test_ffmpeg_sees_the_emulated_camera(urc_process: Start, tmp_path: Path) -> None:
    """Three pictures of its stream; settings by the addresses of the board's own page."""
    ports = await emulate(urc_process, "esp32-cam", ("port", "stream_port"))
    picture = tmp_path / "%d.png"
    await told(
        "ffmpeg", "-v", "error", "-f", "mpjpeg", "-i", f"http://127.0.0.1:{ports['video']}/stream",
        "-frames:v", "3", str(picture),
    )  # fmt: skip
    for number in (1, 2, 3):
        with Image.open(str(picture).replace("%d", str(number))) as seen:
            assert seen.width >= 160
            assert seen.height >= 120
    web = f"http://127.0.0.1:{ports['web']}"
    await told("curl", "-sf", f"{web}/control?var=quality&val=20")
    assert '"quality"' in (status := await told("curl", "-sf", f"{web}/status"))
    assert "20" in status
