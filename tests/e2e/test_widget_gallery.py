"""Every widget in every state of its demo, in four themes and three sizes, in a real browser.

``URC_THOROUGH=1 python -m pytest tests/e2e/test_widget_gallery.py --update`` takes all pictures
again; look at them with ``scripts/widget_pictures.py`` before they are committed.
"""

import re

import pytest
from playwright.async_api import Page, TimeoutError

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard
from tests.e2e.gallery import (
    CELL_SIZES,
    EXHIBITS,
    HIGH,
    MOST_DIFFERENT,
    ONLY,
    THEMES,
    difference,
    groups,
    keep,
    kept,
    lasting_faults,
    resize,
    settled,
    show,
    states_of,
)
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

LOW = (
    *("joystick", "dpad", "axis", "tilt", "keyboard", "value"),
    *("button", "number", "select", "switch", "text", "sequence", "log"),
    *("slider", "battery", "plot", "link"),
)
LOW_CELLS = (
    (126, 128),
    (171, 128),
    (229, 104),
    (356, 128),
    (305, 150),
    (305, 216),
    (258, 202),
    (226, 248),
    (165, 236),
)
"""As grids of several columns have them on phones, upright and on their sides, and on desktops."""
REPEAT_MS = 1000
"""So often the gallery keeps its readings as old as they are meant to be."""
DIGITS = re.compile(r"\d+ px ")

TERMINAL_GROUND = """
() => [".xterm-scrollable-element", ".terminal-list"].map(
  (part) => getComputedStyle(document.querySelector(part)).backgroundColor,
)
"""
"""Returns the colour that the terminal has drawn, and the page's."""

SHOWS = """
([widget, state, texts]) => {
  const cell = document.querySelector(`[data-widget="${widget}"][data-state-name="${state}"]`);
  return texts.every((text) => cell.textContent.includes(text));
}
"""


async def opened(page: Page, address: str, group: str) -> None:
    """Open the widgets of a group; return when they stand, with the modules that they load late."""
    await page.emulate_media(reduced_motion="reduce")
    await page.goto(f"{address}widgets/{group}/")
    await page.wait_for_selector("[data-gallery][data-ready]")
    await page.wait_for_function("() => !document.querySelector('.urc-cell [aria-busy=true]')")


async def promised(page: Page, group: str) -> None:
    """Wait for the texts that the demos promise."""
    for (widget, name), state in states_of(group).items():
        try:
            await page.wait_for_function(SHOWS, arg=[widget, name, state.shows])
        except TimeoutError:
            cell = page.locator(f"[data-widget='{widget}'][data-state-name='{name}']")
            text = await cell.text_content()
            pytest.fail(f"{widget} {name}: {state.shows} is not all in {text!r}")


async def faults_of(page: Page) -> list[str]:
    """Return what a person would see that is wrong, in each size and theme."""
    # Most faults are the same in each theme: told once, with the first.
    faults: dict[str, str] = {}
    for size in CELL_SIZES:
        for theme in THEMES:
            await show(page, theme, size)
            for fault in await lasting_faults(page, EXHIBITS):
                faults.setdefault(f"{size}: {DIGITS.sub('', fault)}", f"{theme} {fault}")
    return [f"{key} ({first})" for key, first in faults.items()]


@pytest.mark.parametrize("group", groups())
async def test_widgets_are_whole_and_look_as_they_did(
    new_page: PageMaker, group: str, request: pytest.FixtureRequest
) -> None:
    """Texts are there, nothing hangs over, is cut, blank or an error; from far nothing changed."""
    names = group.split("+")
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        page = await new_page(size="desktop")
        await opened(page, address, group)
        await promised(page, group)
        assert not await page.locator(".urc-fault").all_inner_texts()
        faults = await faults_of(page)
        seen: dict[str, dict[str, list[list[int]]]] = {name: {} for name in names}
        await page.evaluate(ONLY, True)
        await page.set_viewport_size(HIGH)
        for theme in THEMES:
            await show(page, theme, "tablet")
            for name, grid in (await settled(page, names, theme)).items():
                seen[name][theme] = grid
    if request.config.getoption("--update"):
        for name, pictures in seen.items():
            keep(name, pictures)
    for name, pictures in seen.items():
        before = kept(name)
        assert before.keys() == pictures.keys(), f"{name} has no picture yet: run with --update"
        faults += [
            f"{name} looks otherwise in {theme}"
            for theme, grid in pictures.items()
            if difference(before[theme], grid) > MOST_DIFFERENT
        ]
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize("widget", LOW)
async def test_widgets_are_whole_in_low_cells(new_page: PageMaker, widget: str) -> None:
    """Whatever the shape of a cell, no drawing, control or text of it is cut."""
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        page = await new_page(size="desktop")
        await opened(page, address, widget)
        faults = {}
        for size in LOW_CELLS:
            await resize(page, *size)
            faults[size] = await lasting_faults(page, EXHIBITS)
    assert {size: each for size, each in faults.items() if each} == {}


async def test_a_reading_that_is_kept_alive_is_no_new_one(new_page: PageMaker) -> None:
    """What hears each reading hears it once, however long the gallery is looked at."""
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        page = await new_page(size="desktop")
        await opened(page, address, "terminal")
        lines = page.locator("[data-state-name='normal'] .terminal-list > li")
        before = await lines.all_inner_texts()
        await page.wait_for_timeout(2.5 * REPEAT_MS)
        assert await lines.all_inner_texts() == before
        assert await page.locator("[data-state-name='normal'] .terminal[data-state='live']").count()


async def test_a_theme_is_shown_at_once(new_page: PageMaker) -> None:
    """Also by what draws its colours itself; not when the gallery happens to draw again."""
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        page = await new_page(size="desktop")
        await opened(page, address, "terminal")
        for theme in THEMES * 3:
            await show(page, theme, "tablet")
            drawn, wanted = await page.evaluate(TERMINAL_GROUND)
            assert drawn == wanted, theme
