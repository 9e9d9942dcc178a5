"""Interfaces in a real browser: by screen, by hand, in tabs, over a picture, and one for faults."""

import asyncio
import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from playwright.async_api import FloatRect, Locator, Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import (
    WAIT_S,
    is_on_top,
    running_dashboard,
    turned,
    until,
    until_attribute,
    until_text,
)
from tests.e2e.dev_pages import served
from tests.e2e.drawn import RED, plain, until_seen
from tests.e2e.motion.driving import (
    CALM_LEASE_S,
    USES,
    Wire,
    centre,
    commands,
    driven,
    held,
    number,
    opened,
    push,
)
from tests.e2e.processes import UrcProcess
from urc.model.driver import Argument, Command
from urc.model.exchange import Confirm
from urc.model.interface import Interface, Layout, Slot, Tab, WidgetUse
from urc.model.payload import WriteSpec
from urc.model.values import Signal, Value
from urc.runtime.session import CommandFailed
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.testing.movers import FakeMotionBackend

pytestmark = pytest.mark.anyio

PHONE, PHONE_LYING, TABLET, DESKTOP = (390, 844), (844, 390), (820, 1180), (1440, 900)
A, B, C = "[data-cell='0']", "[data-cell='1']", "[data-cell='2']"


def row(*names: str) -> Layout:
    """Return a grid of one row."""
    return Layout(1, len(names), tuple(Slot(name, 0, place) for place, name in enumerate(names)))


def column(*names: str) -> Layout:
    """Return a grid of one column."""
    return Layout(len(names), 1, tuple(Slot(name, place, 0) for place, name in enumerate(names)))


def gauged(*interfaces: Interface) -> FakeRobot:
    """Return a robot with three values, `a` to `c`, and these interfaces."""
    uses = [WidgetUse(name, "value", {"value": name}) for name in "abc"]
    profile = dashboard_profile(signals={name: Signal(name) for name in "abc"}, uses=uses)
    named = {each.name: each for each in interfaces}
    return FakeRobot(profile._replace(interfaces=named or profile.interfaces))


def steered(*interfaces: Interface) -> Wire:
    """Return a robot with two sticks and a button, and these interfaces."""
    robot = Wire(lease_s=CALM_LEASE_S)
    named = {each.name: each for each in interfaces}
    robot.profile = robot.profile._replace(interfaces=named)
    return robot


async def box(page: Page, selector: str) -> FloatRect:
    """Return where an element is."""
    found = await page.locator(selector).bounding_box()
    assert found is not None, selector
    return found


async def test_each_screen_has_its_own_picture(new_page: PageMaker) -> None:
    """Wide, tall, and a phone both ways; what a picture leaves out is not shown there."""
    grids = {
        "landscape": row("a", "b", "c"),
        "portrait": column("c", "b", "a"),
        "phone_portrait": row("b", "a"),
    }
    async with running_dashboard(gauged(Interface("x", "X", grids))) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        for size in (DESKTOP, PHONE_LYING):
            await turned(page, size)
            lefts = [(await box(page, one))["x"] for one in (A, B, C)]
            assert lefts == sorted(lefts), size
            assert lefts[0] < lefts[1] < lefts[2], size
        await turned(page, TABLET)
        tops = [(await box(page, one))["y"] for one in (C, B, A)]
        assert tops[0] < tops[1] < tops[2]
        await turned(page, PHONE)
        assert (await box(page, B))["x"] < (await box(page, A))["x"]
        await expect(page.locator(C)).to_be_hidden()


async def test_the_left_hand_is_kept_on_the_device(new_page: PageMaker) -> None:
    """The columns are the other way round, also after the page was opened anew."""
    async with running_dashboard(gauged()) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        assert (await box(page, A))["x"] < (await box(page, C))["x"]
        await page.get_by_role("button", name="This device").click()
        await page.locator("label:has([data-hand-choice][value='left'])").click()
        assert (await box(page, C))["x"] < (await box(page, A))["x"]
        await page.reload()
        assert (await box(page, C))["x"] < (await box(page, A))["x"]


async def test_only_the_first_visit_asks_to_turn_a_phone_whose_slots_are_stacked(
    new_page: PageMaker,
) -> None:
    """Never in landscape, nor for an interface that is drawn for a phone in portrait."""
    ask = "Turn the phone for the full layout."
    wide = row("a", "b", "c")
    async with running_dashboard(gauged(Interface("x", "X", {"landscape": wide}))) as address:
        page = await new_page(size="phone", is_first=True)
        hints = page.get_by_role("region", name="Hints")
        await page.goto(f"{address}robots/puppet/")
        await expect(hints).to_contain_text(ask)
        await page.set_viewport_size({"width": 844, "height": 390})
        await page.reload()
        await expect(hints).to_be_visible()
        await expect(hints).not_to_contain_text(ask)
        await page.set_viewport_size({"width": 390, "height": 844})
        await page.get_by_role("button", name="Got it").click()
        await page.reload()
        await expect(page.locator(".urc-cell").first).to_be_visible()
        await expect(page.locator("body")).not_to_contain_text(ask)
    drawn = Interface("x", "X", {"landscape": wide, "phone_portrait": column("a", "b")})
    async with running_dashboard(gauged(drawn)) as address:
        page = await new_page(size="phone", is_first=True)
        hints = page.get_by_role("region", name="Hints")
        await page.goto(f"{address}robots/puppet/")
        await expect(hints).to_be_visible()
        await expect(hints).not_to_contain_text(ask)


async def test_a_tab_hides_what_it_does_not_show(new_page: PageMaker) -> None:
    """Its cells get nothing; a cell that is in both goes on; the address says which is open."""
    tabs = {
        "one": Tab("one", "One", {"landscape": row("a", "b")}),
        "two": Tab("two", "Two", {"landscape": row("b", "c")}),
    }
    robot = gauged(Interface("x", "X", tabs=tabs))
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("a", 1)
        robot.set_reading("b", 2)
        await until_text(page, f"{A} .value-text", "1")
        await page.get_by_role("tab", name="One").focus()
        await page.keyboard.press("ArrowRight")
        await expect(page.get_by_role("tab", name="Two")).to_be_focused()
        await expect(page.get_by_role("tab", name="Two")).to_have_attribute("aria-selected", "true")
        await expect(page.get_by_role("tabpanel", name="Two")).to_be_visible()
        await expect(page.locator(A)).to_be_hidden()
        await expect(page.locator("[data-badge]")).to_be_visible()
        robot.set_reading("a", 11)
        robot.set_reading("b", 12)
        await until_text(page, f"{B} .value-text", "12")
        await until_text(page, f"{A} .value-text", "1")
        assert page.url.endswith("tab=two")
        await page.reload()
        await expect(page.locator(A)).to_be_hidden()
        await expect(page.locator("[data-badge-text]")).to_have_text("Live")
        robot.set_reading("a", 11)
        await page.get_by_role("tab", name="Two").press("Home")
        await until_text(page, f"{A} .value-text", "11")


async def test_another_tab_lets_go_of_what_is_held(new_page: PageMaker) -> None:
    """The robot stops, and STOP stays where it is."""
    names = [use.slot for use in USES]
    tabs = {
        "drive": Tab("drive", "Drive", {"landscape": row(*names)}),
        "more": Tab("more", "More", {"landscape": row(names[2])}),
    }
    async with driven(robot=steered(Interface("x", "X", tabs=tabs))) as (robot, address):
        page = await opened(new_page, address)
        place = await box(page, "[data-stop-button]")
        await push(page)
        await robot.until_moving()
        await page.get_by_role("tab", name="Drive").focus()
        await page.keyboard.press("End")
        await robot.until_stopped()
        assert await box(page, "[data-stop-button]") == place
        assert await is_on_top(page, "[data-stop-button]")


async def test_another_interface_keeps_the_connection(new_page: PageMaker) -> None:
    """What is held is let go; the values are there at once; the way back leads back."""
    sticks = Interface("sticks", "Sticks", {"landscape": row(*(use.slot for use in USES))})
    lift = Interface("lift", "Lift", {"landscape": row("up")})
    async with driven(robot=steered(sticks, lift)) as (robot, address):
        page = await opened(new_page, address)
        await push(page)
        await robot.until_moving()
        choice = page.get_by_label("Interface")
        assert (await box(page, "[data-interface-choice]"))["height"] >= 48
        await choice.select_option("lift")
        await robot.until_stopped()
        await expect(page.locator(".urc-cell")).to_have_count(1)
        await expect(page.locator("#cell-0-main")).to_contain_text("Lift")
        await expect(page).to_have_url(re.compile("interface=lift$"))
        await expect(page.locator("[data-badge-text]")).to_have_text("Live")
        assert robot.opened == 1
        await page.mouse.up()
        await page.locator("#cell-0-main").hover()
        await page.mouse.down()
        await robot.until_moving("lift")
        await page.mouse.up()
        await robot.until_stopped("lift")
        await page.go_back()
        await expect(page.locator(".urc-cell")).to_have_count(len(USES))
        await expect(choice).to_have_value("sticks")
        await choice.select_option("lift")
        await expect(page.locator(".urc-cell")).to_have_count(1)
        await page.goto(address)
        await expect(choice).to_have_value("lift")


async def test_a_link_within_the_page_opens_nothing_anew(new_page: PageMaker) -> None:
    """Neither to the content nor back: what widgets have kept stays, and what is held goes on."""
    sticks = Interface("sticks", "Sticks", {"landscape": row(*(use.slot for use in USES))})
    lift = Interface("lift", "Lift", {"landscape": row("up")})
    async with driven(robot=steered(sticks, lift)) as (_, address):
        page = await opened(new_page, address)
        asked: list[str] = []
        page.on("request", lambda request: asked.append(request.url))
        await page.evaluate("document.querySelector('.urc-cell').dataset.kept = 'yes'")
        await page.locator(".urc-skip").press("Enter")
        await page.wait_for_url("**#main")
        await page.go_back()
        await page.wait_for_url(lambda url: "#" not in url)
        await page.go_forward()
        await page.wait_for_url("**#main")
        await until_attribute(page, "[data-cell='0']", "data-kept", "yes")
        assert [url for url in asked if "part=" in url] == []
        choice = page.get_by_label("Interface")
        await choice.select_option("lift")
        await expect(page.locator(".urc-cell")).to_have_count(1)
        await page.go_back()
        await expect(page.locator(".urc-cell")).to_have_count(len(USES))
        await expect(choice).to_have_value("sticks")


async def test_an_interface_that_cannot_be_opened_leaves_this_one(new_page: PageMaker) -> None:
    """It is said, and what is shown goes on."""
    robot = gauged()
    async with running_dashboard(robot) as address:
        page = await new_page()
        new_page.allow(page, lambda text: "ERR_FAILED" in text)
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        await page.route("**/*interface=debug*", lambda route: route.abort())
        await page.get_by_label("Interface").select_option("debug")
        await expect(page.locator("[data-note]")).to_contain_text("no connection to URC")
        await expect(page.get_by_label("Interface")).to_have_value("default")
        robot.set_reading("a", 5)
        await until_text(page, f"{A} .value-text", "5")


async def test_a_touch_user_sees_hints_once_that_cover_no_control(new_page: PageMaker) -> None:
    async with driven(robot=Wire(lease_s=CALM_LEASE_S)) as (_, address):
        page = await new_page(size="phone", is_first=True)
        await page.goto(address)
        hints = page.get_by_role("region", name="Hints")
        await expect(hints).to_contain_text("Let go to stop")
        assert await is_on_top(page, "[data-stop-button]")
        assert await is_on_top(page, ".joystick-pad")
        await page.reload()
        await page.get_by_role("button", name="Got it").click()
        await page.reload()
        await expect(page.locator("[data-who]")).to_contain_text("No one drives")
        await expect(hints).to_have_count(0)
        mouse = await new_page(size="desktop", is_first=True)
        await mouse.goto(address)
        await expect(mouse.locator("[data-who]")).to_contain_text("No one drives")
        await expect(mouse.get_by_role("region", name="Hints")).to_have_count(0)


async def test_widgets_below_the_dock_of_a_phone_take_no_taps(new_page: PageMaker) -> None:
    """A tap that just misses STOP must not press a widget that is scrolled below the dock."""
    names = [use.slot for use in USES]
    robot = steered(Interface("x", "X", {"phone_portrait": column(*names)}))
    async with driven(robot=robot) as (_, address):
        page = await opened(new_page, address, "phone")
        dock = await box(page, "[data-controls]")
        x, y = dock["x"] + 3, dock["y"] + dock["height"] - 3
        met = await page.evaluate(
            "([x, y]) => document.elementFromPoint(x, y).closest('[data-stage]') === null", [x, y]
        )
        assert met


GROUND = "[data-place='ground']"


async def test_the_background_fills_the_stage_with_the_widgets_in_front(
    new_page: PageMaker,
) -> None:
    """On a phone in portrait, values are lines directly below it, and nothing is in front of it."""
    grid = Layout(2, 3, (Slot("a", 0, 0), Slot("b", 1, 2)))
    async with running_dashboard(
        gauged(Interface("x", "X", {"landscape": grid}, background="c"))
    ) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        for size in (PHONE_LYING, TABLET, DESKTOP):
            await turned(page, size)
            stage, back = await box(page, "[data-stage]"), await box(page, GROUND)
            assert back == stage, size
            assert await is_on_top(page, B), size
            assert await is_on_top(page, C), size
        await turned(page, PHONE)
        stage, back = await box(page, "[data-stage]"), await box(page, GROUND)
        assert (back["y"], back["width"]) == (stage["y"], stage["width"])
        for value in (B, C):
            assert await is_on_top(page, value)
            seen = await box(page, value)
            assert back["y"] + back["height"] <= seen["y"] < back["y"] + back["height"] + 100
            assert seen["height"] == 32


async def test_the_background_shows_the_whole_image_or_fills_the_page(new_page: PageMaker) -> None:
    """The device keeps the choice; beside the whole image, the page has its own colour."""
    signals = {"front": Signal("front", "image")}
    uses = [USES[0], WidgetUse("front", "camera", {"image": "front"})]
    profile = dashboard_profile(signals=signals, uses=uses, commands=commands(CALM_LEASE_S))
    interface = Interface("d", "Drive", {"landscape": row("left")}, background="front")
    robot = FakeRobot(profile._replace(interfaces={"d": interface}))
    async with running_dashboard(robot) as address:
        page = await new_page(size="desktop", theme="light")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("front", plain(RED))
        for edge, colour in ((0.02, (232, 235, 238)), (0.2, RED), (0.8, RED)):
            await until_seen(page, ".camera-face", edge, 0.5, colour)
        await page.get_by_role("button", name="Fill the page with the picture").click()
        for edge in (0.02, 0.98):
            await until_seen(page, ".camera-face", edge, 0.5, RED)
        await turned(page, TABLET)
        await until_seen(page, ".camera-face", 0.9, 0.04, RED)
        await page.reload()
        await expect(page.locator("[data-badge]")).to_have_attribute("data-state", "good")
        robot.set_reading("front", plain(RED))
        await until_seen(page, ".camera-face", 0.9, 0.04, RED)
        await page.get_by_role("button", name="Fit the whole picture").click()
        await until_seen(page, ".camera-face", 0.9, 0.04, (232, 235, 238))
        await until_seen(page, ".camera-face", 0.5, 0.5, RED)
        await turned(page, PHONE)
        fill = page.get_by_role("button", name="Fill the page with the picture")
        await expect(fill).to_be_visible()


async def test_a_tap_on_a_view_swaps_it_with_the_background(new_page: PageMaker) -> None:
    """A held stick stays held; the device keeps the choice for the next visit."""
    robot = steered()
    signals = {name: Signal(name, "image", title=name.title()) for name in ("front", "rear")}
    uses = [USES[0], *(WidgetUse(name, "camera", {"image": name}) for name in signals)]
    grid = Layout(2, 3, (Slot("rear", 0, 0), Slot(USES[0].slot, 1, 2)))
    interface = Interface("x", "X", {"landscape": grid}, background="front")
    profile = dashboard_profile(signals=signals, uses=uses, commands=commands(CALM_LEASE_S))
    robot.profile = profile._replace(interfaces={"x": interface})
    async with driven(robot=robot) as (_, address):
        page = await new_page()
        await page.goto(address)
        await expect(page.locator(".joystick")).to_have_attribute("data-phase", "idle")
        front = page.locator("[aria-label='Show Front large']")
        rear = page.locator("[aria-label='Show Rear large']")
        await expect(front).to_be_hidden()
        await push(page, ".joystick-pad")
        await robot.until_moving()
        await rear.dispatch_event("click")
        await expect(rear).to_be_hidden()
        await expect(front).to_be_visible()
        assert await box(page, GROUND) == await box(page, "[data-stage]")
        count = len(robot.line.texts)
        await until(lambda: len(robot.after(count)) > 3)
        assert robot.newest("drive") != "drive stop"
        await page.mouse.up()
        await robot.until_stopped()
        await page.reload()
        await expect(front).to_be_visible()


async def test_the_buttons_of_the_background_are_in_the_bar(new_page: PageMaker) -> None:
    """A swapped view takes its buttons along; on a phone in portrait, they are in the picture."""
    signals = {name: Signal(name, "image", title=name.title()) for name in ("front", "rear")}
    uses = [WidgetUse(name, "camera", {"image": name}) for name in signals]
    grid = Layout(2, 3, (Slot("rear", 0, 0),))
    interface = Interface("x", "X", {"landscape": grid}, background="front")
    profile = dashboard_profile(signals=signals, uses=uses)
    robot = FakeRobot(profile._replace(interfaces={"x": interface}))
    async with running_dashboard(robot) as address:
        page = await new_page(size="desktop")
        await page.goto(f"{address}robots/puppet/")
        in_bar = page.locator(".urc-bar [aria-label='Save picture']")
        await expect(in_bar).to_have_count(1)
        await expect(page.locator("[data-stage] [aria-label='Save picture']")).to_have_count(1)
        robot.set_reading("rear", plain(RED))
        await page.click("[aria-label='Show Rear large']")
        await expect(in_bar).to_be_enabled()
        await expect(page.locator("[data-cell='0'] [aria-label='Save picture']")).to_have_count(1)
        async with page.expect_download() as saved:
            await in_bar.click()
        assert (await saved.value).suggested_filename.startswith("rear-")
        await page.set_viewport_size({"width": 390, "height": 844})
        await expect(in_bar).to_have_count(0)
        await expect(page.locator(f"{GROUND} [aria-label='Save picture']")).to_be_visible()


async def test_the_cameras_of_the_background_are_chosen_by_mouse_and_touch(
    new_page: PageMaker,
) -> None:
    """No cell lies over their buttons, and the server sends the chosen picture only."""
    signals = {name: Signal(name, "image", title=name.title()) for name in ("front", "rear")}
    signals["a"] = Signal("a")
    uses = [
        *(WidgetUse(f"v{place}", "value", {"value": "a"}) for place in range(6)),
        WidgetUse("c", "camera", lists={"images": ("front", "rear")}),
    ]
    grid = Layout(3, 2, tuple(Slot(f"v{place}", *divmod(place, 2)) for place in range(6)))
    profile = dashboard_profile(signals=signals, uses=uses)
    interface = Interface("x", "X", {"landscape": grid}, background="c")
    robot = FakeRobot(profile._replace(interfaces={"x": interface}))
    async with running_dashboard(robot) as address:
        for size in (PHONE, PHONE_LYING, TABLET, DESKTOP):
            page = await new_page()
            shown: list[list[str]] = []
            page.on("websocket", lambda line, shown=shown: line.on("framesent", hear(shown)))
            await turned(page, size)
            await page.goto(f"{address}robots/puppet/")
            for wanted, name in (("rear", "Rear"), ("front", "Front")):
                choice = page.get_by_role("button", name=name)
                await choice.click(timeout=5000)
                await expect(choice).to_have_attribute("aria-pressed", "true")
                await until(lambda shown=shown, wanted=wanted: shown[-1:] == [[wanted]])  # type: ignore[misc]
            assert ["front", "rear"] not in shown[1:], size


def hear(shown: list[list[str]]) -> Callable[[str | bytes], None]:
    """Keep the names of the images that a page asks for."""

    def take(said: str | bytes) -> None:
        message = json.loads(said)
        if message.get("t") == "show":
            shown.append(message["signals"])

    return take


async def test_every_robot_has_an_interface_for_finding_faults(new_page: PageMaker) -> None:
    """Two hundred signals and a hundred commands, on a phone."""
    signals = {f"s{place}": Signal(f"s{place}", unit="V") for place in range(200)}
    argument = Argument("c", "number", unit="degC", min=0, max=90)
    plain = {
        f"c{place}": Command(f"c{place}", "wire", WriteSpec("text", {})) for place in range(98)
    }
    asked = Command(
        "set", "wire", WriteSpec("text", {}), {"c": argument}, confirm=Confirm(text="Sure?")
    )
    commands = {**plain, "set": asked, "lift": held("lift", number("rate"), lease_s=CALM_LEASE_S)}
    uses = [WidgetUse("a", "value", {"value": "s0"})]
    robot = FakeRobot(dashboard_profile(signals=signals, uses=uses, commands=commands))
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/?interface=debug")
        await until(lambda: robot.is_open)
        await expect(page.locator("[data-signal]")).to_have_count(200)
        await expect(page.locator("[data-command]")).to_have_count(100)
        robot.set_reading("s1", 12.5, alarm="hihi")
        first = page.locator("[data-signal='s1']")
        await expect(first).to_contain_text("12.5 V")
        await expect(first).to_contain_text("▲ Very high")
        await expect(first.locator("[data-age]")).to_contain_text("s")
        await page.get_by_label("Find a signal").fill("s199")
        await expect(page.locator("[data-signal]:visible")).to_have_count(1)
        robot.set_reading("s199", 7)
        await expect(page.locator("[data-signal='s199']")).to_contain_text("7 V")
        assert await page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        await refused_asked_and_given(page, robot)
        await held_by_its_form(page, robot)


YES = "(el) => [...el.querySelectorAll('button')].find((one) => one.textContent === 'Yes')?.click()"


async def agree(form: Locator) -> None:
    """Say yes until it counts: a question that nobody can have read yet takes no answer."""
    yes = form.get_by_role("button", name="Yes")
    await expect(yes).to_be_visible()
    async with asyncio.timeout(WAIT_S):
        while await yes.count():
            await form.evaluate(YES)
            await asyncio.sleep(0.05)


async def refused_asked_and_given(page: Page, robot: FakeRobot) -> None:
    """Fill in the form of `set`."""

    def answer(name: str, arguments: Mapping[str, object]) -> Mapping[str, Value]:
        if "c" not in arguments:
            raise CommandFailed("bad-argument", "c is missing")
        return {"now": 21.0}

    robot.on_command = answer
    form = page.locator("[data-command='set']")
    await page.get_by_label("Find a command").fill("set")
    await form.locator("summary").click()
    await expect(form).to_contain_text("c (number, 0 to 90, degC)")
    await form.get_by_role("button", name="Send").click()
    await agree(form)
    await expect(form.get_by_role("status")).to_contain_text("▲ c is missing")
    await form.get_by_label("c (number").fill("20")
    await form.get_by_role("button", name="Send").click()
    await expect(form.get_by_role("status")).to_contain_text("Sure?")
    await agree(form)
    await expect(form.get_by_role("status")).to_contain_text("now = 21")
    assert robot.commands[-1] == ("set", {"c": 20})


async def held_by_its_form(page: Page, robot: FakeRobot) -> None:
    """Hold the button of `lift`."""
    await page.get_by_label("Find a command").fill("lift")
    form = page.locator("[data-command='lift']")
    await form.locator("summary").click()
    await form.get_by_label("rate").fill("0.5")
    hold = form.get_by_role("button", name="Hold to move")
    await hold.scroll_into_view_if_needed()
    x, y = await centre(page, "[data-command='lift'] button")
    await page.mouse.move(x, y)
    await page.mouse.down()
    line = robot.backend
    assert isinstance(line, FakeMotionBackend)
    await until(lambda: any("rate=0.5" in text for text in line.texts))
    await page.mouse.up()
    await until(lambda: line.texts[-1].startswith("lift stop"))


async def test_where_there_is_a_dev_page_the_wire_is_shown_too(
    new_page: PageMaker, urc_process: Callable[..., UrcProcess], tmp_path: Path
) -> None:
    """In the interface for finding faults, and with the values on one page."""
    page = await new_page()
    async with served(page, urc_process, tmp_path):
        await page.goto(page.url.replace("/dev", "/?interface=debug"))
        ring = page.locator("[data-command='ring']")
        await ring.locator("summary").click()
        await ring.get_by_role("button", name="Send").click()
        await expect(page.locator(".dev-row", has_text="RING 1")).to_be_visible()
        await expect(page.locator("[data-signal]").first).to_contain_text("12")
