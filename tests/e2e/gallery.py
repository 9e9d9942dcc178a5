"""What the tests of the gallery look at: faults that a person would see, pictures as numbers."""

import base64
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from playwright.async_api import Page

from urc.config.parse.widget import WidgetFolder
from urc.shipped import shipped
from urc.web.show.demos import WidgetState, demo_states

__all__ = [
    *("CELLS", "CELL_SIZES", "EXHIBITS", "HIGH", "MOST_DIFFERENT", "ONLY", "PICTURES", "THEMES"),
    *("coarse", "difference", "groups", "keep", "kept", "lasting_faults", "resize", "settled"),
    *("show", "states_of"),
]

THEMES = ("dark", "light", "sunlight", "night")
CELL_SIZES = ("phone", "tablet", "desktop")
PICTURES = Path(__file__).parent / "pictures"
GROUP = 6
"""Widgets on one page: a page costs more than a widget."""
GRID = 16
MOST_DIFFERENT = 12.0
"""Of 255: another font moves the mean by a few, a part that is gone by more than twenty."""
SHOTS = 20
SETTLE_MS = 500


def groups() -> list[str]:
    """Return the widgets there are, some to a page, as the gallery takes them in its address."""
    names = WidgetFolder(shipped("widgets")).names()
    return ["+".join(names[start : start + GROUP]) for start in range(0, len(names), GROUP)]


def states_of(group: str) -> dict[tuple[str, str], WidgetState]:
    """Return (widget, state) → the state, of all widgets of a group."""
    registry = WidgetFolder(shipped("widgets"))
    found = {}
    for name in group.split("+"):
        widget = registry.get(name)
        assert widget is not None, [problem.message for problem in registry.problems]
        found |= {(name, state.name): state for state in demo_states(widget)}
    return found


async def show(page: Page, theme: str, size: str) -> None:
    """Show the gallery in a theme and a size of cells; return when the widgets have drawn that."""
    await page.evaluate(
        """async ([theme, size]) => {
          document.documentElement.dataset.theme = theme;
          document.querySelector("[data-gallery]").dataset.size = size;
          // The observers tell the widgets after the layout, and they draw in the next frame.
          for (let frame = 0; frame < 4; frame += 1) {
            await new Promise((resolve) => requestAnimationFrame(resolve));
          }
        }""",
        [theme, size],
    )


async def resize(page: Page, width: int, height: int) -> None:
    """Give all cells of the gallery another size; return when the widgets have drawn that."""
    await page.evaluate(
        """async ([width, height]) => {
          for (const exhibit of document.querySelectorAll(".urc-exhibit")) {
            exhibit.style.maxWidth = "none";
            exhibit.style.setProperty("--urc-exhibit-width", `${width}px`);
            exhibit.style.setProperty("--urc-exhibit-height", `${height}px`);
          }
          for (let frame = 0; frame < 4; frame += 1) {
            await new Promise((resolve) => requestAnimationFrame(resolve));
          }
        }""",
        [width, height],
    )


_FAULTS = (Path(__file__).parent / "gallery_faults.js").read_text("utf-8")
"""Given their selector, returns what is wrong with the cells, a line a fault."""
EXHIBITS = "[data-state-name]"
"""The cells of the gallery."""
CELLS = "[data-config]"
"""Those of any page."""


async def lasting_faults(page: Page, cells: str) -> list[str]:
    """Return the faults that do not go away: on a busy machine widgets take turns to draw."""
    found: list[str] = await page.evaluate(_FAULTS, cells)
    for _ in range(SHOTS):
        if not found:
            break
        await page.wait_for_timeout(SETTLE_MS)
        found = await page.evaluate(_FAULTS, cells)
    return found


# A picture as a grid of lightness and two differences of colour, each from 0 to 255.
_COARSE = """
async ([data, boxes, grid]) => {
  const bytes = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
  const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }));
  const canvas = new OffscreenCanvas(grid, grid);
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context.imageSmoothingQuality = "high";
  return boxes.map(([x, y, width, height]) => {
    context.drawImage(bitmap, x, y, width, height, 0, 0, grid, grid);
    const { data: pixels } = context.getImageData(0, 0, grid, grid);
    const cells = [];
    for (let place = 0; place < pixels.length; place += 4) {
      const [red, green, blue] = pixels.slice(place, place + 3);
      const light = 0.299 * red + 0.587 * green + 0.114 * blue;
      cells.push([light, 128 + 0.5 * (red - light), 128 + 0.5 * (blue - light)].map(Math.round));
    }
    return cells;
  });
}
"""


HIGH = {"width": 1440, "height": 1600}
"""A window that holds the normal states of a group."""
ONLY = """
(isNormal) => {
  for (const el of document.querySelectorAll(".urc-exhibit")) {
    const isShown = !isNormal || el.querySelector("[data-state-name='normal']");
    el.style.display = isShown ? "" : "none";
  }
}
"""
"""Shows the normal states, or all of them."""


async def coarse(page: Page, selectors: list[str]) -> list[list[list[int]]]:
    """Return each element of the page as a grid of numbers, by one screenshot of them all."""
    boxes = await page.evaluate(
        """(selectors) => selectors.map((selector) => {
          const box = document.querySelector(selector).getBoundingClientRect();
          const { left, top, width, height } = box;
          return [left + scrollX, top + scrollY, width, height].map(Math.round);
        })""",
        selectors,
    )
    png = await page.screenshot(full_page=True, animations="disabled")
    found: list[list[list[int]]] = await page.evaluate(
        _COARSE, [base64.b64encode(png).decode(), boxes, GRID]
    )
    return found


async def settled(page: Page, names: Sequence[str], theme: str) -> dict[str, list[list[int]]]:
    """Return how the normal states look: as before, once they do; else as they do for good.

    The window must hold them all: what is out of sight need not be drawn.
    """
    cells = [f"[data-widget='{name}'][data-state-name='normal']" for name in names]
    last: list[list[list[int]]] = []
    before = [kept(name).get(theme) for name in names]
    for _ in range(SHOTS):
        now = await coarse(page, cells)
        if now == last or not any(
            one is None or difference(one, grid) > MOST_DIFFERENT
            for one, grid in zip(before, now, strict=True)
        ):
            break
        last = now
        await page.wait_for_timeout(SETTLE_MS)
    return dict(zip(names, now, strict=True))


def difference(one: list[list[int]], other: list[list[int]]) -> float:
    """Return how far two grids are apart: the mean over the places, 0 to 255.

    Each place is compared with its neighbourhood in the other grid, so that a text that is some
    pixels wider with another font counts little, and something that is gone counts wholly.
    """
    total = 0.0
    for row in range(GRID):
        for column in range(GRID):
            here = one[row * GRID + column]
            near = [
                other[down * GRID + across]
                for down in range(max(0, row - 1), min(GRID, row + 2))
                for across in range(max(0, column - 1), min(GRID, column + 2))
            ]
            total += min(max(abs(a - b) for a, b in zip(here, each, strict=True)) for each in near)
    return total / (GRID * GRID)


def kept(widget: str) -> Any:
    """Return the kept pictures of a widget by theme; {} when there are none yet."""
    file = PICTURES / f"{widget}.json"
    return json.loads(file.read_text("utf-8")) if file.is_file() else {}


def keep(widget: str, pictures: dict[str, list[list[int]]]) -> None:
    """Write the pictures of a widget: a line a row, so that a change can be seen in a review."""
    PICTURES.mkdir(exist_ok=True)
    themes = []
    for theme, cells in pictures.items():
        rows = [cells[start : start + GRID] for start in range(0, len(cells), GRID)]
        lines = ",\n".join(
            "  " + ",".join(json.dumps(cell, separators=(",", ":")) for cell in row) for row in rows
        )
        themes.append(f'"{theme}": [\n{lines}\n]')
    text = "{\n" + ",\n".join(themes) + "\n}\n"
    (PICTURES / f"{widget}.json").write_text(text, encoding="utf-8")
