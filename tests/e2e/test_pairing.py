"""Pairing in real Chromium: a phone reads the QR code of another screen, pairs and drives."""

import io
import re
import time
from pathlib import Path

import pytest
import zxingcpp
from PIL import Image
from playwright.async_api import Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.motion.driving import CALM_LEASE_S, Wire
from tests.e2e.people_server import PASSPHRASE, is_refusal, people_server

pytestmark = pytest.mark.anyio

THEMES = ("dark", "light", "sunlight", "night")
LONGEST_S = 15.0
NUMBER = re.compile(r"\d\d \d\d")


async def code_on(page: Page) -> str:
    """Return the text of the QR code in a screenshot of the page, as a camera reads it."""
    await expect(page.locator(".urc-qr")).to_be_visible()
    picture = Image.open(io.BytesIO(await page.screenshot()))
    (found,) = zxingcpp.read_barcodes(picture)
    return found.text


async def test_a_phone_scans_the_code_pairs_and_drives(new_page: PageMaker, tmp_path: Path) -> None:
    """At most 15 s and 3 taps from scanning to driving."""
    admin, phone = await new_page(), await new_page(size="phone")
    new_page.allow(phone, is_refusal)
    async with people_server(tmp_path, Wire(lease_s=CALM_LEASE_S)) as server:
        await server.enter(admin, "people")
        await admin.locator("[data-add=device] [type=submit]").click()
        link = await code_on(admin)
        assert link.startswith(f"{server.address}pair#")

        began_s = time.monotonic()
        await phone.goto(link)
        await phone.get_by_role("button", name="Pair this device").tap()  # 1
        check = phone.locator("[data-check]")
        await expect(check).to_have_text(NUMBER)
        assert phone.url == f"{server.address}pair"
        await phone.get_by_role("link", name="Connect to").tap()  # 2
        await phone.locator("[data-verb=take]").tap()  # 3
        await expect(phone.locator("[data-controls]")).to_have_attribute("data-state", "mine")
        took_s = time.monotonic() - began_s

        dialog = admin.get_by_role("dialog")
        await expect(dialog.get_by_role("heading")).to_have_text(re.compile("is paired$"))
        await dialog.get_by_role("button", name="The numbers are equal").click()
        row = admin.locator('[data-rows="devices"] [data-principal]')
        await expect(row).to_have_count(1)
        assert took_s < LONGEST_S

        # The administrator removes the device while it drives.
        await row.get_by_role("button", name="Remove").click()
        await admin.get_by_role("dialog").get_by_role("button", name="Remove").click()
        await expect(row).to_have_count(0)
        await expect(phone.locator("[data-controls]")).not_to_have_attribute("data-state", "mine")
        await phone.goto(server.address)
        await expect(phone.locator("h1")).to_have_text("Open the printed address")


@pytest.mark.parametrize("theme", THEMES)
async def test_a_camera_reads_the_code_in_every_theme(
    new_page: PageMaker, tmp_path: Path, theme: str
) -> None:
    admin = await new_page(size="phone")
    async with people_server(tmp_path, Wire()) as server:
        await server.enter(admin, "people")
        await admin.evaluate("(theme) => (document.documentElement.dataset.theme = theme)", theme)
        await admin.locator("[data-add=device] [type=submit]").click()
        assert "/pair#" in await code_on(admin)


async def test_both_screens_show_the_same_number(new_page: PageMaker, tmp_path: Path) -> None:
    admin, tablet = await new_page(), await new_page(size="tablet")
    async with people_server(tmp_path, Wire()) as server:
        await server.enter(admin, "people")
        await admin.locator("[data-add=device] [name=name]").fill("Tablet in the lab")
        await admin.locator("[data-add=device] [type=submit]").click()
        await tablet.goto(await code_on(admin))
        name = tablet.get_by_label("Name of this device")
        await expect(name).to_have_value("Tablet in the lab")
        await tablet.get_by_role("button", name="Pair this device").tap()
        await expect(tablet.locator("[data-check]")).to_have_text(NUMBER)
        shown = await tablet.locator("[data-check]").text_content()
        await expect(admin.locator("[data-dialog] [data-check]")).to_have_text(str(shown))


async def test_a_used_code_is_refused_on_the_page(new_page: PageMaker, tmp_path: Path) -> None:
    page = await new_page(size="phone")
    new_page.allow(page, is_refusal)
    async with people_server(tmp_path, Wire()) as server:
        await page.goto(f"{server.address}pair#notacode")
        await expect(page.get_by_role("alert")).to_contain_text("This code is unknown")
        await expect(page.get_by_label("Code or link")).to_be_focused()


async def test_an_invited_person_chooses_a_passphrase_and_watches(
    new_page: PageMaker, tmp_path: Path
) -> None:
    admin, phone = await new_page(), await new_page(size="phone")
    async with people_server(tmp_path, Wire()) as server:
        await server.add("Ben", "watch")
        await server.enter(admin, "people")
        await admin.get_by_role("button", name="Invite Ben").click()
        await phone.goto(await code_on(admin))
        await expect(phone.locator("[data-right]")).to_contain_text("You are Ben.")
        await phone.get_by_label("New passphrase").fill(PASSPHRASE)
        await phone.get_by_label("The same again").fill("another one")
        await phone.get_by_role("button", name="Save and sign in").tap()
        await expect(phone.get_by_role("alert")).to_have_text("▲ The two passphrases differ.")
        await phone.get_by_label("The same again").fill(PASSPHRASE)
        await phone.get_by_role("button", name="Save and sign in").tap()
        await phone.wait_for_url(server.address)
        await expect(phone.locator(".urc-nav-me")).to_contain_text("Ben")


async def test_a_guest_watches_one_robot(new_page: PageMaker, tmp_path: Path) -> None:
    admin, phone = await new_page(), await new_page(size="phone")
    async with people_server(tmp_path, Wire()) as server:
        await server.enter(admin, "people")
        await admin.get_by_text("Make a guest link").first.click()
        guest = admin.locator("[data-add=guest]")
        await guest.get_by_label("Name").fill("Visitors")
        await guest.get_by_role("button").click()
        await phone.goto(await code_on(admin))
        await phone.get_by_role("button", name="Watch").tap()
        await phone.wait_for_url(f"{server.address}robots/puppet/")
        await expect(phone.locator("[data-badge]")).to_have_attribute("data-state", "good")
        await expect(phone.locator("[data-verb=take]")).to_be_hidden()
