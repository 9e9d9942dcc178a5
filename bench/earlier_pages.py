"""Operators at the pages of the version before backgrounds, for comparison.

That version's menu shows no alarms, its pages swap no views, and a second finger taps no speed
while the first finger holds a stick.
"""

from typing import Final

from playwright.async_api import Locator

from tests.e2e.dashboards import until
from tests.e2e.operator_tasks import SKIP, STICK, Hand, Keys, Touch

__all__ = ["EARLIER", "WAYS", "EarlierKeys", "EarlierTouch"]

EARLIER: Final = "6417e8de1add84101946e8cbd4bf7432b08ef07a"
"""The last version before backgrounds, as git names it."""
WAYS = "[data-robot-card] a.urc-button-main"
LIVE, ALARM = ".battery[data-state='live']", ".battery[data-alarm='lolo']"
BACK = "[data-back]"
SWIPE_SHARE, SWIPES = 0.5, 40
"""Share of the screen's height that a swipe moves, and the most swipes."""
WHERE = """(el) => {
  const { left, right, top, bottom } = el.getBoundingClientRect();
  const found = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
  if (found !== null && (el.contains(found) || found.contains(el))) return 0;
  return (top + bottom) / 2 < innerHeight / 2 ? -1 : 1;
}"""
"""Returns 0 if an element can be touched, else the direction in which it lies: up -1, down 1."""


async def _has_alarm(hand: Hand) -> bool:
    """Look at the robot's battery."""
    hand.input.decide()
    await hand.page.locator(LIVE).wait_for()
    return await hand.page.locator(ALARM).count() > 0


class EarlierTouch(Touch):
    """Fingers, which swipe to targets outside the screen."""

    async def reach(self, target: Locator) -> Locator:
        """Swipe until a target can be touched."""
        size = self.page.viewport_size
        assert size is not None
        for _ in range(SWIPES):
            direction = await target.evaluate(WHERE)
            if direction == 0:
                return target
            far = direction * size["height"] * SWIPE_SHARE
            await self.input.swipe(size["width"] / 2, (size["height"] + far) / 2, far)
        raise AssertionError(f"not on the page: {target}")

    async def open_card(self) -> None:
        """Open one robot after the other, until one has an alarm."""
        for place in range(await self.page.locator(WAYS).count()):
            await self.input.tap(await self.reach(self.page.locator(WAYS).nth(place)))
            if await _has_alarm(self):
                return
            await self.input.tap(self.at(BACK))
            await self.page.locator(WAYS).first.wait_for()
        raise AssertionError("no robot has an alarm")

    async def drive(self) -> None:
        """Go to the stick, and push it."""
        await self.reach(self.at(STICK))
        await super().drive()

    drive_on = drive


class EarlierKeys(Keys):
    """A keyboard, whose focus does not follow the controls."""

    async def open_card(self) -> None:
        """Open one robot after the other, until one has an alarm."""
        for place in range(await self.page.locator(WAYS).count()):
            await self.input.tab_to(self.page.locator(SKIP))
            await self.input.press("Enter")
            await self.input.tab_to(self.page.locator(WAYS).nth(place))
            await self.input.press("Enter")
            if await _has_alarm(self):
                return
            await self.input.tab_to(self.page.locator(BACK))
            await self.input.press("Enter")
            await self.page.locator(WAYS).first.wait_for()
        raise AssertionError("no robot has an alarm")

    async def drive(self) -> None:
        """Take control, go back to the stick, and hold an arrow key."""
        await self.input.tab_to(self.page.locator("[data-verb='take']"))
        await self.input.press("Enter")
        await self.drive_on()

    async def drive_on(self) -> None:
        """Go back to the stick, and hold an arrow key."""
        await self.input.tab_to(self.page.locator(STICK).first, back=True)
        await self.input.hold_key("ArrowUp")
        await until(self.is_moving)
