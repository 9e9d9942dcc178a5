"""The use cases B.5.1 to B.5.8 of the thesis in a real browser, with the repository on and off."""

import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from anyio import to_thread
from playwright.async_api import Locator, Page, expect

from tests.e2e.axe import CONTRAST, faults, prepare
from tests.e2e.browser import PAGE_TIMEOUT_MS, choose_language
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from tests.e2e.gallery import THEMES
from tests.e2e.managing import (
    GONE,
    Shop,
    emulated_rover,
    fill_lab,
    newer_rover,
    running_managed,
    running_shop,
    set_up,
    static_server,
)
from tests.e2e.motion.driving import calmly_driven, opened, push
from tests.e2e.processes import UrcProcess
from tests.e2e.test_languages import check
from tests.unit.packages.made import DOCUMENTS
from urc.packages.index_builder import make_index
from urc.packages.index_head import IndexSigner
from urc.packages.repositories import Repositories
from urc.packages.signature import read_signer
from urc.packages.store import Store
from urc.runtime.open_profile import open_document
from urc.runtime.settings_store import SettingsStore
from urc.web.words import LANGUAGES

pytestmark = pytest.mark.anyio

expect.set_options(timeout=PAGE_TIMEOUT_MS)
RUNS = pytest.mark.parametrize("is_on", [True, False], ids=["on", "off"])
MANAGERS = ("drivers", "interfaces")
OTHERS = [tag for tag in LANGUAGES if tag != "en"]


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shop]:
    """Run `urc repo serve` for this module; the other one ends once all was got from it."""
    with running_shop(tmp_path_factory.mktemp("shop")) as started:
        yield started


@pytest.fixture
def has(shop: Shop, tmp_path: Path, is_on: bool) -> dict[str, Path]:
    """Return data folders of this test's own: ``empty``, ``bare`` and ``full``."""
    found = {"empty": tmp_path / "empty"}
    for kind in ("bare", "full"):
        found[kind] = tmp_path / kind
        shutil.copytree(shop.folders[is_on, kind], found[kind])
    return found


def installed(data: Path) -> list[str]:
    """Return what was asked for and is there."""
    return [str(lock) for lock in Store(data / "packages").installed()]


def row(page: Page, part: str, package: str) -> Locator:
    """Return the row of a package in one part of a manager's page."""
    return page.locator(f"[data-{part}] [data-package='{package}']")


async def agree(page: Page) -> None:
    """Read what a package may do, say yes, and see it installed."""
    dialog = page.get_by_role("dialog")
    await expect(dialog).to_contain_text("Permissions")
    await dialog.get_by_role("button", name="Install", exact=True).click()
    await expect(dialog).to_contain_text("✓ installed")
    await dialog.get_by_role("button", name="Close").click()
    await expect(dialog).to_be_hidden()


async def unfold(page: Page) -> None:
    """Open all groups of settings."""
    folded = page.locator("[data-group]:not([open]) > summary")
    while await folded.count() > 0:
        await folded.first.click()


@RUNS
async def test_connection_to_a_repository(
    new_page: PageMaker, shop: Shop, has: dict[str, Path], is_on: bool
) -> None:
    """B.5.1: it tells its name and its drivers; one that is off is refused in one line."""
    async with running_managed(has["empty"]) as address:
        page = await new_page(size="phone")
        new_page.allow(page, lambda text: "422" in text)
        await page.goto(address)
        await expect(page.locator("main")).to_contain_text("No driver yet")
        await page.get_by_role("link", name="Open the driver manager").click()
        field = page.get_by_label("Address of a repository")
        url = shop.url if is_on else shop.gone_url
        await field.fill(url.removeprefix("http://"))
        await expect(page.get_by_role("button", name="Connect")).to_be_enabled()
        await field.press("Enter")
        if is_on:
            place = page.locator(f"[data-repository='{url}']")
            await expect(place.get_by_role("heading")).to_have_text("Lab")
            await expect(place).to_contain_text("● 5 package versions")
            await expect(row(page, "available", "drivers/rover")).to_contain_text("rover 1.0.0")
            await page.get_by_label("Search").fill("no such thing")
            await expect(page.locator("[data-count]")).to_have_text("0 found")
            await place.get_by_role("button", name="Forget").click()
            await expect(place).to_have_count(0)
        else:
            await expect(page.locator("main > div [data-said]")).to_contain_text("▲")
            await expect(page.locator("main > div [data-said]")).to_contain_text(url[7:-1])
            await expect(field).to_have_value(url.removeprefix("http://"))
            await expect(page.locator("[data-repository]")).to_have_count(0)


@RUNS
async def test_download_a_driver(
    new_page: PageMaker, shop: Shop, has: dict[str, Path], is_on: bool
) -> None:
    """B.5.2: with all its widgets and interfaces, once it was read what it may do."""
    data = has["bare"]
    async with running_managed(data) as address:
        page = await new_page()
        await page.goto(f"{address}drivers")
        offer = row(page, "available", "drivers/rover")
        await offer.get_by_role("button", name="Install").click()
        dialog = page.get_by_role("dialog")
        if not is_on:
            await expect(dialog).to_contain_text("▲")
            await expect(dialog).to_contain_text(shop.gone_url)
            await dialog.get_by_role("button", name="Close").click()
            known = page.locator(f"[data-repository='{shop.gone_url}']")
            await expect(known).to_contain_text("using its last index")
            assert installed(data) == []
            return
        await expect(dialog).to_contain_text("connects by tcp (wire): host from the settings")
        await expect(dialog).to_contain_text("widgets/dial 1.0.0")
        await dialog.get_by_role("button", name="Cancel").click()
        await expect(dialog).to_be_hidden()
        assert installed(data) == []
        await offer.get_by_role("button", name="Install").click()
        await agree(page)
        mine = row(page, "installed", "drivers/rover")
        await expect(mine).to_contain_text("depends on: interfaces/plain 1.0.0, widgets/dial 1.0.0")
        await expect(page.locator(":focus")).to_have_count(1)
        assert installed(data) == ["drivers/rover 1.0.0"]
        await page.goto(address)
        await expect(page.get_by_role("link", name="Connect to Rover")).to_have_count(0)
        await expect(page.get_by_role("link", name="Settings of Rover").first).to_be_visible()
        await expect(page.locator("main")).to_contain_text("Not set yet: Robot address, Key.")


@RUNS
async def test_remove_a_driver(new_page: PageMaker, has: dict[str, Path]) -> None:
    """B.5.3: what goes with it is said first; the repository is not asked."""
    data = has["full"]
    async with running_managed(data) as address:
        page = await new_page()
        await page.goto(f"{address}drivers")
        mine = row(page, "installed", "drivers/rover")
        await mine.get_by_role("button", name="Remove").click()
        dialog = page.get_by_role("dialog")
        await expect(dialog.get_by_role("listitem")).to_have_text(
            ["drivers/rover 1.0.0", "interfaces/plain 1.0.0", "widgets/dial 1.0.0"]
        )
        await page.keyboard.press("Escape")
        await expect(dialog).to_be_hidden()
        await expect(mine.get_by_role("button", name="Remove")).to_be_focused()
        assert len(installed(data)) == 2
        await mine.get_by_role("button", name="Remove").click()
        await dialog.get_by_role("button", name="Remove").click()
        # The list may change before the server has loaded its robots again.
        await expect(page.locator("main > div [data-said]")).to_contain_text("✓ removed")
        await expect(mine).to_have_count(0)
        assert installed(data) == ["interfaces/wide 1.0.0"]
        await page.goto(address)
        await expect(page.locator("main")).to_contain_text("No driver yet")


@RUNS
async def test_add_an_interface(
    new_page: PageMaker, has: dict[str, Path], is_on: bool, tmp_path: Path
) -> None:
    """B.5.4: by its path in the repository, from a file, and from a folder; then it is offered."""
    data = has["full"]
    set_up(data, 1)
    with Store(data / "packages").changing() as change:
        from urc.packages.names import PackageId, parse_requirement

        change.remove(parse_requirement("interfaces/wide"))
        change.forget_key(PackageId("interface", "wide"))
    async with running_managed(data) as address:
        page = await new_page()
        new_page.allow(page, lambda text: "422" in text)
        await page.goto(f"{address}interfaces")
        if is_on:
            await page.get_by_label("Add by path").fill("/interfaces/wide/")
            await page.get_by_role("button", name="Add", exact=True).click()
        else:
            text = f"urc: 1\nkind: interface\nname: wide\ntitle: Wide\n{DOCUMENTS['interface']}"
            file = tmp_path / "wide.yaml"
            file.write_text(text, encoding="utf-8")
            await page.get_by_label("Or a file on this device").set_input_files(file)
            await page.get_by_role("button", name="Upload").click()
            await page.get_by_label("Accept interfaces/wide without a signature").check()
        await agree(page)
        mine = row(page, "installed", "interfaces/wide")
        await expect(mine).to_contain_text("offered on: Rover")
        await page.get_by_label("Add by path").fill("/nowhere/wide")
        await page.get_by_role("button", name="Add", exact=True).click()
        dialog = page.get_by_role("dialog")
        await expect(dialog).to_contain_text("▲ /nowhere/wide")
        await dialog.get_by_role("button", name="Close").click()
        await page.goto(f"{address}robots/rover/settings")
        await unfold(page)
        await page.get_by_label("Interface").select_option("wide")
        await page.get_by_role("button", name="Save without testing").click()
        await expect(page.locator("[data-said]")).to_have_text("✓ Saved and in use")
        await page.goto(f"{address}robots/rover/")
        await expect(page.locator("[data-interface-choice]")).to_have_value("wide")


@RUNS
async def test_remove_an_interface(new_page: PageMaker, has: dict[str, Path]) -> None:
    """B.5.5: it is offered no more; what came with the driver stays."""
    data = has["full"]
    set_up(data, 1)
    async with running_managed(data) as address:
        page = await new_page()
        await page.goto(f"{address}robots/rover/settings")
        choice = page.get_by_label("Interface").locator("option")
        await expect(choice).to_have_text(["Plain", "Rover", "Wide"])
        await page.goto(f"{address}interfaces")
        mine = row(page, "installed", "interfaces/wide")
        await mine.get_by_role("button", name="Remove").click()
        await page.get_by_role("dialog").get_by_role("button", name="Remove").click()
        # The list may change before the server has loaded its robots again.
        await expect(page.locator("main > div [data-said]")).to_contain_text("✓ removed")
        await expect(mine).to_have_count(0)
        await page.goto(f"{address}robots/rover/settings")
        await expect(choice).to_have_text(["Plain", "Rover"])
        assert installed(data) == ["drivers/rover 1.0.0"]


@RUNS
async def test_connect_to_a_robot_and_disconnect(new_page: PageMaker, has: dict[str, Path]) -> None:
    """B.5.6, B.5.7: settings are tried for real, the robot is shown, and Back lets go of it."""
    data, heard = has["full"], list[str]()
    async with emulated_rover(heard) as port, running_managed(data) as address:
        page = await new_page()
        await page.goto(address)
        await page.get_by_role("link", name="Settings of Rover").click()
        camera = page.locator("[data-field='camera']")
        await expect(camera.locator("input")).to_have_value("")
        await expect(camera.locator("input")).to_have_attribute("placeholder", "127.0.0.1")
        await expect(camera.locator(".urc-is-default")).to_be_visible()
        await expect(camera.locator(".urc-default")).to_have_text("Default: 127.0.0.1")
        test = page.get_by_role("button", name="Test connection")
        save = page.get_by_role("button", name="Save without testing")
        await expect(test).to_be_enabled()
        await expect(save).to_be_hidden()
        await camera.locator("input").fill("127.0.0.2")
        await expect(test).to_have_count(0)
        await expect(save).to_be_enabled()
        await expect(page.locator("[data-save-hint]")).to_contain_text("connects to the robot")
        await expect(camera.locator(".urc-default")).to_have_text("Default: 127.0.0.1")
        await expect(camera.locator(".urc-is-default")).to_be_hidden()
        await camera.locator("input").fill("")
        await expect(save).to_be_hidden()
        await page.get_by_label("Robot address").fill("127.0.0.1")
        await page.get_by_label("Port").fill("1")
        await page.get_by_label("Key").fill("open sesame")
        await expect(page.get_by_label("Pace")).to_be_hidden()
        await unfold(page)
        await page.get_by_label("Pace").fill("12")
        await page.get_by_role("button", name="Test & save").click()
        speed = page.locator("[data-field='speed']")
        await expect(speed).to_contain_text("▲ '12' is not a whole number from 1 to 9")
        await expect(page.get_by_label("Pace")).to_be_focused()
        await page.get_by_label("Pace").fill("7")
        await page.get_by_role("button", name="Test & save").click()
        wire = page.locator("[data-line='wire']")
        await expect(wire).to_contain_text("nothing listens on 127.0.0.1:1")
        blamed = page.locator("[data-field='port'] [data-fault]")
        await expect(blamed).to_contain_text("127.0.0.1:1 refuses the connection.")
        await expect(page.get_by_label("Port")).to_be_focused()
        await expect(page.locator("[data-said]")).to_contain_text("Not saved")
        assert SettingsStore(data / "robots", "rover").load().settings == {}
        await page.get_by_label("Port").fill(str(port))
        await page.get_by_role("button", name="Test & save").click()
        await expect(wire).to_have_attribute("data-verdict", "answers")
        await expect(page.locator("[data-said]")).to_have_text("✓ Saved and in use")
        await expect(test).to_be_enabled()
        await expect(save).to_be_hidden()
        told = page.locator("[data-field='host'] [data-fault]")
        await expect(told).to_contain_text("answers")
        await page.get_by_label("Robot address").press("End")
        await page.get_by_label("Robot address").press("1")
        await expect(told).to_be_hidden()
        assert "charge? 7 dawn" in heard
        await page.get_by_role("link", name="Back to the menu").click()
        await expect(page.locator("main")).not_to_contain_text("open sesame")
        await page.get_by_role("link", name="Connect to Rover").click()
        await expect(page.locator("[data-badge-text]")).to_have_text("Live")
        heard.clear()
        await until(lambda: len(heard) > 0)
        await page.get_by_role("link", name="Back: disconnect").click()
        await expect(page.get_by_role("link", name="Connect to Rover")).to_be_visible()
        await until(lambda: heard[-1:] == [GONE])


TWO_TRANSPORTS = """\
urc: 1
kind: robot
name: pair
settings:
  host: { type: host, default: 127.0.0.1, title: Robot address }
  port: { type: port, title: Port }
transports:
  arm: { type: tcp, host: "{{ settings.host }}", port: "{{ settings.port }}", framing: LF }
  base: { type: tcp, host: "{{ settings.host }}", port: OTHER, framing: LF }
signals: { charge: { type: integer }, load: { type: integer } }
polls:
  - { every: 1s, to: arm, send: "charge?", reply: { regex: '^(?P<charge>[0-9]+)$' } }
  - { every: 1s, to: base, send: "load?", reply: { regex: '^(?P<load>[0-9]+)$' } }
""".replace("LF", "{ type: delimiter, rx: LF, tx: LF }")


async def test_each_transport_of_a_tested_address_is_named(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """A failure comes first; it does not hide that the other transport answers."""
    robot = tmp_path / "pair.yaml"
    async with emulated_rover([]) as port, emulated_rover([]) as other:
        robot.write_text(TWO_TRANSPORTS.replace("OTHER", str(other)), encoding="utf-8")
        profile = open_document(robot)
        async with running_managed(tmp_path / "data", [profile]) as address:
            page = await new_page()
            await page.goto(f"{address}robots/pair/settings")
            told = page.locator("[data-field='host'] [data-fault] > *")
            await page.get_by_label("Port").fill(str(port))
            await page.get_by_role("button", name="Test & save").click()
            await expect(told).to_have_text(["● arm: answers", "● base: answers"])
    robot.write_text(TWO_TRANSPORTS.replace("OTHER", "1"), encoding="utf-8")
    profile = open_document(robot)
    async with (
        emulated_rover([]) as port,
        running_managed(tmp_path / "more", [profile]) as address,
    ):
        page = await new_page()
        await page.goto(f"{address}robots/pair/settings")
        await page.get_by_label("Port").fill(str(port))
        await page.get_by_role("button", name="Test & save").click()
        told = page.locator("[data-field='host'] [data-fault] > *")
        await expect(told).to_have_text(
            [re.compile(r"^▲ base: 127\.0\.0\.1:1 refuses"), "● arm: answers"]
        )
        colours = await told.evaluate_all("(all) => all.map((one) => getComputedStyle(one).color)")
        assert len(set(colours)) == 2


async def test_the_dev_interface(new_page: PageMaker, tmp_path: Path) -> None:
    """B.5.8: what is fixed is shown; begun from there, the documents are read anew each time."""
    robot = tmp_path / "rover.yaml"
    text = f"urc: 1\nkind: robot\nname: rover\ntitle: Rover\n{DOCUMENTS['driver']}"
    text = text.replace("  key: { type: string, secret: true }\n", "")
    robot.write_text(text, encoding="utf-8")
    profile = open_document(robot)
    async with running_managed(tmp_path / "data", [profile], is_dev=True) as address:
        page = await new_page()
        new_page.allow(page, lambda text: "422" in text)
        await page.goto(address)
        await page.get_by_role("link", name="Dev interface").click()
        await expect(page.locator("main")).to_contain_text("rover.yaml")
        await page.get_by_role("button", name="Start Rover").click()
        await expect(page.locator("h1")).to_have_text("Rover")
        robot.write_text(text.replace("title: Rover", "title: Rover two"), encoding="utf-8")
        await page.goto(f"{address}dev")
        await page.get_by_role("button", name="Start Rover").click()
        await expect(page.locator("h1")).to_have_text("Rover two")
        robot.write_text(text.replace("6789", "678900"), encoding="utf-8")
        await page.goto(f"{address}dev")
        await page.get_by_role("button", name="Start Rover").click()
        await expect(page.locator("[data-said]")).to_contain_text("rover.yaml")


async def test_an_update_says_what_it_changes_and_can_be_taken_back(
    new_page: PageMaker, shop: Shop, tmp_path: Path
) -> None:
    """Versions, permissions and the wire; the robot on the menu is the new one at once."""
    data = tmp_path / "data"
    shutil.copytree(shop.folders[True, "full"], data)
    set_up(data, 1)
    newer = tmp_path / "newer"
    fill_lab(newer)
    newer_rover(newer)
    keeper = read_signer(shop.lab.parent / "keeper.pem")
    assert keeper is not None
    make_index(newer, "Lab", lambda _: [], IndexSigner(keeper))
    with static_server(newer) as url:
        known = Repositories(data / "packages", print)
        known.remove(shop.url)
        await to_thread.run_sync(known.add, url)
        async with running_managed(data) as address:
            page = await new_page(size="tablet", theme="dark")
            await page.goto(f"{address}drivers")
            mine = row(page, "installed", "drivers/rover")
            await mine.get_by_role("button", name="Update to 1.1.0").click()
            dialog = page.get_by_role("dialog")
            await expect(dialog).to_contain_text("drivers/rover 1.0.0 → 1.1.0")
            await expect(dialog).to_contain_text("nothing more")
            await dialog.get_by_text("Changed connections").click()
            await expect(dialog.locator("pre")).to_contain_text("battery?")
            await dialog.get_by_role("button", name="Update", exact=True).click()
            await expect(dialog).to_contain_text("✓ installed")
            await dialog.get_by_role("button", name="Close").click()
            assert installed(data) == ["drivers/rover 1.1.0", "interfaces/wide 1.0.0"]
            await page.goto(address)
            await expect(page.locator("main")).to_contain_text("drivers/rover 1.1.0")
            await page.goto(f"{address}drivers")
            await mine.get_by_role("button", name="Restore 1.0.0").click()
            await expect(mine).to_have_attribute("data-version", "1.0.0")
            assert installed(data) == ["drivers/rover 1.0.0", "interfaces/wide 1.0.0"]


@pytest.mark.needs("axe")
async def test_the_pages_are_for_everybody(new_page: PageMaker, shop: Shop, tmp_path: Path) -> None:
    """By axe's rules in every theme, on a phone, in four languages, without a word in English."""
    data = tmp_path / "data"
    shutil.copytree(shop.folders[True, "full"], data)
    async with running_managed(data) as address:
        page = await prepare(await new_page(size="phone"))
        for path in ("", "drivers", "interfaces", "robots/rover/settings"):
            await page.goto(f"{address}{path}")
            if path in MANAGERS:
                await expect(page.locator("[data-available] li").first).to_be_visible()
            assert await faults(page) == []
            for theme in THEMES:
                await page.evaluate(
                    "(name) => document.documentElement.dataset.theme = name", theme
                )
                assert await faults(page, CONTRAST) == []
            for tag in (*OTHERS, "en"):
                await choose_language(page, tag)
                await expect(page.locator("html")).to_have_attribute("lang", tag)
                if path in MANAGERS:
                    await expect(page.locator("[data-available] li").first).to_be_visible()
                if tag != "en":
                    await check(page, tag)


async def test_back_stops_what_is_held_and_gives_the_controls_back(new_page: PageMaker) -> None:
    """Another page may drive at once; the line closes when the last page is gone."""
    async with calmly_driven() as (robot, address):
        first, second = await opened(new_page, address), await opened(new_page, address)
        await push(first)
        await robot.until_moving()
        await first.evaluate("document.querySelector('[data-back]').click()")
        await robot.until_stopped()
        await first.wait_for_url(address.removesuffix("robots/puppet/"))
        await expect(second.locator("[data-who]")).to_have_text("No one drives")
        assert robot.is_open
        await second.get_by_role("link", name="Back: disconnect").click()
        await until(lambda: not robot.is_open)
        assert robot.newest("drive") == "drive stop"


async def test_what_is_installed_is_driven_by_urc_serve_alone(
    new_page: PageMaker, shop: Shop, tmp_path: Path, urc_process: Callable[..., UrcProcess]
) -> None:
    """As a person starts it: no profile, no repository in reach, settings of the last time."""
    data, heard = tmp_path / "data", list[str]()
    shutil.copytree(shop.folders[False, "full"], data)
    async with emulated_rover(heard) as port:
        set_up(data, port)
        process = urc_process("serve", "--port", "0", "--data-dir", str(data))
        page = await new_page(size="tablet")
        await page.goto((await process.wait_for_async(r"dashboard (http://\S+)"))[1])
        await page.get_by_role("link", name="Connect to Rover").click()
        await expect(page.locator("[data-badge-text]")).to_have_text("Live")
        await page.get_by_role("link", name="Back: disconnect").click()
        await expect(page.get_by_role("link", name="Connect to Rover")).to_be_visible()
        await until(lambda: heard[-1:] == [GONE])
        await page.goto("about:blank")
        await to_thread.run_sync(process.interrupt)
        assert process.errors == []
