"""Widgets of others in a real browser: each costs its own cell, whatever it tries, and no more."""

import json
import shutil
from pathlib import Path

import pytest
from playwright.async_api import Browser, FrameLocator, Page, expect

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, turned, until, until_text
from tests.e2e.motion.driving import CALM_LEASE_S, STOP, Wire, commands, moved, push
from urc.model.driver import Command
from urc.model.interface import OutputBinding, WidgetUse
from urc.model.payload import WriteSpec
from urc.model.values import Signal
from urc.model.widget import Widget
from urc.shipped import shipped
from urc.testing.dashboard import BATTERY, FakeRobot, dashboard_profile, plain_widget
from urc.web.show.demos import colour_bars

pytestmark = pytest.mark.anyio

SLOW_MS = 60_000
"""A browser on a busy machine starts its processes in its own time."""

TRIES = """
const tries = {
  parent: () => parent.document.title,
  top: () => top.location.href,
  cookie: () => document.cookie,
  local: () => localStorage.length,
  session: () => sessionStorage.length,
  database: () => { if (!indexedDB.open("x")) throw 0; },
  fetch: () => fetch("/healthz"),
  api: () => fetch("/api/v1/robots/puppet/stop", { method: "POST" }),
  beacon: () => caughtByPolicy(() => navigator.sendBeacon("/healthz", "x")),
  image: () => caughtByPolicy(() => { new Image().src = "/healthz?leak"; }),
  style: () => caughtByPolicy(() => {
    const link = document.createElement("link");
    link.rel = "stylesheet";
    link.href = "/healthz?leak";
    document.head.append(link);
  }),
  script: () => import("/widgets/battery/widget.js"),
  text: () => (0, eval)("1"),
  worker: () => new Worker("/static/widgets/kit.js"),
  popup: () => { if (!open("/healthz")) throw 0; },
  socket: () => new Promise((resolve, reject) => {
    const line = new WebSocket(`ws://${location.host}/ws?robot=puppet`);
    line.onopen = resolve;
    line.onerror = reject;
  }),
  frame: () => new Promise((resolve, reject) => {
    const inner = document.createElement("iframe");
    inner.src = "/";
    inner.onload = () => { try { resolve(inner.contentDocument.title); } catch (e) { reject(e); } };
    document.body.append(inner);
    setTimeout(reject, 1000);
  }),
  away: () => { top.location = "/healthz"; throw 0; },
};
const caughtByPolicy = (work) => new Promise((resolve, reject) => {
  addEventListener("securitypolicyviolation", reject, { once: true });
  work();
  setTimeout(resolve, 2000);
});
export default {
  async mount({ el, send, memory, drive, follow, options }) {
    const out = [];
    for (const [name, attempt] of Object.entries(tries)) {
      try { await attempt(); out.push(name); } catch { /* kept in */ }
    }
    for (const work of [() => send("erase"), () => send("toString"), () => drive("force"),
                        () => drive("reset"), () => follow("log", () => {})]) {
      try { await work(); out.push(String(work)); } catch { /* refused */ }
    }
    Object.assign(el.style, { position: "fixed", inset: "-2000px", zIndex: 2147483647 });
    el.dataset.out = JSON.stringify(out);
  },
};
"""
ON_TOP = """
(selector) => {
  const el = document.querySelector(selector);
  el.scrollIntoView({ block: "nearest" });
  const { x, y, width, height } = el.getBoundingClientRect();
  return el.contains(document.elementFromPoint(x + width / 2, y + height / 2));
}
"""
GOOD = """
import { write } from "urc/kit";
export default {
  async mount({ el, on, send, command, memory, options, follow, picture, unit, t, onStop, style }) {
    const tell = (name, value) => { el.dataset[name] = String(value); };
    on("level", (reading) => tell("heard", reading.text));
    picture("eye", (bitmap) => tell("eye", `${bitmap.width}x${bitmap.height}`));
    follow("alarms", (alarms) => tell("alarms", alarms.map((one) => one.signal)));
    follow("links", ({ links }) => tell("links", links.map((one) => one.state + one.address)));
    follow("lease", ({ isMine }) => tell("mine", isMine));
    onStop(({ isLatched }) => tell("latched", isLatched));
    tell("theme", getComputedStyle(document.documentElement).getPropertyValue("--urc-text"));
    tell("command", command("press").command);
    tell("before", memory.read());
    tell("option", options.label);
    tell("unit", unit("level").symbol);
    memory.write((memory.read() ?? 0) + 1);
    await style("uplot");
    el.querySelector("button").addEventListener("click", async () => {
      try { tell("reply", JSON.stringify(await send("press", { power: 2 }))); }
      catch (error) { tell("reply", error.message); }
    });
    return {
      update({ level }, { press }) {
        write(el.querySelector("p"), level.text);
        tell("ready", press.isReady);
        tell("age", performance.now() / 1000 - level.time < 60);
      },
      resize({ width }) { tell("width", width > 50); },
    };
  },
};
"""
BAD = {
    "throwing": "export default { mount() { throw new Error('I am broken'); } };",
    "flooding": """
        export default { mount({ memory }) {
          for (let count = 0; count < 10000; count += 1) memory.write(count);
        } };""",
    "leaving": "export default { mount() { location.href = '/static/favicon.svg'; } };",
    "endless": "export default { mount() { for (;;); } };",
    "never": "export default { mount: () => new Promise(() => {}) };",
    "spinning": """
        export default { mount() { return { update({ level }) {
          while (level.value === 66);
        } }; } };""",
    "heavy": """
        export default { mount({ el }) { return { update({ level }) {
          const all = Array.from({ length: 2e5 }, (_, place) => Math.sin(place));
          el.dataset.last = String(all.sort().length + level.value);
        } }; } };""",
}
CARDS = {
    "throwing": "I am broken",
    "flooding": "it floods the page with messages",
    "leaving": "it navigated to another page",
    "endless": "it stopped answering",
}


@pytest.fixture(scope="session")
def browser(whole_browser: Browser) -> Browser:
    """Let frames have processes of their own: one that spins would hold up its page else."""
    return whole_browser


def made(folder: Path, name: str, script: str, template: str = "<p>—</p>") -> Widget:
    """Return a widget that somebody wrote."""
    place = folder / name
    place.mkdir()
    (place / "widget.js").write_text(script, "utf-8")
    (place / "widget.css").write_text(".urc-controls { display: none }", "utf-8")
    (place / "template.html.j2").write_text(template, "utf-8")
    return plain_widget(name, ["level", "eye"], place)


def cell(page: Page, slot: str, uses: list[WidgetUse]) -> str:
    """Return the selector of a slot's cell."""
    return f"[data-cell='{[use.slot for use in uses].index(slot)}']"


class Zoo(Wire):
    """A robot with all kinds of widgets."""

    def __init__(self, uses: list[WidgetUse], widgets: list[Widget]) -> None:
        FakeRobot.__init__(
            self,
            dashboard_profile(
                signals={"battery": BATTERY, "cam": Signal("cam", "image", stale_after_s=60)},
                uses=uses,
                widgets=widgets,
                commands=commands(CALM_LEASE_S),
            ),
        )


def inside(page: Page, selector: str) -> FrameLocator:
    """Return what is in the frame of a cell."""
    return page.frame_locator(f"{selector} .urc-frame")


def is_told(text: str) -> bool:
    """Return whether a browser has to say that: the widgets try what is forbidden."""
    words = ("CSP", "Content Security Policy", "sandbox", "Refused", "Blocked", "permission")
    others = ("WebSocket", "Failed to load", "violat", "refused", "Unsafe attempt")
    return any(word.lower() in text.lower() for word in (*words, *others))


async def test_a_foreign_widget_gets_its_cell_and_nothing_else(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """What one tries in vain, beside one that uses all that it is given."""
    template = "<p>—</p><button type='button'>Press</button>"
    widgets = [made(tmp_path, "spy", TRIES), made(tmp_path, "good", GOOD, template)]
    uses = [
        WidgetUse("spy", "spy", {"level": "battery"}, {"press": "go"}),
        WidgetUse(
            "good",
            "good",
            {"level": "battery", "eye": "cam"},
            {"press": "go"},
            {"label": "A label"},
        ),
        WidgetUse("left", "joystick", {}, {"moved": "drive"}),
    ]
    robot = Zoo(uses, widgets)
    robot.on_command = lambda name, arguments: {"done": True}
    async with running_dashboard(robot) as address:
        page = await new_page()
        new_page.allow(page, is_told)
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        spy, good = inside(page, cell(page, "spy", uses)), inside(page, cell(page, "good", uses))
        await expect(spy.locator("[data-frame]")).to_have_attribute(
            "data-out", "[]", timeout=SLOW_MS
        )
        assert page.url.endswith("/robots/puppet/")
        assert len(page.context.pages) == 1
        for number in range(30):  # of screens, from small to large, upright and across
            size = 320 + number * 37 % 1300, 400 + number * 53 % 900
            await turned(page, size)
            for mine in (STOP, "[data-badge]"):
                assert await page.evaluate(ON_TOP, mine), (mine, size)
        assert await page.locator(".urc-fault").count() == 0
        assert robot.commands == []

        robot.set_reading("battery", 5, alarm="lolo")
        robot.set_reading("cam", colour_bars(8, 4))
        el = good.locator("[data-frame]")
        for name, value in {
            "heard": "5",
            "eye": "8x4",
            "alarms": "battery",
            "links": "live",
            "mine": "false",
            "latched": "false",
            "command": "go",
            "before": "null",
            "option": "A label",
            "unit": "%",
            "ready": "true",
            "age": "true",
            "width": "true",
        }.items():
            await expect(el).to_have_attribute(f"data-{name}", value, timeout=SLOW_MS)
        assert await el.get_attribute("data-theme")
        await good.get_by_role("button", name="Press").click()
        await expect(el).to_have_attribute(
            "data-reply", json.dumps({"done": True}).replace(" ", "")
        )
        assert robot.commands == [("go", {"power": 2})]

        await page.evaluate("document.documentElement.dataset.theme = 'night'")
        await expect(good.locator(":root")).to_have_attribute(
            "data-theme", "night", timeout=SLOW_MS
        )
        await good.get_by_role("button", name="Press").press("Escape")
        await expect(el).to_have_attribute("data-latched", "true", timeout=SLOW_MS)
        await page.reload()
        await expect(el).to_have_attribute("data-before", "1", timeout=SLOW_MS)


def zoo(folder: Path, *names: str) -> tuple[Zoo, list[WidgetUse]]:
    """Return a robot with two sticks, of which one is somebody else's, and some that are bad."""
    stick = folder / "other-stick"
    shutil.copytree(shipped("widgets") / "joystick", stick)
    widgets = [plain_widget("other-stick", [], stick)]
    widgets += [made(folder, name, BAD[name]) for name in names]
    plain = {"axes": "x", "expo": 0.0, "dead_zone": 0.0}
    given = {"moved": OutputBinding({"speed": "x"})}
    uses = [
        WidgetUse("left", "joystick", {}, {"moved": "drive"}, plain, given=given),
        WidgetUse("level", "battery", {"level": "battery"}),
        WidgetUse("other", "other-stick", {}, {"moved": "drive"}, plain, given=given),
        *(WidgetUse(name, name, {"level": "battery"}) for name in names),
    ]
    return Zoo(uses, widgets), uses


async def test_what_does_not_come_up_is_a_card_and_the_others_go_on(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """Each cell says what happened; values are shown all the while, and a foreign stick drives."""
    robot, uses = zoo(tmp_path, *CARDS, "never")
    async with running_dashboard(robot) as address:
        page = await new_page()
        new_page.allow(page, is_told)
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        for level, (name, text) in enumerate(CARDS.items(), 30):
            robot.set_reading("battery", level)
            await until_text(page, ".battery-digits", str(level))
            card = page.locator(f"{cell(page, name, uses)} .urc-fault")
            await expect(card).to_contain_text(text, timeout=SLOW_MS)

        # In one process with the one that will never end, the foreign stick is made anew by then.
        other = f"{cell(page, 'other', uses)} .urc-grip >> nth=0"
        await expect(page.locator(other)).to_be_visible(timeout=SLOW_MS)
        await push(page, other)
        await robot.until_moving()
        await page.mouse.up()
        await robot.until_stopped()
        never = page.locator(f"{cell(page, 'never', uses)} .urc-remark")
        await expect(never).to_contain_text("still loading", timeout=SLOW_MS)
        assert await page.locator(".urc-fault").count() == len(CARDS)


async def test_one_that_spins_later_stops_neither_the_page_nor_who_drives(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """A stick drives on; what a foreign stick holds is let go when it does not answer."""
    robot, uses = zoo(tmp_path, "spinning", "heavy")
    async with running_dashboard(robot) as address:
        page = await new_page()
        new_page.allow(page, is_told)
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        other = f"{cell(page, 'other', uses)} .urc-grip >> nth=0"
        heavy = inside(page, cell(page, "heavy", uses)).locator("[data-frame]")
        robot.set_reading("battery", 65)
        last = str(200_000 + 65)
        await expect(heavy).to_have_attribute("data-last", last, timeout=SLOW_MS)
        await push(page, f"{cell(page, 'left', uses)} .joystick-pad")
        await robot.until_moving()
        robot.set_reading("battery", 66)  # one of them spins from here on
        await until_text(page, ".battery-digits", "66")
        before = len(robot.line.texts)
        spun = page.locator(f"{cell(page, 'spinning', uses)} .urc-fault")
        await expect(spun).to_contain_text("it stopped answering", timeout=SLOW_MS)
        await until(lambda: len(moved(robot.after(before))) >= 10)
        assert "drive stop" not in robot.after(before)
        await page.mouse.up()
        await robot.until_stopped()

        await expect(page.locator(other)).to_be_visible(timeout=SLOW_MS)
        await push(page, other)
        await robot.until_moving()
        frame = await page.locator(f"{cell(page, 'other', uses)} .urc-frame").element_handle()
        hung = await frame.content_frame()
        assert hung is not None
        await hung.evaluate("() => void setTimeout(() => { for (;;); })")
        await robot.until_stopped()  # the hand is still there; what it means, nobody says
        hanging = page.locator(f"{cell(page, 'other', uses)} .urc-fault")
        await expect(hanging).to_contain_text("it stopped answering", timeout=SLOW_MS)
        await page.mouse.up()
        assert await page.locator(".urc-fault").count() == 2


async def test_a_foreign_widget_moves_nothing_without_a_yes(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """The driver asks nothing before this command; the page does, where the code is foreign."""
    eager = "export default { mount({ send, el }) { void send('press', {}); } };"
    uses = [WidgetUse("eager", "eager", {}, {"press": "takeoff"})]
    takeoff = Command("takeoff", "wire", WriteSpec("text", {}), title="Take off", moves=True)
    robot = FakeRobot(
        dashboard_profile(
            uses=uses, widgets=[made(tmp_path, "eager", eager)], commands={"takeoff": takeoff}
        )
    )
    async with running_dashboard(robot) as address:
        page = await new_page()
        new_page.allow(page, is_told)
        await page.goto(f"{address}robots/puppet/")
        question = page.locator(f"{cell(page, 'eager', uses)} .urc-ask")
        await expect(question).to_contain_text("“Take off”", timeout=SLOW_MS)
        assert robot.commands == []
        await question.get_by_role("button", name="Yes").click()
        await until(lambda: robot.commands == [("takeoff", {})])


async def test_a_reset_holds_against_a_widget_that_stops_by_itself(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """It may stop the robot once; its cell says that it did."""
    nervous = "export default { mount({ stop }) { setInterval(stop, 50); } };"
    uses = [
        WidgetUse("nervous", "nervous", {}),
        WidgetUse("left", "joystick", {}, {"moved": "drive"}),
    ]
    robot = Zoo(uses, [made(tmp_path, "nervous", nervous)])
    async with running_dashboard(robot) as address:
        page = await new_page()
        new_page.allow(page, is_told)
        await page.goto(f"{address}robots/puppet/")
        remark = page.locator(f"{cell(page, 'nervous', uses)} .urc-remark")
        await expect(remark).to_contain_text("pressed STOP, not you", timeout=SLOW_MS)
        stop = page.locator(STOP)
        await expect(stop).not_to_have_attribute("data-phase", "", timeout=SLOW_MS)
        await page.get_by_role("button", name="Reset").click()
        await expect(stop).to_have_attribute("data-phase", "")
        await page.wait_for_timeout(1000)  # twenty more presses
        await expect(stop).to_have_attribute("data-phase", "")


async def test_a_flood_past_the_port_ends_the_frame(new_page: PageMaker, tmp_path: Path) -> None:
    """The page answers all the while: it counts such messages, and does not read them."""
    loud = """
        export default { mount() { setInterval(() => {
          for (let count = 0; count < 2000; count += 1) parent.postMessage({ count }, "*");
        }, 20); } };"""
    quiet = """
        export default { mount({ el }) {
          for (let count = 0; count < 10; count += 1) parent.postMessage({ count }, "*");
          el.dataset.stands = "yes";
        } };"""
    uses = [WidgetUse("loud", "loud", {}), WidgetUse("quiet", "quiet", {})]
    uses.append(WidgetUse("left", "joystick", {}, {"moved": "drive"}))
    robot = Zoo(uses, [made(tmp_path, "loud", loud), made(tmp_path, "quiet", quiet)])
    async with running_dashboard(robot) as address:
        page = await new_page()
        new_page.allow(page, is_told)
        await page.goto(f"{address}robots/puppet/")
        card = page.locator(f"{cell(page, 'loud', uses)} .urc-fault")
        await expect(card).to_contain_text("it floods the page with messages", timeout=SLOW_MS)
        assert await page.locator(f"{cell(page, 'loud', uses)} .urc-frame").count() == 0
        quiet_one = inside(page, cell(page, "quiet", uses)).locator("[data-frame]")
        await expect(quiet_one).to_have_attribute("data-stands", "yes", timeout=SLOW_MS)
        await page.locator(STOP).click()
        await expect(page.locator(STOP)).not_to_have_attribute("data-phase", "")
