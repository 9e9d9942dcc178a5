"""What the pages show is so, over real sockets: the commands of a page, the widget of another."""

import asyncio
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import yaml
from playwright.async_api import Locator, expect

from tests.documentation import Block, answers, write_files
from tests.e2e.conftest import PageMaker
from tests.e2e.dashboards import running_dashboard, until
from tests.e2e.processes import UrcProcess
from urc.config.load import load_profile
from urc.model.interface import WidgetUse
from urc.model.values import Signal, Value
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import CommandFailed
from urc.runtime.widget_registry import WidgetRegistry
from urc.shipped import shipped
from urc.testing.dashboard import FakeRobot, dashboard_profile

pytestmark = pytest.mark.anyio

FRAME_MS = 60_000
"""A widget that does not ship with URC lives in a frame, which takes a browser some time."""

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


def say(robot: FakeRobot, state: str, shown: Mapping[str, Any]) -> None:
    """Let the robot say what it says in a state of the demo."""
    for value in shown["values"].values():
        robot.set_reading(state, value, age_s=shown.get("age_s", 0.0))


async def until_it_says(inside: Locator, texts: list[str], again: Callable[[], None]) -> None:
    """Wait until all the texts are there; what is 7 s old is soon 8 s old, so it is said again."""
    await inside.wait_for(timeout=FRAME_MS)
    async with asyncio.timeout(FRAME_MS / 1000):
        said = ""
        while not all(text in said for text in texts):
            again()
            await asyncio.sleep(0.05)
            said = await inside.text_content() or ""


async def test_the_widget_of_the_page_lives_in_a_browser(
    tmp_path: Path, new_page: PageMaker
) -> None:
    """Each state of its demo shows its texts, with the module that the page shows."""
    shelf = WidgetRegistry(shipped("widgets"), write_files(tmp_path))
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
        for index, (state, shown) in enumerate(demo["states"].items()):
            cell = page.locator(f"[data-cell='{index}']")
            await cell.scroll_into_view_if_needed()
            inside = cell.frame_locator(".urc-frame").locator(".lamp")
            await until_it_says(inside, shown["shows"], partial(say, robot, state, shown))
        assert await page.locator(".urc-fault").count() == 0


async def test_the_button_of_the_page_gives_its_command(
    tmp_path: Path, new_page: PageMaker
) -> None:
    """The profile of the page with its widget: what the button does, and what it says when not."""
    shelf = WidgetRegistry(shipped("widgets"), write_files(tmp_path))
    profile = load_profile(tmp_path / "desk-lamp.yaml", built_in_catalog(), shelf)
    robot = FakeRobot(profile)
    async with running_dashboard(robot) as address:
        page = await new_page()
        await page.goto(f"{address}robots/desk-lamp/")
        await until(lambda: robot.is_open)
        robot.set_reading("lit", True)
        lamp = page.frame_locator(".urc-frame")
        word, answer = lamp.locator(".lamp-word"), lamp.locator(".lamp-answer")
        await expect(word).to_have_text("● on", timeout=FRAME_MS)
        await lamp.get_by_role("button", name="Toggle").click()
        await until(lambda: robot.commands == [("toggle", {})])
        await expect(answer).to_have_text("", timeout=FRAME_MS)

        def refuse(name: str, arguments: Mapping[str, Value]) -> Mapping[str, Value]:
            raise CommandFailed("refused", f"the robot answered 'ERR' to {name}")

        robot.on_command = refuse
        await lamp.get_by_role("button", name="Toggle").click()
        told = "▲ the robot answered 'ERR' to toggle"
        await expect(answer).to_have_text(told, timeout=FRAME_MS)
