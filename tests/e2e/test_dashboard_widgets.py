"""Widgets in a real browser: hostile texts, and what a broken one may cost."""

from pathlib import Path

import pytest

from tests.e2e.browser import choose_theme
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_text
from urc.model.interface import WidgetUse
from urc.model.values import AlarmLimits, Signal
from urc.testing.dashboard import BATTERY, FakeRobot, dashboard_profile, plain_widget

pytestmark = pytest.mark.anyio

HOSTILE = [
    "<img src=x onerror=alert(1)>",
    "<script>alert(1)</script>",
    "\"'><svg onload=alert(1)>",
    "</p></section><h1>STOP</h1>",
    "javascript:alert(1)",
    "{{ 7*7 }} ${7*7} <%= 7*7 %>",
    "\u202egnp.exe",
    "__proto__",
    "&lt;b&gt;",
    "\x1b[31mred\x07",
]


async def test_hostile_texts_are_shown_as_they_are(new_page: PageMaker) -> None:
    """Values, titles, units, states, links and log: no element is made, nothing runs."""
    evil = HOSTILE[0]
    signals = {
        "__proto__": Signal("__proto__", "string", title=evil, unit=evil, stale_after_s=60),
        "b": BATTERY._replace(name="b", title=evil, unit=evil),
    }
    uses = [
        WidgetUse("constructor", "value", {"value": "__proto__"}),
        WidgetUse("battery", "battery", {"level": "b"}, title=evil),
    ]
    robot = FakeRobot(dashboard_profile(signals=signals, uses=uses))
    async with running_dashboard(robot) as address:
        page = await new_page()
        page.on("dialog", lambda dialog: pytest.fail(f"a script ran: {dialog.message}"))
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("b", 50)
        await until_text(page, ".battery-digits", "50")
        elements = await page.locator("*").count()
        for text in HOSTILE:
            robot.set_reading("__proto__", text)
            robot.link("lost", text)
            robot.log(text)
            await until_text(page, ".value-text", text.strip())
            await page.locator("[data-log] > li", has_text=text).first.wait_for(state="attached")
        assert await page.locator("main :is(img, script, svg[onload], h1)").count() == 0
        assert await page.locator("[data-panel] :is(img, script, svg, h1)").count() == 0
        grown = await page.locator("*").count() - elements
        assert grown <= len(HOSTILE) * 3 + 10  # the lines of the log, and the link's


BROKEN = {
    "mount": "export default { mount() { throw new Error('mount <b>broke</b>'); } };",
    "update": "export default { mount: () => ({ update() { throw new Error('broke'); } }) };",
    "syntax": "export default {",
    "shape": "export default {};",
    "destroy": (
        "export default { mount: () => ({ update() { throw new Error('first'); },"
        " destroy() { throw new Error('second'); } }) };"
    ),
    "late": "export default { mount: async () => { await 0; throw new Error('late'); } };",
    "template": "export default { mount: () => ({}) };",
}


def made_widget(folder: Path, name: str, script: str, template: str = "<p>—</p>") -> Path:
    """Write a widget's folder for one test."""
    place = folder / name
    place.mkdir()
    (place / "widget.js").write_text(script, "utf-8")
    (place / "widget.css").write_text("", "utf-8")
    (place / "template.html.j2").write_text(template, "utf-8")
    return place


async def test_a_widget_that_breaks_costs_its_own_cell(new_page: PageMaker, tmp_path: Path) -> None:
    """However it breaks, a card says so in its place, and its neighbours go on."""
    widgets = []
    for name, script in BROKEN.items():
        template = "{{ missing }}" if name == "template" else "<p>—</p>"
        folder = made_widget(tmp_path, name, script, template)
        widgets.append(plain_widget(name, ["level"], folder))
    broken = [WidgetUse(name, name, {"level": "battery"}) for name in BROKEN]
    uses = [*broken, WidgetUse("good", "battery", {"level": "battery"})]
    robot = FakeRobot(dashboard_profile(uses=uses, widgets=widgets))
    async with running_dashboard(robot, trusted=robot.profile.widgets) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        for level in (10, 11, 12):
            robot.set_reading("battery", level)
            await until_text(page, ".battery-digits", str(level))
        cards = page.locator(".urc-fault")
        assert await cards.count() == len(BROKEN)
        assert await page.locator(".urc-fault b").count() == 0
        assert "mount <b>broke</b>" in await cards.nth(0).inner_text()
        assert "'missing' is undefined" in await cards.last.inner_text()


COUNTING = """
export default {
  mount({ el, signal }) {
    let count = 0;
    signal.addEventListener("abort", () => { el.dataset.aborted = "yes"; });
    return { update({ level }) { count += 1; el.dataset.count = String(count);
                                 el.dataset.level = level.text; } };
  },
};
"""


async def test_a_cell_that_is_out_of_sight_is_sent_nothing(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """It is not called while it cannot be seen; once seen, it gets the newest at once."""
    folder = made_widget(tmp_path, "counting", COUNTING)
    uses = [WidgetUse(f"slot{n}", "counting", {"level": "battery"}) for n in range(12)]
    profile = dashboard_profile(uses=uses, widgets=[plain_widget("counting", ["level"], folder)])
    robot = FakeRobot(profile)
    async with running_dashboard(robot, trusted=robot.profile.widgets) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        first, last = page.locator("[data-cell='0']"), page.locator("[data-cell='11']")
        await page.wait_for_selector("[data-cell='0'][data-count]")
        for level in range(20, 40):
            robot.set_reading("battery", level)
            await page.wait_for_selector(f"[data-cell='0'][data-level='{level}']")
        assert int(await first.get_attribute("data-count") or "0") >= 20
        assert int(await last.get_attribute("data-count") or "0") <= 1
        await last.scroll_into_view_if_needed()
        await page.wait_for_selector("[data-cell='11'][data-level='39']")
        assert int(await last.get_attribute("data-count") or "0") <= 3


async def test_a_widget_sends_the_commands_bound_to_it_and_no_other(
    new_page: PageMaker, tmp_path: Path
) -> None:
    """One promise a command: its values, or why it was not done."""
    script = """
    export default { async mount({ el, send }) {
      const outcome = async (promise) => promise.then(JSON.stringify, (error) => error.message);
      const show = async () => { el.dataset.outcome = JSON.stringify([
        await outcome(send("press", { power: 1.5 })),
        await outcome(send("erase")),
        await outcome(send("toString")),
      ]); };
      el.addEventListener("click", show);
    } };
    """
    folder = made_widget(tmp_path, "pressing", script)
    use = WidgetUse("slot", "pressing", {"level": "battery"}, {"press": "go"})
    widget = plain_widget("pressing", ["level"], folder)
    robot = FakeRobot(dashboard_profile(uses=[use], widgets=[widget]))
    robot.on_command = lambda name, arguments: {"done": True}
    async with running_dashboard(robot, trusted=robot.profile.widgets) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until_text(page, "[data-badge-text]", "Live")
        await page.click("[data-cell='0']")
        await page.wait_for_selector("[data-cell='0'][data-outcome]")
        outcome = await page.locator("[data-cell='0']").get_attribute("data-outcome")
    assert robot.commands == [("go", {"power": 1.5})]
    assert outcome == (
        '["{\\"done\\":true}","the output erase is not bound to a command",'
        '"the output toString is not bound to a command"]'
    )


async def test_arguments_go_to_a_command_under_its_own_names(new_page: PageMaker) -> None:
    """By the same name, by the one that the binding says, and what is fixed stays as it is."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page()
        # A page without our policy, so that the test may import a module into it.
        await page.route("**/empty", lambda route: route.fulfill(body="", content_type="text/html"))
        await page.goto(f"{address}empty")
        got = await page.evaluate(
            """async ([outputs, given]) => {
              const { argumentsOf } = await import("/static/widgets/output.js");
              return outputs.map(([names, fixed]) => argumentsOf({ names, fixed }, given));
            }""",
            [
                [
                    [{}, {}],
                    [{"speed": "value"}, {}],
                    [{"left": "value", "right": "value"}, {"gear": 2}],
                    [{"speed": "absent"}, {"value": 0}],
                    [{"__proto__": "toString"}, {}],
                ],
                {"value": 0.5, "on": True},
            ],
        )
    assert got == [
        {"value": 0.5, "on": True},
        {"on": True, "speed": 0.5},
        {"on": True, "left": 0.5, "right": 0.5, "gear": 2},
        {"value": 0, "on": True},
        {"value": 0.5, "on": True},
    ]


LUMINANCE = """
(colour) => {
  const canvas = document.createElement("canvas").getContext("2d");
  canvas.fillStyle = colour;
  canvas.fillRect(0, 0, 1, 1);
  const linear = [...canvas.getImageData(0, 0, 1, 1).data.slice(0, 3)]
    .map((part) => part / 255)
    .map((part) => (part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4));
  return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
}
"""

MARKS = """
() => {
  const look = (selector, name) => getComputedStyle(document.querySelector(selector))[name];
  const box = (selector) => document.querySelector(`.battery-lying ${selector}`).getBBox();
  const marks = box(".battery-limits"), shell = box(".battery-shell");
  const level = document.querySelector(".battery-level"), probe = document.createElement("i");
  probe.style.background = "var(--battery-tint)";
  level.append(probe);
  const tint = getComputedStyle(probe).backgroundColor;
  probe.remove();
  return {
    tint,
    inside: look(".battery-inside", "fill"),
    mark: look(".battery-limits", "fill"),
    digits: look(".battery-number", "color"),
    surface: getComputedStyle(document.querySelector(".urc-cell")).backgroundColor,
    reach: [shell.y - marks.y, marks.y + marks.height - shell.y - shell.height],
    numbers: document.querySelectorAll(".battery-number").length,
  };
}
"""


@pytest.mark.parametrize("theme", ["light", "dark", "sunlight", "night"])
@pytest.mark.parametrize("level", [3, 12, 100])
async def test_limits_and_number_of_the_battery_are_seen_whatever_its_level(
    new_page: PageMaker, theme: str, level: int
) -> None:
    """The marks stand outside the shell; the digits are readable on the level and beside it."""
    robot = FakeRobot(dashboard_profile())
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(address)
        await choose_theme(page, theme)
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("battery", level)
        await until_text(page, ".battery-digits", str(level))
        seen = await page.evaluate(MARKS)
        shades = {
            name: await page.evaluate(LUMINANCE, seen[name])
            for name in ("mark", "digits", "tint", "inside", "surface")
        }

    def contrast(one: str, other: str) -> float:
        bright, dark = sorted((shades[one], shades[other]), reverse=True)
        return float((bright + 0.05) / (dark + 0.05))

    assert min(seen["reach"]) >= 5
    assert contrast("mark", "surface") >= 3
    assert contrast("digits", "tint") >= 4.5
    assert contrast("digits", "inside") >= 4.5
    assert seen["numbers"] == 1


VOLTAGE = Signal(
    "voltage",
    "number",
    unit="V",
    precision=2,
    limits=AlarmLimits(low=11, high=13, hihi=40),
    stale_after_s=3,
)

# First and last column of the plot in which anything is drawn, as shares of its width.
DRAWN = """
() => {
  const canvas = document.querySelector(".value-plot canvas");
  const { width, height } = canvas;
  const pixels = canvas.getContext("2d").getImageData(0, 0, width, height).data;
  const columns = new Set();
  for (let place = 3; place < pixels.length; place += 4) {
    if (pixels[place]) columns.add(((place - 3) / 4) % width);
  }
  return [Math.min(...columns) / width, Math.max(...columns) / width];
}
"""


async def test_the_line_of_a_value_has_a_scale_a_span_and_its_limits(new_page: PageMaker) -> None:
    """The window is the option's; a limit far off does not flatten the line; old is grey."""
    use = WidgetUse("v", "value", {"value": "voltage"}, {}, {"history": "60s"})
    profile = dashboard_profile(signals={"voltage": VOLTAGE}, uses=[use])
    robot = FakeRobot(profile)
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        await page.wait_for_selector(".value-plot canvas")
        for age_s, volts in ((2.0, 12.0), (1.0, 12.5), (0.1, 12.25)):
            robot.set_reading("voltage", volts, age_s=age_s)
            await until_text(page, ".value-text", f"{volts:.2f}")
        await until_text(page, ".value-most", "13.00")
        await until_text(page, ".value-least", "11.00")
        assert await page.inner_text(".value-span") == "last 60 s"
        assert await page.locator(".value-limit").count() == 2
        await page.wait_for_function(f"() => ({DRAWN})()[0] > 0.9")
        first, last = await page.evaluate(DRAWN)
        assert last > first > 0.9
        colour = "getComputedStyle(document.querySelector('.value-plot')).color"
        live = await page.evaluate(colour)
        robot.set_reading("voltage", 12.25, age_s=40)
        await until_text(page, ".value-text", "—")
        assert await page.evaluate(colour) != live
        assert await page.evaluate(colour) == await page.evaluate(
            "getComputedStyle(document.querySelector('.value-note')).color"
        )


async def test_a_text_has_no_line(new_page: PageMaker) -> None:
    """An option that cannot be met leaves no empty frame."""
    use = WidgetUse("v", "value", {"value": "mode"}, {}, {"history": "60s"})
    robot = FakeRobot(dashboard_profile(signals={"mode": Signal("mode", "string")}, uses=[use]))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        robot.set_reading("mode", "docked")
        await until_text(page, ".value-text", "docked")
        assert await page.locator(".value-history").count() == 0
