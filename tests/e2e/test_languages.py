"""Pages in the reader's language: whole, in their place, and STOP where it always is."""

import re
from typing import Any

import pytest
from playwright.async_api import Browser, Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until
from tests.e2e.keys import known_here
from tests.e2e.motion.driving import CALM_LEASE_S, Wire
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.web.words import LANGUAGES, table

pytestmark = pytest.mark.anyio

AUTHORS = {"Battery", "Lift", "Puppet", "Still", "Steering", "Throttle"}
"""What the test's robots call their own things."""

# What people see or hear read out, element by element.
TEXTS = """
() => {
  const found = new Set();
  for (const el of document.body.querySelectorAll("*")) {
    if (el.closest("[lang='en'], script, style, noscript, [data-log]")) continue;
    for (const name of ["aria-label", "title", "placeholder", "aria-valuetext"]) {
      if (el.hasAttribute(name)) found.add(el.getAttribute(name).trim());
    }
    for (const { nodeType, textContent } of el.childNodes) {
      if (nodeType === Node.TEXT_NODE) found.add(textContent.replace(/\\s+/g, " ").trim());
    }
  }
  return [...found].filter(Boolean);
}
"""

# What is cut, or hangs over the edge of the screen.
CUT = """
() => {
  const WORDS = "button, a, select, p, h1, h2, h3, [data-badge-text], [data-stop-note]";
  const seen = (el) => !el.closest(".urc-hidden, .urc-skip") &&
    el.checkVisibility({ visibilityProperty: true });
  const found = [];
  const wide = document.documentElement.scrollWidth - innerWidth;
  if (wide > 0) found.push(`the page is ${wide} px wider than the screen`);
  for (const el of document.querySelectorAll(WORDS)) {
    if (!seen(el)) continue;
    const { left, right, width } = el.getBoundingClientRect();
    if (width < 2 || !el.textContent.trim()) continue; // for screen readers only
    const what = `${el.tagName} ${JSON.stringify(el.textContent.trim().slice(0, 40))}`;
    if (left < -1 || right > innerWidth + 1) found.push(`${what} is beside the screen`);
    const style = getComputedStyle(el);
    if (style.overflowX === "visible" || style.textOverflow === "ellipsis") continue;
    if (!el.matches("select") && el.scrollWidth > el.clientWidth + 1) found.push(`${what} is cut`);
  }
  return found;
}
"""

SAID = "(text) => import('/static/core/words.js').then(({ said }) => said(text))"


def english(tag: str) -> list[re.Pattern[str]]:
    """Return what English looks like that has a translation of its own."""
    found = []
    for text, said in table(tag).items():
        if text != said and text not in AUTHORS:
            parts = re.split(r"\{[a-z_]+\}", text)
            if any(re.search(r"[A-Za-z]{2}", part) for part in parts):
                found.append(re.compile("[^ ]+".join(map(re.escape, parts))))
    return found


async def check(page: Page, tag: str) -> None:
    """Fail when the page is in another language, says something in English, or hides a word."""
    await expect(page.locator("html")).to_have_attribute("lang", tag)
    # The attribute is there as soon as the first bytes of the page are.
    await page.wait_for_function("() => document.readyState === 'complete'")
    texts: Any = await page.evaluate(TEXTS)
    known = english(tag)
    left = [text for text in texts if any(one.fullmatch(text) for one in known)]
    assert left == []
    assert await page.evaluate(CUT) == []


async def check_sentences(page: Page, tag: str) -> None:
    """What the server says in a fixed form is translated; names in it, and the rest, are not."""
    words = table(tag)
    screen = words["screen {n}"].replace("{n}", "2")
    for sentence, expected in {
        "Stopped by screen 2. Reset to drive again.": words[
            "Stopped by {name}. Reset to drive again."
        ],
        "Keep has the controls": words["{name} has the controls"].replace("{name}", "Keep"),
        "nothing is stopped": words["nothing is stopped"],
        "the motor is hot": "the motor is hot",
    }.items():
        said = await page.evaluate(SAID, sentence)
        assert said == expected.replace("{name}", screen)


async def stop_box(page: Page) -> list[float]:
    """Return where STOP is: left, top, width, height."""
    box = await page.locator("[data-stop-button]").bounding_box()
    assert box is not None
    return [box["x"], box["y"], box["width"], box["height"]]


@pytest.mark.parametrize("tag", [tag for tag in LANGUAGES if tag != "en"])
async def test_a_robot_is_driven_in_another_language(new_page: PageMaker, tag: str) -> None:
    """Chosen on the robot's page, kept for all pages; the words change, and STOP does not move."""
    wire = Wire(lease_s=CALM_LEASE_S)
    still = FakeRobot(dashboard_profile(name="still"))
    async with running_dashboard(wire, still) as address:
        page = await new_page(size="phone")
        new_page.allow(page, lambda text: "ERR_CONNECTION_REFUSED" in text)
        await page.goto(f"{address}robots/puppet/")
        await expect(page.locator("[data-who]")).to_have_text("No one drives")
        before = pytest.approx(await stop_box(page), abs=1.5)
        await page.get_by_role("button", name="This device").click()
        await page.locator("#device [data-language-choice]").select_option(tag)
        words = table(tag)
        await expect(page.locator("[data-who]")).to_have_text(words["No one drives"])
        await expect(page.locator(".joystick").first).to_have_attribute("data-phase", "idle")
        await check(page, tag)
        assert await stop_box(page) == before
        await check_sentences(page, tag)
        await page.locator("[data-verb='take']").click()
        await expect(page.locator("[data-who]")).to_have_text(words["● You drive"])
        await check(page, tag)
        assert await stop_box(page) == before
        await expect(page.locator("[data-stop-button]")).to_have_text("STOP")
        await page.locator("[data-stop-button]").click()
        await expect(page.locator("[data-stop-note]")).to_contain_text(words["✓ latched"])
        await expect(page.locator("[data-stop-button]")).to_have_text(words["STOPPED"])
        await check(page, tag)
        assert await stop_box(page) == before
        await page.goto(f"{address}robots/still/")
        await until(lambda: still.is_open)
        still.set_reading("battery", 5, alarm="lolo")
        await expect(page.locator(".urc-grid")).to_contain_text(words["Very low"])
        await check(page, tag)
        await page.goto(address)
        await check(page, tag)
        await page.goto(f"{address}robots/puppet/")
        await expect(page.locator("[data-latched-text]")).to_contain_text(
            words["■ Stopped by {who}"][:5]
        )
        await page.locator("[data-verb='reset']").click()
        await expect(page.locator("[data-latched]")).to_be_hidden()
    await expect(page.locator("[data-who]")).to_have_text(words["Not connected to URC"])
    await page.locator("[data-stop-button]").click()
    await expect(page.locator("[data-stop-note]")).to_have_text(
        words["▲ NO LINK: use the robot's own stop switch"]
    )
    await check(page, tag)
    assert await stop_box(page) == before


async def test_the_browsers_wish_is_followed_without_a_choice(browser: Browser) -> None:
    """Also by a page that is not there."""
    context = await browser.new_context(locale="fr-CH", service_workers="block")
    await known_here(context)
    try:
        async with running_dashboard(FakeRobot(dashboard_profile())) as address:
            page = await context.new_page()
            await page.goto(f"{address}nowhere")
            await expect(page.locator("html")).to_have_attribute("lang", "fr")
            await expect(page.locator("main")).to_contain_text(
                table("fr")["This page does not exist."]
            )
    finally:
        await context.close()
