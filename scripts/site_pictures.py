"""Take the site's pictures: `python -m scripts.site_pictures [drive] [tutorials]`.

``drive`` films the real dashboard: an operator drives an emulated TurtleBot 4, releases the stick,
presses STOP and resets it. ``tutorials`` takes the tutorials' pictures from the documents on their
pages.
"""

import argparse
import asyncio
import base64
import io
import re
import sys
import tempfile
from collections.abc import Sequence
from contextlib import asynccontextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import yaml
from PIL import Image
from playwright.async_api import Browser, CDPSession, Locator, Page

from tests.documentation import blocks
from tests.e2e.browser import LOCALE, running_browser
from tests.e2e.keys import enter
from tests.e2e.processes import UrcProcess

__all__ = ["main"]

DOCS = Path(__file__).resolve().parents[1] / "docs"
LOOP = DOCS / "_static" / "drive.webp"
STILL = DOCS / "_static" / "drive-still.webp"
"""A still picture from the film, for people who prefer reduced motion."""
STILL_QUALITY = 70
SCREEN = (1120, 700)
LOOP_SIZE = (960, 600)
LOOP_QUALITY = 45
MOST_BYTES = 2_000_000
LEAST_WAY_M = 0.5
FRAME_S = 0.12
"""Shortest time between two frames of the film, in seconds."""
STEERING = ((0.0, -0.9, 2.5), (-0.6, -0.7, 1.8), (0.7, -0.6, 2.2), (0.0, -0.8, 1.2))
"""Positions of the knob (right and down, as fractions of the radius), with durations in seconds."""
TABLET = (1024, 640)
COLOURS = 128
LIVE = "() => document.querySelector('[data-badge]')?.dataset.state === 'good'"
READY_MS = 90_000
SETTLED_MS = 3000
HINT_MS = 12_000


def main(arguments: Sequence[str] | None = None) -> int:
    """Take the pictures; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("subjects", nargs="*", choices=("drive", "tutorials", []))
    chosen = parser.parse_args(arguments).subjects or ["drive", "tutorials"]
    if "drive" in chosen:
        asyncio.run(film())
        if LOOP.stat().st_size > MOST_BYTES:
            print(f"{LOOP.name} has more than {MOST_BYTES} bytes", file=sys.stderr)
            return 1
    if "tutorials" in chosen:
        asyncio.run(tutorials())
    return 0


@asynccontextmanager
async def served(*words: str) -> Any:
    """Run `urc` with these arguments and a separate data folder; yield its dashboard's address."""
    with tempfile.TemporaryDirectory() as data:
        process = UrcProcess((*words, "--port", "0"), {"URC_DATA_DIR": data})
        try:
            found = await process.wait_for_async(r"dashboard (http://\S+)", READY_MS / 1000)
            yield found[1].rstrip("/")
        finally:
            process.kill()


async def opened(browser: Browser, address: str, path: str, size: tuple[int, int]) -> Page:
    """Open a dashboard page in the light theme, with hints disabled; return the page."""
    context = await browser.new_context(
        viewport={"width": size[0], "height": size[1]}, locale=LOCALE, color_scheme="light"
    )
    await enter(context, address)
    await context.add_init_script("localStorage.setItem('urc-hints', 'seen')")
    page = await context.new_page()
    await page.goto(f"{address}{path}")
    return page


async def film() -> None:
    """Write the animated picture for the front page."""
    async with (
        served("serve", "turtlebot4", "--simulate") as address,
        running_browser(is_whole=True) as browser,  # the other browser cannot keep a screen on
    ):
        page = await opened(browser, address, "/robots/turtlebot4/", SCREEN)
        await page.wait_for_function(LIVE, timeout=READY_MS)
        await tap(page)
        await page.wait_for_timeout(HINT_MS)
        frames: list[tuple[float, bytes]] = []
        camera = await shoot(page, frames)
        await drive(page)
        await camera.detach()
        place = re.search(r"x (-?[0-9.]+) m", await page.inner_text("body"))
    if place is None or abs(float(place[1])) < LEAST_WAY_M:
        raise SystemExit("the robot hardly moved: URC stopped it, because this computer is busy")
    write_loop(frames)


async def tap(page: Page) -> None:
    """Touch the stick once, so that the hint about the screen disappears before the film begins."""
    x, y, _ = await centre(page.locator(".joystick-pad").first)
    await page.mouse.move(x, y)
    await page.mouse.down()
    await page.mouse.up()


async def shoot(page: Page, frames: list[tuple[float, bytes]]) -> CDPSession:
    """Append painted frames with their times to `frames` until the returned session ends."""
    session = await page.context.new_cdp_session(page)
    waiting = set()

    def keep_frame(event: dict[str, Any]) -> None:
        when = float(event["metadata"]["timestamp"])
        if not frames or when - frames[-1][0] >= FRAME_S:
            frames.append((when, base64.b64decode(event["data"])))
        task = asyncio.ensure_future(
            session.send("Page.screencastFrameAck", {"sessionId": event["sessionId"]})
        )
        waiting.add(task)
        task.add_done_callback(waiting.discard)

    session.on("Page.screencastFrame", keep_frame)
    await session.send(
        "Page.startScreencast", {"format": "jpeg", "quality": 80, "everyNthFrame": 4}
    )
    return session


async def drive(page: Page) -> None:
    """Hold the stick and steer, then release the stick, press STOP, and reset the stop."""
    x, y, radius = await centre(page.locator(".joystick-pad").first)
    await asyncio.sleep(1)
    await page.mouse.move(x, y)
    await page.mouse.down()
    for right, down, for_s in STEERING:
        await page.mouse.move(x + right * radius, y + down * radius, steps=6)
        await asyncio.sleep(for_s)
    await page.mouse.up()
    await asyncio.sleep(1.2)
    await page.locator("[data-stop-button]").first.dispatch_event("pointerdown")
    await asyncio.sleep(1.8)
    await page.locator("[data-verb='reset']").first.click()
    await asyncio.sleep(1)


async def centre(pad: Locator) -> tuple[float, float, float]:
    """Return a stick's centre and radius, in page pixels."""
    box = await pad.bounding_box()
    assert box is not None  # noqa: S101  the page shows its stick
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    return (*middle, min(box["width"], box["height"]) / 2)


def write_loop(frames: list[tuple[float, bytes]]) -> None:
    """Write the film as an animated WebP that plays at its original speed."""
    taken = (Image.open(io.BytesIO(data)).convert("RGB") for _, data in frames)
    pictures = [one.resize(LOOP_SIZE, Image.Resampling.LANCZOS) for one in taken]
    times = [when for when, _ in frames]
    lasting = [round((after - when) * 1000) for when, after in pairwise(times)]
    LOOP.parent.mkdir(parents=True, exist_ok=True)
    first, *others = pictures
    first.save(
        LOOP,
        save_all=True,
        append_images=others,
        duration=[*lasting, 1500],
        loop=0,
        quality=LOOP_QUALITY,
        method=4,
    )
    pictures[len(pictures) // 3].save(STILL, quality=STILL_QUALITY)
    print(f"{LOOP.name}: {len(pictures)} frames, {LOOP.stat().st_size} bytes")


async def tutorials() -> None:
    """Write the tutorials' pictures."""
    images = DOCS / "images" / "tutorials"
    images.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for name in ("cart", "widget"):
            write_blocks(DOCS / "tutorials" / f"{name}.md", Path(folder))
        async with running_browser() as browser:
            cart = f"{folder}/lab-cart.yaml"
            async with served("serve", cart, "--simulate") as address:
                page = await opened(browser, address, "/robots/lab-cart/", TABLET)
                await page.wait_for_function(LIVE, timeout=READY_MS)
                await page.wait_for_timeout(SETTLED_MS)
                await keep(page, images / "lab-cart.png")
            boiler = f"{folder}/boiler.yaml"
            async with served("serve", boiler, "--simulate") as address:
                page = await opened(browser, address, "/robots/boiler/", TABLET)
                await page.wait_for_function(LIVE, timeout=READY_MS)
                await page.wait_for_timeout(SETTLED_MS)
                await keep(page, images / "thermo.png")


def write_blocks(page: Path, folder: Path) -> None:
    """Write a tutorial page's documents and widget files into `folder`."""
    for block in blocks(page):
        if block.file:
            file = folder / "widgets" / block.file
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(block.text, "utf-8")
        elif block.language == "yaml" and block.text.startswith("urc: 1\n"):
            name = yaml.safe_load(block.text)["name"]
            (folder / f"{name}.yaml").write_text(block.text, "utf-8")


async def keep(page: Page, file: Path) -> None:
    """Write a picture of the page with few colours, to keep the file small."""
    taken = Image.open(io.BytesIO(await page.screenshot())).convert("RGB")
    taken.quantize(COLOURS, dither=Image.Dither.NONE).save(file, optimize=True)
    print(file.name)


if __name__ == "__main__":
    sys.exit(main())
