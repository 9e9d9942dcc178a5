"""Take the widgets' pictures for the manual: ``docs/images/widgets/NAME.png``.

    python -m scripts.widget_pictures             all widgets
    python -m scripts.widget_pictures NAME ...    only these

Each picture shows the first states of the widget's demo in one row, in the dark theme, as in the
gallery.
"""

import argparse
import asyncio
import sys
from pathlib import Path

from playwright.async_api import Browser, Page

from tests.e2e.browser import LOCALE, running_browser
from tests.e2e.dashboards import running_dashboard
from tests.e2e.keys import known_here
from urc.config.parse.widget import WidgetFolder
from urc.shipped import shipped
from urc.testing.dashboard import FakeRobot, dashboard_profile

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images" / "widgets"
STATES = 3
"""Maximum number of states in one picture."""
WIDTH = 1240
READY_MS = 30_000

# Shows only the first states, without the page around them.
ONLY = """
(count) => {
  document.documentElement.dataset.theme = "dark";
  for (const el of document.querySelectorAll(".urc-exhibit")) {
    const place = [...el.parentElement.children].indexOf(el);
    if (place >= count) el.hidden = true;
    el.style.display = place >= count ? "none" : "";
  }
}
"""


async def take(browser: Browser, address: str, name: str) -> None:
    """Write the picture of one widget's demo."""
    context = await browser.new_context(
        viewport={"width": WIDTH, "height": 700}, locale=LOCALE, reduced_motion="reduce"
    )
    try:
        await known_here(context)
        page: Page = await context.new_page()
        await page.goto(f"{address}widgets/{name}/")
        await page.wait_for_selector("[data-gallery][data-ready]", timeout=READY_MS)
        await page.evaluate(ONLY, STATES)
        await page.evaluate(
            "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
        )
        await page.locator(".urc-exhibits").screenshot(path=IMAGES / f"{name}.png")
        print(f"{IMAGES / f'{name}.png'}")
    finally:
        await context.close()


async def run(names: list[str]) -> None:
    """Take pictures of the widgets, one after another."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    async with (
        running_dashboard(FakeRobot(dashboard_profile())) as address,
        running_browser() as browser,
    ):
        for name in names:
            await take(browser, address, name)


def main(arguments: list[str] | None = None) -> int:
    """Take the pictures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    known = WidgetFolder(shipped("widgets")).names()
    wanted = parser.parse_args(arguments).names or known
    if unknown := sorted(set(wanted) - set(known)):
        print(f"unknown widget {unknown[0]!r}", file=sys.stderr)
        return 2
    asyncio.run(run(wanted))
    return 0


if __name__ == "__main__":
    sys.exit(main())
