"""Widgets in a real browser: their demo states, hostile texts, and what a broken one may cost."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_text
from urc.model.interface import WidgetUse
from urc.model.values import Limits, Signal
from urc.shipped import shipped
from urc.testing.dashboard import BATTERY, FakeRobot, dashboard_profile, plain_widget

pytestmark = pytest.mark.anyio

WIDGETS = sorted(path.name for path in shipped("widgets").iterdir() if path.is_dir())

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


def demo_of(widget: str) -> Any:
    """Return the widget's demo document."""
    return yaml.safe_load((shipped("widgets") / widget / "demo.yaml").read_text("utf-8"))


@pytest.mark.parametrize("widget", WIDGETS)
async def test_a_widget_shows_each_state_of_its_demo(new_page: PageMaker, widget: str) -> None:
    """All states side by side on one page, each with the texts that its demo promises."""
    demo = demo_of(widget)
    signals: dict[str, Signal] = {}
    uses: list[WidgetUse] = []
    for state, shown in demo["states"].items():
        bind = {}
        for name, given in demo["signals"].items():
            signal = f"{state}_{name}"
            bind[name] = signal
            signals[signal] = Signal(
                signal, **{**given, "limits": Limits(**given.get("limits", {}))}
            )
        uses.append(
            WidgetUse(state, widget, bind, {}, shown.get("options", {}), shown.get("title", ""))
        )
    robot = FakeRobot(dashboard_profile(signals=signals, uses=uses))
    async with running_dashboard(robot) as address:
        page = await new_page(size="tablet")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        for state, shown in demo["states"].items():
            for name, value in shown["values"].items():
                alarm = shown.get("alarms", {}).get(name, "")
                age_s = shown.get("age_s", 0.0)
                robot.say(f"{state}_{name}", value, alarm=alarm, age_s=age_s)
        for index, (state, shown) in enumerate(demo["states"].items()):
            await page.locator(f"[data-cell='{index}']").scroll_into_view_if_needed()
            (
                await page.wait_for_function(
                    "([index, texts]) => texts.every((text) =>"
                    " document.querySelector(`[data-cell='${index}']`).textContent.includes(text))",
                    arg=[index, shown["shows"]],
                ),
                state,
            )
        assert await page.locator(".urc-fault").count() == 0


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
        robot.say("b", 50)
        elements = await page.locator("*").count()
        for text in HOSTILE:
            robot.say("__proto__", text)
            robot.link("lost", text)
            robot.tell(text)
            await until_text(page, ".value-text", text.strip())
            await page.locator("[data-log] > li", has_text=text).first.wait_for()
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
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        for level in (10, 11, 12):
            robot.say("battery", level)
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
    async with running_dashboard(robot) as address:
        page = await new_page(size="phone")
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        first, last = page.locator("[data-cell='0']"), page.locator("[data-cell='11']")
        await page.wait_for_selector("[data-cell='0'][data-count]")
        for level in range(20, 40):
            robot.say("battery", level)
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
    async with running_dashboard(robot) as address:
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
