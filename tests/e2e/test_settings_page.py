"""The settings of a robot in a real browser: defaults, marks of changes, summaries of groups."""

from pathlib import Path

import pytest
from playwright.async_api import Dialog, Locator, Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.managing import emulated_rover, running_managed
from tests.e2e.test_languages import CUT
from tests.unit.packages.made import DOCUMENTS, install, package
from urc.packages.store import Store
from urc.runtime.open_profile import open_document

pytestmark = pytest.mark.anyio

FIELDS = ("host", "pace", "baud")

ROVER = """\
urc: 1
kind: robot
name: rover
settings:
  host: { type: host, default: 127.0.0.1, title: Robot address }
  port: { type: port, default: 6789 }
  key: { type: string, secret: true, required: false, title: Key, group: Login }
  pace: { type: integer, min: 1, max: 9, default: 3, title: Pace, group: Wheels }
  look: { type: choice, choices: [dawn, dusk], default: dawn, title: Look, group: Wheels }
  note: { type: string, default: "", title: Note, group: Wheels }
transports:
  wire: { type: tcp, host: "{{ settings.host }}", port: "{{ settings.port }}", framing: LF }
signals: { charge: { type: integer, unit: "%" } }
polls:
  - { every: 1s, send: "charge? {{ settings.pace }}", reply: { regex: '^(?P<charge>[0-9]+)$' } }
commands:
  shout: { send: "{{ settings.key }} {{ settings.look }} {{ settings.note }}" }
widgets: { charge: { use: battery, bind: { level: charge } } }
interfaces: { default: { title: Drive, grid: charge } }
""".replace("LF", "{ type: delimiter, rx: LF, tx: LF }")


async def settings_of(page: Page, address: str) -> None:
    """Open the settings of the rover, with all groups as they are at first."""
    await page.goto(f"{address}robots/rover/settings")
    await expect(page.get_by_role("button", name="Test connection")).to_be_enabled()


def group(page: Page, title: str) -> Locator:
    """Return the summary of a group."""
    return page.locator("summary").filter(has_text=title).locator("[data-group-says]")


def rover(tmp_path: Path, text: str = ROVER) -> Path:
    """Write the rover's profile."""
    robot = tmp_path / "rover.yaml"
    robot.write_text(text, encoding="utf-8")
    return robot


async def test_an_unsaved_field_is_marked_and_goes_back_to_its_default(
    new_page: PageMaker, tmp_path: Path
) -> None:
    profile = open_document(rover(tmp_path))
    async with running_managed(tmp_path / "data", [profile]) as address:
        page = await new_page()
        await settings_of(page, address)
        said, port = page.locator("[data-said]"), page.locator("[data-field='port']")
        back = port.get_by_role("button", name="Use the default")
        await expect(said).to_have_text("All changes are saved")
        await expect(port.locator("[data-unsaved]")).to_be_hidden()
        await expect(back).to_be_hidden()
        await page.get_by_label("Robot address").fill("10.0.0.5")
        await expect(said).to_have_text("◆ 1 change is not saved")
        await page.get_by_label("Port").fill("7000")
        await expect(said).to_have_text("◆ 2 changes are not saved")
        await expect(page.get_by_label("Port")).to_have_accessible_description(
            "Default: 6789 A port, 1 to 65535 Not saved"
        )
        await expect(back).to_have_accessible_description("Port")
        await back.click()
        await expect(page.get_by_label("Port")).to_have_value("")
        await expect(page.get_by_label("Port")).to_be_focused()
        await expect(port.locator("[data-unsaved]")).to_be_hidden()
        await expect(back).to_be_hidden()
        await expect(said).to_have_text("◆ 1 change is not saved")


async def test_a_saved_field_is_not_marked_and_still_has_the_way_back(
    new_page: PageMaker, tmp_path: Path
) -> None:
    async with emulated_rover([]) as port:
        profile = open_document(rover(tmp_path))
        async with running_managed(tmp_path / "data", [profile]) as address:
            page = await new_page()
            await settings_of(page, address)
            await page.get_by_label("Port").fill(str(port))
            await page.get_by_role("button", name="Test & save").click()
            said, field = page.locator("[data-said]"), page.locator("[data-field='port']")
            await expect(said).to_have_text("✓ Saved and in use")
            await expect(field.locator("[data-unsaved]")).to_be_hidden()
            await settings_of(page, address)
            await expect(said).to_have_text("All changes are saved")
            await field.get_by_role("button", name="Use the default").click()
            await expect(field.locator("[data-unsaved]")).to_have_text("Not saved")
            await expect(said).to_have_text("◆ 1 change is not saved")


async def test_a_folded_group_says_what_it_holds(new_page: PageMaker, tmp_path: Path) -> None:
    """Two changed settings are named; more are counted."""
    profile = open_document(rover(tmp_path))
    async with running_managed(tmp_path / "data", [profile]) as address:
        for size in ("phone", "desktop"):
            page = await new_page(size=size)
            await settings_of(page, address)
            wheels, login = group(page, "Wheels"), group(page, "Login")
            await expect(wheels).to_have_text("3 settings, all default")
            await expect(login).to_have_text("1 setting, default")
            await expect(group(page, "Driver")).to_have_text("rover.yaml · Drive")
            assert await page.evaluate(CUT) == []
            await page.locator("summary").filter(has_text="Wheels").click()
            await expect(wheels).to_be_hidden()
            await page.get_by_label("Pace").fill("7")
            await page.get_by_label("Look").select_option("dusk")
            await page.locator("summary").filter(has_text="Wheels").click()
            await expect(wheels).to_have_text("3 settings, changed: Pace, Look")
            await page.locator("summary").filter(has_text="Wheels").click()
            await page.get_by_label("Note").fill("slow")
            await page.locator("summary").filter(has_text="Wheels").click()
            await expect(wheels).to_have_text("3 settings, 3 changed")
            await page.locator("summary").filter(has_text="Login").click()
            await page.get_by_label("Key").fill("open sesame")
            await page.locator("summary").filter(has_text="Login").click()
            await expect(login).to_have_text("1 setting, changed")
            assert await page.evaluate(CUT) == []
            await expect(page.locator("[data-said]")).to_have_text("◆ 4 changes are not saved")


async def test_a_group_with_a_missing_setting_is_open_and_the_setting_is_named(
    new_page: PageMaker, tmp_path: Path
) -> None:
    needy = ROVER.replace(", required: false", "")
    profile = open_document(rover(tmp_path, needy))
    async with running_managed(tmp_path / "data", [profile]) as address:
        page = await new_page(size="phone")
        await settings_of(page, address)
        await expect(page.get_by_label("Key")).to_be_visible()
        await expect(page.locator("[data-field='key']")).to_contain_text("Required.")
        await expect(page.locator("[data-said]")).to_have_text("◆ Not set yet: Key.")
        await expect(page.get_by_role("link", name="Connect")).to_be_hidden()
        await page.get_by_label("Key").fill("open sesame")
        await page.get_by_role("button", name="Save without testing").click()
        await expect(page.locator("[data-said]")).to_have_text("✓ Saved and in use")
        await expect(page.get_by_role("link", name="Connect")).to_be_visible()
        await settings_of(page, address)
        await expect(page.locator("[data-said]")).to_have_text("All changes are saved")
        await page.get_by_role("button", name="Forget Key").click()
        await expect(page.locator("[data-said]")).to_have_text("To be deleted when you save")
        await expect(page.locator("[data-field='key'] [data-unsaved]")).to_be_visible()


async def test_leaving_with_unsaved_input_asks_first(new_page: PageMaker, tmp_path: Path) -> None:
    """After the change is undone or saved, the page can be left without a question."""
    profile = open_document(rover(tmp_path))
    async with running_managed(tmp_path / "data", [profile]) as address:
        page = await new_page()
        await settings_of(page, address)
        asked: list[str] = []

        async def stay(dialog: Dialog) -> None:
            asked.append(dialog.type)
            await dialog.dismiss()

        page.on("dialog", stay)
        back = page.get_by_role("link", name="Back to the menu")
        port = page.get_by_label("Port")
        await port.fill("7000")
        await back.click(no_wait_after=True)
        await until(lambda: asked == ["beforeunload"])
        await expect(port).to_have_value("7000")
        await port.fill("")
        await expect(page.locator("[data-said]")).to_have_text("All changes are saved")
        await back.click()
        await page.wait_for_url(address)
        assert asked == ["beforeunload"]


async def test_another_driver_version_brings_its_own_settings(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """At once, not after a reload: without the new fields, the version could not be saved."""
    data = tmp_path / "data"
    store = Store(data / "packages")
    text = DOCUMENTS["driver"]
    older = text.replace("settings:\n", "settings:\n  baud: { type: integer, default: 9600 }\n")
    newer = text.replace("settings:\n", "settings:\n  pace: { type: integer, default: 3 }\n")
    install(store, package("driver", "rover", "1.0.0", text=older))
    install(store, package("driver", "rover", "1.1.0", text=newer))
    async with running_managed(data) as address:
        page = await new_page()
        await page.goto(f"{address}robots/rover/settings")
        host, pace, baud = (page.locator(f"input[name='{name}']") for name in FIELDS)
        await page.locator("summary").filter(has_text="Further settings").click()
        await expect(pace).to_be_visible()
        await host.fill("10.0.0.5")
        version = page.locator("[data-version]")
        await version.focus()
        await version.select_option("1.0.0")
        await expect(baud).to_be_visible()
        await expect(pace).to_have_count(0)
        await expect(host).to_have_value("10.0.0.5")
        await expect(version).to_be_focused()
        said = page.locator("[data-said]")
        await expect(said).to_have_text("◆ 2 changes are not saved")
        await baud.fill("19200")
        await page.get_by_role("button", name="Save without testing").click()
        await expect(said).to_contain_text("✓ Saved")
        await page.goto(f"{address}robots/rover/settings")
        await expect(baud).to_have_value("19200")
        await expect(version).to_have_value("1.0.0")
        answer = await page.request.get(f"{address}robots/rover/settings?version=9.9.9")
        assert answer.status == 404
