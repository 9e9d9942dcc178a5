"""The twelve things that happen to a page and mean that nobody holds anything any more."""

from collections.abc import Awaitable, Callable

from playwright.async_api import Page

from tests.e2e.motion.driving import LEFT, fire

__all__ = ["WAYS", "start_over"]

Letting = Callable[[Page], Awaitable[object]]


def script(text: str) -> Letting:
    """Return what lets something happen in the page."""
    return lambda page: fire(page, text)


async def press_the_other_button(page: Page) -> None:
    """A menu, as the second button of a mouse opens one."""
    await page.mouse.down(button="right")


HIDDEN = """
Object.defineProperty(document, "hidden", { configurable: true, get: () => true });
Object.defineProperty(document, "visibilityState", { configurable: true, get: () => "hidden" });
document.dispatchEvent(new Event("visibilitychange"));
"""
LOST_CAPTURE = f"""
(() => {{
  const el = document.querySelector("{LEFT}");
  for (let id = 0; id < 64; id += 1) {{
    if (el.hasPointerCapture(id)) el.releasePointerCapture(id);
  }}
}})()
"""
CANCELLED = f"""
(() => {{
  const el = document.querySelector("{LEFT}");
  for (let pointerId = 0; pointerId < 64; pointerId += 1) {{
    if (el.hasPointerCapture(pointerId)) {{
      el.dispatchEvent(new PointerEvent("pointercancel", {{ pointerId, bubbles: true }}));
    }}
  }}
}})()
"""

WAYS: dict[str, Letting] = {
    "pointerup": lambda page: page.mouse.up(),
    "pointercancel": script(CANCELLED),
    "lostpointercapture": script(LOST_CAPTURE),
    "blur": script("window.dispatchEvent(new Event('blur'))"),
    "hidden": script(HIDDEN),
    "pagehide": script(
        "window.wasLeft = true; window.dispatchEvent(new PageTransitionEvent('pagehide'))"
    ),
    "freeze": script("document.dispatchEvent(new Event('freeze'))"),
    "resize": lambda page: page.set_viewport_size({"width": 900, "height": 700}),
    "rotation": script("window.dispatchEvent(new Event('orientationchange'))"),
    "full screen": script("document.documentElement.requestFullscreen().catch(() => {})"),
    "context menu": press_the_other_button,
    "pad lost": script("window.dispatchEvent(new Event('gamepaddisconnected'))"),
}

BEGUN = """
async () => {
delete document.hidden;
delete document.visibilityState;
if (document.fullscreenElement) document.exitFullscreen();
if (window.wasLeft) {
  window.wasLeft = false;
  // It says that it is not connected any more; only then is it waited for that it is again.
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
  window.dispatchEvent(new PageTransitionEvent("pageshow", { persisted: true }));
}
}
"""


async def start_over(page: Page, width: int, height: int) -> None:
    """Undo what any of them has left behind: nothing is pressed, and the page is as it was."""
    await page.mouse.up(button="right")
    await page.mouse.up()
    await fire(page, BEGUN)
    await page.wait_for_function(
        "() => !document.fullscreenElement"
        " && document.querySelector('[data-who]').textContent.match(/driv/)"
    )
    if page.viewport_size != {"width": width, "height": height}:
        await page.set_viewport_size({"width": width, "height": height})
        await page.wait_for_function("(width) => innerWidth === width", arg=width)
