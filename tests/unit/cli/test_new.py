"""`urc new widget NAME`: a folder that is complete and sound before anything is changed."""

import re
from pathlib import Path

import pytest

from urc.cli.main import main
from urc.config.parse.widget import WidgetFolder
from urc.web.show.cells import render_widget, widget_context
from urc.web.show.demos import demo_states


def test_a_new_widget_validates_and_shows_all_its_states(tmp_path: Path) -> None:
    """Manifest, template and demo fit each other."""
    assert main(["new", "widget", "twin-lamp", "--into", str(tmp_path)]) == 0
    assert main(["validate", str(tmp_path / "twin-lamp" / "widget.yaml")]) == 0
    registry = WidgetFolder(tmp_path)
    widget = registry.get("twin-lamp")
    assert widget is not None, registry.problems
    assert (widget.title, registry.problems) == ("Twin lamp", [])
    states = demo_states(widget)
    assert {"normal", "stale", "gone", "none", "hostile"} <= {state.name for state in states}
    for state in states:
        html = render_widget(widget, widget_context(state.use, widget, state.profile, "cell-0"))
        assert 'class="twin-lamp"' in html
    for path in (tmp_path / "twin-lamp").iterdir():
        assert "NEW" not in path.read_text("utf-8")


def test_what_is_there_is_not_touched(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A name that is taken is refused in one line."""
    (tmp_path / "lamp").mkdir()
    assert main(["new", "widget", "lamp", "--into", str(tmp_path)]) == 1
    told = capsys.readouterr().err
    assert "already exists" in told
    assert len(told.splitlines()) == 1
    assert not list((tmp_path / "lamp").iterdir())


@pytest.mark.parametrize("name", ["Lamp", "1st", "../lamp", "two words", "", "lämp"])
def test_a_name_that_no_folder_may_have_is_refused(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is made."""
    assert main(["new", "widget", name, "--into", str(tmp_path)]) == 1
    assert "is not a valid widget name" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_the_name_of_a_shipped_widget_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The new one would never be used."""
    assert main(["new", "widget", "gauge", "--into", str(tmp_path)]) == 1
    assert "'gauge' ships with URC" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_an_editor_finds_the_schema_and_the_types(tmp_path: Path) -> None:
    """Also outside of a checkout."""
    assert main(["new", "widget", "lamp", "--into", str(tmp_path)]) == 0
    manifest = (tmp_path / "lamp" / "widget.yaml").read_text("utf-8")
    module = (tmp_path / "lamp" / "widget.js").read_text("utf-8")
    paths = re.findall(r"\$schema=(\S+)", manifest) + re.findall(r'import\("(.+?)"\)', module)
    assert [Path(path).name for path in paths] == ["widget.schema.json", "types.js", "types.js"]
    for path in paths:
        assert (tmp_path / "lamp" / path).is_file(), path
