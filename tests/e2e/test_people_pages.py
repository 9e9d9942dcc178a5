"""The pages of sign-in, people and one's own account, in real Chromium."""

from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.e2e.axe import faults, prepare
from tests.e2e.browser import Size
from tests.e2e.conftest import PageMaker
from tests.e2e.gallery import THEMES
from tests.e2e.motion.driving import CALM_LEASE_S, Wire
from tests.e2e.people_server import PASSPHRASE, PeopleServer, is_refusal, people_server
from tests.e2e.test_accessibility import check, check_tab, themed

pytestmark = pytest.mark.anyio


async def sign_in(page: Page, name: str, passphrase: str = PASSPHRASE) -> None:
    """Fill in the sign-in page."""
    await page.get_by_label("Name").fill(name)
    await page.get_by_label("Passphrase").fill(passphrase)
    await page.get_by_role("button", name="Sign in", exact=True).click()


async def test_a_person_signs_in_and_comes_to_the_requested_page(
    new_page: PageMaker, tmp_path: Path
) -> None:
    page = await new_page()
    new_page.allow(page, is_refusal)
    async with people_server(tmp_path, Wire()) as server:
        await server.add("Ann", "drive", passphrase=PASSPHRASE)
        wanted = f"{server.address}robots/puppet/?watch"
        await page.goto(wanted)
        await sign_in(page, "Ann", "not this one")
        alert = page.get_by_role("alert")
        await expect(alert).to_have_text("▲ The name or the passphrase is wrong.")
        await sign_in(page, "Ann")
        await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
        assert page.url == wanted
        await page.goto(f"{server.address}account")
        await page.get_by_role("button", name="Sign out").click()
        await expect(page.locator("h1")).to_have_text("Sign in")


async def test_stop_works_on_the_sign_in_page(new_page: PageMaker, tmp_path: Path) -> None:
    page = await new_page(size="phone")
    new_page.allow(page, is_refusal)
    async with people_server(tmp_path, Wire()) as server:
        await server.add("Ann", "drive", passphrase=PASSPHRASE)
        await page.goto(server.address)
        await expect(page.get_by_label("Passphrase")).to_be_visible()
        await page.locator("[data-early-stop]").tap()
        await expect(page.locator(".urc-stop-note")).to_contain_text("Stop")


async def test_an_administrator_adds_grants_renames_and_removes(
    new_page: PageMaker, tmp_path: Path
) -> None:
    page = await new_page()
    new_page.allow(page, is_refusal)
    async with people_server(tmp_path, Wire()) as server:
        await server.enter(page, "people")
        await page.get_by_text("Add a person").first.click()
        form = page.locator("[data-add=person]")
        await form.get_by_label("Name").fill("Ben")
        await form.get_by_label("Role").select_option("watch")
        await form.get_by_role("button").click()
        row = page.locator('[data-principal="Ben"]')
        await expect(row).to_contain_text("watch, all robots")

        await row.get_by_role("button", name="Roles of Ben").click()
        dialog = page.get_by_role("dialog")
        await dialog.locator("[name=role]").select_option("drive")
        await dialog.locator("[name=scope]").select_option("@puppet")
        await dialog.get_by_role("button", name="Add", exact=True).click()
        await dialog.get_by_role("button", name="Save").click()
        await expect(row).to_contain_text("watch, all robots; drive, puppet")

        await row.get_by_role("button", name="Rename Ben").click()
        await dialog.get_by_label("Name").fill("Ben Lee")
        await dialog.get_by_role("button", name="Save").click()
        row = page.locator('[data-principal="Ben Lee"]')
        await row.get_by_role("button", name="Remove Ben Lee").click()
        await expect(dialog).to_contain_text("Remove Ben Lee?")
        await dialog.get_by_role("button", name="Cancel").click()
        await expect(row).to_be_visible()
        await row.get_by_role("button", name="Remove Ben Lee").click()
        await dialog.get_by_role("button", name="Remove").click()
        await expect(page.locator('[data-rows="people"]')).to_have_text("No people yet.")


async def test_a_token_is_shown_once(new_page: PageMaker, tmp_path: Path) -> None:
    page = await new_page()
    async with people_server(tmp_path, Wire()) as server:
        await server.enter(page, "people")
        await page.get_by_text("Add a token").first.click()
        form = page.locator("[data-add=program]")
        await form.get_by_label("Name").fill("Patrol")
        await form.get_by_role("button").click()
        secret = page.locator("[data-dialog] [data-secret]")
        token = str(await secret.text_content())
        assert len(token) > 32
        await page.get_by_role("button", name="Done").click()
        await page.reload()
        await expect(page.locator('[data-principal="Patrol"]')).to_be_visible()
        assert token not in await page.content()


async def test_a_driver_who_is_revoked_stops(new_page: PageMaker, tmp_path: Path) -> None:
    admin, driver = await new_page(), await new_page(size="tablet")
    new_page.allow(driver, is_refusal)
    async with people_server(tmp_path, Wire(lease_s=CALM_LEASE_S)) as server:
        await server.add("Ben", "drive", passphrase=PASSPHRASE)
        await driver.goto(f"{server.address}robots/puppet/")
        await sign_in(driver, "Ben")
        await driver.locator("[data-verb=take]").tap()
        controls = driver.locator("[data-controls]")
        await expect(controls).to_have_attribute("data-state", "mine")
        await server.enter(admin, "people")
        await admin.get_by_role("button", name="End all sign-ins of Ben").click()
        await admin.get_by_role("dialog").get_by_role("button", name="End all").click()
        await expect(controls).not_to_have_attribute("data-state", "mine")


async def filled(server: PeopleServer) -> None:
    """Give the server people and devices of all kinds."""
    await server.add("Ann Lee", "administer", passphrase=PASSPHRASE)
    await server.add("Käthe Müller-Lüdenscheidt von Hohenfels", "drive@#lab", "watch")


async def test_a_shared_tablet_changes_its_operator_in_two_taps(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """The sign-in page opens with two taps; the robot stops, and the next person drives."""
    tablet = await new_page(size="tablet")
    new_page.allow(tablet, is_refusal)
    wire = Wire(lease_s=CALM_LEASE_S)
    async with people_server(tmp_path, wire) as server:
        for name in ("Ann", "Ben"):
            await server.add(name, "drive", passphrase=PASSPHRASE)
        url = f"{server.address}robots/puppet/"
        await tablet.goto(url)
        await sign_in(tablet, "Ann")
        await tablet.locator("[data-verb=take]").tap()
        controls = tablet.locator("[data-controls]")
        await expect(controls).to_have_attribute("data-state", "mine")

        await tablet.get_by_role("button", name="This device").tap()
        await tablet.locator("[data-change-operator]").tap()
        await sign_in(tablet, "Ben")
        await tablet.wait_for_url(url)
        await tablet.locator("[data-verb=take]").tap()
        await expect(controls).to_have_attribute("data-state", "mine")
        names = {
            server.access.control.directory.principals[one.principal].name
            for one in server.access.control.directory.sign_ins.values()
            if one.way == "passphrase"
        }
        assert names == {"Ben"}


@pytest.mark.needs("axe")
@pytest.mark.parametrize("size", ["phone", "desktop"])
async def test_the_pages_have_no_faults_of_accessibility(
    new_page: PageMaker, tmp_path: Path, size: Size
) -> None:
    page = await prepare(await new_page(size=size))
    new_page.allow(page, is_refusal)
    async with people_server(tmp_path, Wire()) as server:
        await filled(server)
        for path in ("", "pair", "join", "guest", "sign-in"):
            await page.goto(f"{server.address}{path}")
            await check(page, path or "sign-in page", *THEMES)
        await server.enter(page)
        for path in ("people", "account"):
            await page.goto(f"{server.address}{path}")
            await expect(page.locator(".urc-row:visible").first).to_be_visible()
            await check(page, path, *THEMES)
        await page.goto(f"{server.address}people")
        await page.locator("[data-add=device] [type=submit]").click()
        await expect(page.locator(".urc-qr")).to_be_visible()
        await themed(page, THEMES[0])
        assert not await faults(page)


@pytest.mark.needs("axe")
async def test_every_control_is_reached_by_tab(new_page: PageMaker, tmp_path: Path) -> None:
    page = await new_page()
    new_page.allow(page, is_refusal)
    async with people_server(tmp_path, Wire()) as server:
        await filled(server)
        await page.goto(server.address)
        await check_tab(page, "sign-in page")
        await server.enter(page, "people")
        await expect(page.locator(".urc-row:visible").first).to_be_visible()
        await check_tab(page, "people")


@pytest.mark.parametrize("width", [320, 390, 820])
async def test_no_page_is_wider_than_the_screen(
    new_page: PageMaker, tmp_path: Path, width: int
) -> None:
    page = await new_page()
    new_page.allow(page, is_refusal)
    await page.set_viewport_size({"width": width, "height": 844})
    async with people_server(tmp_path, Wire()) as server:
        await filled(server)
        for path in ("", "pair", "join"):
            await page.goto(f"{server.address}{path}")
            assert await page.evaluate("document.documentElement.scrollWidth") <= width, path
        await server.enter(page)
        for path in ("people", "account"):
            await page.goto(f"{server.address}{path}")
            await expect(page.locator(".urc-row:visible").first).to_be_visible()
            assert await page.evaluate("document.documentElement.scrollWidth") <= width, path
