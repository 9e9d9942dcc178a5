"""Five tasks of an operator, by touch and by keys; each ends when the robot has done it."""

from playwright.async_api import Locator, Page

from tests.e2e.dashboards import until
from tests.e2e.operator_input import OperatorInput, Told

__all__ = ["CARD", "SKIP", "STICK", "Hand", "Keys", "Touch"]

FULL_PX = 120
"""Push of a stick beyond its rim, in pixels."""
MOVING, STILL = 0.02, 0.005
"""Speeds of the robot that count as driven and as stopped, in m/s."""
NEARLY = 0.9
PUSHED_TICKS = 10
"""Number of ticks after which all ticks on their way show the whole push, not its first half."""
SKIP = ".urc-skip"
CARD = "[data-robot-card]:has([data-alarms]:not([hidden])) h2 a"
STICK, STOP = ".joystick-pad", "[data-stop-button]"
GROUND = "[data-place='ground']"
FOCUSED = "() => document.activeElement?.matches('.joystick-pad') ?? false"


class Hand:
    """What an operator does, whatever the device; subclasses press and touch."""

    def __init__(self, input_: OperatorInput, told: Told) -> None:
        self.input = input_
        self.page: Page = input_.page
        self.told = told

    # -- the tasks

    async def stop_the_robot_with_an_alarm(self) -> None:
        """Find a robot with an alarm in the menu, and stop it."""
        self.input.begin()
        await self.open_card()
        await self.stop()
        await self.until_latched()

    async def swap_the_camera(self) -> None:
        """Drive, swap the background with another view, and let go."""
        before = await self.page.locator(GROUND).get_attribute("data-cell")
        self.input.begin()
        await self.drive()
        await self.swap()
        await self.page.wait_for_function(
            f"(before) => document.querySelector(`{GROUND}`).dataset.cell !== before", arg=before
        )
        assert self.is_moving(), "the swap ended the motion"
        await self.let_go()

    async def slow_down(self) -> None:
        """Drive, choose half of the speed while holding, and let go."""
        self.input.begin()
        await self.drive()
        pushed = self.told.ticks + PUSHED_TICKS
        await until(lambda: self.told.ticks > pushed and self.has_reached_its_speed())
        fast = self.speed()
        await self.choose_slowest()
        await until(lambda: STILL < self.speed() < 0.6 * fast)
        await self.let_go()

    async def drive_after_stop(self) -> None:
        """Drive, press STOP while holding, reset, and drive again."""
        await self.drive()
        self.input.begin()
        await self.stop(is_driving=True)
        await self.until_latched()
        await until(lambda: not self.is_moving())
        await self.release()
        await self.reset()
        await until(lambda: self.told.lease["latched"] == "")
        await self.drive_on()
        await self.let_go()

    async def take_over(self) -> None:
        """Take the controls from a screen at which nobody is, and drive."""
        await until(lambda: self.told.lease.get("holder") is not None)
        assert not self.has_lease()
        self.input.begin()
        await self.force()
        await until(self.has_lease)
        await self.drive_on()
        await self.let_go()

    # -- the steps

    async def open_card(self) -> None:
        """Open the page of the robot with an alarm."""
        raise NotImplementedError

    async def drive(self) -> None:
        """Hold the stick forward, from any state of the page."""
        raise NotImplementedError

    async def drive_on(self) -> None:
        """Hold the stick forward after a button about the controls."""
        raise NotImplementedError

    async def release(self) -> None:
        """Lift finger or key."""
        raise NotImplementedError

    async def swap(self) -> None:
        """Show another view large."""
        raise NotImplementedError

    async def choose_slowest(self) -> None:
        """Choose the slowest speed step."""
        raise NotImplementedError

    async def stop(self, *, is_driving: bool = False) -> None:
        """Press STOP."""
        raise NotImplementedError

    async def reset(self) -> None:
        """Reset the latched STOP."""
        raise NotImplementedError

    async def force(self) -> None:
        """Take the controls over."""
        raise NotImplementedError

    # -- what the robot does

    async def let_go(self) -> None:
        """Let go, and wait until the robot stands."""
        await self.release()
        await until(lambda: not self.is_moving())

    def speed(self) -> float:
        """Return the speed that the robot measures."""
        return abs(float(self.told.values.get("speed") or 0.0))

    def is_moving(self) -> bool:
        """Whether the robot moves."""
        return self.speed() > MOVING

    def has_lease(self) -> bool:
        """Whether this page has the controls."""
        holder = self.told.lease.get("holder")
        return holder is not None and holder["id"] == self.told.lease["you"]

    async def until_latched(self) -> None:
        """Wait until the server has latched STOP."""
        await until(lambda: bool(self.told.lease.get("latched")))

    def has_reached_its_speed(self) -> bool:
        """Whether the robot is nearly as fast as the stick says."""
        wanted = abs(float(self.told.wanted.get("speed") or 0.0))
        return wanted > MOVING and self.speed() > NEARLY * wanted


class Touch(Hand):
    """Fingers: the first one holds the stick, the second one taps meanwhile."""

    def at(self, selector: str) -> Locator:
        """Return the first visible element."""
        return self.page.locator(selector).locator("visible=true").first

    async def open_card(self) -> None:
        """Tap the card."""
        await self.input.tap(self.at(CARD))

    async def drive(self) -> None:
        """Push the stick."""
        await self.input.hold(self.at(STICK), up=FULL_PX)
        await until(self.is_moving)

    drive_on = drive

    async def release(self) -> None:
        """Lift the finger."""
        await self.input.lift()

    async def swap(self) -> None:
        """Tap a small view."""
        await self.input.tap(self.at(".urc-pip .urc-swap"), finger=2)

    async def choose_slowest(self) -> None:
        """Tap the first step."""
        await self.input.tap(self.at("[data-speed]"), finger=2)

    async def stop(self, *, is_driving: bool = False) -> None:
        """Tap STOP."""
        await self.input.tap(self.at(STOP), finger=2)

    async def reset(self) -> None:
        """Tap the button of the red band."""
        await self.input.tap(self.at("[data-verb='reset']"))

    async def force(self) -> None:
        """Tap the button of the bar."""
        await self.input.tap(self.at("[data-verb='force']"))


class Keys(Hand):
    """A keyboard alone; each task begins without focus."""

    async def open_card(self) -> None:
        """Skip the bar, and go to the card."""
        await self.input.tab_to(self.page.locator(SKIP))
        await self.input.press("Enter")
        await self.input.tab_to(self.page.locator(CARD).first)
        await self.input.press("Enter")
        await self.page.locator(STOP).wait_for()

    async def drive(self) -> None:
        """Take control, which brings the focus to the stick, and hold an arrow key."""
        if not await self.page.evaluate(FOCUSED):
            await self.input.tab_to(self.page.locator("[data-verb='take']"))
            await self.input.press("Enter")
        await self.drive_on()

    async def drive_on(self) -> None:
        """Hold an arrow key: the focus is on the stick already."""
        await self.page.wait_for_function(FOCUSED)
        await self.input.hold_key("ArrowUp")
        await until(self.is_moving)

    async def release(self) -> None:
        """Lift the key."""
        await self.input.lift_key("ArrowUp")

    async def swap(self) -> None:
        """Press V."""
        self.input.decide()
        await self.input.press("v")

    async def choose_slowest(self) -> None:
        """Press the number of the step."""
        self.input.decide()
        await self.input.press("1")

    async def stop(self, *, is_driving: bool = False) -> None:
        """Press Escape, or Space while driving."""
        self.input.decide()
        await self.input.press("Space" if is_driving else "Escape")

    async def reset(self) -> None:
        """Go to the button, and press it."""
        await self.input.tab_to(self.page.locator("[data-verb='reset']"))
        await self.input.press("Enter")

    async def force(self) -> None:
        """Go to the button, and press it."""
        await self.input.tab_to(self.page.locator("[data-verb='force']"))
        await self.input.press("Enter")
