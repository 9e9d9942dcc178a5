"""Widgets that a document may use: those that ship, and those beside it."""

from pathlib import Path

import pytest

from urc.cli.main import main
from urc.runtime.widget_registry import widget_folder_of
from urc.shipped import shipped
from urc.web.load.widget_trust import WidgetTrust

MANIFEST = """
urc: 1
kind: widget
name: {name}
title: {name}
summary: A widget of somebody.
"""


def write(folder: Path, name: str) -> None:
    """Write the manifest of a widget."""
    place = folder / "widgets" / name
    place.mkdir(parents=True)
    (place / "widget.yaml").write_text(MANIFEST.format(name=name), "utf-8")


def test_a_document_finds_the_widgets_beside_it_and_they_are_foreign(tmp_path: Path) -> None:
    """They come after those that ship, and never take their place."""
    write(tmp_path, "lamp")
    write(tmp_path, "battery")
    registry = widget_folder_of(tmp_path / "robot.yaml")
    lamp, battery = registry.get("lamp"), registry.get("battery")
    assert lamp is not None, registry.problems
    assert battery is not None, registry.problems
    assert lamp.folder.resolve() == (tmp_path / "widgets" / "lamp").resolve()
    assert battery.folder.resolve() == (shipped("widgets") / "battery").resolve()
    assert [WidgetTrust().is_foreign(one) for one in (lamp, battery)] == [True, False]


def test_a_document_without_such_a_folder_has_what_ships(tmp_path: Path) -> None:
    """So has one that stands beside URC's own folder."""
    for document in (tmp_path / "robot.yaml", shipped("widgets").parent / "robot.yaml"):
        assert (
            widget_folder_of(document).names() == widget_folder_of(tmp_path / "other.yaml").names()
        )
        assert widget_folder_of(document).get("lamp") is None


def test_a_new_widget_stands_where_the_robot_beside_it_finds_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`urc new widget` makes it in the folder that is looked into."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "widget", "lamp"]) == 0
    assert widget_folder_of(tmp_path / "robot.yaml").get("lamp") is not None
