"""What a cell says of a template that fails."""

import shutil
from pathlib import Path

import pytest

from urc.config.parse.widget import WidgetFolder
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
