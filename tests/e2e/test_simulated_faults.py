"""Faults on demand over real sockets: given at the start, changed by typed lines, and over HTTP."""

import asyncio
import json
import subprocess
import sys
import time
from asyncio import StreamReader, StreamWriter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import httpx2
import pytest

from tests.e2e.dashboards import until
from urc.config.load import load_profile
from urc.runtime.document_tests import sample_settings
from urc.runtime.registries import built_in_catalog
from urc.simulator.emulated_robot import EmulatedRobot
from urc.simulator.server import serve

ROOT = Path(__file__).parents[2]
PUPPET = str(ROOT / "robots" / "puppet.yaml")
WAIT_S = 20.0
URC = (sys.executable, "-m", "urc.cli.main")
QUESTION = b"Give me the battery %\n"


async def asked(port: int) -> tuple[bytes, float]:
    """Return the answer of the puppet to one question, and how long it took in seconds."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    begin = time.monotonic()
    writer.write(QUESTION)
    async with asyncio.timeout(WAIT_S):
        answer = await reader.readline()
    writer.close()
    return answer, time.monotonic() - begin


@asynccontextmanager
async def running(
    *arguments: str,
) -> AsyncIterator[tuple[StreamWriter, StreamReader, StreamReader]]:
    """Run `urc`; give what is typed, said and complained about. Nothing of it takes for ever."""
    process = await asyncio.create_subprocess_exec(
        *URC,
        *arguments,
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stderr is not None
    try:
        async with asyncio.timeout(WAIT_S):
            yield process.stdin, process.stdout, process.stderr
    finally:
        process.terminate()
        await process.wait()


@pytest.mark.anyio
async def test_faults_are_given_at_the_start_and_changed_by_typed_lines() -> None:
    """The answer is late as told; after `mend` nothing is wrong; nonsense is told in one line."""
    how = ("simulate", PUPPET, "--set", "port=0", "--fault", "delay=400ms")
    async with running(*how) as (typed, said, complaints):
        port = int((await said.readline()).split(b":")[-1])
        answer, took_s = await asked(port)
        assert answer.strip().isdigit()
        assert took_s >= 0.35
        typed.write(b"fault nosie=2x\nmend\n")
        error = await complaints.readline()
        assert error.startswith(b"unknown fault 'nosie'; known faults: delay=200ms, loss=5%")
        assert await said.readline() == b"faults: none\n"
        assert (await asked(port))[0].strip().isdigit()
        typed.write(b"fault silent\n")
        assert await said.readline() == b"faults: silent\n"


@pytest.mark.anyio
async def test_a_dashboard_has_faults_from_the_start_and_by_typed_lines(tmp_path: Path) -> None:
    """`urc serve --simulate`, as `urc demo`: the robot is named, since there may be several."""
    how = ("serve", PUPPET, "--simulate", "--port", "0", "--data-dir", str(tmp_path))
    async with running(*how, "--fault", "puppet:delay=400ms") as (typed, said, complaints):
        assert (await said.readline()).startswith(b"dashboard http://")
        typed.write(b"faults\nfault tello:silent\nmend puppet\n")
        assert await said.readline() == b"faults: delay=400ms\n"
        error = await complaints.readline()
        assert error.startswith(b"no emulated robot has the name 'tello'")
        assert await said.readline() == b"faults: none\n"


def test_an_unknown_fault_is_wrong_use() -> None:
    """One line, before anything listens."""
    done = subprocess.run(
        [*URC, "simulate", PUPPET, "--fault", "noise=2x"],
        cwd=ROOT,
        capture_output=True,
        stdin=subprocess.DEVNULL,
        timeout=WAIT_S,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("urc simulate: --fault: fault noise: this robot has no world")
    assert done.stderr.count("\n") == 1


@pytest.mark.anyio
async def test_a_camera_shows_the_world_and_fails_on_demand() -> None:
    """Two pictures of its stream differ, for the board turns; then there is none, and 503."""
    profile = load_profile(ROOT / "robots" / "esp32-cam.yaml", built_in_catalog())
    settings = sample_settings(profile.settings)
    emulated_robot = EmulatedRobot(profile, settings)
    async with (
        serve(profile, settings, is_anywhere=True, emulated_robot=emulated_robot) as places,
        httpx2.AsyncClient(timeout=WAIT_S) as client,
    ):
        pictures: list[bytes] = []
        stream = f"{places['video'].options['url']}stream"
        async with client.stream("GET", stream) as response:
            data = b""
            async for piece in response.aiter_raw():
                data += piece
                while b"\r\n--picture" in data:
                    whole, _, data = data.partition(b"\r\n--picture")
                    pictures.append(whole.partition(b"\r\n\r\n")[2])
                if len(pictures) > 4:
                    break
        assert pictures[0][:2] == b"\xff\xd8"
        assert pictures[0] != pictures[4]
        status = f"{places['web'].options['url']}status"
        assert (await client.get(status)).json()["framesize"] == 8
        emulated_robot.inject("dropout=frame_size", time.time())
        assert (await client.get(status)).status_code == 503
        emulated_robot.mend()
        emulated_robot.inject("loss=100%", time.time())
        with pytest.raises(httpx2.TransportError):
            await client.get(status)


@pytest.mark.anyio
async def test_what_is_done_with_an_emulated_robot_leaves_the_real_ones_stop_as_it_was(
    tmp_path: Path,
) -> None:
    """Both have one name: who plays with the one must not lift, or make, a stop of the other."""
    tello = str(ROOT / "robots" / "tello.yaml")
    latches = tmp_path / "latches"
    latches.mkdir()
    real = latches / "tello.latch.json"
    real.write_text('{"epoch": 7, "latched_by": "screen 1"}', "utf-8")
    how = ("serve", tello, "--simulate", "--port", "0", "--data-dir", str(tmp_path))
    async with running(*how) as (_, said, _), httpx2.AsyncClient() as page:
        address = (await said.readline()).split()[1].decode().partition("?")[0]
        stopped = await page.post(
            f"{address}api/v1/robots/tello/stop", headers={"Origin": address.rstrip("/")}
        )
        assert stopped.status_code == 200, stopped.text
        await until((latches / "emulated" / "tello.latch.json").exists)
    assert "screen 1" in real.read_text("utf-8")
    assert json.loads(real.read_text("utf-8"))["epoch"] == 7
