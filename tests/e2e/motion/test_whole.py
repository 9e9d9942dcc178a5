"""From finger to socket: `urc serve` with its guard, a real robot's line, and a real browser."""

import asyncio
import json
import re
import signal
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from playwright.async_api import Page

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until, until_text
from tests.e2e.motion.driving import STOP, fresh, push
from tests.e2e.ports import free_port
from tests.e2e.processes import UrcProcess

pytestmark = [pytest.mark.anyio, pytest.mark.alone]

PROFILE = """\
urc: 1
kind: robot
name: rover
title: Rover
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: PORT
    framing: { type: delimiter, tx: LF, rx: LF }
commands:
  drive:
    send: "V {{ speed }} {{ turn }}"
    args:
      speed: { type: integer, min: -100, max: 100, default: 0 }
      turn: { type: number, min: -1, max: 1, default: 0 }
    hold: { repeat: 50ms, lease: 1s, release: { speed: 0, turn: 0 }, watchdog: 2s }
widgets:
  stick:
    use: joystick
    bind: { moved: { command: drive, args: { x: speed, y: turn } } }
interfaces:
  default: { grid: stick }
"""
STOPPED = "V 0 0"


class Rover:
    """A robot that keeps each line it is sent."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._writers: set[asyncio.StreamWriter] = set()
        self._server: asyncio.Server | None = None
        self._port = free_port()

    async def talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one connection."""
        self._writers.add(writer)
        try:
            while line := await reader.readline():
                self.lines.append(line.decode().strip())
        except ConnectionError:
            pass
        finally:
            self._writers.discard(writer)
            writer.close()

    async def come(self) -> int:
        """Listen, each time on the same port; return it."""
        self._server = await asyncio.start_server(self.talk, "127.0.0.1", self._port)
        return self._port

    async def leave(self) -> None:
        """Hang up, and listen no more."""
        assert self._server is not None
        self._server.close()
        for writer in tuple(self._writers):
            writer.transport.abort()

    @property
    def is_moving(self) -> bool:
        """Whether the newest line is motion."""
        return bool(self.lines) and self.lines[-1] != STOPPED

    async def until_stopped(self) -> None:
        """Wait until the newest line is the stop."""
        await until(lambda: bool(self.lines) and not self.is_moving)


@asynccontextmanager
async def rover(tmp_path: Path) -> AsyncIterator[tuple[Rover, str]]:
    """Let a robot listen; give it and its profile."""
    robot = Rover()
    port = await robot.come()
    file = tmp_path / "rover.yaml"
    file.write_text(PROFILE.replace("PORT", str(port)), encoding="utf-8")
    try:
        yield robot, str(file)
    finally:
        await robot.leave()


Start = Callable[..., UrcProcess]


async def serve(start: Start, file: str, tmp_path: Path) -> tuple[UrcProcess, str]:
    """Start the dashboard; give it and the address of the robot's page."""
    process = start("serve", file, "--port", "0", "--data-dir", str(tmp_path / "data"))
    found = await process.wait_for_async(r"dashboard (http://\S+)")
    return process, f"{found[1]}robots/rover/"


async def ready(page: Page, address: str) -> None:
    """Open the page and wait until it can be driven: its robot is there, and the stick is free."""
    await page.goto(address)
    await page.wait_for_selector("[data-badge][data-state='good']")
    await page.wait_for_selector(".joystick[data-phase='idle']")


async def test_a_finger_moves_the_robot_and_letting_go_stops_it(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """Scaled to the arguments' ranges, at the declared rate at most, and then silence."""
    async with rover(tmp_path) as (robot, file):
        _, address = await serve(urc_process, file, tmp_path)
        page = await fresh(new_page)
        await ready(page, address)
        began_s = time.monotonic()
        await push(page, ".joystick-pad", right=30, up=60)
        await until(lambda: robot.is_moving)
        await asyncio.sleep(1)
        await page.mouse.up()
        await robot.until_stopped()
        took_s = time.monotonic() - began_s
        moving = [line for line in robot.lines if line != STOPPED]
        assert re.fullmatch(r"V [1-9]\d* -0\.\d+", moving[-1]), "forward, and to the right"
        assert len(moving) <= took_s / 0.05 + 2
        count = len(robot.lines)
        await asyncio.sleep(1)
        assert len(robot.lines) == count


async def test_a_tab_that_is_closed_stops_the_robot(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """Its socket is gone, and so is the motion."""
    async with rover(tmp_path) as (robot, file):
        _, address = await serve(urc_process, file, tmp_path)
        page = await fresh(new_page)
        await ready(page, address)
        await push(page, ".joystick-pad")
        await until(lambda: robot.is_moving)
        await page.close()
        await robot.until_stopped()


async def test_a_server_that_is_killed_stops_the_robot_and_keeps_the_latch(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """Its guard stops what moves; a stop that was latched before is latched afterwards."""
    async with rover(tmp_path) as (robot, file):
        process, address = await serve(urc_process, file, tmp_path)
        page = await fresh(new_page)
        await ready(page, address)
        await push(page, ".joystick-pad")
        await until(lambda: robot.is_moving)
        process.kill()
        await robot.until_stopped()
        await page.mouse.up()

        process, address = await serve(urc_process, file, tmp_path)
        await ready(page, address)
        await page.click(STOP)
        await until_text(page, "[data-stop-note]", "✓ sent ✓ confirmed ✓ latched")
        kept = tmp_path / "data" / "latches" / "rover.latch.json"
        await until(lambda: kept.exists() and json.loads(kept.read_text())["latched_by"] != "")
        process.kill()

        process, address = await serve(urc_process, file, tmp_path)
        await page.goto(address)
        await page.wait_for_function(
            "() => document.querySelector('[data-latched-text]').textContent.includes('Stopped by')"
        )
        count = len(robot.lines)
        await push(page, ".joystick-pad")
        await asyncio.sleep(0.4)
        assert not [line for line in robot.lines[count:] if line != STOPPED]
        assert process.end(signal.SIGTERM) == 0


async def test_a_stop_by_request_reaches_a_robot_that_nobody_looks_at(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """URC connects to it for that, and says whether it was reached."""
    async with rover(tmp_path) as (robot, file):
        _, address = await serve(urc_process, file, tmp_path)
        page = await fresh(new_page)
        await page.goto(address.split("/robots/")[0])
        said = {"confirmed": False}
        while not said["confirmed"]:  # it waits two seconds at most, a busy machine needs more
            said = await page.evaluate(
                "fetch('/api/v1/robots/rover/stop', { method: 'POST' }).then((said) => said.json())"
            )
            assert said["latched"] == "a screen on this machine"
        await until(lambda: bool(robot.lines))  # "confirmed": its line has taken it
        assert set(robot.lines) == {STOPPED}
        new_page.allow(page, lambda text: "404" in text)
        refused = await page.evaluate(
            "fetch('/api/v1/robots/nobody/stop', { method: 'POST' }).then((said) => said.text())"
        )
        assert "unknown-robot" in refused


async def test_a_stop_while_the_robot_is_away_is_the_first_thing_that_it_hears(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """Latched at once, NO LINK meanwhile, confirmed when its line has taken it."""
    async with rover(tmp_path) as (robot, file):
        _, address = await serve(urc_process, file, tmp_path)
        page = await fresh(new_page)
        await ready(page, address)
        await robot.leave()
        await until_text(page, "[data-stop-note]", "▲ NO LINK")
        await page.click(STOP)
        await until_text(page, "[data-stop-note]", "▲ NO LINK, latched")
        assert robot.lines == []
        await robot.come()
        await until_text(page, "[data-stop-note]", "✓ sent ✓ confirmed ✓ latched")
        await until(lambda: bool(robot.lines))
        assert robot.lines == [STOPPED]
