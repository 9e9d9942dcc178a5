"""The pages of the robots that ship, on every kind of screen: shares, overlaps and sticks."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.processes import UrcProcess
from tests.e2e.robots.recording import FOLDER

pytestmark = pytest.mark.anyio

NAMES = sorted(file.stem for file in FOLDER.glob("*.yaml"))
GROUPS = [NAMES[start::3] for start in range(3)]
SIZES = {
    "small phone": (320, 568),
    "phone": (390, 844),
    "phone, landscape": (844, 390),
    "tablet": (820, 1180),
    "tablet, landscape": (1180, 820),
    "desktop": (1440, 900),
    "large": (2560, 1440),
}
WIDE = ("phone, landscape", "tablet", "tablet, landscape", "desktop", "large")
"""Screens on which widgets are in front of the background."""
LAYOUT = (Path(__file__).parent / "page_layout.js").read_text("utf-8")
DRAWN = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


@pytest.mark.parametrize("names", GROUPS, ids=["first", "second", "third"])
async def test_the_background_fills_the_screen_and_nothing_overlaps(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess], names: list[str], tmp_path: Path
) -> None:
    process = urc_process("demo", "--no-browser", "--port", "0", XDG_DATA_HOME=str(tmp_path))
    address = (await process.wait_for_async(r"dashboard (http://\S+)", 60.0))[1]
    page = await new_page()
    await page.goto(address)
    found: dict[str, list[str]] = {}
    for name in names:
        await page.goto(f"{page.url.split('?')[0].split('robots/')[0]}robots/{name}/")
        await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
        for size, (width, height) in SIZES.items():
            await page.set_viewport_size({"width": width, "height": height})
            await page.evaluate(DRAWN)
            found[f"{name}, {size}"] = faults(await layout(page), size)
    wrong = {place: lines for place, lines in found.items() if lines}
    assert not wrong, json.dumps(wrong, indent=1)


async def layout(page: Page) -> dict[str, Any]:
    """Return the measures of a robot's page."""
    seen: dict[str, Any] = await page.evaluate(LAYOUT)
    return seen


def faults(seen: dict[str, Any], size: str) -> list[str]:
    """Return the faults of a page on a screen of this size."""
    lines = list(seen["faults"])
    if seen["bars"] > (16 if "phone, " in size or "small" in size else 12):
        lines.append(f"the bars take {seen['bars']} % of the screen")
    if size not in WIDE or not seen["isOverGround"]:
        return lines
    if seen["isPicture"] and seen["ground"] < 55:
        lines.append(f"the camera has {seen['ground']} % of the stage")
    if any(not 8 <= edge <= 32 for edge in seen["edges"]):
        lines.append(f"sticks are {seen['edges']} px from the side")
    if seen["gap"] is not None and seen["gap"] < 16:
        lines.append(f"the sticks are {seen['gap']} px apart")
    return lines
