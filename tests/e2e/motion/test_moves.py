"""What moves by itself, and sequences: a real page, and what is on the wire after STOP."""

import asyncio
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import WAIT_S, until, until_text
from tests.e2e.motion.driving import STOP, fresh
from urc.config.load import load_profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session
from urc.testing.entry import ACCESS
from urc.web.app import DashboardOptions, Robot, build_app, serve

pytestmark = pytest.mark.anyio

PROFILE = """\
urc: 1
kind: robot
name: arm
title: Arm
transports:
  wire:
    type: tcp
    host: 127.0.0.1
    port: PORT
    framing: { type: delimiter, tx: LF, rx: LF }
commands:
  fold: { title: Fold, send: FOLD, moves: true }
  beep: { title: Beep, send: BEEP }
sequences:
  show:
    title: Show
    moves: true
    steps: [{ send: A }, { wait: 1s }, { send: B }, { wait: 1s }, { send: C }]
widgets:
  fold: { use: button, bind: { press: fold } }
  beep: { use: button, bind: { press: beep } }
  show: { use: button, bind: { press: show } }
interfaces:
  default: { grid: fold beep show }
"""
FOLD, BEEP, SHOW = (f"[data-cell='{place}'] .button-main" for place in range(3))
LOCKED = "◆ Reset STOP first."
WATCHES = "◆ this page only watches"


def note(place: int) -> str:
    """Return where the button in a cell says why it cannot be pressed, and what came of it."""
    return f"[data-cell='{place}'] .button-note"


@asynccontextmanager
async def served(folder: Path, profile: str = PROFILE) -> AsyncIterator[tuple[list[str], str]]:
    """Serve an arm; give the lines that it hears, and the address of its page."""
    heard: list[str] = []

    async def listen(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while line := await reader.readline():
            heard.append(line.decode().strip())
        writer.close()

    arm = await asyncio.start_server(listen, "127.0.0.1", 0)
    file = folder / "arm.yaml"
    file.write_text(profile.replace("PORT", str(arm.sockets[0].getsockname()[1])), "utf-8")
    catalog = built_in_catalog()
    known = load_profile(file, catalog)
    robot = Robot(known, {}, lambda: Session(known, {}, catalog.transports, motion="here"))
    ready: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    app = build_app({"arm": robot}, DashboardOptions(access=ACCESS, linger_s=0.2))
    task = asyncio.create_task(serve(app, port=0, on_ready=ready.set_result))
    try:
        async with asyncio.timeout(WAIT_S):
            yield heard, f"{await ready}robots/arm/"
    finally:
        task.cancel()
        await asyncio.wait((task,), timeout=WAIT_S)
        arm.close()


async def opened(new_page: PageMaker, address: str) -> Page:
    """Open a page, and wait until its robot is there."""
    page = await fresh(new_page)
    await page.goto(address)
    await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
    await expect(page.locator("[data-who]")).to_contain_text(re.compile("No one drives"))
    return page


async def test_stop_holds_back_what_moves_by_itself_and_ends_sequences(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """Nothing of it is on the wire after the stop; other commands are given all the same."""
    async with served(tmp_path) as (heard, address):
        page = await opened(new_page, address)
        await page.click(FOLD)
        await until(lambda: heard == ["FOLD"])
        await page.click(SHOW)
        await until(lambda: heard == ["FOLD", "A"])
        await page.click(STOP)
        await until_text(page, "[data-stop-note]", "✓ sent ✓ latched")
        before = list(heard)  # the next step, B, may have come before the stop
        assert "C" not in before
        await expect(page.locator(note(0))).to_have_text(LOCKED)
        await expect(page.locator(note(2))).to_contain_text("Reset STOP first")
        await page.click(FOLD, force=True)
        await page.click(BEEP)
        await until(lambda: "BEEP" in heard)
        await asyncio.sleep(1.2)  # longer than it would have taken to the next step
        assert heard == [*before, "BEEP"]
        await page.click("[data-verb='reset']")
        await expect(page.locator(note(0))).not_to_have_text(LOCKED)
        await page.click(FOLD)
        await until(lambda: heard[-1] == "FOLD")


async def test_a_page_that_only_watches_gives_nothing_and_says_so(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """Not even what does not move; it stops."""
    async with served(tmp_path) as (heard, address):
        page = await opened(new_page, f"{address}?watch")
        for place, button in enumerate((FOLD, BEEP, SHOW)):
            await expect(page.locator(note(place))).to_have_text(WATCHES)
            await page.click(button, force=True)
        await page.keyboard.press("Escape")
        await until_text(page, "[data-stop-note]", "✓ sent ✓ latched")
        assert heard == []


async def test_what_moves_by_itself_is_locked_while_another_screen_drives(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """As a stick is, with the same words."""
    async with served(tmp_path) as (heard, address):
        first, second = await opened(new_page, address), await opened(new_page, address)
        await first.click("[data-verb='take']")
        await expect(second.locator(note(0))).to_have_text("◆ screen 1 has the controls")
        await second.click(FOLD, force=True)
        await second.click(BEEP)
        await until(lambda: heard == ["BEEP"])
        await first.click(FOLD)
        await until(lambda: heard == ["BEEP", "FOLD"])


async def test_stop_gives_the_stop_of_the_robot_past_what_waits(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """An answer that does not come holds nothing up; and once more at the next press."""
    halt, ask = "  halt: { send: HALT, stop: true }", "  ask: { send: ASK, reply: { equals: OK } }"
    profile = PROFILE.replace("sequences:", f"{halt}\n{ask}\nsequences:")
    profile = profile.replace("press: beep", "press: ask")
    async with served(tmp_path, profile) as (heard, address):
        page = await opened(new_page, address)
        await page.click(BEEP)
        await until(lambda: heard == ["ASK"])
        await page.click(FOLD)  # it waits behind the answer
        await page.keyboard.press("Escape")
        await until_text(page, "[data-stop-note]", "✓ sent ✓ confirmed ✓ latched")
        # A page that hears late that it stopped says so twice, and the robot stops twice.
        assert heard in (["ASK", "HALT"], ["ASK", "HALT", "HALT"])
        before = len(heard)
        await page.click(STOP)
        await expect(page.locator(note(0))).to_contain_text("▲ Stopped by screen 1")
        await until(lambda: len(heard) > before)
        assert set(heard[before:]) == {"HALT"}


async def test_a_choice_that_moves_is_refused_after_stop_and_one_that_ends_motion_is_given(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """The list stays free: what is chosen decides, and the server says why not."""
    mode = """\
  mode:
    send: "MODE {{ mode }}"
    args: { mode: { type: string, choices: [hold, auto] } }
    moves: mode == 'auto'
"""
    profile = PROFILE.replace("sequences:", f"{mode}sequences:")
    profile = profile.replace(
        "{ use: button, bind: { press: beep } }", "{ use: select, bind: { change: mode } }"
    )
    async with served(tmp_path, profile) as (heard, address):
        page = await opened(new_page, address)
        choice = page.locator("[data-cell='1'] select")
        await choice.select_option("auto")
        await until(lambda: heard == ["MODE auto"])
        await page.click(STOP)
        await until_text(page, "[data-stop-note]", "✓ sent ✓ latched")
        await choice.select_option("hold")
        await until(lambda: heard == ["MODE auto", "MODE hold"])
        await choice.select_option("auto")
        await expect(page.locator("[data-cell='1']")).to_contain_text("Reset to drive again")
        await choice.select_option("hold")
        await until(lambda: heard == ["MODE auto", "MODE hold", "MODE hold"])
