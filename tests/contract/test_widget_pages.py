"""The pages about widgets: one each, with a picture, all that it takes and gives, and a robot."""

import re
from pathlib import Path
from typing import Any

import pytest

from tests.documentation import blocks
from urc.config.load import WidgetFolder, check
from urc.runtime.document_tests import exercise
from urc.runtime.registries import built_in_catalog
from urc.shipped import shipped
from urc.source import read_document

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "widgets"
NAMES = sorted(path.name for path in shipped("widgets").iterdir() if path.is_dir())
SHELF = WidgetFolder(shipped("widgets"))
WIDGETS = pytest.mark.parametrize("name", NAMES)

_ROW = re.compile(r"^\| `([\w-]+)`(?: to `([\w-]+)`)? \| (.*?) \|", re.MULTILINE)


def page_of(name: str) -> Path:
    """Return the page about a widget."""
    return FOLDER / f"{name}.md"


def rows(name: str, heading: str) -> dict[str, str]:
    """Return the first two columns of the table under a heading; nothing where there is none."""
    parts = re.split(r"^## (.+)$", page_of(name).read_text("utf-8"), flags=re.MULTILINE)
    found = _ROW.finditer(dict(zip(parts[1::2], parts[2::2], strict=True)).get(heading, ""))
    return {name: row[3] for row in found for name in _series(row[1], row[2])}


def _series(first: str, last: str | None) -> list[str]:
    """Return `step_1`, `step_2`, `step_3` for `step_1` to `step_3`."""
    if last is None:
        return [first]
    stem, low = first.rsplit("_", 1)
    return [f"{stem}_{number}" for number in range(int(low), int(last.rsplit("_", 1)[1]) + 1)]


def manifest(name: str) -> dict[str, Any]:
    """Return the widget's manifest as it is written."""
    data: dict[str, Any] = read_document(str(shipped("widgets") / name / "widget.yaml")).data
    return data


def test_every_widget_has_a_page_and_every_page_a_widget() -> None:
    """So that nothing is left over when one is renamed."""
    assert sorted(path.stem for path in FOLDER.glob("*.md")) == NAMES


@WIDGETS
def test_a_page_shows_its_widget(name: str) -> None:
    """Its picture is there."""
    found = re.search(r"^!\[.+\]\((.+\.png)\)$", page_of(name).read_text("utf-8"), re.MULTILINE)
    assert found is not None
    assert (FOLDER / found[1]).resolve().is_file()


@WIDGETS
@pytest.mark.parametrize("kind", ["inputs", "outputs", "options"])
def test_a_page_tells_all_that_the_manifest_declares(name: str, kind: str) -> None:
    """And nothing that it does not."""
    assert set(rows(name, kind.capitalize())) == set(manifest(name).get(kind) or {})


@WIDGETS
def test_a_page_tells_the_defaults_of_options(name: str) -> None:
    """As they are written in a document."""
    declared = manifest(name).get("options") or {}
    wanted = {
        key: str(one["default"]).lower() if isinstance(one["default"], bool) else one["default"]
        for key, one in declared.items()
        if isinstance(one.get("default"), bool | int | float | str)
    }
    told = rows(name, "Options")
    assert {key: told[key] for key in wanted} == {
        key: f"`{one}`" * (one != "") for key, one in wanted.items()
    }


@WIDGETS
def test_the_robot_of_a_page_is_without_a_finding(name: str, tmp_path: Path) -> None:
    """Not even a hint; it uses the widget, and its tests pass."""
    text = page_of(name).read_text("utf-8")
    robots = [one.text for one in blocks(page_of(name)) if "kind: robot" in one.text]
    assert robots
    for robot in robots:
        file = re.search(r"^name: ([\w-]+)$", robot, re.MULTILINE)
        assert file is not None
        assert f"`{file[1]}.yaml`" in text
        path = tmp_path / f"{file[1]}.yaml"
        path.write_text(robot, "utf-8")
        checked = check(str(path), built_in_catalog(), SHELF)
        assert [str(problem) for problem in checked.problems] == []
        assert checked.profile is not None
        assert name in checked.profile.widgets
        assert exercise(checked.profile).problems == []
