"""The playground's service worker: it keeps all files of one version, and nothing else.

A few small files stand in for those of the playground. `test_playground.py` does the same with all.
"""

import os
import shutil
from collections.abc import AsyncIterator
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Browser, BrowserContext, Page

from scripts.playground import PAGE as PLAYGROUND
from scripts.playground import write_list
from tests.e2e.playground import served

pytestmark = [pytest.mark.anyio, pytest.mark.needs("headless-shell")]

KEEP = """async () => {
  await navigator.serviceWorker.register("sw.js");
  const { active } = await navigator.serviceWorker.ready;
  const { port1, port2 } = new MessageChannel();
  const told = new Promise((resolve) => { port1.onmessage = ({ data }) => resolve(data); });
  active.postMessage("keep", [port2]);
  return told;
}"""
UPDATE = """async () => {
  const registration = await navigator.serviceWorker.getRegistration();
  await registration.update();
  const next = registration.installing;
  if (next) await new Promise((resolve) => next.addEventListener("statechange", resolve));
  return registration.waiting !== null;
}"""
NONE_WAITS = """async () => {
  const registration = await navigator.serviceWorker.getRegistration("/one/");
  return registration.waiting === null && registration.active.state === "activated";
}"""
TIMES_S = count(1_700_000_000, 60)
"""Times of writing: web servers compare whole seconds."""
CACHES = "() => caches.keys()"


def put_version(folder: Path, text: str) -> str:
    """Write a small playground of two files, whose page shows a text; return its version."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(PLAYGROUND / "sw.js", folder / "sw.js")
    (folder / "index.html").write_text(
        '<!doctype html><title>x</title><script src="show.js"></script>', "utf-8"
    )
    (folder / "show.js").write_text(f"document.title = {text!r};", "utf-8")
    version = write_list(folder)
    written_s = next(TIMES_S)
    for file in folder.iterdir():
        os.utime(file, (written_s, written_s))
    return version


@pytest.fixture
async def context(browser: Browser) -> AsyncIterator[BrowserContext]:
    """A browser profile without any kept files."""
    made = await browser.new_context()
    yield made
    await made.close()


async def kept_page(context: BrowserContext, url: str) -> tuple[Page, Any]:
    """Open a page and let its files be kept; return the page and the reply."""
    page = await context.new_page()
    await page.goto(url)
    assert not any(url in name for name in await page.evaluate(CACHES))
    return page, await page.evaluate(KEEP)


async def test_kept_files_are_shown_without_a_server(
    context: BrowserContext, tmp_path: Path
) -> None:
    """The page and its script, also at the folder's own address and with a query."""
    put_version(tmp_path / "one", "first")
    with ExitStack() as stack:
        url = f"{stack.enter_context(served(tmp_path))}one/"
        page, told = await kept_page(context, url)
        assert told == {"isKept": True}
        stack.close()
        for address in (url, f"{url}index.html", f"{url}?embedded"):
            answer = await page.goto(address)
            assert answer is not None
            assert answer.from_service_worker
            assert await page.title() == "first"


async def test_a_new_version_replaces_the_kept_one_when_no_page_uses_it(
    context: BrowserContext, tmp_path: Path
) -> None:
    """Never two versions in one page; the caches of another playground remain."""
    versions = [put_version(tmp_path / "one", "first"), put_version(tmp_path / "two", "other")]
    with ExitStack() as stack:
        url = stack.enter_context(served(tmp_path))
        other, _ = await kept_page(context, f"{url}two/")
        await other.close()
        page, _ = await kept_page(context, f"{url}one/")
        newer = put_version(tmp_path / "one", "second")
        assert newer not in versions
        assert await page.evaluate(UPDATE)
        await page.reload()
        assert await page.title() == "first"
        await page.goto(f"{url}elsewhere")
        await page.wait_for_function(NONE_WAITS)
        stack.close()
        await page.goto(f"{url}one/")
        assert await page.title() == "second"
        names = await page.evaluate(CACHES)
        assert sorted(names) == sorted(
            [f"urc-playground {url}one/ {newer}", f"urc-playground {url}two/ {versions[1]}"]
        )


async def test_a_file_of_another_version_is_not_kept(
    context: BrowserContext, tmp_path: Path
) -> None:
    """The reply names the file, and pages still come from the server."""
    put_version(tmp_path / "one", "first")
    (tmp_path / "one" / "show.js").write_text("document.title = 'changed';", "utf-8")
    with served(tmp_path) as url:
        page, told = await kept_page(context, f"{url}one/")
        assert told["isKept"] is False
        assert f"{url}one/show.js" in told["reason"]
        answer = await page.reload()
        assert answer is not None
        assert await page.title() == "changed"
