"""The documentation site: it builds, is found through, reads without JavaScript, loads nothing."""

import os
import posixpath
import re
import subprocess
import sys
from collections.abc import AsyncIterator, Iterator
from functools import partial
from html.parser import HTMLParser
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest
from playwright.async_api import Browser, Page, Request

from scripts.check import BUILT_SITE
from tests.documentation import ROOT
from tests.e2e.axe import faults, prepare
from tests.e2e.playground import WITHIN_MS

pytestmark = [pytest.mark.anyio, pytest.mark.needs("chromium")]

QUESTIONS = {
    "change the baud rate": "how-to/arduino",
    "robot silent": "how-to/troubleshooting",
    "Modbus": "how-to/modbus",
    "stick does nothing": "how-to/troubleshooting",
    "certificate warning": "how-to/troubleshooting",
    "gamepad": "how-to/gamepad",
    "Arduino serial port": "how-to/arduino",
    "permission denied /dev/ttyUSB0": "how-to/troubleshooting",
    "cmd_vel": "how-to/ros2",
    "TwistStamped": "how-to/ros2",
    "rosbridge": "how-to/ros2",
    "Tello drone": "how-to/drone",
    "MAVLink": "how-to/drone",
    "skid steer": "how-to/mqtt-device",
    "left and right tracks": "how-to/mqtt-device",
    "tank drive": "how-to/mqtt-device",
    "differential drive mix": "how-to/mqtt-device",
    "mqtt last will": "how-to/mqtt-device",
    "REST API robot": "how-to/http-robot",
    "robot with a web server": "how-to/http-robot",
    "Zenoh": "transports/zenoh",
    "Nav2 goal": "how-to/nav2",
    "damaged picture": "how-to/troubleshooting",
    "record the demo": "recordings",
    "pip install": "install/index",
    "install from a checkout": "install/index",
    "RTSP camera": "how-to/camera",
    "emergency stop": "explanation/stop-limits",
    "two people confirm a command": "how-to/two-operators",
    "use a tablet": "how-to/tablet",
    "pandas": "how-to/analyse-recordings",
    "Foxglove": "how-to/analyse-recordings",
    "SARIF": "how-to/ci",
    "Node-RED": "how-to/migrate",
    "checksum": "language/framing",
    "write a widget": "widgets",
    "publish a package": "tutorial",
    "lost passphrase": "how-to/troubleshooting",
    "value is grey": "how-to/troubleshooting",
    "URC_DATA_DIR": "reference/environment",
    "environment variables": "reference/environment",
    "urc validate options": "reference/cli",
    "hold to run": "language/flow",
    "login sequence": "language/flow",
    "ssh tunnel": "how-to/ssh-robot",
    "backup": "backup",
}
"""A question as people type it, and the page that answers it."""
FIRST = 3
MOST_LINES_PX = 100
"""A text that breaks between all its letters is higher."""
LOADING = re.compile(r"<(?:script|img|iframe|source|video|link)\b[^>]*>", re.IGNORECASE)
"""The tags that load something; the parser needs a minute for the whole text of all pages."""
READ = ("index", "tutorials/cart", "how-to/arduino", "reference/keys/serial", "reference/cli")
"""One page of each kind, to look at in a browser."""


class Loads(HTMLParser):
    """Collects what a page loads."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.addresses: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        if tag in ("script", "img", "iframe", "source", "video"):
            self.addresses.append(found.get("src") or "")
        if tag == "link" and found.get("rel") != "canonical":
            self.addresses.append(found.get("href") or "")


@pytest.fixture(scope="module")
def html(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built once from nothing; a warning fails the build, here or in `./dev test`."""
    if built := os.environ.get(BUILT_SITE):
        return Path(built)
    folder = tmp_path_factory.mktemp("site") / "html"
    command = [sys.executable, "-m", "scripts.site", str(folder)]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (built.returncode, built.stderr) == (0, "")
    return folder


@pytest.fixture(scope="module")
def address(html: Path) -> Iterator[str]:
    """A static file server for the site, as any host would be."""
    handler = partial(QuietHandler, directory=str(html))
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    thread = Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
    thread.join()


class QuietHandler(SimpleHTTPRequestHandler):
    """Logs nothing."""

    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture
async def page(browser: Browser) -> AsyncIterator[Page]:
    """A page that fails on requests to other hosts."""
    context = await browser.new_context()
    opened = await context.new_page()
    away: list[str] = []

    def look(request: Request) -> None:
        if not request.url.startswith(("http://127.0.0.1", "data:", "blob:")):
            away.append(request.url)

    opened.on("request", look)
    yield opened
    await context.close()
    assert away == []


def test_no_page_loads_from_another_host(html: Path) -> None:
    """Neither fonts nor scripts nor pictures; the site works in a laboratory without internet."""
    files = pages_of(html)
    assert len(files) > 200
    for file in files:
        loads = Loads("".join(LOADING.findall(file.read_text("utf-8"))))
        assert loads.addresses, file
        away = [one for one in loads.addresses if re.match(r"(?:[a-z]+:)?//", one)]
        assert away == [], file


def test_every_link_within_the_site_leads_to_an_anchor(html: Path) -> None:
    """Also the links that the site makes itself, from names to the reference."""
    texts = {file.relative_to(html).as_posix(): file.read_text("utf-8") for file in pages_of(html)}
    anchors = {name: set(re.findall(r'\bid="([^"]+)"', text)) for name, text in texts.items()}
    broken = []
    for name, text in texts.items():
        for target in re.findall(r'<a [^>]*href="([^":]*#[^"]+)"', text):
            path, _, anchor = target.partition("#")
            folder = posixpath.dirname(name)
            other = posixpath.normpath(posixpath.join(folder, path)) if path else name
            if anchor not in anchors.get(other, set()):
                broken.append(f"{name}: {target}")
    assert broken == []


def pages_of(html: Path) -> list[Path]:
    """Return the pages of the site, without its sources."""
    return [file for file in sorted(html.rglob("*.html")) if "_static" not in file.parts]


def test_a_list_for_language_models_names_every_page(html: Path) -> None:
    """Each link of llms.txt is a Markdown file of the site."""
    text = (html / "llms.txt").read_text("utf-8")
    links = re.findall(r"\]\(([^)]+)\)", text)
    assert len(links) > 200
    assert [link for link in links if not (html / link).is_file()] == []


def test_each_whole_document_has_the_mark_of_the_playground(html: Path) -> None:
    """The playground puts its button there."""
    text = (html / "tutorials" / "cart.html").read_text("utf-8")
    assert text.count("urc-document") == 1
    assert 'class="urc-demo"' in (html / "index.html").read_text("utf-8")


async def test_questions_find_their_page_among_the_first_three(page: Page, address: str) -> None:
    """By the search of the site itself, in a browser."""
    await page.goto(f"{address}/search.html")
    await page.wait_for_function("() => Search.hasIndex()")
    found: dict[str, list[str]] = await page.evaluate(
        """([questions, first]) => Object.fromEntries(questions.map((question) => {
          const results = Search._performSearch(...Search._parseQuery(question));
          return [question, results.reverse().slice(0, first).map((one) => one[0])];
        }))""",
        [list(QUESTIONS), FIRST],
    )
    assert len(QUESTIONS) >= 30
    missed = {ask: found[ask] for ask, wanted in QUESTIONS.items() if wanted not in found[ask]}
    assert missed == {}


async def test_the_search_page_shows_results(page: Page, address: str) -> None:
    """Typed into the field of the sidebar, with the links to headings."""
    await page.goto(f"{address}/search.html?q=change+the+baud+rate")
    first = page.locator("ul.search li a").first
    await first.wait_for()
    assert "how-to/arduino.html#change-the-baud-rate" in str(await first.get_attribute("href"))


@pytest.mark.parametrize("scheme", ["light", "dark"])
async def test_pages_are_accessible(browser: Browser, address: str, scheme: str) -> None:
    """By axe, on one page of each kind, on a phone; nothing scrolls to the side."""
    context = await browser.new_context(
        color_scheme="dark" if scheme == "dark" else "light",
        viewport={"width": 390, "height": 844},
    )
    try:
        opened = await prepare(await context.new_page())
        for name in READ:
            await opened.goto(f"{address}/{name}.html")
            assert await faults(opened) == [], name
            wide = await opened.evaluate("document.documentElement.scrollWidth - innerWidth")
            assert wide <= 0, f"{name} scrolls to the side"
    finally:
        await context.close()


@pytest.mark.needs("node")
@pytest.mark.needs("pyodide")
async def test_a_robot_is_driven_on_the_front_page_after_a_click(page: Page, address: str) -> None:
    """Nothing of the playground is loaded before; an edit beside the robot changes it."""
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    await page.set_viewport_size({"width": 1440, "height": 900})
    await page.goto(f"{address}/index.html")
    button = page.get_by_role("button", name="Drive it here")
    await button.wait_for()
    assert not any(one.startswith(f"{address}/playground/") for one in asked)
    await button.click()
    inner = page.frame_locator(".urc-demo iframe")
    dashboard = inner.frame_locator("iframe")
    good = dashboard.locator("[data-badge][data-state=good]")
    await good.wait_for(timeout=WITHIN_MS)
    who = await dashboard.locator("[data-who]").bounding_box()
    assert who is not None
    assert who["height"] < MOST_LINES_PX
    area = inner.locator("textarea")
    text = await area.input_value()
    await area.fill(text.replace("title: TurtleBot 4\n", "title: Edited robot\n", 1))
    title = dashboard.locator(".urc-bar-title", has_text="Edited robot")
    await title.wait_for(timeout=WITHIN_MS)
    assert await area.is_visible()


@pytest.mark.needs("node")
@pytest.mark.needs("pyodide")
async def test_a_document_is_checked_on_its_page(page: Page, address: str) -> None:
    """“Check” opens an editor with the report; a mistake is listed with its place."""
    await page.goto(f"{address}/tutorials/cart.html")
    await page.get_by_role("button", name="Check").click()
    good = page.locator(".urc-editor-summary[data-state=good]")
    await good.wait_for(timeout=WITHIN_MS)
    assert "0 errors" in await good.inner_text()
    area = page.locator(".urc-editor textarea")
    text = await area.input_value()
    await area.fill(text.replace("kind: robot", "kind: robbot", 1))
    problem = page.locator(".urc-editor-problems li").first
    await problem.wait_for(timeout=WITHIN_MS)
    assert "line 2, column" in await problem.inner_text()


@pytest.mark.needs("pyodide")
async def test_without_javascript_a_link_leads_to_the_playground(
    browser: Browser, address: str, html: Path
) -> None:
    """It stands where the button would be."""
    context = await browser.new_context(java_script_enabled=False)
    try:
        opened = await context.new_page()
        await opened.goto(f"{address}/index.html")
        link = opened.get_by_role("link", name="Drive it here")
        assert await link.is_visible()
        assert (html / str(await link.get_attribute("href"))).is_file()
    finally:
        await context.close()


async def test_pages_read_without_javascript_on_a_phone(browser: Browser, address: str) -> None:
    """The text, and the links to other chapters."""
    context = await browser.new_context(
        java_script_enabled=False, viewport={"width": 390, "height": 844}
    )
    try:
        opened = await context.new_page()
        for name in READ:
            await opened.goto(f"{address}/{name}.html")
            assert await opened.locator("article h1").is_visible()
            assert await opened.locator(".sidebar-tree a").count() > 5
    finally:
        await context.close()
