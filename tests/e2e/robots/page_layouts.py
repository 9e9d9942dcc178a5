"""Measures of the pages of the robots that ship: shares, overlaps, sticks and cut texts.

The variants of a page are its screen, its language and the size of its text.
"""

import asyncio
from collections.abc import AsyncIterator, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from playwright.async_api import Browser, BrowserContext, Page, expect

from tests.e2e.keys import enter
from tests.e2e.robots.recording import FOLDER

__all__ = ["LANGUAGES", "NAMES", "SCREENS", "TEXT_PX", "Variant", "measured"]

NAMES = sorted(file.stem for file in FOLDER.glob("*.yaml"))
SCREENS = {
    "small phone": (320, 568),
    "low phone": (360, 640),
    "phone": (390, 844),
    "phone, landscape": (844, 390),
    "tablet": (820, 1180),
    "tablet, landscape": (1180, 820),
    "desktop": (1440, 900),
    "large": (2560, 1440),
}
WIDE = ("phone, landscape", "tablet", "tablet, landscape", "desktop", "large")
"""Screens on which widgets are in front of the background."""
ROOMY = ("tablet", "tablet, landscape", "desktop", "large")
"""Screens on which each text is at least 14 px high."""
IMAGE_PERCENT = 55
"""Least share of the stage that a camera's image takes without its bars and below no widget."""
LOW_IMAGE_PERCENT = 45
"""The same on a phone in landscape: there, more would cost more than a quarter of the image."""
CLEAR_PERCENT = 60
"""Least share of the camera that no widget covers on a phone in portrait."""
STICK_PX = (143, 221)
"""Sizes of a stick's face, with the rounding of half a pixel."""
LANGUAGES = ("en-GB", "de-DE", "fr-FR", "it-IT")
TEXT_PX = (16, 24)
"""Sizes of normal text in the browser's settings: usual, and large."""
LAYOUT = (Path(__file__).parent / "page_layout.js").read_text("utf-8")
DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
SETTLE_S = 0.3
"""Time for widgets that lay themselves out, and for the floats of the background, after a change of
size."""


class Variant(NamedTuple):
    """One robot's page in one language with one size of text, on some screens."""

    name: str
    language: str
    text_px: int
    screens: Sequence[str]


async def measured(
    browser: Browser, address: str, variants: Iterable[Variant]
) -> AsyncIterator[tuple[str, list[str]]]:
    """Yield the place and the faults of each variant on each of its screens.

    Args:
        browser: a running browser.
        address: address of the running demo.
        variants: the pages; neighbours of the same language and text share a context.
    """
    context: BrowserContext | None = None
    shared: tuple[str, int] | None = None
    page: Page | None = None
    for name, language, text_px, screens in variants:
        if page is None or shared != (language, text_px):
            if context is not None:
                await context.close()
            shared = language, text_px
            context = await browser.new_context(locale=language, reduced_motion="reduce")
            page = await _page(context, address, text_px)
        await page.goto(f"{address.rstrip('/')}/robots/{name}/")
        await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
        for screen in screens:
            width, height = SCREENS[screen]
            await page.set_viewport_size({"width": width, "height": height})
            await page.evaluate(DRAWN)
            await asyncio.sleep(SETTLE_S)
            seen = await page.evaluate(LAYOUT)
            is_large = text_px > TEXT_PX[0]
            yield f"{name}, {screen}, {language}, {text_px} px", faults(seen, screen, is_large)
    if context is not None:
        await context.close()


async def _page(context: BrowserContext, address: str, text_px: int) -> Page:
    await enter(context, address)
    await context.add_init_script("localStorage.setItem('urc-hints', 'seen')")
    page = await context.new_page()
    devtools = await context.new_cdp_session(page)
    await devtools.send("Page.enable")
    sizes = {"standard": text_px, "fixed": round(text_px * 13 / 16)}
    await devtools.send("Page.setFontSizes", {"fontSizes": sizes})
    return page


def faults(seen: dict[str, Any], screen: str, is_large: bool) -> list[str]:
    """Return the faults of a page; large text may take shares, but is neither cut nor covered."""
    lines = list(seen["faults"])
    if is_large:
        return lines
    if seen["bars"] > (16 if "phone, " in screen or "small" in screen else 12):
        lines.append(f"the bars take {seen['bars']} % of the screen")
    if screen not in WIDE and seen["isPicture"] and seen["clear"] < CLEAR_PERCENT:
        lines.append(f"widgets leave {seen['clear']} % of the camera clear")
    if screen in ROOMY:
        lines += seen["small"]
    if screen not in WIDE or not seen["isOverGround"]:
        return lines
    if seen["scrolls"]:
        lines.append("the page scrolls, so widgets can be next to STOP")
    if seen["isPicture"] and seen["ground"] < 55:
        lines.append(f"the camera has {seen['ground']} % of the stage")
    least = LOW_IMAGE_PERCENT if "phone, " in screen else IMAGE_PERCENT
    if seen["isPicture"] and seen["image"] < least:
        lines.append(f"the image has {seen['image']} % of the stage")
    if any(size < STICK_PX[0] or size > STICK_PX[1] for size in seen["sizes"]):
        lines.append(f"sticks are {seen['sizes']} px wide")
    if any(not 8 <= edge <= 32 for edge in seen["edges"]):
        lines.append(f"sticks are {seen['edges']} px from the side")
    if seen["gap"] is not None and seen["gap"] < 16:
        lines.append(f"the sticks are {seen['gap']} px apart")
    return lines
