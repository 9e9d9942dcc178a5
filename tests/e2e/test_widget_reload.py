"""An author's widget under ``--dev``: each save is shown at once, mistakes with their place."""

from pathlib import Path

import pytest
from playwright.async_api import expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dev_pages import ROBOT, Start
from urc.cli.main import main

pytestmark = pytest.mark.anyio


@pytest.mark.parametrize(
    ("name", "before", "after", "told"),
    [
        ("demo.yaml", "{ value: 12.5 }", "{ valu: 12.5 }", r"demo\.yaml:9:23: error unknown-key"),
        ("demo.yaml", "  normal: {", "  normal: {{", r"demo\.yaml:\d+:\d+: error"),
        ("widget.yaml", "summary:", "sumary:", r"widget\.yaml:\d+:1: error unknown-key sumary"),
        ("widget.yaml", "options:\n", "options: [\n", r"widget\.yaml:\d+:\d+: error"),
    ],
)
async def test_a_mistake_is_told_on_the_page_and_mending_it_brings_the_page_back(
    new_page: PageMaker,
    urc_process: Start,
    tmp_path: Path,
    name: str,
    before: str,
    after: str,
    told: str,
) -> None:
    """Nobody reloads anything, and the terminal says it too."""
    assert main(["new", "widget", "throttle", "--into", str(tmp_path / "widgets")]) == 0
    robot = tmp_path / "bell.yaml"
    robot.write_text(ROBOT.replace("PORT", "1"), "utf-8")
    data = str(tmp_path / "data")
    words = ("serve", str(robot), "--set", "password=x", "--port", "0", "--data-dir", data)
    process = urc_process(*words, "--dev")
    address = (await process.wait_for_async(r"(http://\S+)"))[1]
    page = await new_page()
    new_page.allow(page, lambda text: "409" in text)
    await page.goto(f"{address}widgets/throttle/")
    cells = page.locator("[data-widget='throttle']")
    await expect(cells).to_have_count(6)
    file = tmp_path / "widgets" / "throttle" / name
    sound = file.read_text("utf-8")
    assert before in sound
    file.write_text(sound.replace(before, after, 1), "utf-8")
    await page.wait_for_function(
        "(told) => new RegExp(told).test(document.querySelector('main')?.textContent)", arg=told
    )
    await expect(cells).to_have_count(0)
    await process.wait_for_async(told)
    file.write_text(sound, "utf-8")
    await expect(cells).to_have_count(6)
    await page.goto("about:blank")  # before the server goes
