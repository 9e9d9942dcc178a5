"""What a cell says of a template that fails, and of a hazardous command."""

import shutil
from pathlib import Path
from typing import Literal

import pytest

from urc.config.parse.widget import WidgetFolder
from urc.model.exchange import Confirm
from urc.shipped import shipped
from urc.web.show.cells import widget_cell
from urc.web.show.demos import demo_states


@pytest.mark.parametrize(
    ("template", "error"),
    [
        ("<p>\n{% if %}", "template.html.j2:2: TemplateSyntaxError: Expected an expression"),
        ("<p>\n\n{{ titel }}", "template.html.j2:3: UndefinedError: 'titel' is undefined"),
        ("{{ 1 // 0 }}", "template.html.j2:1: ZeroDivisionError: "),
    ],
)
def test_it_says_in_which_line(tmp_path: Path, template: str, error: str) -> None:
    """And what Jinja says of it; the page goes on without this cell."""
    shutil.copytree(shipped("widgets") / "value", tmp_path / "value")
    (tmp_path / "value" / "template.html.j2").write_text(template, "utf-8")
    widget = WidgetFolder(tmp_path).get("value")
    assert widget is not None
    state = next(one for one in demo_states(widget) if one.name == "none")
    cell = widget_cell(0, state.use, state.profile)
    assert cell.html == ""
    assert cell.error.startswith(error)


@pytest.mark.parametrize("level", ["normal", "hazardous"])
def test_a_button_warns_of_a_slide(level: Literal["normal", "hazardous"]) -> None:
    """Before the first tap. A question of the normal level is no hazard."""
    widget = WidgetFolder(shipped("widgets")).get("button")
    assert widget is not None
    state = next(one for one in demo_states(widget) if one.name == "normal")
    (command,) = state.use.outputs.values()
    commands = state.profile.driver.commands
    asked = commands[command]._replace(confirm=Confirm(level, "The drone will fall."))
    driver = state.profile.driver._replace(commands=commands | {command: asked})
    cell = widget_cell(0, state.use, state.profile._replace(driver=driver))
    assert ("slide to confirm" in cell.html) == (level == "hazardous")
    assert ("data-hazardous" in cell.html) == (level == "hazardous")
    assert ("data-asks" in cell.html) == (level == "normal")
