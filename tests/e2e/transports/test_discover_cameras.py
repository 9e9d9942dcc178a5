"""`urc discover --cameras`: cameras that another implementation of WS-Discovery announces."""

import asyncio
import json
import os
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest

from tests.e2e.robots.lan import Lan, lan

pytestmark = pytest.mark.anyio

WAIT_S = 30.0
PUBLISHER = Path(__file__).with_name("onvif_publisher.py")
ADDRESS = "http://192.168.10.1:8000/onvif/device_service"


@asynccontextmanager
async def camera(network: Lan, *words: str) -> AsyncIterator[None]:
    """Announce a camera on the robot's machine."""
    process = await asyncio.create_subprocess_exec(
        *network.robot,
        *(sys.executable, str(PUBLISHER), *words),
        stdout=asyncio.subprocess.PIPE,
        start_new_session=True,
    )
    try:
        assert process.stdout
        async with asyncio.timeout(WAIT_S):
            assert await process.stdout.readline() == b"published\n"
        yield
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        await process.wait()


async def discover(network: Lan, *words: str) -> tuple[int, list[dict[str, object]]]:
    """Run `urc discover` on the other machine; return its exit code and its rows."""
    process = await asyncio.create_subprocess_exec(
        *network.client,
        *(sys.executable, "-m", "urc.cli.main", "discover", "--json", "--for", "1s", *words),
        stdout=asyncio.subprocess.PIPE,
    )
    said, _ = await asyncio.wait_for(process.communicate(), WAIT_S)
    assert process.returncode is not None
    return process.returncode, [json.loads(line) for line in said.splitlines()]


async def test_a_camera_is_found_with_its_name_and_its_service() -> None:
    async with (
        lan(f"urcv{os.getpid() % 10**6}") as network,
        camera(network, "Front door", "D7", ADDRESS),
    ):
        _, rows = await discover(network, "--cameras")
        assert [row for row in rows if row["found"] == "camera"] == [
            {
                "found": "camera",
                "place": "192.168.10.1:8000",
                "what": "Front door D7 (/onvif/device_service)",
                "host": "192.168.10.1",
                "port": 8000,
                "path": "/onvif/device_service",
                "name": "Front door D7",
            }
        ]
        _, rows = await discover(network)
        assert "camera" not in {row["found"] for row in rows}, "only on request"
