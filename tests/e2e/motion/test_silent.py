"""A robot that says nothing any more, or is cut off, under a hand that drives it."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import pytest
from playwright.async_api import Page

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import WAIT_S, until, until_text
from tests.e2e.motion.driving import PUSH_S, fresh, push_until
from tests.e2e.processes import UrcProcess

pytestmark = pytest.mark.anyio

EVERY_S = 0.05
PROFILE = r"""
urc: 1
kind: robot
name: cart
title: Cart
transports:
  wire:
    { type: tcp, host: 127.0.0.1, port: PORT, stale_after: 1s,
      framing: { type: delimiter, tx: LF, rx: LF } }
signals: { volts: { type: number, unit: V } }
messages: { says: { from: wire, regex: '^V (?P<volts>[\d.]+)$' } }
commands:
  drive:
    send: "drive {{ x | round(2) }}"
    args: { x: { type: number, min: -1, max: 1, default: 0 } }
    hold: { repeat: 50ms, lease: 1s, release: { x: 0 } }
widgets:
  stick: { use: joystick, bind: { moved: drive }, options: { axes: x } }
interfaces: { default: { grid: stick } }
"""
STICK, NOTE = ".joystick-pad", ".joystick-note"


class Cart:
    """It says its voltage all the time, until the test mutes it."""

    def __init__(self) -> None:
        self.is_mute = False
        self.said: list[bytes] = []
        self.lines: set[asyncio.StreamWriter] = set()

    async def talk(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one line."""
        self.lines.add(writer)
        telling = asyncio.create_task(self._tell(writer))
        with suppress(ConnectionError):
            while line := await reader.readline():
                self.said.append(line)
        telling.cancel()
        self.lines.discard(writer)
        writer.close()

    async def _tell(self, writer: asyncio.StreamWriter) -> None:
        while True:
            if not self.is_mute:
                writer.write(b"V 12.5\n")
            await asyncio.sleep(EVERY_S)

    def is_driven(self) -> bool:
        """Return whether it was told to move just now."""
        return bool(self.said) and self.said[-1] not in (b"drive 0\n", b"drive 0.0\n")


async def mute_while_driven(page: Page, robot: Cart) -> None:
    """Drive the robot and mute it; do both again if a busy machine has ended the gesture before."""
    end_s = asyncio.get_running_loop().time() + WAIT_S
    while True:
        await push_until(robot.is_driven, page, STICK)
        robot.is_mute = True
        await until_text(page, "[data-badge-text]", "Robot silent")
        is_driven = robot.is_driven()
        try:
            async with asyncio.timeout(PUSH_S):
                await until_text(page, NOTE, "◆ Lost contact while driving")
            return
        except TimeoutError:
            assert not is_driven, "the stick does not say why the robot has stopped"
            assert asyncio.get_running_loop().time() < end_s, "no push held until the silence"
            robot.is_mute = False
            await page.mouse.up()
            await until_text(page, "[data-badge-text]", "Live")


@asynccontextmanager
async def cart(
    urc_process: Callable[..., UrcProcess], folder: Path
) -> AsyncIterator[tuple[Cart, asyncio.Server, str]]:
    """Serve a cart; give it, its door and its page."""
    robot = Cart()
    door = await asyncio.start_server(robot.talk, "127.0.0.1", 0)
    file = folder / "cart.yaml"
    file.write_text(PROFILE.replace("PORT", str(door.sockets[0].getsockname()[1])), "utf-8")
    try:
        process = urc_process("serve", str(file), "--port", "0")
        address = (await process.wait_for_async(r"(http://\S+)"))[1]
        yield robot, door, f"{address}robots/cart/"
    finally:
        door.close()
        for line in list(robot.lines):
            line.transport.abort()
        await until(lambda: not robot.lines)


async def test_a_robot_that_falls_silent_is_told_on_the_badge_and_on_the_stick(
    urc_process: Callable[..., UrcProcess], tmp_path: Path, new_page: PageMaker
) -> None:
    """The guard resets the line of a silent robot, and the stick says so while it is held.

    Then all is as before.
    """
    async with cart(urc_process, tmp_path) as (robot, _, address):
        page = await fresh(new_page)
        await page.goto(address)
        await until_text(page, "[data-badge-text]", "Live")
        await mute_while_driven(page, robot)
        robot.is_mute = False
        await until_text(page, "[data-badge-text]", "Live")
        await until_text(page, NOTE, "◆ Lost contact while driving")
        await page.mouse.up()
        await push_until(robot.is_driven, page, STICK)
        await page.mouse.up()


async def test_a_robot_that_is_lost_is_the_reason_that_the_stick_gives(
    urc_process: Callable[..., UrcProcess], tmp_path: Path, new_page: PageMaker
) -> None:
    """Not that it is to be let go, which would not help."""
    async with cart(urc_process, tmp_path) as (robot, door, address):
        page = await fresh(new_page)
        await page.goto(address)
        await until_text(page, "[data-badge-text]", "Live")
        await push_until(robot.is_driven, page, STICK)
        door.close()
        for line in list(robot.lines):
            line.transport.abort()
        await until_text(page, "[data-badge-text]", "Robot lost")
        await until_text(page, "[data-badge-trip]", "")
        await page.wait_for_function(
            "() => /Lost contact while driving|the robot is not connected/"
            f".test(document.querySelector('{NOTE}').textContent)"
        )
        await page.mouse.up()
