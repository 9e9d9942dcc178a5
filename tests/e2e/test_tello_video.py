"""The page of the Tello shows its own video: encoded by the drone, decoded by the browser."""

import asyncio
import os
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.async_api import Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.drawn import PIXELS_OF
from tests.e2e.robots.hands import give
from tests.e2e.robots.recording import Overheard, alive
from tests.e2e.test_video_page import kinds_of_frames
from tests.e2e.transports.encoders import encoders, until_encoders
from urc.simulator.servers import camera as emulated_camera
from urc.transports import camera
from urc.wire.picture import PICTURE, VIDEO

pytestmark = pytest.mark.anyio

WAIT_S: Final = 60.0
PATIENCE_MS: Final = 1000 * WAIT_S
LOOK: Final = f"""
() => {{
  const root = document.querySelector(".camera");
  const canvas = root.querySelector("canvas");
  if (canvas.width < 320) return null;
  const {{ width, height, data }} = ({PIXELS_OF})(canvas);
  const grey = [];
  for (let y = 8; y < height; y += 16)
    for (let x = 8; x < width; x += 16) {{
      const at = 4 * (y * width + x);
      grey.push((data[at] + data[at + 1] + data[at + 2]) / 3);
    }}
  return {{
    width, height, grey,
    state: root.dataset.state,
    isFrozen: root.dataset.frozen === "yes",
    age: root.querySelector(".camera-age").textContent,
  }};
}}
"""
"""What the page shows: grey levels of a grid of points, and what it says of the image's age."""
STILL: Final = 2.0
"""Mean difference of the grey levels of two images of a drone that stands still."""
TURNED: Final = 10.0
"""Mean difference of the grey levels after a turn in the room."""


async def seen(page: Page, is_it: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Wait for an image on the page; return it."""
    found: dict[str, Any] | None = None
    async with asyncio.timeout(WAIT_S):
        while found is None or not is_it(found):
            await asyncio.sleep(0.1)
            found = await page.evaluate(LOOK)
    return found


def is_live(found: dict[str, Any]) -> bool:
    return found["state"] == "live" and not found["isFrozen"]


def difference(one: dict[str, Any], other: dict[str, Any]) -> float:
    """Return the mean difference of the grey levels, 0 to 255."""
    pairs = list(zip(one["grey"], other["grey"], strict=True))
    return float(sum(abs(left - right) for left, right in pairs) / len(pairs))


async def still(page: Page) -> dict[str, Any]:
    """Wait until the drone stands still, as the page shows it; return the image."""
    before, same = await seen(page, is_live), 0

    def is_same(found: dict[str, Any]) -> bool:
        nonlocal before, same
        before, last = found, before
        same = same + 1 if is_live(found) and difference(found, last) < STILL else 0
        return same >= 5

    return await seen(page, is_same)


async def is_connected(page: Page) -> None:
    badge = page.locator("[data-badge]")
    await expect(badge).to_have_attribute("data-state", "good", timeout=PATIENCE_MS)


async def commander(robot: Overheard, new_page: PageMaker) -> Callable[..., Any]:
    """Return a function that gives a command on another page."""
    page = await new_page()
    await page.goto(f"{robot.address}robots/tello/?interface=debug")
    await is_connected(page)
    commands = robot.profile.driver.commands
    return lambda name, **arguments: give(page, commands[name], arguments)


async def test_the_page_sees_the_drone_turn_and_marks_the_end_of_the_video(
    new_page: PageMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """H.264 all the way; after streamoff, the last image is marked as old until streamon."""
    async with alive("tello", tmp_path, monkeypatch) as robot:
        page = await new_page()
        kinds = kinds_of_frames(page)
        await page.goto(f"{robot.address}robots/tello/")
        first = await seen(page, is_live)
        assert (first["width"], first["height"]) == (320, 240)
        assert first["age"] == ""
        await is_connected(page)
        run = await commander(robot, new_page)
        await run("takeoff")
        before = await still(page)
        await run("turn", angle=90)
        await seen(page, lambda found: is_live(found) and difference(found, before) > TURNED)
        await run("stream", sends=False)
        frozen = await seen(page, lambda found: bool(found["isFrozen"]))
        assert "s old" in frozen["age"]
        await seen(page, lambda found: found["state"] == "stale")
        await run("stream", sends=True)
        await seen(page, is_live)
        assert VIDEO in kinds
        assert PICTURE not in kinds
    assert encoders() == []


async def test_an_encoder_that_stands_still_is_marked_and_replaced(
    new_page: PageMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a drone whose camera has failed; its other parts go on."""
    async with alive("tello", tmp_path, monkeypatch) as robot:
        page = await new_page()
        await page.goto(f"{robot.address}robots/tello/")
        await seen(page, is_live)
        (process,) = await until_encoders(1)
        os.kill(process, signal.SIGSTOP)
        frozen = await seen(page, lambda found: bool(found["isFrozen"]))
        assert "s old" in frozen["age"]
        await seen(page, lambda found: found["state"] == "stale")
        run = await commander(robot, new_page)
        await run("takeoff")
        await seen(page, is_live)
        assert encoders() != [process]


async def test_without_the_package_the_drone_flies_and_its_log_says_why(
    new_page: PageMaker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The badge shows the state of the drone, not of a camera that this computer cannot read."""
    monkeypatch.setattr(camera, "find_spec", lambda _: None)
    monkeypatch.setattr(emulated_camera, "has_encoder", lambda: False)
    async with alive("tello", tmp_path, monkeypatch) as robot:
        page = await new_page()
        await page.goto(f"{robot.address}robots/tello/")
        await is_connected(page)
        await expect(page.locator(".attitude")).to_be_visible()
        await page.goto(f"{robot.address}robots/tello/?interface=default")
        await is_connected(page)
        await expect(page.locator(".camera")).to_have_attribute("data-state", "none")
        mark = robot.mark()
        run = await commander(robot, new_page)
        await run("takeoff")
        assert b"takeoff" in robot.bytes_since("control", mark)
