"""The playground in a real browser, from static files under a path, without other hosts."""

import json
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from random import Random
from typing import Literal

import anyio
import pytest
from playwright.async_api import Browser, Locator, Page, expect

from scripts.playground import write
from tests.contract.test_broken_documents import BROKEN, DOCUMENTS
from tests.e2e import axe
from tests.e2e.playground import (
    OFFLINE,
    WITHIN_MS,
    all_files,
    command_report,
    opened,
    put,
    served,
    shown_report,
    start,
)

pytestmark = [
    pytest.mark.anyio,
    pytest.mark.needs("node"),
    pytest.mark.needs("pyodide"),
]

GESTURES = 5
"""Gestures until the robot has moved: the first one may only take the controls, and a pause of a
busy machine ends a gesture."""
PLACE = "some/path/playground"
ROOT = Path(__file__).resolve().parents[2]
FIRST = "dash/robots/turtlebot4.yaml"
SAMPLE = Random(22).sample(DOCUMENTS, 12)  # noqa: S311  # no secret
"""A browser takes a second for each; `tests/contract/test_stand_ins.py` compares all of them."""


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a built playground, under a path."""
    folder = tmp_path_factory.mktemp("site")
    write(folder / PLACE)
    return folder


@pytest.fixture(scope="module")
def address(root: Path) -> Iterator[str]:
    """The address of the playground."""
    with served(root) as url:
        yield f"{url}{PLACE}/"


@pytest.fixture(scope="module")
async def started(browser: Browser, address: str) -> AsyncIterator[Page]:
    """One page for all tests that change only its text: the start of Python takes half a minute."""
    async with opened(browser, address) as page:
        await start(page)
        yield page


@pytest.fixture
async def page(started: Page) -> Page:
    """The page with the TurtleBot in its frame, and without problems in its text."""
    area = started.locator("textarea")
    await area.fill(await started.evaluate(f"async () => (await fetch({FIRST!r})).text()"))
    title = started.frame_locator("iframe").locator(".urc-bar-title")
    await expect(title).to_have_text("TurtleBot 4", timeout=WITHIN_MS)
    await expect(started.locator(".urc-editor-problems li")).to_have_count(0, timeout=WITHIN_MS)
    return started


async def test_reports_are_those_of_the_command(page: Page) -> None:
    """Place, severity, code and message of every problem, for a sample of the broken documents."""
    found = await put(page, all_files(BROKEN), SAMPLE)
    mine = {name: shown_report(one) for name, one in zip(SAMPLE, found, strict=True)}
    assert mine == {name: shown_report(command_report(BROKEN, name)) for name in SAMPLE}
    assert any(mine.values())


async def test_a_turtlebot_is_driven_let_go_and_stopped(page: Page) -> None:
    """By a hand on the real dashboard: it moves while held, and not after STOP."""
    await drive_and_let_go(page)
    frame = page.frame_locator("iframe")
    place = frame.locator("[data-cell]").filter(has_text="Position")
    await frame.locator("[data-stop-button]").click()
    await expect(frame.locator("[data-latched]")).to_be_visible()
    still = await place.inner_text()
    pad = frame.locator(".joystick-pad")
    assert not await pushed(page, pad, lambda: place.inner_text(), still)
    await frame.locator("[data-verb='reset']").first.click()
    await expect(frame.locator("[data-latched]")).to_be_hidden()


async def drive_and_let_go(page: Page) -> None:
    """Fail unless the robot moves while the stick is held, and stops when it is let go."""
    frame = page.frame_locator("iframe")
    place = frame.locator("[data-cell]").filter(has_text="Position")
    speed = frame.locator("[data-cell]").filter(has_text="Speed").first
    pad = frame.locator(".joystick-pad")
    before = await place.inner_text()
    for _ in range(GESTURES):
        if await pushed(page, pad, lambda: place.inner_text(), before):
            break
    assert await place.inner_text() != before
    # A robot that has moved leans, and its camera with it.
    await expect(frame.locator(".camera")).to_have_attribute("data-state", "live")
    await expect(speed).to_contain_text("0.00")


async def pushed(page: Page, pad: Locator, read: Callable[[], Awaitable[str]], before: str) -> bool:
    """Push the stick forward and let go; return whether the reading has changed meanwhile."""
    box = await pad.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    await page.mouse.move(x, y)
    await page.mouse.down()
    await page.mouse.move(x, y - box["height"] / 3, steps=3)
    for _ in range(20):
        await page.wait_for_timeout(100)
        if await read() != before:
            break
    await page.mouse.up()
    return await read() != before


async def test_an_edit_changes_the_robot_and_an_error_does_not(page: Page) -> None:
    """The frame shows the newest valid text; a problem is listed with its place."""
    area = page.locator("textarea")
    text = await area.input_value()
    await area.fill(text.replace("title: TurtleBot 4\n", "title: Edited robot\n", 1))
    title = page.frame_locator("iframe").locator(".urc-bar-title")
    await expect(title).to_have_text("Edited robot", timeout=WITHIN_MS)
    await area.fill(text.replace("kind: robot", "kind: robbot", 1))
    problem = page.locator(".urc-editor-problems li").first
    lines = (ROOT / "robots/turtlebot4.yaml").read_text("utf-8").splitlines()
    line = lines.index("kind: robot") + 1
    await expect(problem).to_contain_text(f"line {line}", timeout=WITHIN_MS)
    await expect(title).to_have_text("Edited robot")


async def test_an_edit_waits_until_the_robot_is_at_rest(page: Page) -> None:
    """A robot is never replaced under a hand; the newest text follows without another edit."""
    frame = page.frame_locator("iframe")
    title = frame.locator(".urc-bar-title")
    area = page.locator("textarea")
    text = await area.input_value()
    pad = await frame.locator(".joystick-pad").bounding_box()
    assert pad is not None
    await page.mouse.move(pad["x"] + pad["width"] / 2, pad["y"] + pad["height"] / 2)
    await page.mouse.down()
    await area.evaluate(
        "(area, text) => { area.value = text; area.dispatchEvent(new Event('input')); }",
        text.replace("title: TurtleBot 4\n", "title: Waiting robot\n", 1),
    )
    await expect(page.locator("[data-state]").first).to_have_text(
        "The new text waits until no one drives the robot.", timeout=WITHIN_MS
    )
    await expect(title).to_have_text("TurtleBot 4")
    await page.mouse.up()
    await expect(title).to_have_text("Waiting robot", timeout=WITHIN_MS)


async def test_lines_stay_next_to_their_numbers(page: Page) -> None:
    """The text area has all its lines in sight, so it never scrolls within its frame."""
    heights = await page.evaluate(
        """() => ["textarea", ".urc-editor-numbers", ".urc-editor-marks"].map((name) => {
          const { offsetHeight, scrollHeight } = document.querySelector(name);
          return [offsetHeight, scrollHeight];
        })"""
    )
    assert heights[0][0] > 1000
    assert {one for pair in heights for one in pair} == {heights[0][0]}


async def test_a_link_carries_the_text(page: Page, browser: Browser, address: str) -> None:
    """The fragment has the whole text, which is checked at once."""
    text = json.loads('"urc: 1\\nkind: robot\\nname: é😀\\n"')
    link = await page.evaluate(
        "async (text) => (await import('./text_link.js')).fragmentOf(text)", text
    )
    async with opened(browser, address, link) as other:
        assert await other.locator("textarea").input_value() == text
        problem = other.locator(".urc-editor-problems li").first
        await expect(problem).to_be_visible(timeout=WITHIN_MS)


@pytest.mark.parametrize("theme", ["light", "dark"])
async def test_the_page_is_accessible(page: Page, theme: Literal["light", "dark"]) -> None:
    """By the rules of axe, with a report in sight."""
    await page.emulate_media(color_scheme=theme)
    await page.locator("textarea").fill("urc: 1\nkind: robbot\nname: x\n")
    await expect(page.locator(".urc-editor-problems li").first).to_be_visible(timeout=WITHIN_MS)
    assert await axe.faults(page) == []


async def test_once_loaded_it_works_without_a_server(browser: Browser, root: Path) -> None:
    """After the server has ended, the page is loaded again, and the robot is driven."""
    with ExitStack() as stack:
        url = f"{stack.enter_context(served(root))}{PLACE}/"
        async with opened(browser, url) as page:
            await start(page)
            await expect(page.locator("[data-state]")).to_contain_text(OFFLINE, timeout=WITHIN_MS)
            stack.close()
            host, _, port = url.split("/")[2].partition(":")
            with pytest.raises(OSError, match="connect"):
                await anyio.connect_tcp(host, int(port))
            answer = await page.reload()
            assert answer is not None
            assert answer.from_service_worker
            await start(page)
            await drive_and_let_go(page)


def test_the_build_names_no_other_host(root: Path) -> None:
    """Neither the page nor its modules, apart from the interpreter, contain an address."""
    home = root / PLACE
    ours = [*home.glob("*.js"), *home.glob("*.html"), *home.glob("*.css")]
    assert len(ours) > 8
    assert [
        file.name for file in ours if "http://" in (said := file.read_text()) or "https://" in said
    ] == []
