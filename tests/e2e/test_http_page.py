"""The rover of docs/how-to/http-robot.md, on the web server of Python's standard library."""

import asyncio
import json
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from tests.documentation import ROOT, blocks
from tests.e2e.dashboards import until
from urc import connect
from urc.client import CommandFailed

pytestmark = pytest.mark.anyio

PAGE = ROOT / "docs" / "how-to" / "http-robot.md"
KEY = "k3y"
WAIT_S = 30


class Rover(ThreadingHTTPServer):
    """The robot of the sheet on the page: its state, and all that it was told."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Handler)
        self.speed = 0.0
        self.is_docked = False
        self.told: list[tuple[str, Any]] = []

    def answer(self, request: str, body: bytes) -> tuple[int, object]:
        """Return the status and the JSON of a response, as in the table of the page."""
        if request == "GET /api/state":
            return 200, {"battery": 87, "motion": {"speed": self.speed}, "bumper": False}
        said = json.loads(body) if body else None
        self.told.append((request, said))
        if request == "PUT /api/drive":
            if self.is_docked:
                return 409, {"error": "docked"}
            self.speed = said["forward"]
            return 204, None
        if request == "POST /api/halt":
            self.speed = 0.0
            return 204, None
        if request == "POST /api/horn":
            return 409, {"error": "no horn"}
        return 404, None


class Handler(BaseHTTPRequestHandler):
    """One request to the rover."""

    protocol_version = "HTTP/1.1"
    server: Rover

    def do(self) -> None:
        """Answer any request that has the key."""
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        status, said = 401, None
        if self.headers.get("X-Api-Key") == KEY:
            status, said = self.server.answer(f"{self.command} {self.path}", body)
        data = b"" if said is None else json.dumps(said).encode()
        self.send_response(status)
        if status != 204:
            self.send_header("Content-Type", "application/json")
            self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    do_GET = do_PUT = do_POST = do  # noqa: N815 - the names that http.server looks for

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing."""


@pytest.fixture
def rover() -> Iterator[Rover]:
    """A rover that listens."""
    with Rover() as server:
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@pytest.fixture
def profile(tmp_path: Path) -> Path:
    """The profile of the page."""
    [text] = [one.text for one in blocks(PAGE) if one.text.startswith("urc: 1\n")]
    file = tmp_path / "web-rover.yaml"
    file.write_text(text, "utf-8")
    return file


async def test_a_robot_with_a_web_server_is_read_and_driven(profile: Path, rover: Rover) -> None:
    """Its state is read with the key, a held drive is a request, and its release is the last."""
    async with asyncio.timeout(WAIT_S), connect(profile, port=rover.server_port, key=KEY) as robot:
        assert (await robot.wait_for("battery")).value == 87
        async with robot.drive() as stick:
            while rover.speed != 0.25:
                stick(forward=0.25, turn=0.5)
                await asyncio.sleep(0.05)
        assert ("PUT /api/drive", {"forward": 0.25, "turn": 0.5}) in rover.told
        await until(lambda: rover.told[-1] == ("PUT /api/drive", {"forward": 0, "turn": 0}))
        count = len(rover.told)
        await asyncio.sleep(0.5)
        last = ("PUT /api/drive", {"forward": 0, "turn": 0})
        assert all(one == last for one in rover.told[count - 1 :])
        assert rover.speed == 0


async def test_the_robots_reason_for_a_refusal_is_told(profile: Path, rover: Rover) -> None:
    """And STOP sends its own stop."""
    async with asyncio.timeout(WAIT_S), connect(profile, port=rover.server_port, key=KEY) as robot:
        await robot.wait_for("battery")
        with pytest.raises(CommandFailed, match="Refused: no horn"):
            await robot.command("horn")
        rover.told.clear()
        await robot.stop()
        await until(lambda: ("POST /api/halt", None) in rover.told)


async def test_a_wrong_key_is_told(profile: Path, rover: Rover) -> None:
    """A robot that refuses all requests is not driven."""
    async with asyncio.timeout(WAIT_S), connect(profile, port=rover.server_port, key="x") as robot:
        with pytest.raises(CommandFailed, match="401"):
            await robot.command("horn")
    assert rover.told == []
