"""axe-core in the tests' pages: what is wrong for people who see, hear or point otherwise."""

from typing import Any

from playwright.async_api import Page

from scripts.needs import AXE

__all__ = ["CONTRAST", "faults", "prepare"]

CONTRAST = "color-contrast"
"""The one rule whose answer depends on the theme."""

_RUN = """
async (rules) => {
  // During a transition or an animation, colours are neither those before nor those after.
  const fades = document.getAnimations().filter((one) =>
    one.playState === "running" && Number.isFinite(one.effect.getComputedTiming().endTime));
  await Promise.allSettled(fades.map((one) => one.finished));
  const found = await axe.run(document, {
    runOnly: rules.length > 0
      ? { type: "rule", values: rules }
      : { type: "tag", values: [
          "wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"] },
    resultTypes: ["violations"],
    preload: false,  // it would fetch style sheets in a way that the page's policy forbids
  });
  const said = ({ any, all, none }) => [...any, ...all, ...none].map(({ message }) => message);
  return found.violations.flatMap(({ id, help, nodes }) =>
    nodes.map((node) => `${id}: ${help}: ${node.target.join(" ")}: ${said(node).join("; ")}`));
}
"""


async def prepare(page: Page) -> Page:
    """Let every page that is opened in `page` from now on have axe."""
    await page.add_init_script(path=AXE)
    return page


async def faults(page: Page, *rules: str) -> list[str]:
    """Return what is wrong, a line an element; `rules`: by these alone, not by all."""
    found: Any = await page.evaluate(_RUN, list(rules))
    return [str(line) for line in found]
