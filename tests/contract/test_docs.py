"""What the pages show is so: documents load, pieces fit, commands exist, reports are the same."""

import importlib
import re
import shlex
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.documentation import (
    BLOCKS,
    DOCUMENTS,
    ROOT,
    RULES,
    YAML,
    Block,
    answers,
    is_piece,
    write_files,
)
from urc.cli.arguments import parse
from urc.cli.main import VERBS, main, module_of
from urc.config.load import WidgetFolder, check
from urc.fleet.rules_file import read_rules
from urc.model.values import AlarmLimits, Signal
from urc.runtime.document_tests import exercise
from urc.runtime.registries import built_in_catalog
from urc.runtime.widget_registry import widget_folder_of
from urc.web.show.cells import WidgetContext, render_widget

COMMANDS = [
    (block, command)
    for block in BLOCKS
    if block.language == "sh"
    for command in block.commands
    if command.startswith(("urc ", "./dev "))
]
REPORTS = [(words, block) for words, block in answers() if words[:2] == ["urc", "validate"]]

# What the page says about these slips must be what the tool says about them.
SLIPS = {
    "a misspelt key": ("oven.yaml", "precision: 1", "presicion: 1"),
    "a failing test": (
        "oven.yaml",
        "expect: { temperature: 23.5 }",
        "expect: { temperature: 24 }",
    ),
}


def dev_verbs() -> dict[str, tuple[str, ...]]:
    """Return the verbs of `./dev`."""
    loader = SourceFileLoader("dev_script_of_docs", str(ROOT / "dev"))
    spec = spec_from_loader(loader.name, loader)
    assert spec is not None
    module = module_from_spec(spec)
    loader.exec_module(module)
    verbs: dict[str, tuple[str, ...]] = module.VERBS
    return verbs


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The reader's folder, with all that the pages let him write; the current one."""
    write_files(tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_there_is_something_to_check() -> None:
    """The pattern that finds blocks has not gone blind."""
    assert {"README.md", "profile.md", "widgets.md"} <= {block.page.name for block in DOCUMENTS}
    assert len(COMMANDS) > 20
    assert len(REPORTS) >= 2


@pytest.mark.parametrize("block", DOCUMENTS, ids=str)
def test_a_document_of_the_pages_is_without_a_finding(folder: Path, block: Block) -> None:
    """It loads with the widgets that the pages show, not even a warning, and its tests pass."""
    path = f"widgets/{block.file}" if block.file else f"{yaml.safe_load(block.text)['name']}.yaml"
    checked = check(path, built_in_catalog(), widget_folder_of(folder / "robot.yaml"))
    assert checked.problems == ()
    if checked.kind == "robot":
        assert checked.profile is not None
        assert exercise(checked.profile).problems == []


@pytest.mark.parametrize("block", RULES, ids=str)
def test_the_rules_of_the_pages_are_correct(tmp_path: Path, block: Block) -> None:
    """They are read as a site reads them."""
    file = tmp_path / "rules.yaml"
    file.write_text(block.text, "utf-8")
    assert read_rules(file).rules


@pytest.mark.parametrize(
    "block", [one for one in YAML if one not in (*DOCUMENTS, *RULES) and not one.file], ids=str
)
def test_a_piece_is_part_of_the_whole_file(block: Block) -> None:
    """What a step of the page shows stands in the whole file, line for line."""
    assert is_piece(block)


@pytest.mark.parametrize(("block", "command"), COMMANDS, ids=str)
def test_a_command_of_the_pages_is_understood(block: Block, command: str) -> None:
    """The verb and every option exist, by the parser of the command itself."""
    program, verb, *words = shlex.split(re.split(r" [|>] ", command)[0])
    if program == "./dev":
        verbs = dev_verbs()
        assert verb in verbs, str(block)
        if verb != "run":
            return
        verb, *words = words
    assert verb in VERBS, str(block)
    module: Any = importlib.import_module(module_of(verb))
    assert not isinstance(parse(verb, VERBS[verb], module, words), int), str(block)


def run_validate(capsys: pytest.CaptureFixture[str], *paths: str) -> str:
    """Return all that `urc validate` says."""
    main(["validate", *paths])
    said = capsys.readouterr()
    return said.out + said.err


@pytest.mark.parametrize(
    ("words", "answer"), REPORTS, ids=[f"{block}: {words[-1]}" for words, block in REPORTS]
)
def test_a_report_of_the_pages_is_what_validate_says(
    folder: Path, words: list[str], answer: Block, capsys: pytest.CaptureFixture[str]
) -> None:
    """Word for word; the first one of a page that grows its file is about the first piece."""
    before = [block for block in YAML if block.page == answer.page and block.line < answer.line]
    if len(before) == 1 and is_piece(before[0]):
        (folder / words[-1]).write_text(before[0].text, "utf-8")
    assert run_validate(capsys, *words[2:]) == answer.text


@pytest.mark.parametrize("slip", SLIPS)
def test_a_slip_is_reported_as_the_page_says(
    folder: Path, slip: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """A profile with one slip in it; the page shows its report."""
    name, good, bad = SLIPS[slip]
    file = folder / name
    text = file.read_text("utf-8")
    assert text.count(good) == 1
    file.write_text(text.replace(good, bad), "utf-8")
    assert run_validate(capsys, name) in {block.text for block in BLOCKS}


def test_the_widget_of_the_page_renders_in_each_state(folder: Path) -> None:
    """All five files are shown, and the template makes sense before any value is there."""
    lamp = folder / "widgets" / "lamp"
    needed = {"widget.yaml", "template.html.j2", "widget.js", "widget.css", "demo.yaml"}
    assert {path.name for path in lamp.iterdir()} == needed
    registry = WidgetFolder(lamp.parent)
    widget = registry.get("lamp")
    assert widget is not None
    assert registry.problems == []
    demo = yaml.safe_load((lamp / "demo.yaml").read_text("utf-8"))
    signals = {
        name: Signal(name, **{**given, "limits": AlarmLimits(**given.get("limits", {}))})
        for name, given in demo["signals"].items()
    }
    for state in demo["states"].values():
        options = {"label": "Switch", **state.get("options", {})}
        context = WidgetContext(
            state.get("title", "Lamp"), options, signals, widget.name, uid="cell-0"
        )
        html = str(render_widget(widget, context))
        assert "—" in html
        assert f">{options['label']}</button>" in html
        assert "<img" not in html
