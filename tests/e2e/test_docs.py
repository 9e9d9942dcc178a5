"""What the pages show is so, over real sockets: the commands of a page, the widget of another."""

from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
import yaml

from tests.documentation import Block, answers, write_files
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until, until_text
from tests.e2e.processes import UrcProcess
from urc.config.load import Shelf, load_profile
from urc.model.interface import WidgetUse
from urc.model.values import Signal, Value
from urc.runtime.catalog import built_in_catalog
from urc.runtime.session import CommandFailed
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

SENT = [(words, block) for words, block in answers() if words[:2] == ["urc", "send"]]


@pytest.mark.parametrize(("words", "answer"), SENT, ids=[str(block) for _, block in SENT])
def test_a_command_of_the_page_is_answered_as_it_says(
    tmp_path: Path, urc_process: Callable[..., UrcProcess], words: list[str], answer: Block
) -> None:
    """Each `urc send` of the page, to the emulated robot of the page, word for word."""
    write_files(tmp_path)
    profile = str(tmp_path / words[2])
    robot = urc_process("simulate", profile, "--set", "port=0")
    port = robot.wait_for(r"listening wire tcp .*:(\d+)")[1]
    send = urc_process("send", profile, *words[3:], URC_SET_PORT=port)
    send.wait()
    assert "\n".join((*send.output, *send.errors, "")) == answer.text


async def test_the_widget_of_the_page_lives_in_a_browser(
    tmp_path: Path, new_page: PageMaker
) -> None:
    """Each state of its demo shows its texts, with the module that the page shows."""
    shelf = Shelf(write_files(tmp_path))
    lamp = shelf.get("lamp")
    assert lamp is not None
    demo = yaml.safe_load((lamp.folder / "demo.yaml").read_text("utf-8"))
    signals = {
        state: Signal(state, **demo["signals"]["lit"]) for state in demo["states"]
    }  # one each, so that all states stand side by side
    uses = [
        WidgetUse(
            state,
            "lamp",
            {"lit": state},
            {"press": "toggle"},
            {"label": "Switch", **shown.get("options", {})},
            shown.get("title", ""),
        )
        for state, shown in demo["states"].items()
    ]
    robot = FakeRobot(dashboard_profile(signals=signals, uses=uses, widgets=[lamp]))
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/puppet/")
        await until(lambda: robot.is_open)
        for state, shown in demo["states"].items():
            for value in shown["values"].values():
                robot.say(state, value, age_s=shown.get("age_s", 0.0))
        for index, shown in enumerate(demo["states"].values()):
            cell = f"[data-cell='{index}']"
            await page.locator(cell).scroll_into_view_if_needed()
            await page.wait_for_function(
                "([cell, texts]) => texts.every((text) =>"
                " document.querySelector(cell).textContent.includes(text))",
                arg=[cell, shown["shows"]],
            )
        assert await page.locator(".urc-fault").count() == 0


async def test_the_button_of_the_page_gives_its_command(
    tmp_path: Path, new_page: PageMaker
) -> None:
    """The profile of the page with its widget: what the button does, and what it says when not."""
    shelf = Shelf(write_files(tmp_path))
    profile = load_profile(tmp_path / "desk-lamp.yaml", built_in_catalog(), shelf)
    robot = FakeRobot(profile)
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/desk-lamp/")
        await until(lambda: robot.is_open)
        robot.say("lit", True)
        await until_text(page, ".lamp-word", "● on")
        await page.get_by_role("button", name="Toggle").click()
        await until(lambda: robot.commands == [("toggle", {})])
        await until_text(page, ".lamp-answer", "")

        def refuse(name: str, arguments: Mapping[str, Value]) -> Mapping[str, Value]:
            raise CommandFailed("refused", f"the robot answered 'ERR' to {name}")

        robot.on_command = refuse
        await page.get_by_role("button", name="Toggle").click()
        await until_text(page, ".lamp-answer", "▲ the robot answered 'ERR' to toggle")
