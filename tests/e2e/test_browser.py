"""The browser of the tests, and the third-party modules in it as the build vendored them."""

import json
import mimetypes
from pathlib import Path

import pytest
from playwright.async_api import Page, Route

from tests.e2e.browser import PageFaults
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until
from urc.shipped import vendored

pytestmark = pytest.mark.anyio

HOST = "http://vendor.test"


async def serve(page: Page, body: str) -> None:
    """Show a page whose import map is the vendored one; no server and no network is needed."""
    folder = vendored()
    assert folder is not None, "the build brought no urc_vendor"
    imports = json.loads((folder / "importmap.json").read_text("utf-8"))["imports"]
    shown = {name: f"/vendor/{address.removeprefix('./')}" for name, address in imports.items()}
    html = f'<script type="importmap">{json.dumps({"imports": shown})}</script>{body}'

    async def answer(route: Route) -> None:
        path = route.request.url.removeprefix(HOST)
        if path == "/":
            await route.fulfill(body=f"<!doctype html>{html}", content_type="text/html")
        elif path.startswith("/vendor/"):
            file: Path = folder / path.removeprefix("/vendor/")
            kind = "text/javascript" if file.suffix == ".js" else mimetypes.guess_type(file)[0]
            await route.fulfill(body=file.read_bytes(), content_type=kind)
        else:
            await route.fulfill(status=204)

    await page.route("**/*", answer)
    await page.goto(f"{HOST}/")


async def test_the_vendored_chart_draws_through_the_import_map(new_page: PageMaker) -> None:
    """uPlot loads by its bare name, unbundled, and draws: no internet, no build step."""
    page = await new_page(size="phone", theme="dark")
    await serve(
        page,
        """<div id="chart"></div><script type="module">
        import uPlot from "uplot";
        const series = [{}, { stroke: "red" }];
        const data = [[1, 2, 3], [10, 20, 15]];
        new uPlot({ width: 300, height: 200, series }, data, document.getElementById("chart"));
        </script>""",
    )
    await page.wait_for_selector("#chart canvas")
    assert await page.evaluate("document.querySelector('#chart canvas').width") > 0


async def test_page_has_the_size_theme_and_locale_asked_for(new_page: PageMaker) -> None:
    """Pages of a test are what it says they are, on whatever machine."""
    page = await new_page(size="phone", theme="dark")
    seen = await page.evaluate(
        "[innerWidth, matchMedia('(prefers-color-scheme: dark)').matches, navigator.language]"
    )
    assert seen == [390, True, "en-GB"]


@pytest.mark.parametrize(
    ("body", "fault"),
    [
        ("<script>console.error('a fault')</script>", "console: a fault"),
        ("<script>nobody()</script>", "exception: ReferenceError"),
        (
            """<meta http-equiv="Content-Security-Policy" content="img-src 'none'"><img src="x">""",
            "CSP violation: img-src",
        ),
    ],
)
async def test_a_page_that_complains_is_noticed(new_page: PageMaker, body: str, fault: str) -> None:
    """Console errors, exceptions and policy violations all fail the test they happen in."""
    page = await new_page()
    faults = PageFaults(page)
    new_page.allow(page, lambda text: True)
    async with page.expect_event("load"):
        await serve(page, body)
    await until(lambda: any(fault in text for text in faults.unexpected()))
    faults.allow(lambda text: True)
    assert faults.unexpected() == []


async def test_what_a_page_still_waits_for_is_told(
    new_page: PageMaker, caplog: pytest.LogCaptureFixture
) -> None:
    """A load that does not end names the file that did not come."""
    page = await new_page()

    async def answer(route: Route) -> None:
        if route.request.url.endswith("/late.js"):
            asked.append(route)
        else:
            await route.fulfill(body='<script src="late.js"></script>', content_type="text/html")

    asked: list[Route] = []
    await page.route("**/*", answer)
    await page.goto(f"{HOST}/", wait_until="commit")
    await until(lambda: len(asked) == 1)
    assert await new_page.close() == []
    assert f"{HOST}/ still waits for GET {HOST}/late.js" in caplog.messages
