"""Take pictures for design work: `python -m scripts.page_pictures FOLDER`.

The pictures show the menu and every robot of the demo on each kind of screen, in each theme. The
robots are emulated, with a separate data folder. ``shares.md`` lists the layout faults of each
page, and the percentages covered by the background and the bars. ``--robots``, ``--screens`` and
``--themes`` select some of the robots, screens and themes.
"""

import argparse
import asyncio
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from playwright.async_api import Browser, Error

from tests.e2e.browser import LOCALE, running_browser
from tests.e2e.keys import enter
from tests.e2e.processes import UrcProcess

ROOT = Path(__file__).resolve().parents[1]
MENU = "menu"
DESKTOP = "desktop"
ROBOTS = (MENU, *sorted(path.stem for path in (ROOT / "robots").glob("*.yaml")))
SCREENS = {
    "desktop": (1440, 900),
    "tablet-landscape": (1180, 820),
    "tablet": (820, 1180),
    "phone": (390, 844),
    "phone-landscape": (844, 390),
    "small-phone": (360, 640),
}
THEMES = ("light", "dark", "sunlight", "night")
LAYOUT = (ROOT / "tests/e2e/robots/page_layout.js").read_text("utf-8")
LIVE = "() => document.querySelector('[data-badge]')?.dataset.state === 'good'"
WAIT_MS = 30_000
THEME = "(theme) => { document.documentElement.dataset.theme = theme; }"
DRAWN_MS = 400
"""Time to wait after a change of size or theme, in milliseconds."""
SETTLE_MS = 1500
"""Time to wait for camera images and the first values, in milliseconds."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Take the pictures; return the exit code."""
    parser = argparse.ArgumentParser(prog="page_pictures", description="Picture all pages.")
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("--interface", default="", help="an interface other than the first")
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=ROBOTS)
    parser.add_argument("--screens", nargs="+", choices=tuple(SCREENS), default=tuple(SCREENS))
    parser.add_argument("--themes", nargs="+", choices=THEMES, default=THEMES)
    given = parser.parse_args(arguments)
    given.folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as data:
        demo = UrcProcess(("demo", "--no-browser", "--port", "0"), {"XDG_DATA_HOME": data})
        try:
            address = demo.wait_for(r"dashboard (http://\S+)")[1]
            asyncio.run(take(address, given))
        finally:
            demo.kill()
    return 0


async def take(address: str, given: argparse.Namespace) -> None:
    """Take the pictures, and write the measurements to shares.md."""
    lines = ["| robot | screen | background | bars | faults |", "|---|---|---|---|---|"]
    touched = [screen for screen in given.screens if screen != DESKTOP]
    async with running_browser() as browser:
        for screens in ([DESKTOP] if DESKTOP in given.screens else [], touched):
            if screens:
                lines += await pictures(browser, address, given, screens)
    (given.folder / "shares.md").write_text("\n".join(lines) + "\n", encoding="utf-8")


def row(name: str, screen: str, seen: dict[str, Any]) -> str:
    """Return a page's measurements as a table row in Markdown."""
    share = f"{seen['ground']} %" if seen["isOverGround"] else "none"
    faults = "; ".join(seen["faults"]) or "none"
    return f"| {name} | {screen} | {share} | {seen['bars']} % | {faults} |"


async def pictures(
    browser: Browser, address: str, given: argparse.Namespace, screens: Sequence[str]
) -> list[str]:
    """Take pictures of all pages on the given screens; return a table row for each picture.

    Each page is loaded once; then its window size and theme are changed for each picture.
    """
    context = await browser.new_context(
        has_touch=DESKTOP not in screens, locale=LOCALE, reduced_motion="reduce"
    )
    await enter(context, address)
    await context.add_init_script("localStorage.setItem('urc-hints', 'seen')")
    page = await context.new_page()
    start = address.split("?")[0].split("#")[0].rstrip("/")
    rows = []
    query = f"?interface={given.interface}" if given.interface else ""
    for name in given.robots:
        await page.goto(f"{start}/" if name == MENU else f"{start}/robots/{name}/{query}")
        if name != MENU:
            try:
                await page.wait_for_function(LIVE, timeout=WAIT_MS)
            except Error:
                print(f"{name} did not become live in time", file=sys.stderr)
        await page.wait_for_timeout(SETTLE_MS)
        for screen in screens:
            width, height = SCREENS[screen]
            await page.set_viewport_size({"width": width, "height": height})
            for theme in given.themes:
                await page.evaluate(THEME, theme)
                await page.wait_for_timeout(DRAWN_MS)
                await page.screenshot(path=given.folder / f"{name}-{screen}-{theme}.png")
            if name != MENU:
                rows.append(row(name, screen, await page.evaluate(LAYOUT)))
        print(name, *screens, flush=True)
    await context.close()
    return rows


if __name__ == "__main__":
    sys.exit(main())
