"""Widgets that give commands, in a real browser: what people do, and what the robot gets."""

from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from playwright.async_api import Locator, Page

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_attribute, until_text
from tests.e2e.keys import signed_in
from tests.e2e.processes import UrcProcess
from tests.e2e.widgets.cranes import Crane, crane, ready
from urc.model.driver import Argument, Command
from urc.model.interface import WidgetUse
from urc.model.payload import WriteSpec
from urc.model.values import Signal
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

RADIO = "[data-cell='0'] .select-radio >> nth=0"
WORDED = """
  gear: { use: select, bind: { state: gear, change: set_gear }, options: { look: radio } }
  gears: { use: select, bind: { state: gear, change: set_gear } }
  pump: { use: switch, bind: { state: pump, change: set_pump } }
  seen: { use: state, bind: { value: pump }, options: { meanings: { P1: busy, still: caution } } }
"""


async def in_low_gear(new_page: PageMaker, robot: Crane, address: str) -> Page:
    """Open the page, and let the robot say that it is in low gear."""
    page = await new_page(size="desktop")
    await page.goto(address)
    await ready(page, "[data-cell='0'] .select-radio")
    await robot.tell_gear(0, "P0")
    await until_text(page, ".select-now", "low")
    return page


async def test_a_signal_with_words_is_chosen_and_switched_by_what_the_robot_says(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """People read the words, the robot is told its own; the mark stands where it says it is."""
    async with crane(urc_process, tmp_path, WORDED) as (robot, address):
        page = await in_low_gear(new_page, robot, address)
        assert await page.get_by_role("radio", name="low").is_checked()
        assert await page.input_value("select.select-list") == "0"
        assert await page.inner_text(".state-shape") == "◆"
        await until_text(page, ".switch-word", "off")

        await page.get_by_role("radio", name="high").click()
        await robot.until_got("GEAR 1")
        await page.click(".switch-main")
        await robot.until_got("PUMP P1")
        await robot.tell_gear(1, "P1")
        await until_text(page, ".select-now", "high")
        assert await page.get_by_role("radio", name="high").is_checked()
        assert await page.input_value("select.select-list") == "1"
        await until_text(page, ".switch-word", "on")
        await until_text(page, ".state-shape", "◐")
        assert await page.locator("[data-wish=missed], [data-wish=waiting]").count() == 0


async def test_a_switch_outlines_the_request_of_a_robot_that_reports_no_state(
    new_page: PageMaker,
) -> None:
    """It says “unknown”, then “requested”; both buttons stay, and none claims a state."""
    change = Command("enable", "wire", WriteSpec("text"), {"on": Argument("on", "boolean")})
    use = WidgetUse("motors", "switch", {"requested": "asked"}, {"change": "enable"}, {})
    asked = {"asked": Signal("asked", "boolean", stale_after_s=3600)}
    robot = FakeRobot(dashboard_profile(signals=asked, uses=[use], commands={"enable": change}))
    async with running_dashboard(robot) as address:
        page = await new_page(size="desktop")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        await ready(page, ".switch-on")
        await until_text(page, ".switch-note", "unknown")
        robot.set_reading("asked", True)
        await until_text(page, ".switch-note", "requested")
        await until_attribute(page, ".switch-on", "aria-pressed", "true")
        await until_attribute(page, ".switch-off", "aria-pressed", "false")
        assert not await page.is_visible(".switch-main")


async def test_numbers_are_chosen_for_a_robot_that_reports_words(new_page: PageMaker) -> None:
    """Their labels are the robot's words; a word that cannot be chosen is shown too."""
    change = Command("set_mode", "wire", WriteSpec("text"), {"mode": Argument("mode", "integer")})
    use = WidgetUse(
        "mode",
        "select",
        {"state": "mode"},
        {"change": "set_mode"},
        {"look": "list", "choices": ["0=manual", "4=hold"]},
    )
    profile = dashboard_profile(
        signals={"mode": Signal("mode", "string")}, commands={"set_mode": change}, uses=[use]
    )
    robot = FakeRobot(profile)
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        chosen = "(list) => list.selectedOptions[0].text"
        for word in ("hold", "manual", "acro"):
            robot.set_reading("mode", word)
            await until_text(page, ".select-now", word)
            assert await page.eval_on_selector("select.select-list", chosen) == word


async def test_choosing_by_keys_keeps_the_focus(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """While the robot is asked, too: a key that fell to the page could drive it."""
    async with crane(urc_process, tmp_path, WORDED) as (robot, address):
        page = await in_low_gear(new_page, robot, address)
        for control in ("select.select-list", "[data-cell='0'] .select-radio"):
            robot.holds = True
            await page.focus(control)
            await page.keyboard.press("ArrowDown")
            await until_attribute(page, ".select:has(:focus)", "data-phase", "pending")
            robot.release()
            await page.wait_for_selector(".select:has(:focus)[data-phase='done']")
            robot.lines.clear()


@pytest.mark.parametrize(
    "control", ["select.select-list", "[data-cell='0'] .select-radio >> nth=0"]
)
async def test_what_is_chosen_while_the_robot_is_asked_is_given_next(
    new_page: PageMaker,
    urc_process: Callable[..., UrcProcess],
    tmp_path: Path,
    control: str,
) -> None:
    """Arrow keys go on from what was chosen last; of all that is chosen meanwhile the newest."""
    async with crane(urc_process, tmp_path, WORDED) as (robot, address):
        page = await in_low_gear(new_page, robot, address)
        robot.holds = True
        await page.focus(control)
        await page.keyboard.press("ArrowDown")
        await until_attribute(page, ".select:has(:focus)", "data-phase", "pending")
        await page.keyboard.press("ArrowDown")
        await page.keyboard.press("ArrowUp")
        await page.keyboard.press("ArrowDown")
        robot.release()
        await robot.until_got("GEAR 1", "GEAR 2")
        await robot.tell_gear(2, "P0")
        await until_text(page, ".select:has(:focus) .select-now", "top")
        assert await page.locator("[data-wish=missed], [data-wish=waiting]").count() == 0


CONTROLS = """
  lamp: { use: switch, bind: { state: lamp, change: set_lamp } }
  mode: { use: select, bind: { state: mode, change: set_mode }, options: { look: segmented } }
  volts: { use: slider, bind: { state: volts, change: set_volts }, options: { step: 0.5 } }
  turn: { use: knob, bind: { change: set_volts }, options: { step: 1, send: release } }
  exact: { use: number, bind: { change: set_volts } }
  words: { use: text, bind: { change: say } }
  console: { use: terminal, bind: { typed: raw } }
  beep: { use: button, bind: { press: beep }, options: { gesture: double } }
  horn: { use: button, bind: { press: arm }, options: { gesture: hold } }
  ready: { use: checklist, bind: { complete: unlock }, options: { items: [Sky, Fuel] } }
"""


async def test_each_control_gives_exactly_its_command(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """By finger and by key; what is shown is what the robot says, and a difference is marked."""
    async with crane(urc_process, tmp_path, CONTROLS) as (robot, address):
        page = await new_page(size="desktop")
        await page.goto(address)
        await ready(page, ".switch-on")
        await robot.tell("off", "idle", "2.5")

        # A switch shows the robot's state, never the wish.
        await until_text(page, ".switch-word", "off")
        await page.click(".switch-main")
        await robot.until_got("LAMP 1")
        await until_text(page, ".switch-word", "off …")
        await robot.tell("on", "idle", "2.5")
        await until_text(page, ".switch-word", "on")
        await page.focus(".switch-main")
        await page.keyboard.press("Space")
        await robot.until_got("LAMP 0")
        await until_attribute(page, ".switch", "data-wish", "missed")
        await until_text(page, ".switch-word", "on ≠")
        await robot.tell("off", "idle", "2.5")
        await until_attribute(page, ".switch", "data-wish", "")

        await page.get_by_role("radio", name="auto").click()
        await robot.until_got("MODE auto")
        assert await page.get_by_role("radio", name="idle").is_checked()
        await robot.tell("off", "auto", "2.5")
        await until_text(page, ".select-now", "auto")

        track = await ready(page, ".slider-track")
        await until_attribute(page, ".slider-track", "aria-valuetext", "2.5 V")
        await track.focus()
        await page.keyboard.press("ArrowRight")
        await robot.until_got("VOLT 3")
        await robot.tell("off", "auto", "3")
        await until_attribute(page, ".slider-track", "aria-valuetext", "3.0 V")
        for key, line, said in (("PageDown", "VOLT 2", "2.0 V"), ("End", "VOLT 10", "10.0 V")):
            await page.keyboard.press(key)
            await robot.until_got(line)
            await robot.tell("off", "auto", line.split()[1])
            await until_attribute(page, ".slider-track", "aria-valuetext", said)
        box = await track.bounding_box()
        assert box is not None
        await track.click(position={"x": box["width"] / 2, "y": box["height"] / 2})
        await robot.until_got("VOLT 5")

        await page.locator(".knob-dial").focus()
        await page.keyboard.press("Home")
        await robot.until_got("VOLT 0")
        await until_attribute(page, ".knob-dial", "aria-valuetext", "0 V")
        await page.click(".knob-more")
        await robot.until_got("VOLT 1")

        await page.fill(".number-field", "11")
        await page.keyboard.press("Enter")
        await page.locator(".number-note", has_text="not above 10.0 V").wait_for()
        await page.fill(".number-field", "7,25 V")
        await page.keyboard.press("Enter")
        await robot.until_got("VOLT 7.25")
        await page.fill(".number-field", "1,000")
        await page.keyboard.press("Enter")
        note = page.locator(".number-note", has_text="1 or 1000? Type the number without a comma")
        await note.wait_for()
        await page.fill(".number-field", "3")
        await page.keyboard.press("ArrowUp")
        await robot.until_got("VOLT 3.1")
        assert await page.input_value(".number-field") == "3.1"

        await page.fill(".text-field", "a\u0007b")
        await page.locator(".text-note", has_text="control characters").wait_for()
        await page.keyboard.press("Enter")
        await page.fill(".text-field", "hello {{ 1 }}")
        await page.keyboard.press("Enter")
        await robot.until_got("SAY hello {{ 1 }}")

        await page.fill(".terminal-field", "STATUS 1")
        await page.keyboard.press("Enter")
        await robot.until_got("STATUS 1")
        await until_attribute(page, ".terminal", "data-phase", "done")
        await page.keyboard.press("ArrowUp")
        assert await page.input_value(".terminal-field") == "STATUS 1"

        beep = page.get_by_role("button", name="Beep")
        await beep.dblclick()
        await robot.until_got("BEEP")
        horn = page.get_by_role("button", name="Arm")
        await horn.focus()
        await page.keyboard.down("Enter")
        await robot.until_got("ARM")
        await page.keyboard.up("Enter")

        done = page.get_by_role("button", name="Unlock")
        await page.get_by_label("Sky").check()
        await done.click(force=True)
        await page.get_by_label("Fuel").check()
        await done.click()
        await robot.until_got("UNLOCK")
        await page.reload()
        await until_text(page, ".checklist-note", "✓ all done")
        assert await page.get_by_label("Fuel").is_checked()
        assert robot.lines == []


SENT_ONLY = """
  mode: { use: select, bind: { change: set_mode } }
  turn: { use: knob, bind: { change: set_volts }, options: { step: 1, send: release } }
"""


async def test_what_was_sent_is_shown_after_a_reload_where_the_robot_says_nothing(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """It is sent no second time, may be sent again by hand, and another tab shows no value."""
    async with crane(urc_process, tmp_path, SENT_ONLY) as (robot, address):
        page = await new_page(size="desktop")
        await page.goto(address)
        await ready(page, "select.select-list")
        await until_text(page, ".select-now", "—")
        await page.select_option("select.select-list", label="auto")
        await robot.until_got("MODE auto")
        await until_text(page, ".select-now", "auto")
        await page.locator(".knob-dial").focus()
        await page.keyboard.press("End")
        await robot.until_got("VOLT 10")
        await page.wait_for_selector(".knob[data-phase='done']")

        await page.reload()
        await until_attribute(page, ".knob-dial", "aria-valuetext", "10 V")
        await until_text(page, ".select-now", "auto")
        await ready(page, "select.select-list")
        assert robot.lines == []
        await page.select_option("select.select-list", label="auto")
        await robot.until_got("MODE auto")

        other = await new_page(size="desktop")
        await other.goto(address)
        await ready(other, "select.select-list")
        await until_text(other, ".select-now", "—")
        assert await other.get_attribute(".knob-dial", "aria-valuetext") == "— V"


WISHED = """
  lamp: { use: switch, bind: { state: lamp, change: set_lamp }, \
options: { echo: optimistic, echo_s: 60 } }
"""


async def test_a_switch_that_shows_the_wish_is_switched_back_by_the_next_tap(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """A tap means the other of what is shown, also while the robot has not said it yet."""
    async with crane(urc_process, tmp_path, WISHED) as (robot, address):
        page = await new_page(size="desktop")
        await page.goto(address)
        await ready(page, ".switch-on")
        await robot.tell("off", "idle", "2.5")
        await until_text(page, ".switch-word", "off")
        for line, word in (("LAMP 1", "on …"), ("LAMP 0", "off …"), ("LAMP 1", "on …")):
            await (await ready(page, ".switch-main")).click()
            await robot.until_got(line)
            await until_text(page, ".switch-word", word)
        await robot.tell("on", "idle", "2.5")
        await until_text(page, ".switch-word", "on")


ASKING = """
  dock: { use: button, bind: { press: dock } }
  erase: { use: button, bind: { press: erase } }
  beam: { use: button, bind: { press: beam } }
"""


async def test_what_the_driver_asks_is_asked_in_the_place_of_the_widget(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """No sends nothing; a hazard is slid; two people are not two screens, and may refuse."""
    async with crane(urc_process, tmp_path, ASKING) as (robot, address):
        page = await new_page(size="desktop")
        await page.goto(address)
        dock, erase, beam = (page.locator(f"[data-cell='{place}']") for place in range(3))
        await ready(page, "[data-cell='0'] .button-main")
        await dock.locator(".button-main").click()
        await dock.get_by_text("Dock now?").wait_for()
        await page.keyboard.press("Escape")
        await dock.locator(".button-note", has_text="Cancelled").wait_for()
        await dock.locator(".button-main").click()
        await dock.get_by_role("button", name="Yes").click()
        await robot.until_got("DOCK")

        await confirmed(page, erase, lambda: as_soon(bool(robot.lines)))
        await robot.until_got("ERASE")

        own = await new_page(size="tablet")  # of the same person, so it is not asked
        await own.goto(address)
        await ready(own, "[data-cell='2'] .button-main")
        other = await new_page(size="phone")
        await signed_in(other.context, address, tmp_path / "data", "Bea", "drive")
        await other.goto(address)
        await ready(other, "[data-cell='2'] .button-main")
        for answer in ("Refuse", "Slide to agree"):
            await confirmed(page, beam, beam.get_by_text("Waiting for a second person").is_visible)
            asked = other.locator(".urc-asked", has_text="The beam goes on")
            await asked.wait_for()
            assert robot.lines == []
            assert await own.locator(".urc-asked").count() == 0
            if answer == "Refuse":
                await asked.get_by_role("button", name=answer).click()
                await beam.locator(
                    ".button-note", has_text="refused by another operator"
                ).wait_for()
            else:
                agree = asked.get_by_role("slider", name=answer)
                await agree.focus()
                await slid(other, agree)
                await robot.until_got("BEAM")
            await asked.wait_for(state="detached")


async def as_soon(is_so: bool) -> bool:
    """Return what is known already, where something is awaited."""
    return is_so


async def confirmed(page: Page, cell: Locator, is_done: Callable[[], Awaitable[bool]]) -> None:
    """Slide what is asked; a slow machine lets a question lapse, which is then asked again."""
    slide = cell.get_by_role("slider", name="Slide to confirm")
    for _ in range(500):
        is_asked = await cell.locator(".urc-ask").count() > 0
        if await is_done():
            return
        if not is_asked:
            await cell.locator(".button-main").click()
        elif await slide.count():
            await slide.evaluate_all("(found) => found[0]?.focus()")
            await page.keyboard.press("ArrowRight")
    pytest.fail("it was never confirmed")


async def slid(page: Page, slide: Locator) -> None:
    """Slide something to its end by its keys; it may take a moment before it can be."""
    while await slide.count():
        await page.keyboard.press("ArrowRight")


STEPPED = """
  fly: { use: sequence, bind: { run: take_off }, options: { confirm_each: true } }
  own: { use: sequence, bind: { step_1: unlock, step_2: beep } }
"""


async def test_a_sequence_is_gone_through_step_by_step(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """Nothing begins before somebody says so; every screen sees where it stands, and can end it."""
    async with crane(urc_process, tmp_path, STEPPED) as (robot, address):
        page, other = await new_page(size="desktop"), await new_page(size="phone")
        await page.goto(address)
        await other.goto(address)
        fly, own = page.locator("[data-cell='0']"), page.locator("[data-cell='1']")
        await ready(page, "[data-cell='0'] .sequence-start")
        assert await fly.locator("li").all_inner_texts() == [
            "○ run unlock",
            "○ run arm",
            "○ run beep",
        ]
        await fly.locator(".sequence-start").click()
        for place, line in enumerate(("UNLOCK", "ARM", "BEEP")):
            note = f"paused before step {place + 1} of 3"
            await other.locator("[data-cell='0'] .sequence-note", has_text=note).wait_for()
            await fly.locator(".sequence-note", has_text=note).wait_for()
            assert robot.lines == []
            await fly.locator(".sequence-next").click()
            await robot.until_got(line)
        await fly.locator(".sequence-note", has_text="✓ done").wait_for()

        await fly.locator(".sequence-start").click()
        await fly.locator(".sequence-note", has_text="paused before step 1").wait_for()
        await other.locator("[data-cell='0'] .sequence-abort").click()
        await fly.locator(".sequence-note", has_text="ended on request").wait_for()
        assert robot.lines == []

        await own.locator(".sequence-start").click()
        await own.locator(".sequence-note", has_text="✓ done").wait_for()
        await robot.until_got("UNLOCK", "BEEP")
