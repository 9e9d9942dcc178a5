"""Why did it move? An emulated robot, driven in one browser, asked about on its dev page."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import WAIT_S, until_text
from tests.e2e.dev_pages import Start
from tests.e2e.motion.driving import STOP, fresh, push
from tests.e2e.motion.test_whole import PROFILE

pytestmark = pytest.mark.anyio

STATE = "[data-why-state]"


async def refresh_until(page: Page, what: str) -> None:
    """Press Refresh until an entry of this kind is there: the guard reports in its own time."""
    await page.wait_for_function(
        "(what) => { document.querySelector('[data-why-refresh]').click();"
        " return document.querySelector(`[data-why] > [data-what='${what}']`) !== null; }",
        arg=what,
        polling=100,
        timeout=WAIT_S * 1000,
    )


async def insist(page: Page) -> None:
    """Want the controls although the page knows better, over a line of its own."""
    refused = await page.evaluate(
        "() => new Promise((resolve) => {"
        " const line = new WebSocket(`ws://${location.host}/ws?robot=rover`);"
        " line.onopen = () => line.send(JSON.stringify({ t: 'drive', verb: 'take' }));"
        " line.onmessage = ({ data }) => { const told = JSON.parse(data);"
        " if (told.t === 'refused') { line.close(); resolve(told); } }; })"
    )
    assert refused["about"] == "take", refused


async def test_the_dev_page_says_who_moved_the_robot_and_who_was_refused(
    new_page: PageMaker, urc_process: Start, tmp_path: Path
) -> None:
    """Begin and end of a gesture with its bytes, the refusal of a second driver, and a STOP."""
    file, data = tmp_path / "rover.yaml", str(tmp_path / "data")
    file.write_text(PROFILE.replace("PORT", "7001"), "utf-8")
    words = ("serve", str(file), "--simulate", "--dev", "--port", "0")
    process = urc_process(*words, "--data-dir", data)
    address = (await process.wait_for_async(r"(http://\S+)"))[1]
    dev, first, second = [await fresh(new_page) for _ in range(3)]
    await dev.goto(f"{address}robots/rover/dev")
    await until_text(dev, STATE, "No entries yet.")
    for page in (first, second):
        await page.goto(f"{address}robots/rover/")
        await expect(page.locator(".joystick[data-phase='idle']")).to_have_count(1)
    await push(first, ".joystick-pad", right=40)
    await expect(first.locator("[data-who]")).to_contain_text("You drive")
    await push(second, ".joystick-pad", right=40)
    await expect(second.locator(".joystick-note")).to_contain_text("has the controls")
    await second.mouse.up()
    await insist(second)
    await refresh_until(dev, "refused")
    await first.mouse.up()
    await refresh_until(dev, "stopped")
    entries = dev.locator("[data-why] > li")
    moved = entries.and_(dev.locator("[data-what='moved']"))
    await expect(moved).to_have_count(1)
    await expect(moved).to_contain_text("administer")
    await expect(moved).to_contain_text("drive · ")
    await expect(moved.locator(".dev-hex")).to_contain_text("5620")  # "V "
    stopped = entries.and_(dev.locator("[data-what='stopped']"))
    await expect(stopped).to_contain_text("released")
    refused = entries.and_(dev.locator("[data-what='refused']")).first
    await expect(refused).to_contain_text("has the controls")
    holder = (await moved.locator(".dev-row-head span").last.inner_text()).partition(" (")[0]
    refused_one = await refused.locator(".dev-row-head span").last.inner_text()
    assert not refused_one.startswith(holder)
    await expect(refused).to_contain_text(f"{holder} has the controls")
    await second.click(STOP)
    await refresh_until(dev, "STOP")
    kinds = await entries.evaluate_all("(all) => all.map((one) => one.dataset.what)")
    assert kinds.index("STOP") < kinds.index("stopped") < kinds.index("moved"), "newest first"
    for page in (dev, first, second):
        await page.goto("about:blank")
    told = audit(data, "--robot", "rover")
    assert told.returncode == 0, told.stderr
    lines = [json.loads(line) for line in told.stdout.splitlines()]
    begins = next(line for line in lines if line["what"] == "moved")
    assert (begins["who"], begins["role"], begins["command"]) == (holder, "administer", "drive")


def audit(data: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Run `urc audit` beside the server that writes the file."""
    command = [sys.executable, "-m", "urc.cli.main", "audit", "--data-dir", data, *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
