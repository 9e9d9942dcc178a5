"""Generate the robots' pictures and manual pages.

    python -m scripts.robot_pictures             all shipped robots
    python -m scripts.robot_pictures NAME ...    only these
    python -m scripts.robot_pictures --text      only the pages, with the existing pictures

``docs/images/robots/NAME.png`` shows the robot's default interface on a tablet.
``docs/robots/NAME.md`` is the output of `urc docs` with the robot's picture below its first lines.
"""

import argparse
import asyncio
import io
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from PIL import Image
from playwright.async_api import Browser

from tests.e2e.browser import LOCALE, running_browser
from tests.e2e.keys import enter
from tests.e2e.processes import UrcProcess
from urc.config.load import load_profile
from urc.runtime.manual import manual
from urc.runtime.registries import built_in_catalog
from urc.shipped import shipped

__all__ = ["with_picture"]

DOCS = Path(__file__).resolve().parents[1] / "docs"
IMAGES = DOCS / "images" / "robots"
TABLET = {"width": 1024, "height": 768}
COLOURS = 128
SETTLED_MS = 3000
"""Maximum time to wait for values before a picture is taken, in milliseconds."""
READY_MS = 60_000


def with_picture(page: str, name: str) -> str:
    """Return a manual page, with the robot's picture below the summary."""
    head, summary, rest = page.split("\n\n", 2)
    title = head.removeprefix("# ")
    picture = f"![The page of {title} on a tablet](../images/robots/{name}.png)"
    return "\n\n".join((head, summary, picture, rest))


async def take(browser: Browser, address: str, name: str) -> None:
    """Write the picture of one robot's default interface."""
    context = await browser.new_context(
        viewport=TABLET,  # type: ignore[arg-type]  # a mapping with the right keys
        locale=LOCALE,
        color_scheme="light",
        reduced_motion="reduce",
    )
    try:
        await enter(context, address)
        page = await context.new_page()
        await page.goto(f"{address}robots/{name}/?interface=default")
        badge = page.locator("[data-badge][data-state='good']")
        await badge.wait_for(state="attached", timeout=READY_MS)
        await page.wait_for_timeout(SETTLED_MS)
        taken = Image.open(io.BytesIO(await page.screenshot())).convert("RGB")
        small = taken.quantize(COLOURS, dither=Image.Dither.NONE)
        small.save(IMAGES / f"{name}.png", optimize=True)
        print(IMAGES / f"{name}.png")
    finally:
        await context.close()


async def pictures(names: list[str]) -> None:
    """Take pictures of the named robots, one after another."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:  # without the user's latched stop
        await pictures_of(names, {"URC_DATA_DIR": folder})


async def pictures_of(names: list[str], environment: Mapping[str, str]) -> None:
    """Take the pictures from `urc demo`, started with the given environment variables."""
    demo = UrcProcess(("demo", "--no-browser", "--port", "0"), environment)
    try:
        address = (await demo.wait_for_async(r"dashboard (http://\S+)", READY_MS / 1000))[1]
        async with running_browser() as browser:
            for name in names:
                await take(browser, address, name)
    finally:
        demo.kill()


def main(arguments: list[str] | None = None) -> int:
    """Take the pictures and write the manual pages."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument(
        "--text", action="store_true", help="write only the pages, with the existing pictures"
    )
    given = parser.parse_args(arguments)
    known = sorted(file.stem for file in shipped("robots").glob("*.yaml"))
    if unknown := sorted(set(given.names) - set(known)):
        print(f"unknown robot {unknown[0]!r}", file=sys.stderr)
        return 2
    names = given.names or known
    if not given.text:
        asyncio.run(pictures(names))
    for name in names:
        profile = load_profile(str(shipped("robots") / f"{name}.yaml"), built_in_catalog())
        page = with_picture(manual(profile), name)
        (DOCS / "robots" / f"{name}.md").write_text(page, "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
