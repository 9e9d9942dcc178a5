"""What hands do to each input, in a real browser, and what then reaches the robot."""

import asyncio
import re

import pytest
from playwright.async_api import expect

from tests.e2e.browser import PLAIN_HOST
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import until, until_attribute, until_text
from tests.e2e.motion.driving import CALM_LEASE_S, centre, fingers_on, fire, held, number
from tests.e2e.widgets.inputs import PLAIN, drag, shown, until_values, use
from urc.model.interface import OutputBinding

pytestmark = pytest.mark.anyio

LOW = """
    const { style } = document.querySelector(".urc-cell");
    Object.assign(style, { height: "10rem", minHeight: "0" });
"""
FRAMES = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


async def test_a_stick_goes_where_its_options_say(new_page: PageMaker) -> None:
    """Gate, turned axis, speed step by button and by key; the value is in words."""
    stick = use("joystick", gate="cross", invert_y=True, **PLAIN)
    async with shown(new_page, stick) as (robot, page):
        await drag(page, ".joystick-pad", 300, 320)
        await until_values(robot, x=1.0)
        await until_text(page, ".joystick-x", "forward 100 %")
        slider = page.get_by_role("slider", name="joystick: forward and backward")
        assert await slider.get_attribute("aria-valuetext") == "forward 100 %"
        await page.mouse.move(0, 450)
        await until(lambda: robot.values("go").get("y", 0) < 0)
        await page.mouse.up()
        await robot.until_stopped("go")
        await page.get_by_role("button", name="Speed 30 %").click()
        await slider.focus()
        await page.keyboard.down("KeyW")
        await until_values(robot, x=0.15)
        await page.keyboard.press("Digit2")
        await until_values(robot, x=0.3)
        await page.keyboard.up("KeyW")
        await robot.until_stopped("go")


async def test_a_stick_tells_the_direction_of_its_arguments(new_page: PageMaker) -> None:
    """In the same words to eyes and ears, for inverted axes and for any name."""
    given = {"moved": OutputBinding({"constructor": "x", "right": "y"})}
    stick = use("joystick", invert_y=True, **PLAIN)._replace(given=given)
    go = held("go", number("constructor"), number("right"), lease_s=CALM_LEASE_S)
    async with shown(new_page, stick, go=go) as (robot, page):
        await drag(page, ".joystick-pad", 0, 300)
        await until_text(page, ".joystick-x", "forward 100 %")
        await page.mouse.up()
        await robot.until_stopped("go")
        await drag(page, ".joystick-pad", 300, 0)
        await until_text(page, ".joystick-y", "right 100 %")
        await until_attribute(page, ".joystick-y", "aria-valuetext", "right 100 %")
        await page.mouse.up()
        await robot.until_stopped("go")


async def test_the_values_of_both_axes_are_one_below_the_other(new_page: PageMaker) -> None:
    """In the width of a stick next to a picture, both are readable."""
    async with shown(new_page, use("joystick", **PLAIN)) as (_, page):
        await page.locator(".joystick").evaluate("(stick) => { stick.style.width = '144px'; }")
        await drag(page, ".joystick-pad", 300, 300)
        await until_text(page, ".joystick-y", "right 71 %")
        ahead = await page.locator(".joystick-x").bounding_box()
        aside = await page.locator(".joystick-y").bounding_box()
        pill = await page.locator(".joystick-values").bounding_box()
        await page.mouse.up()
    assert ahead is not None
    assert aside is not None
    assert pill is not None
    assert ahead["y"] + ahead["height"] <= aside["y"]
    assert max(ahead["width"], aside["width"]) <= pill["width"] <= 144


async def test_letting_go_counts_while_another_button_of_the_mouse_is_down(
    new_page: PageMaker,
) -> None:
    """The browser tells of the first one's end by a move only."""
    async with shown(new_page, use("joystick", **PLAIN)) as (robot, page):
        await drag(page, ".joystick-pad", 0, 400)
        await until_values(robot, x=1.0)
        await page.mouse.down(button="middle")
        await page.mouse.up()
        await robot.until_stopped("go")
        assert "released" in robot.line.reasons
        await page.mouse.up(button="middle")


async def test_a_key_that_hides_when_others_come_up_lets_them_go(new_page: PageMaker) -> None:
    """On a Mac nobody hears a key that comes up while Command is down."""
    async with shown(new_page, use("joystick", **PLAIN)) as (robot, page):
        await page.get_by_role("slider", name="joystick: forward and backward").focus()
        await page.keyboard.down("KeyW")
        await robot.until_moving("go")
        await page.keyboard.down("Meta")
        await robot.until_stopped("go")
        assert "released" in robot.line.reasons
        await page.keyboard.up("Meta")


async def test_one_button_goes_through_the_speed_steps_in_a_low_cell(new_page: PageMaker) -> None:
    """After the fastest it begins anew; where there is room for all, it is not there."""
    async with shown(new_page, use("joystick", **PLAIN)) as (robot, page):
        step = page.locator(".urc-speed-next")
        await expect(step).to_be_hidden()
        await fire(page, LOW)
        await expect(page.get_by_role("button", name="Speed 30 %")).to_be_hidden()
        await expect(step).to_have_text(re.compile(r"100 % ›$"))
        await step.click()
        await expect(step).to_have_text(re.compile(r"30 % ›$"))
        await drag(page, ".joystick-pad", right=0, up=200)
        await until_values(robot, x=0.3)
        await page.mouse.up()
        for _ in range(2):
            await step.click()
        await expect(step).to_have_text(re.compile(r"100 % ›$"))


async def test_slew_holds_up_speeding_up_and_never_stopping(new_page: PageMaker) -> None:
    """It begins at nothing and grows; letting go is a stop at once."""
    async with shown(new_page, use("joystick", slew=2.0, **PLAIN)) as (robot, page):
        await drag(page, ".joystick-pad", 0, 400)
        await until_values(robot, x=1.0)
        speeds = [
            float(text.split("x=")[1].split()[0])
            for text in robot.line.texts
            if text.startswith("go x")
        ]
        assert speeds == sorted(speeds)
        assert speeds[0] == 0
        assert len(set(speeds)) > 5, "it took several steps"
        await page.mouse.up()
        await robot.until_stopped("go")


@pytest.mark.parametrize(
    ("host", "event"), [("127.0.0.1", "pointerrawupdate"), (PLAIN_HOST, "pointermove")]
)
async def test_a_move_of_the_pointer_is_sent_without_waiting_for_a_frame(
    new_page: PageMaker, host: str, event: str
) -> None:
    """The tick leaves within the event, by raw events or, over plain http, by hurried ones.

    An event that was kept for a frame comes in the frame's own task.
    """
    async with shown(new_page, use("joystick", **PLAIN), host=host) as (robot, page):
        new_page.allow(page, lambda text: "header has been ignored" in text)  # it is not secure
        await fire(
            page,
            """
            window.isIn = false; window.rawTicks = 0;
            addEventListener("EVENT", () => { window.isIn = true; }, true);
            addEventListener("EVENT", () => { window.isIn = false; });
            const send = WebSocket.prototype.send;
            WebSocket.prototype.send = function (text) {
              if (window.isIn && text.includes('"tick"')) {
                let isFrame = false;
                const { port1, port2 } = new MessageChannel();
                requestAnimationFrame(() => { isFrame = true; });
                port1.onmessage = () => { window.rawTicks += Number(!isFrame); port1.close(); };
                port2.postMessage(null);
              }
              return send.call(this, text);
            };
            null;
            """.replace("EVENT", event),
        )
        await drag(page, ".joystick-pad", 0, 30)
        await until(lambda: robot.values("go").get("x", 0) > 0)
        x, y = await centre(page, ".joystick-pad")
        for step in range(1000):  # a busy browser makes one event of many moves
            await page.mouse.move(x, y - 30 - step % 40)
            await asyncio.sleep(0.01)
            if step % 20 == 19 and await page.evaluate("() => window.rawTicks > 5"):
                break
        assert await page.evaluate("() => window.rawTicks > 5")


async def test_a_cross_of_arrows_needs_no_dragging(new_page: PageMaker) -> None:
    """A press is full on, the thumb may slide, and keys hold it."""
    async with shown(new_page, use("dpad", level=0.5)) as (robot, page):
        await page.get_by_role("button", name="forward", exact=True).hover()
        await page.mouse.down()
        await until_values(robot, x=0.5)
        await until_attribute(page, "[data-at='1 0']", "aria-pressed", "true")
        await page.get_by_role("button", name="forward and to the right").hover()
        await until_values(robot, x=0.5, y=-0.5)
        await page.mouse.up()
        await robot.until_stopped("go")
        await page.get_by_role("button", name="to the left", exact=True).focus()
        await page.keyboard.down("Enter")
        await until_values(robot, y=0.5)
        await page.keyboard.up("Enter")
        await robot.until_stopped("go")


async def test_a_lever_stays_only_while_a_dead_man_is_held(new_page: PageMaker) -> None:
    """Let go by itself it returns; beside a dead-man it stays, and stops with it."""
    lever = use("axis", "level", stay=True, **PLAIN)
    async with shown(new_page, lever, use("deadman"), size="tablet") as (robot, page):
        hands = await fingers_on(page)
        x, y = await centre(page, ".axis-lever")
        await hands.put(0, x, y)
        await until_text(page, ".axis-note", "◆ hold the dead-man control first")
        await hands.lift(0)
        assert robot.line.texts == []
        await hands.put(1, *(await centre(page, ".deadman-main")))
        await until_attribute(page, ".deadman", "data-open", "yes")
        await hands.put(0, x, y)
        await hands.put(0, x, y - 400)
        await until_values(robot, "level", value=1.0)
        await hands.lift(0)
        count = len(robot.line.written)
        await until(lambda: len(robot.after(count)) > 5)
        assert robot.values("level") == {"value": 1.0}, "it stays"
        await hands.put(0, x, y)
        await hands.put(0, x, y + 1)
        count = len(robot.line.written)
        await until(lambda: len(robot.after(count)) > 2)
        assert robot.values("level")["value"] > 0.9, "taken hold of again, it does not jump"
        await hands.lift(0)
        await hands.lift(1)
        await robot.until_stopped("level")
        await until_text(page, ".axis-note", "◆ the dead-man control was released")


async def test_an_axis_without_a_spring_stays_and_the_other_returns(new_page: PageMaker) -> None:
    """Beside a dead-man's key; the face that floats comes to the thumb, and goes home."""
    stick = use("joystick", spring_x=False, origin="floating", gate="square", **PLAIN)
    async with shown(new_page, stick, use("deadman")) as (robot, page):
        await fire(page, "document.activeElement.blur()")
        await page.keyboard.down("ShiftLeft")
        await until_attribute(page, ".deadman", "data-open", "yes")
        x, y = await centre(page, ".joystick-pad")
        await page.mouse.move(x + 40, y + 40)
        await page.mouse.down()
        assert await page.get_attribute(".joystick-all", "transform") != "translate(0.0 0.0)"
        await page.mouse.move(x - 300, y - 300, steps=3)
        await until_values(robot, x=1.0, y=1.0)
        await page.mouse.up()
        await until_values(robot, x=1.0)
        await until_attribute(page, ".joystick-all", "transform", "translate(0.0 0.0)")
        await page.keyboard.up("ShiftLeft")
        await robot.until_stopped("go")


async def test_a_dead_man_is_a_key_too_or_a_switch_with_an_end(new_page: PageMaker) -> None:
    """Shift holds it from anywhere; a switched one goes off by itself, and says why."""
    stick = use("joystick", **PLAIN)
    async with shown(new_page, stick, use("deadman")) as (robot, page):
        await page.focus(".joystick-pad")
        await page.keyboard.down("ShiftLeft")
        await page.keyboard.down("KeyW")
        await until_values(robot, x=0.5)
        await page.keyboard.up("ShiftLeft")
        await robot.until_stopped("go")
        await page.keyboard.up("KeyW")
    switched = use("deadman", mode="toggle", timeout=3.0)
    async with shown(new_page, stick, switched) as (robot, page):
        await page.get_by_role("button", name="deadman").click()
        await page.focus(".joystick-pad")
        await page.keyboard.down("KeyW")
        await until_values(robot, x=0.5)
        await page.keyboard.up("KeyW")
        await until_attribute(page, ".deadman", "data-open", "no")
        await until_text(page, ".deadman-note", "◆ no control was used for too long")


async def test_keys_drive_from_anywhere_once_they_are_switched_on(new_page: PageMaker) -> None:
    """Not while somebody types; Space is STOP, whatever has the focus."""
    async with shown(new_page, use("keyboard", level=0.5)) as (robot, page):
        await fire(page, "document.activeElement.blur()")
        await page.keyboard.press("KeyW")
        assert robot.line.texts == []
        await page.get_by_role("button", name="On the whole page").click()
        await page.keyboard.down("KeyW")
        await page.keyboard.down("KeyQ")
        await until_values(robot, x=0.5, turn=0.5)
        await page.keyboard.up("KeyW")
        await until_values(robot, turn=0.5)
        await page.keyboard.up("KeyQ")
        await robot.until_stopped("go")
        await fire(
            page,
            "document.querySelector('.urc-bar').append(document.createElement('textarea'));"
            "document.querySelector('textarea').focus()",
        )
        count = len(robot.line.written)
        await page.keyboard.type("wasd ")
        assert await page.input_value("textarea") == "wasd "
        assert robot.after(count) == []
        await page.get_by_role("button", name="On the whole page").focus()
        await page.keyboard.down("KeyS")
        await until_values(robot, x=-0.5)
        await page.keyboard.press("Space")
        await robot.until_stopped("go")
        await page.wait_for_selector("[data-controls][data-state='latched']")
        on = page.get_by_role("button", name="On the whole page")
        assert await on.get_attribute("aria-pressed") == "true", "Space pressed no button"


STRANGE_PAD = """
window.pad = { id: "Strange", index: 0, connected: true, mapping: "", axes: [0, 0, -1, 0, 0],
  timestamp: 1, buttons: Array.from({ length: 6 }, () => ({ pressed: false })) };
navigator.getGamepads = () => [window.pad];
dispatchEvent(new Event("gamepadconnected"));
setInterval(() => { if (!window.isFrozen) window.pad.timestamp += 1; }, 20);
"""


async def test_a_strange_gamepad_is_learnt_kept_and_driven(new_page: PageMaker) -> None:
    """Its axes and buttons are shown; what was learnt is kept on the device; frozen, it lets go."""
    async with shown(new_page, use("gamepad", **PLAIN)) as (robot, page):
        await fire(page, STRANGE_PAD)
        await page.wait_for_selector(".gamepad-device:has-text('Sticks unknown')")
        await fire(page, "pad.axes[3] = -1; pad.buttons[2].pressed = true")
        await until_text(page, ".gamepad-axis:nth-child(4)", "3: −1.00")
        await until_text(page, ".gamepad-button:nth-child(3)", "● 2")
        await fire(page, "pad.axes[3] = 0; pad.buttons[2].pressed = false")
        await page.click(".gamepad-map summary")
        await page.get_by_role("button", name="Change: Left stick, along").click()
        await page.wait_for_selector(".gamepad-learn:has-text('pull it back')")
        await fire(page, "pad.axes[3] = -1")
        await page.wait_for_selector(".gamepad-part:nth-child(2):has-text('3 ↔')")
        await fire(page, "pad.axes[3] = 0")
        await page.get_by_role("button", name="Change: Enables the left stick").click()
        await page.wait_for_selector(".gamepad-learn:has-text('press a button')")
        await fire(page, "pad.buttons[2].pressed = true")
        await page.wait_for_selector(".gamepad-learn:has-text('press a button')", state="hidden")
        kept = await page.evaluate("JSON.parse(localStorage['urc-pad:Strange'])")
        assert (kept["axes"][1], kept["turned"][1], kept["left"]) == (3, True, [2])
        assert robot.line.texts == [], "a button that was down already enables nothing"
        await fire(page, "pad.axes[2] = 0; pad.buttons[2].pressed = false")
        await until_text(page, ".gamepad-button:nth-child(3)", "○ 2")
        await page.evaluate(FRAMES)  # the page looks at pads in frames, the widget when it likes
        await fire(page, "pad.buttons[2].pressed = true")
        await until_values(robot)
        await fire(page, "pad.axes[3] = 1")  # its sign is turned: ahead
        await until_values(robot, x=1.0)
        await fire(page, "window.isFrozen = true")
        await robot.until_stopped("go")
        count = len(robot.line.written)
        await fire(page, "window.isFrozen = false; pad.axes[3] = 0")
        await until_text(page, ".gamepad-axis:nth-child(4)", "3: 0.00")
        await fire(page, "pad.axes[3] = 1")
        await until_text(page, ".gamepad-axis:nth-child(4)", "3: +1.00")
        assert robot.after(count) == [], "it needs a new press"
