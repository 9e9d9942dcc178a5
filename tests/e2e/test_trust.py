"""A browser with a fresh profile meets the warning, trusts the authority, and opens URC by HTTPS.

No flag ignores certificates: the authority is imported as the page says.
"""

import asyncio
import os
import subprocess
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from cryptography import x509
from playwright.async_api import BrowserContext, Error, Page, async_playwright, expect

from scripts.needs import NEEDS
from tests.e2e.axe import faults, prepare
from tests.e2e.browser import FLAGS, LOCALE
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard
from tests.e2e.keys import headers_for
from tests.e2e.processes import UrcProcess
from urc.access.authority import fingerprint
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio
Start = Callable[..., UrcProcess]


@asynccontextmanager
async def person(home: Path, profile: str = "profile") -> AsyncIterator[BrowserContext]:
    """Open the browser of a person with a home of their own, where it finds its authorities."""
    program = next(need for need in NEEDS if need.name == "chromium").find()
    async with async_playwright() as playwright:
        context = await playwright.chromium.launch_persistent_context(
            str(home / profile),
            executable_path=program,
            args=[*FLAGS],
            env={**os.environ, "HOME": str(home)},
            locale=LOCALE,
            viewport={"width": 390, "height": 844},
            has_touch=True,
            accept_downloads=True,
        )
        try:
            yield context
        finally:
            await context.close()


def typed(home: Path, command: str) -> None:
    """Run a command of the page in a terminal of the person."""
    environment = {**os.environ, "HOME": str(home)}
    subprocess.run(["sh", "-c", command], cwd=home, env=environment, check=True, timeout=60)


async def rows(page: Page) -> dict[str, bool]:
    """Return what the page says of each feature at this address."""
    found = {}
    for row in await page.locator("[data-features] li").all():
        title = (await row.locator("span").nth(1).inner_text()).partition(":")[0]
        found[title] = await row.get_attribute("data-there") == "true"
    return found


@pytest.mark.needs("chromium", "certutil")
async def test_a_fresh_browser_trusts_the_authority(urc_process: Start, tmp_path: Path) -> None:
    """The warning first, then the page by plain HTTP, the import, and no warning any more."""
    data, home = tmp_path / "data", tmp_path / "home"
    home.mkdir()
    process = urc_process(
        "serve", "robots/tello.yaml", "--simulate", "--host", "0.0.0.0", "--port", "0",
        "--data-dir", str(data),
    )  # fmt: skip
    others = (await process.wait_for_async(r"^for others (https://\S+)"))[1]
    shown = (await process.wait_for_async(r"^authority ([0-9A-F ]{79})$"))[1]
    if urlsplit(others).hostname == "127.0.0.1":
        pytest.skip("this machine has no network")
    key = headers_for(others)["Authorization"].removeprefix("Bearer ")

    async with person(home) as context:
        page = await context.new_page()
        with pytest.raises(Error, match="ERR_CERT_AUTHORITY_INVALID"):
            await page.goto(others)
        page = await prepare(await context.new_page())
        await page.goto(others.replace("https://", "http://") + "trust")
        assert await faults(page) == []
        assert await page.evaluate("document.documentElement.scrollWidth") == 390
        printed = await page.locator("[data-fingerprint] code").all_inner_texts()
        assert " ".join(printed) == shown
        features = await rows(page)
        # Chromium offers gamepads everywhere; other browsers do not.
        assert {title for title, is_there in features.items() if is_there} == {"Gamepad"}
        assert set(features) >= {"Encrypted connection", "Tilt sensors", "Installing as an app"}
        await expect(page.locator("[data-guide=linux]")).to_have_attribute("open", "")
        async with page.expect_download() as downloading:
            await page.locator("[data-download]").click()
        download = await downloading.value
        assert download.suggested_filename == "authority.crt"
        file = home / "authority.crt"
        await download.save_as(file)
        way = page.get_by_role("link", name="Open URC over HTTPS")
        assert await way.get_attribute("href") == others
        guide = page.locator("[data-guide=linux]")
        command = await guide.locator("ol code").inner_text()
        removal = await guide.locator("p code").inner_text()
    assert fingerprint(x509.load_pem_x509_certificate(file.read_bytes())) == shown
    await asyncio.to_thread(typed, home, command)

    async with person(home) as context:
        page = await context.new_page()
        await page.goto(f"{others}?key={key}")
        await page.wait_for_url(others)
        await page.goto(f"{others}robots/tello/")
        assert await page.evaluate("isSecureContext")
        await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
        await page.goto(f"{others}trust")
        row = page.locator("[data-features] li", has_text="Installing as an app")
        await expect(row).to_have_attribute("data-there", "true")
        features = await rows(page)
        assert features["Encrypted connection"]
        assert features["Clipboard"]
        assert not features["Passkeys"]  # at an IP address
        assert await page.locator("a", has_text="Open URC over HTTPS").count() == 0
        cookies = [one for one in await context.cookies() if one["value"] and "urc" in one["name"]]
        assert any(one["secure"] and one["httpOnly"] for one in cookies)

    await asyncio.to_thread(typed, home, removal)
    # In the old profile, the installed app would open without the server.
    async with person(home, "other") as context:
        page = await context.new_page()
        with pytest.raises(Error, match="ERR_CERT_AUTHORITY_INVALID"):
            await page.goto(others)


@pytest.mark.needs("headless-shell")
async def test_the_page_of_plain_http_on_this_machine(new_page: PageMaker) -> None:
    """No certificate to trust; the menu leads to it, and a reader of the screen can use it."""
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        page = await prepare(await new_page(size="phone"))
        await page.goto(address)
        await page.get_by_role("link", name="This connection").click()
        await expect(page.locator("h1")).to_have_text("This connection")
        await expect(page.locator("[data-place]")).to_have_text(address.rstrip("/"))
        features = await rows(page)
        assert (features["Encrypted connection"], features["Clipboard"]) == (False, True)
        assert await page.locator("[data-download]").count() == 0
        assert await faults(page) == []
