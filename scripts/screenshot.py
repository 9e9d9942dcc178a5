"""The generator of the README's picture of the dashboard: `python -m scripts.screenshot`.

The demo runs in a separate process. A real Chromium takes the picture when the battery shows the
charge that the README mentions. ``--all FOLDER`` instead takes pictures of every screen and theme,
for work on the design.
"""

import argparse
import asyncio
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from playwright.async_api import Browser

from tests.e2e.browser import LOCALE, SIZES, running_browser
from tests.e2e.keys import enter
from tests.e2e.processes import UrcProcess

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "images" / "dashboard.png"
CHARGE = "74"
"""Battery charge in the picture, in percent.

The emulated battery reaches each charge once in 100 s.
"""
WAIT_MS = 110_000
MAX_BYTES = 150_000
THEMES = ("light", "dark", "sunlight", "night")
ADDRESS = r"dashboard (http://\S+)"


@dataclass(frozen=True, slots=True)
class Shot:
    """One picture."""

    file: Path
    page: str = "robots/puppet/"
    width: int = 1280
    height: int = 800
    theme: str = "light"
    charge: str = ""
    """Text that the battery must show before the picture is taken; "" for any text."""


def main() -> int:
    """Take the README's picture, or all pictures; return the exit code."""
    parser = argparse.ArgumentParser(prog="screenshot", description="Picture the dashboard.")
    parser.add_argument("--all", type=Path, metavar="FOLDER", help="every screen and theme")
    folder = parser.parse_args().all
    shots = every_shot(folder) if folder else [Shot(PICTURE, charge=CHARGE)]
    demo = UrcProcess(("demo", "--no-browser", "--port", "0"), {})
    try:
        address = demo.wait_for(ADDRESS)[1]
        asyncio.run(take(address, shots))
    finally:
        demo.kill()
    size = PICTURE.stat().st_size if not folder else 0
    if size > MAX_BYTES:
        print(f"{PICTURE.name} has {size} bytes; {MAX_BYTES} are allowed", file=sys.stderr)
        return 1
    return 0


def every_shot(folder: Path) -> list[Shot]:
    """Return the planned pictures of the menu and the dashboard for each screen and theme."""
    pages = {"menu": "", "gui": "robots/puppet/"}
    return [
        Shot(folder / f"{name}-{size}-{theme}.png", page, width, height, theme)
        for name, page in pages.items()
        for size, (width, height) in SIZES.items()
        for theme in THEMES
    ]


async def take(address: str, shots: Sequence[Shot]) -> None:
    """Take the pictures one after another, each on a new page."""
    async with running_browser() as browser:
        for shot in shots:
            await take_one(browser, address, shot)
            print(shot.file, flush=True)


async def take_one(browser: Browser, address: str, shot: Shot) -> None:
    """Open the page, wait for the required values, and write the picture."""
    context = await browser.new_context(
        viewport={"width": shot.width, "height": shot.height},
        color_scheme="dark" if shot.theme in ("dark", "night") else "light",
        locale=LOCALE,
        reduced_motion="reduce",
    )
    await enter(context, address)
    page = await context.new_page()
    await page.goto(address)
    await page.evaluate("theme => localStorage.setItem('urc-theme', theme)", shot.theme)
    await page.goto(f"{address.rstrip('/')}/{shot.page}")
    if shot.page:
        await page.wait_for_function(
            """(charge) => {
              const shown = document.querySelector(".battery-digits")?.textContent;
              const state = document.querySelector(".battery")?.getAttribute("data-state");
              return state === "live" && (charge ? shown === charge : shown !== "—");
            }""",
            arg=shot.charge,
            timeout=WAIT_MS,
        )
        await page.wait_for_selector("[data-badge-trip]:not(:empty)", timeout=WAIT_MS)
    shot.file.parent.mkdir(parents=True, exist_ok=True)
    await page.screenshot(path=shot.file)
    await context.close()


if __name__ == "__main__":
    sys.exit(main())
