"""Take the README's picture of the dashboard: `python -m scripts.screenshot`.

The demo runs in a separate process. A real Chromium takes the picture when the battery shows the
charge that the README mentions. `scripts.page_pictures` takes pictures of all pages.
"""

import asyncio
import sys
from pathlib import Path

from tests.e2e.browser import LOCALE, running_browser
from tests.e2e.keys import enter
from tests.e2e.processes import UrcProcess

PICTURE = Path(__file__).resolve().parents[1] / "docs" / "images" / "dashboard.png"
CHARGE = "74"
"""Battery charge in the picture, in percent.

The emulated battery reaches each charge once every 100 s.
"""
WAIT_MS = 110_000
MAX_BYTES = 150_000
ADDRESS = r"dashboard (http://\S+)"


def main() -> int:
    """Take the README's picture; return the exit code."""
    demo = UrcProcess(("demo", "--no-browser", "--port", "0"), {})
    try:
        asyncio.run(take(demo.wait_for(ADDRESS)[1]))
    finally:
        demo.kill()
    size = PICTURE.stat().st_size
    if size > MAX_BYTES:
        print(f"{PICTURE.name} has {size} bytes; at most {MAX_BYTES} are allowed", file=sys.stderr)
        return 1
    return 0


async def take(address: str) -> None:
    """Open the robot's page, wait for the battery charge, and write the picture."""
    async with running_browser() as browser:
        context = await browser.new_context(
            viewport={"width": 1280, "height": 800}, locale=LOCALE, reduced_motion="reduce"
        )
        await enter(context, address)
        page = await context.new_page()
        await page.goto(f"{address.rstrip('/')}/robots/puppet/")
        await page.wait_for_function(
            """(charge) => {
              const shown = document.querySelector(".battery-digits")?.textContent;
              const state = document.querySelector(".battery")?.getAttribute("data-state");
              return state === "live" && shown === charge;
            }""",
            arg=CHARGE,
            timeout=WAIT_MS,
        )
        await page.wait_for_selector("[data-badge-trip]:not(:empty)", timeout=WAIT_MS)
        await page.screenshot(path=PICTURE)


if __name__ == "__main__":
    sys.exit(main())
