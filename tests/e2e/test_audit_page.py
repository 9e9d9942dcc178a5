"""The page of the audit log in a real browser: search, older entries, export, small screens."""

import json
from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.e2e.axe import faults, prepare
from tests.e2e.browser import Size
from tests.e2e.conftest import PageMaker
from tests.e2e.dev_pages import Start
from urc.runtime.audit import AuditLog
from urc.runtime.audit_check import check_export
from urc.runtime.audit_entry import AuditEntry

pytestmark = pytest.mark.anyio

ROWS = "[data-entries] > tr"
HOSTILE = "<img src=x onerror=alert(1)>\u202e"
MOVES = 250
SIGN_INS = "signed+in,sign-in+failed,signed+out,revoked,pairing"


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Return a data folder with a long log."""
    folder = tmp_path / "data"
    with AuditLog(folder / "audit.sqlite") as log:
        for number in range(MOVES):
            who = "Ann" if number % 2 else "Ben"
            log.add(
                AuditEntry(
                    1_700_000_000.0 + number, "puppet", "moved", who, "drive", "s1", 7, "drive",
                    '{"speed": 0.5}', "5620", "begins", principal=who, way="passkey",
                    place="192.0.2.7",
                )
            )  # fmt: skip
        log.add(AuditEntry(1_700_000_900.0, "", "sign-in failed", HOSTILE, outcome=HOSTILE))
        assert log.settle(10)
    return folder


async def opened(page: Page, urc_process: Start, data: Path, query: str = "") -> str:
    """Open the page at an emulated robot's server, and return the address of the server."""
    words = ("serve", "puppet", "--simulate", "--port", "0", "--data-dir", str(data))
    process = urc_process(*words)
    address = str((await process.wait_for_async(r"(http://\S+)"))[1])
    await page.goto(address)
    pages = page.get_by_role("button", name="Pages of URC")
    if await pages.is_visible():
        await pages.click()
    await page.get_by_role("link", name="Audit log").click()
    if query:
        await page.goto(page.url + query)
    await expect(page.locator("[data-said]")).not_to_be_empty()
    return address


async def test_entries_are_searched_and_older_ones_loaded(
    new_page: PageMaker, urc_process: Start, data: Path
) -> None:
    page = await new_page("desktop")
    await opened(page, urc_process, data)
    await expect(page.locator(ROWS)).to_have_count(100)
    await expect(page.locator(ROWS).first).to_contain_text("start key · may administer")
    await page.get_by_role("button", name="Load older entries").click()
    await expect(page.locator(ROWS)).to_have_count(200)
    await page.get_by_role("button", name="Load older entries").click()
    await expect(page.locator(ROWS)).to_have_count(MOVES + 3)
    await expect(page.get_by_role("button", name="Load older entries")).to_be_hidden()
    await page.get_by_label("Person, device or address").fill("ann")
    await page.get_by_label("Event").select_option("Motion")
    await expect(page.locator("[data-said]")).to_have_text("the newest 100 entries")
    await expect(page.locator(ROWS).first).to_contain_text("passkey · may drive · 192.0.2.7")
    assert "who=ann" in page.url
    await page.reload()
    await expect(page.locator(ROWS)).to_have_count(100)
    await expect(page.get_by_label("Person, device or address")).to_have_value("ann")
    await page.get_by_label("Text").fill("no such text")
    await expect(page.locator("[data-said]")).to_have_text("No entry matches the search.")
    await expect(page.locator("[data-table]")).to_be_hidden()
    await page.get_by_role("button", name="Clear the search").click()
    await expect(page.locator(ROWS)).to_have_count(100)
    assert "?" not in page.url


async def test_texts_of_others_are_text(
    new_page: PageMaker, urc_process: Start, data: Path
) -> None:
    page = await new_page("desktop")
    await opened(page, urc_process, data, f"?what={SIGN_INS}")
    row = page.locator(ROWS)
    await expect(row).to_have_count(2)
    await expect(row.last).to_contain_text("<img src=x")
    await expect(page.locator(f"{ROWS} img")).to_have_count(0)


async def test_export_can_be_checked(new_page: PageMaker, urc_process: Start, data: Path) -> None:
    page = await new_page("desktop")
    await opened(page, urc_process, data)
    async with page.expect_download() as waiting:
        await page.get_by_role("link", name="Export").click()
    file = await (await waiting.value).path()
    lines = file.read_text("utf-8").splitlines(keepends=True)
    found = check_export(lines)
    assert (found.fault, found.gap) == ("", "")
    assert found.entries == MOVES + 4
    assert json.loads(lines[-1])["what"] == "audit"


@pytest.mark.needs("axe")
@pytest.mark.parametrize("size", ["phone", "tablet", "desktop"])
async def test_page_is_for_everybody_on_each_screen(
    new_page: PageMaker, urc_process: Start, data: Path, size: Size
) -> None:
    page = await prepare(await new_page(size))
    await opened(page, urc_process, data)
    assert await faults(page) == []
    wide = await page.evaluate("document.documentElement.scrollWidth - innerWidth")
    assert wide <= 0
    await page.locator("[data-filters]").evaluate("(el) => { el.open = true; }")
    assert await faults(page) == []
    await expect(page.get_by_label("Text")).to_be_visible()
